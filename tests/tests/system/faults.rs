//! Failing disks and databases under the real binary: nothing uncommitted is acknowledged, the
//! server exits with advice, and once the fault is gone every game resumes. `restarts` tests
//! crashes without failing disks.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use chefshat_client::Client;
use chefshat_proto::v1::{
    self, instrument_service_client::InstrumentServiceClient, record_line::Line,
    seat_update::Update,
};
use chefshat_record::{jsonl, replay};
use chefshat_tests::{
    BusyRooms, Ended, Launch, Ledger, Process, RoomKind, SmallDisk, StreamSeat, first_legal,
    first_update, is_legal, one_shift, patiently, room_of_four, skip,
};
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{Connection as _, Executor as _};
use tokio::process::Command;
use tonic_types::StatusExt as _;

/// Name of the database in a data directory.
const DATABASE: &str = "games.sqlite3";
/// Size of a disk that the write-ahead log of a few games does not fill, KiB.
const DISK_KIB: u32 = 16 * 1024;
/// Rooms that reserve more space than is left then.
const WAITING_ROOMS: usize = 24;
/// What is left of a disk that is nearly full, bytes: running games go on.
const LEFT_BYTES: u64 = 4 * 1024 * 1024;
/// How often a test looks for a file.
const LOOK_AGAIN: Duration = Duration::from_millis(50);
/// How long another program locks the database.
const LOCKED_FOR: Duration = Duration::from_secs(3);
/// Decision time while it is locked.
const DECISION_TIME_MS: u32 = 2_000;
/// Acknowledgements that may be on their way when the database is locked: one for each seat of four
/// rooms.
const ON_THE_WAY: u64 = 16;

fn rooms(count: usize, policy: v1::RoomPolicy) -> Vec<RoomKind> {
    let kind = RoomKind {
        rules: v1::RuleSet {
            stop: Some(v1::rule_set::Stop::TargetShifts(2)),
            ..v1::RuleSet::default()
        },
        policy,
        ..RoomKind::default()
    };
    vec![kind; count]
}

fn unhurried() -> v1::RoomPolicy {
    RoomKind::default().policy
}

/// A policy under which a seat that is charged for a locked database times out.
fn hurried() -> v1::RoomPolicy {
    v1::RoomPolicy {
        decision_time_ms: Some(DECISION_TIME_MS),
        bank_ms: Some(0),
        ..v1::RoomPolicy::default()
    }
}

/// Checks that a failed server reports the failure with this advice.
fn assert_failed(ended: &Ended, advice: &str) {
    assert!(!ended.status.success(), "{ended:?}");
    assert!(
        ended.said.contains(advice),
        "{advice:?} is not in {}",
        ended.said
    );
    assert!(
        ended.said.contains("start the server again"),
        "{}",
        ended.said
    );
}

/// Lets games continue for a while and end, and finds every acknowledged decision in the records.
async fn assert_continues(
    launch: &Launch,
    server: Process,
    busy_rooms: BusyRooms,
    data_dir: &Path,
) {
    let ledger = Arc::clone(&busy_rooms.ledger);
    patiently("decisions", ledger.reaches(ledger.count() + 100)).await;
    let games = busy_rooms.finish().await;
    let client = Client::connect(launch.url())
        .await
        .expect("the server listens");
    let acknowledged = assert_committed(&client, &ledger, &games).await;
    assert_eq!(
        u64::try_from(acknowledged),
        Ok(ledger.count()),
        "all of them"
    );
    let ended = server.stop().await;
    assert!(ended.status.success(), "{ended:?}");
    for game in &games {
        jsonl::read(&jsonl::path_of(data_dir, game)).expect("a record file");
    }
}

/// Checks that every game finished, every record is valid and contains every acknowledged decision,
/// and no agent timed out. Returns the number of decisions.
async fn assert_committed(client: &Client, ledger: &Ledger, games: &[String]) -> usize {
    let mut acknowledged = 0;
    for game in games {
        let record = client.record(game).await.expect("a stored record");
        let replayed = replay::replay(&record).unwrap_or_else(|error| panic!("{game}: {error}"));
        assert_eq!(replayed.state, v1::RoomState::Finished, "{game}");
        acknowledged += ledger.assert_committed(game, &record);
        for line in &record {
            if let Some(Line::Decision(decision)) = &line.line {
                assert_eq!(decision.source(), v1::DecisionSource::Agent, "{decision:?}");
            }
        }
    }
    acknowledged
}

