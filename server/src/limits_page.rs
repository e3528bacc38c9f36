//! The tables of limits in docs/hosting.md, made from the constants.

use std::path::Path;
use std::time::Duration;

use crate::access::{COST_OF_STREAM, Call, MessageLimits};
use crate::config::{
    FIRST_MESSAGE_TIMEOUT, IMPORT_IDLE_TIMEOUT, IMPORT_RATE, MAX_ANALYSES, MAX_ANALYSIS_TIME,
    MAX_FOLLOWERS, MAX_IMPORT_MEMORY, MAX_IMPORTS, MAX_RECORDS_SENT, MAX_STUDIES, MAX_STUDY_DATA,
    MAX_STUDY_MEMORY, MAX_STUDY_STREAMS, MAX_TOURNAMENTS, MAX_VECTOR_NETWORK_MULTIPLICATIONS,
    MAX_VECTOR_SEATS_IN_ALL, MAX_VECTOR_STREAMS, PICTURE_PATIENCE, RECORD_SEND_TIMEOUT,
    ServerConfig, VECTOR_SETUP_TIMEOUT,
};
use crate::connections::{MAX_UNREAD, STALLED_LIMIT};
use crate::convert::{MAX_SEARCH_BUDGET, MAX_SEARCH_ROLLOUTS};
use crate::grpc::MAX_WAITING_MEMORY;
use crate::handshakes::{
    COST_OF_FAILED, HANDSHAKES_AT_ONCE, HANDSHAKES_PER_SECOND, MAX_HANDSHAKES,
};
use crate::limits::{background, calls, decoding, fair_semaphore, frames};
use crate::room::MAX_SPECTATORS;
use crate::store::MAX_CONCURRENT_RECORDS;
use crate::web::{MAX_PREVIEWS, MAX_PREVIEWS_WAITING};
use crate::webhooks::MAX_WAITING;
use chefshat_record::words::grouped as number;
use chefshat_room::{SEARCH_PATIENCE, SEARCH_PATIENCE_UNATTENDED};

fn seconds(time: Duration) -> String {
    format!("{} s", time.as_secs())
}

fn table<const COLUMNS: usize>(header: [&str; COLUMNS], rows: &[[String; COLUMNS]]) -> String {
    let line = |cells: &[String; COLUMNS]| {
        let cells = cells.iter().map(|cell| match cell.as_str() {
            "" => " |".to_owned(),
            cell => format!(" {cell} |"),
        });
        format!("|{}\n", cells.collect::<String>())
    };
    let mut text = line(&header.map(str::to_owned));
    text += &format!("|{}\n", "---|".repeat(COLUMNS));
    text.extend(rows.iter().map(line));
    text
}