/// Another program's connection to the database.
async fn other_program(data_dir: &Path) -> SqliteConnection {
    let options = SqliteConnectOptions::new().filename(data_dir.join(DATABASE));
    SqliteConnection::connect_with(&options)
        .await
        .expect("there is a database")
}

async fn execute(connection: &mut SqliteConnection, statement: &'static str) {
    connection.execute(statement).await.expect("executed");
}

async fn connected(launch: &Launch) -> Client {
    Client::connect(launch.url())
        .await
        .expect("the server listens")
}

/// Checks that new durable rooms are refused because of the disk.
async fn assert_refuses_rooms(client: &Client) {
    let refused = client
        .create_room(v1::CreateRoomRequest::default())
        .await
        .expect_err("no space");
    assert_eq!(refused.reason(), Some("DISK_NEARLY_FULL"), "{refused}");
}

/// Lists rooms, of which some wait for the disk.
async fn assert_lists_rooms(client: &Client) {
    let listed = patiently("rooms", client.list_rooms(v1::ListRoomsRequest::default())).await;
    let rooms = listed.expect("a list").rooms;
    // That of `assert_plays_in_memory`.
    let has_one = (rooms.iter()).any(|room| room.state() == v1::RoomState::Playing);
    assert!(has_one, "{rooms:?}");
}