fn of_all() -> String {
    let config = ServerConfig::default();
    let rows: [(&str, String, &str); _] = [
        (
            "connections",
            format!(
                "{}, or what `ulimit -n` leaves",
                number(config.max_connections)
            ),
            "`--max-connections`",
        ),
        (
            "TLS handshakes at a time",
            format!("{}; others wait", number(MAX_HANDSHAKES)),
            "",
        ),
        (
            "rooms that wait or play",
            number(config.max_rooms),
            "`--max-rooms`",
        ),
        ("spectators of a room", number(MAX_SPECTATORS), ""),
        ("tournaments that are not over", number(MAX_TOURNAMENTS), ""),
        ("studies", number(MAX_STUDIES), ""),
        (
            "memory of the settings of studies",
            format!("{} MiB; further ones are refused", MAX_STUDY_MEMORY >> 20),
            "",
        ),
        (
            "memory of the participants of studies and of their answers",
            format!("{} MiB; further ones are refused", MAX_STUDY_DATA >> 20),
            "",
        ),
        (
            "streams (play, watch, follow, read)",
            number(calls::MAX_STREAMS),
            "",
        ),
        ("streams of vector games", number(MAX_VECTOR_STREAMS), ""),
        (
            "vector games, counted times the seats that their client plays",
            number(MAX_VECTOR_SEATS_IN_ALL),
            "",
        ),
        ("streams that follow tournaments", number(MAX_FOLLOWERS), ""),
        ("streams that follow studies", number(MAX_FOLLOWERS), ""),
        (
            "streams that show studies to participants",
            number(MAX_STUDY_STREAMS),
            "",
        ),
        (
            "answers that have not been read",
            format!(
                "{}; after {} in which nothing of one is read, the connection is closed",
                number(calls::MAX_ANSWERS),
                seconds(STALLED_LIMIT)
            ),
            "",
        ),
        (
            "bytes of streams that one caller does not read",
            format!(
                "{} MiB for longer than {}; then connections are closed",
                MAX_UNREAD >> 20,
                seconds(STALLED_LIMIT)
            ),
            "",
        ),
        (
            "calls that are executed at a time",
            format!(
                "{}; others wait for {}",
                number(calls::MAX_EXECUTED),
                seconds(fair_semaphore::MAX_WAIT)
            ),
            "",
        ),
        (
            "bytes of messages that are received at a time, twice each, without those of up to 4 KiB",
            format!(
                "{} MiB, and as much for those of players; others wait for {}",
                decoding::MAX_RECEIVED >> 20,
                seconds(fair_semaphore::MAX_WAIT)
            ),
            "",
        ),
        (
            "memory of decoded messages, without those of up to 8 KiB",
            format!(
                "{} MiB, and as much for those of players; others wait for {}",
                decoding::MAX_DECODED >> 20,
                seconds(fair_semaphore::MAX_WAIT)
            ),
            "",
        ),
        (
            "memory of commands that wait for a seat to be attached, or for another node",
            format!(
                "{} MiB; further ones are refused, or read later",
                MAX_WAITING_MEMORY >> 20
            ),
            "",
        ),
        (
            "time for a message, or a whole call with one message, to arrive",
            seconds(decoding::MESSAGE_TIMEOUT),
            "",
        ),
        (
            "memory for streams of other nodes that spectators share, beyond their first bytes",
            format!(
                "{} MiB; then those who come later or read slowly have streams of their own",
                calls::MAX_HISTORY >> 20
            ),
            "",
        ),
        (
            "lists of rooms and of studies that are made at a time",
            number(calls::MAX_LISTS),
            "",
        ),
        (
            "records that are read at a time",
            format!("{}; others wait", number(MAX_CONCURRENT_RECORDS)),
            "",
        ),
        (
            "records that are sent at a time",
            format!(
                "{}; others wait. A part that is not received in {} ends one",
                number(MAX_RECORDS_SENT),
                seconds(RECORD_SEND_TIMEOUT)
            ),
            "",
        ),
        (
            "pictures and titles of replays that are made at a time",
            format!(
                "{}; {} requests wait for {} at most, further ones are refused",
                number(MAX_PREVIEWS),
                number(MAX_PREVIEWS_WAITING),
                seconds(PICTURE_PATIENCE)
            ),
            "",
        ),
        (
            "imports at a time",
            format!(
                "{} with {} MiB a second together; others wait. {} without a part end one",
                number(MAX_IMPORTS),
                IMPORT_RATE >> 20,
                seconds(IMPORT_IDLE_TIMEOUT)
            ),
            "",
        ),
        (
            "memory of records that are being imported",
            format!("{} MiB; further ones are refused", MAX_IMPORT_MEMORY >> 20),
            "",
        ),
        (
            "analyses at a time",
            format!(
                "{}, for {} at most each; addresses share the threads in turns, and the tokens of an address what it has; one that could not end by its deadline is refused",
                number(MAX_ANALYSES),
                seconds(MAX_ANALYSIS_TIME)
            ),
            "",
        ),
        (
            "searches in rooms",
            format!(
                "{} or {} rollouts at most each; those that wait for a thread longer than {}, in games of built-in agents alone {}, are given up",
                seconds(MAX_SEARCH_BUDGET),
                number(MAX_SEARCH_ROLLOUTS),
                seconds(SEARCH_PATIENCE),
                seconds(SEARCH_PATIENCE_UNATTENDED)
            ),
            "",
        ),
        (
            "games that only built-in agents play",
            format!("{} at a time; others wait", number(background::MAX_GAMES)),
            "",
        ),
        (
            "their decisions",
            format!(
                "{} a second; for {} as fast as the machine can",
                number(config.built_in_decisions_per_second),
                seconds(background::BURST)
            ),
            "`--built-in-rate`",
        ),
        (
            "webhooks that wait for their receiver",
            format!("{}; further ones are dropped", number(MAX_WAITING)),
            "",
        ),
    ];
    let rows = rows.map(|(what, most, flag)| [what.to_owned(), most, flag.to_owned()]);
    table(["limit of all clients together", "default", "flag"], &rows)
}

fn of_each() -> String {
    let rate = |per_second: u64, at_once: u64| {
        format!(
            "{} a second, {} at once",
            number(per_second),
            number(at_once)
        )
    };
    assert_eq!(calls::COST_OF_BUILT_IN_GAME, calls::COST_OF_TOURNAMENT);
    let rows = [
        (
            "calls",
            format!(
                "{}. An answer costs one more for each {} bytes, a message for each {} bytes that it takes once it is decoded (within a stream only one of more than {} KiB, which waits until its client may make another call; imports have a rate of their own), a stream {}, a new room or a participant who joins a study {}, a room of built-in agents, a tournament, or the deletion of a participant's data {}",
                rate(calls::CALLS_PER_SECOND, calls::CALLS_AT_ONCE),
                calls::BYTES_PER_CALL,
                number(calls::DECODED_BYTES_PER_CALL),
                calls::MAX_FREE_DECODED / 1024,
                COST_OF_STREAM,
                calls::COST_OF_ROOM,
                calls::COST_OF_BUILT_IN_GAME
            ),
        ),
        (
            "wrong join codes",
            format!(
                "{} (an IPv6 /48 counts as one client). Above {} from all clients together, a client that has just sent a wrong code is refused. A tournament's code does not count as wrong where a room's is asked for",
                rate(calls::WRONG_CODES_PER_SECOND, calls::WRONG_CODES_AT_ONCE),
                rate(
                    calls::ALL_WRONG_CODES_PER_SECOND,
                    calls::ALL_WRONG_CODES_AT_ONCE
                )
            ),
        ),
        (
            "PING, SETTINGS, PRIORITY and RST_STREAM frames of a connection",
            format!(
                "{}; it is read more slowly then",
                rate(frames::PER_SECOND.into(), frames::BURST.into())
            ),
        ),
        (
            "headers of a request",
            format!(
                "{} KiB; of HTTP/1.1, the connection is closed beyond",
                frames::MAX_HEADER_BYTES >> 10
            ),
        ),
        (
            "TLS handshakes",
            format!(
                "{}; one that fails or is abandoned counts as {}",
                rate(HANDSHAKES_PER_SECOND, HANDSHAKES_AT_ONCE),
                COST_OF_FAILED
            ),
        ),
        (
            "time until a connection has said what it speaks, after its TLS handshake",
            seconds(ServerConfig::default().first_bytes_timeout),
        ),
        (
            "time until the first message of a Play stream",
            seconds(FIRST_MESSAGE_TIMEOUT),
        ),
        (
            "time until the setup of a vector stream",
            seconds(VECTOR_SETUP_TIMEOUT),
        ),
        (
            "multiplications for a decision of a network file in vector games",
            number(MAX_VECTOR_NETWORK_MULTIPLICATIONS),
        ),
    ];
    table(
        ["limit of each client", "default"],
        &rows.map(|(what, most)| [what.to_owned(), most]),
    )
}

/// What the messages of each call may be, what a call counts as and which place it takes, those of
/// most calls in the first row.
fn of_messages() -> String {
    let kib = |bytes: usize| format!("{} KiB", number(bytes >> 10));
    let row = |name: String, limits: &MessageLimits, charge: u64, streams: bool| {
        let place = if streams { "stream" } else { "call" };
        [
            name,
            kib(limits.bytes),
            number(limits.elements),
            kib(limits.memory),
            charge.to_string(),
            place.to_owned(),
        ]
    };
    let own = Call::all().filter(|call| call.path.starts_with("/chefshat.v1."));
    let special =
        own.filter(|call| call.message != MessageLimits::USUAL || call.charge != 1 || call.streams);
    let special = special.map(|call| {
        let name = call.path.trim_start_matches("/chefshat.v1.");
        let name = format!("`{}`", name.replace('/', "."));
        row(name, &call.message, call.charge, call.streams)
    });
    let usual = row("all others".to_owned(), &MessageLimits::USUAL, 1, false);
    let rows: Vec<_> = std::iter::once(usual).chain(special).collect();
    let header = [
        "messages of a call",
        "longest",
        "submessages, texts in lists, entries of maps",
        "memory once decoded",
        "counts as",
        "place",
    ];
    table(header, &rows)
}

#[test]
fn the_page_has_the_limits() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/hosting.md");
    let page = std::fs::read_to_string(page).expect("the page");
    for table in [of_all(), of_each(), of_messages()] {
        assert!(
            page.contains(&format!("\n\n{table}\n")),
            "docs/hosting.md should have:\n{table}"
        );
    }
}