/// Takes a decision in a room that needs no disk.
async fn assert_plays_in_memory(client: &Client) {
    let policy = v1::RoomPolicy {
        durability: v1::Durability::Ephemeral.into(),
        ..unhurried()
    };
    let (_, tickets) = room_of_four(client, one_shift(), policy).await;
    let mut seats = Vec::new();
    for ticket in tickets {
        let mut seat = StreamSeat::open(client.channel()).await;
        let attach = v1::Attach {
            ticket,
            delivery: v1::EventDelivery::AtOnce.into(),
            ..v1::Attach::default()
        };
        seat.attach(attach).await;
        assert!(matches!(seat.next().await, Update::Attached(_)));
        seats.push(seat);
    }
    let (Update::Decision(decision), asked) = first_update(&mut seats).await else {
        panic!("the first update is a decision");
    };
    let action = first_legal(&decision);
    seats[asked].answer(decision.decision_id, action).await;
    let result = seats[asked].result().await;
    assert_eq!(result.status(), v1::AnswerStatus::Accepted);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_holds_games_up_and_loses_nothing() {
    let disk = match SmallDisk::new(DISK_KIB).await {
        Ok(disk) => disk,
        Err(why) => return skip("a_full_disk_holds_games_up_and_loses_nothing", &why),
    };
    let mut launch = Launch::new(disk.mounted_at()).through(disk.enter());
    let server = launch.start().await.expect("the server starts");
    let busy_rooms = BusyRooms::start(&launch.url(), rooms(4, unhurried()));
    patiently("decisions", busy_rooms.ledger.reaches(50)).await;
    disk.fill("filler");
    let client = connected(&launch).await;
    assert_refuses_rooms(&client).await;
    assert_plays_in_memory(&client).await;
    assert_lists_rooms(&client).await;
    // It recovers by itself.
    std::fs::remove_file(disk.path().join("filler")).expect("removed");
    let ledger = Arc::clone(&busy_rooms.ledger);
    patiently("decisions", ledger.reaches(ledger.count() + 50)).await;
    // Or it dies, and starts although there is no space.
    disk.fill("filler");
    server.kill().await;
    let server = launch.start().await.expect("the server restarts");
    let client = connected(&launch).await;
    assert_refuses_rooms(&client).await;
    assert_plays_in_memory(&client).await;
    std::fs::remove_file(disk.path().join("filler")).expect("removed");
    assert_continues(&launch, server, busy_rooms, &disk.path()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_with_a_full_disk_starts_and_ends() {
    let disk = match SmallDisk::new(DISK_KIB).await {
        Ok(disk) => disk,
        Err(why) => return skip("a_server_with_a_full_disk_starts_and_ends", &why),
    };
    let mut launch = Launch::new(disk.mounted_at()).through(disk.enter());
    let server = launch.start().await.expect("the server starts");
    assert!(server.stop().await.status.success());
    disk.fill("filler");
    let server = launch.start().await.expect("it starts on what it has kept");
    let client = connected(&launch).await;
    client.server_info().await.expect("information");
    assert_refuses_rooms(&client).await;
    assert_plays_in_memory(&client).await;
    std::fs::remove_file(disk.path().join("filler")).expect("removed");
    let busy_rooms = BusyRooms::start(&launch.url(), rooms(4, unhurried()));
    patiently("decisions", busy_rooms.ledger.reaches(50)).await;
    disk.fill("filler");
    assert_refuses_rooms(&client).await;
    // What was not committed is not acknowledged, and nobody waits for it when the server stops.
    let ended = server.stop().await;
    if !ended.status.success() {
        assert_failed(&ended, "the disk is full: free some space");
    }
    std::fs::remove_file(disk.path().join("filler")).expect("removed");
    let server = launch.start().await.expect("the server restarts");
    assert_continues(&launch, server, busy_rooms, &disk.path()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_nearly_full_disk_is_reserved_for_running_games() {
    let disk = match SmallDisk::new(DISK_KIB).await {
        Ok(disk) => disk,
        Err(why) => return skip("a_nearly_full_disk_is_reserved_for_running_games", &why),
    };
    let mut launch = Launch::new(disk.mounted_at()).through(disk.enter());
    let server = launch.start().await.expect("the server starts");
    let client = connected(&launch).await;
    let created = client
        .create_room(v1::CreateRoomRequest::default())
        .await
        .expect("a new room");
    disk.fill("filler");
    assert_refuses_rooms(&client).await;
    // Nor is anything stored that no game needs.
    let mut instruments = InstrumentServiceClient::new(client.channel());
    let marker = v1::AddMarkerRequest {
        room_id: created.room.expect("a room").room_id,
        owner_token: created.owner_token,
        label: "fixation".into(),
        ..v1::AddMarkerRequest::default()
    };
    let refused = instruments.add_marker(marker.clone()).await;
    let refused = refused.expect_err("no space");
    let details = refused.get_details_error_info().expect("details");
    assert_eq!(details.reason, "DISK_NEARLY_FULL");
    std::fs::remove_file(disk.path().join("filler")).expect("removed");
    let marked = instruments.add_marker(marker).await;
    marked.expect("there is space again");
    client
        .create_room(v1::CreateRoomRequest::default())
        .await
        .expect("there is space again");
    let ended = server.stop().await;
    assert!(ended.status.success(), "{ended:?}");
}

/// The files of records are copies of what the database has: they take nothing of what is kept for
/// running games, and are written once there is space.
#[tokio::test(flavor = "multi_thread")]
async fn record_files_wait_while_the_disk_is_nearly_full() {
    let disk = match SmallDisk::new(DISK_KIB).await {
        Ok(disk) => disk,
        Err(why) => return skip("record_files_wait_while_the_disk_is_nearly_full", &why),
    };
    let mut launch = Launch::new(disk.mounted_at()).through(disk.enter());
    let server = launch.start().await.expect("the server starts");
    let busy_rooms = BusyRooms::start(&launch.url(), rooms(1, unhurried()));
    patiently("decisions", busy_rooms.ledger.reaches(10)).await;
    let client = connected(&launch).await;
    for _ in 0..WAITING_ROOMS {
        let created = client.create_room(v1::CreateRoomRequest::default()).await;
        created.expect("there is space");
    }
    disk.fill("filler");
    disk.shorten("filler", LEFT_BYTES);
    assert_refuses_rooms(&client).await;
    let games = busy_rooms.finish().await;
    let record = jsonl::path_of(&disk.path(), &games[0]);
    let ended = server.stop().await;
    assert!(ended.status.success(), "{ended:?}");
    assert!(!record.exists(), "{}", ended.said);

    let server = launch.start().await.expect("the server restarts");
    assert_refuses_rooms(&connected(&launch).await).await;
    std::fs::remove_file(disk.path().join("filler")).expect("removed");
    let written = async {
        while !record.exists() {
            tokio::time::sleep(LOOK_AGAIN).await;
        }
    };
    patiently("the record's file", written).await;
    jsonl::read(&record).expect("a record");
    server.kill().await;
}

/// Each running game reserves what it may still write, so that rooms are refused long before the disk
/// is full.
#[tokio::test(flavor = "multi_thread")]
async fn rooms_reserve_the_space_that_they_may_need() {
    let disk = match SmallDisk::new(DISK_KIB).await {
        Ok(disk) => disk,
        Err(why) => return skip("rooms_reserve_the_space_that_they_may_need", &why),
    };
    let mut launch = Launch::new(disk.mounted_at()).through(disk.enter());
    let server = launch.start().await.expect("the server starts");
    let client = connected(&launch).await;
    let mut created = 0;
    let refused = loop {
        match client.create_room(v1::CreateRoomRequest::default()).await {
            Ok(_) => created += 1,
            Err(refused) => break refused,
        }
        assert!(
            created < DISK_KIB / 128,
            "{created} rooms on {DISK_KIB} KiB"
        );
    };
    assert_eq!(refused.reason(), Some("DISK_NEARLY_FULL"), "{refused}");
    assert!(created > DISK_KIB / 512, "only {created} rooms");
    server.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_temporarily_locked_database_delays_nobody() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(folder.path());
    let server = launch.start().await.expect("the server starts");
    let busy_rooms = BusyRooms::start(&launch.url(), rooms(4, hurried()));
    patiently("decisions", busy_rooms.ledger.reaches(50)).await;
    let mut other = other_program(folder.path()).await;
    execute(&mut other, "BEGIN IMMEDIATE").await;
    let before = busy_rooms.ledger.count();
    tokio::time::sleep(LOCKED_FOR).await;
    let meanwhile = busy_rooms.ledger.count() - before;
    execute(&mut other, "ROLLBACK").await;
    assert!(
        meanwhile <= ON_THE_WAY,
        "{meanwhile} were acknowledged although nothing can be committed"
    );
    assert_continues(&launch, server, busy_rooms, folder.path()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_seat_that_waits_for_the_database_may_still_answer() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(folder.path());
    let server = launch.start().await.expect("the server starts");
    let client = Client::connect(launch.url())
        .await
        .expect("the server listens");
    let (_, tickets) = room_of_four(&client, one_shift(), hurried()).await;
    let mut other = other_program(folder.path()).await;
    let mut seats = Vec::new();
    for ticket in tickets {
        let mut seat = StreamSeat::open(client.channel()).await;
        let attach = v1::Attach {
            ticket,
            delivery: v1::EventDelivery::AtOnce.into(),
            ..v1::Attach::default()
        };
        seat.attach(attach).await;
        assert!(matches!(seat.next().await, Update::Attached(_)));
        seats.push(seat);
    }
    let (Update::Decision(decision), asked) = first_update(&mut seats).await else {
        panic!("the first update is a decision");
    };
    execute(&mut other, "BEGIN IMMEDIATE").await;
    let wrong = (0..500).find(|action| !is_legal(&decision, *action));
    let wrong = wrong.expect("some action is illegal");
    seats[asked].answer(decision.decision_id, wrong).await;
    tokio::time::sleep(LOCKED_FOR).await;
    execute(&mut other, "ROLLBACK").await;
    let refused = seats[asked].result().await;
    assert_eq!(refused.status(), v1::AnswerStatus::Invalid);
    let right = first_legal(&decision);
    seats[asked].answer(decision.decision_id, right).await;
    let result = seats[asked].result().await;
    assert_eq!(result.status(), v1::AnswerStatus::Accepted);
    let limit_us = u64::from(DECISION_TIME_MS) * 1_000;
    assert!(result.decision_time_us < limit_us, "{result:?}");
    server.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_database_that_stays_locked_ends_the_server_and_loses_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(folder.path());
    let server = launch.start().await.expect("the server starts");
    let busy_rooms = BusyRooms::start(&launch.url(), rooms(2, unhurried()));
    patiently("decisions", busy_rooms.ledger.reaches(50)).await;
    let mut other = other_program(folder.path()).await;
    execute(&mut other, "BEGIN IMMEDIATE").await;
    let advice = "another program has kept games.sqlite3 locked for more than 10 s";
    assert_failed(&server.ended().await, advice);
    execute(&mut other, "ROLLBACK").await;
    other.close().await.expect("closed");
    let server = launch.start().await.expect("the server restarts");
    assert_continues(&launch, server, busy_rooms, folder.path()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_disk_that_fails_to_sync_ends_the_server_and_loses_nothing() {
    let name = "a_disk_that_does_not_sync_ends_the_server_and_loses_nothing";
    let mut tried = Command::new("strace");
    match tried.args(["-o", "/dev/null", "true"]).output().await {
        Ok(output) if output.status.success() => {}
        Ok(output) => return skip(name, &String::from_utf8_lossy(&output.stderr)),
        Err(error) => return skip(name, &format!("strace: {error}")),
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let log = folder.path().join("strace.log");
    // Once some games are running, syncs fail. The tracer is a separate process: the server stays
    // our child.
    let strace = [
        "strace".as_ref(),
        "-D".as_ref(),
        "-f".as_ref(),
        "--seccomp-bpf".as_ref(),
        "-o".as_ref(),
        log.as_os_str(),
        "--trace=fsync,fdatasync".as_ref(),
        "--inject=fsync,fdatasync:error=EIO:when=150+".as_ref(),
    ];
    let data_dir = folder.path().join("data");
    let mut launch = Launch::new(&data_dir).through(strace);
    let server = launch.start().await.expect("the server starts");
    let busy_rooms = BusyRooms::start(&launch.url(), rooms(2, unhurried()));
    let ended = server.ended().await;
    assert_failed(&ended, "the disk fails to read or write");
    assert!(busy_rooms.ledger.count() > 20, "in mid-game");
    let log = std::fs::read_to_string(log).expect("strace wrote it");
    assert!(log.contains("(INJECTED)"), "{log}");
    launch.by_itself();
    let server = launch.start().await.expect("the server restarts");
    assert_continues(&launch, server, busy_rooms, &data_dir).await;
}

/// The message of a server that does not start. Checks that it leaves the database unchanged.
async fn refusal(launch: &mut Launch, file: &Path) -> String {
    let before = std::fs::read(file).expect("readable");
    let ended = launch.start().await.expect_err("it does not start");
    assert!(!ended.status.success(), "{ended:?}");
    assert!(
        std::fs::read(file).expect("readable") == before,
        "left unchanged"
    );
    ended.said
}

#[tokio::test(flavor = "multi_thread")]
async fn an_unusable_database_is_left_unchanged() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(folder.path());
    let server = launch.start().await.expect("the server starts");
    let file = folder.path().join(DATABASE);

    // A second server would listen elsewhere.
    let said = refusal(&mut Launch::new(folder.path()), &file).await;
    assert!(said.contains("another chefshat server uses"), "{said}");
    assert!(said.contains("--data-dir"), "{said}");
    assert!(server.stop().await.status.success());
    let well = std::fs::read(&file).expect("readable");

    let mut future = other_program(folder.path()).await;
    execute(
        &mut future,
        "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
         VALUES (9999, 'of the future', 1, x'00', 0)",
    )
    .await;
    future.close().await.expect("closed");
    let said = refusal(&mut launch, &file).await;
    assert!(said.contains("newer version"), "{said}");

    // The first page is intact, so the file is recognised; the pages it refers to are missing.
    let mut damaged = well.clone();
    damaged[4_096..].fill(0xa5);
    std::fs::write(&file, damaged).expect("written");
    let said = refusal(&mut launch, &file).await;
    assert!(
        said.contains("damaged") && said.contains("backup"),
        "{said}"
    );

    std::fs::write(&file, "shopping list: flour, tomatoes".repeat(500)).expect("written");
    let said = refusal(&mut launch, &file).await;
    assert!(said.contains("not a database of chefshat"), "{said}");

    std::fs::write(&file, well).expect("written");
    let server = launch.start().await.expect("the server starts again");
    assert!(server.stop().await.status.success());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_folder_that_is_not_writable_is_named() {
    let disk = match SmallDisk::new(DISK_KIB).await {
        Ok(disk) => disk,
        Err(why) => return skip("a_folder_that_cannot_be_written_is_named", &why),
    };
    let mut launch = Launch::new(disk.mounted_at()).through(disk.enter());
    let server = launch.start().await.expect("the server starts");
    assert!(server.stop().await.status.success());
    disk.make_read_only().await;
    let said = refusal(&mut launch, &disk.path().join(DATABASE)).await;
    assert!(said.contains("--data-dir"), "{said}");
    assert!(
        said.contains(&*disk.mounted_at().to_string_lossy()),
        "{said}"
    );
}
