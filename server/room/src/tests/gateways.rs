//! Seats whose clients are connected to another server, which measures the time of their answers.

use super::*;
use crate::log::RoomEvent;
use crate::testing::first_connection;
use crate::{Answered, MAX_GATEWAY_DELAY, RECALL_TIME};

/// A game in which the seats' answers are measured elsewhere; each has 1.5 s for a decision.
fn measured() -> Table {
    let mut table = Table::playing(Policy {
        decision_time: ms(1000),
        bank: ms(500),
        ..Policy::default()
    });
    for seat in table.core.all_seats() {
        table.core.expect_delays(seat);
    }
    table
}

/// Answers the open decision, whose request was handed over at `handed`.
fn answer(table: &mut Table, arrived: u64, time: u64, handed: Option<u64>) -> Answered {
    let (seat, id) = table.open();
    let answer = Answer {
        measured: Some(ms(time)),
        ..Answer::new(id, table.legal(0))
    };
    let arrived = ms(arrived);
    let answered = (table.core).answer(arrived, seat, answer, arrived, handed.map(ms));
    table.commit();
    answered
}

#[test]
fn the_measured_time_counts_instead_of_the_time_that_passed() {
    // Arrived, measured, handed over, and the time that counts.
    for (arrived, time, handed, counts) in [
        (900, 400, Some(0), 400),
        // The report was slower than the answer.
        (700, 400, Some(500), 400),
        // No report came: it is computed from the answer.
        (900, 400, None, 400),
        // In time at the gateway.
        (1700, 1400, Some(0), 1400),
        // The network does not delay an answer longer than this.
        (7400, 400, Some(0), 1400),
    ] {
        let mut table = measured();
        let answered = answer(&mut table, arrived, time, handed);
        assert_eq!(answered.verdict, Verdict::Accepted, "{arrived} {time}");
        assert_eq!(answered.time, ms(counts), "{arrived} {time}");
        assert_eq!(
            u128::from(table.last_decision().time_us),
            ms(counts).as_micros()
        );
        table.assert_replays();
    }
}

#[test]
fn an_answer_that_was_late_at_the_gateway_closes_the_decision() {
    let mut table = measured();
    let (seat, _) = table.open();
    let answered = answer(&mut table, 1600, 1500, Some(0));
    assert_eq!(answered.verdict, Verdict::Closed);
    let decided = table.last_decision();
    assert_eq!((decided.seat, decided.source), (seat, Source::Timeout));
    assert_eq!((decided.time_us, decided.bank_left_ms), (1_500_000, 0));
}

#[test]
fn the_deadline_waits_for_answers_that_may_be_on_their_way() {
    let mut table = measured();
    let (seat, _) = table.open();
    table.pass_time(ms(1500) + MAX_GATEWAY_DELAY - ms(1));
    assert_eq!(table.core.decisions(), 0);
    table.pass_time(ms(1));
    let decided = table.last_decision();
    assert_eq!((decided.seat, decided.source), (seat, Source::Timeout));
    assert_eq!(decided.time_us, 1_500_000, "the seat had no longer");
    // A connection to this server has no such time.
    let mut table = measured();
    table.attach(seat);
    table.pass_time(ms(1500));
    assert_eq!(table.core.decisions(), 1);
    table.assert_replays();
}

/// Loses the server through which a seat is connected.
fn lose_server(table: &mut Table, seat: Seat) {
    (table.core).lost_with_node(table.now, seat, first_connection(seat), None);
    table.commit();
}

#[test]
fn the_clock_waits_for_a_seat_whose_server_is_lost() {
    let mut table = measured();
    let (seat, id) = table.open();
    // Its time is up, and an answer may be on its way when the loss is noticed.
    table.pass_time(ms(1500) + MAX_GATEWAY_DELAY - ms(1));
    lose_server(&mut table, seat);
    table.pass_time(RECALL_TIME - ms(1));
    assert_eq!(table.open(), (seat, id));
    table.attach(seat);
    let lost = |it: &RoomEvent| matches!(it, RoomEvent::Disconnected { seat: lost, with_node: true } if *lost == seat);
    assert_eq!(table.happened(lost), 1);
    assert_eq!(table.happened(|it| matches!(it, RoomEvent::Returned(_))), 1);
    assert_eq!(table.core.time_left(table.now), (ms(1000), ms(500)));
    let action = table.legal(0);
    assert_eq!(table.answer(seat, id, action).verdict, Verdict::Accepted);
    // It was lost once.
    lose_server(&mut table, seat);
    assert!(table.core.standing(seat).connected);
    table.assert_replays();
}

#[test]
fn the_clock_waits_once_its_turn_comes_too() {
    let mut table = measured();
    let (first, _) = table.open();
    let next = (table.core.all_seats()).filter(|seat| *seat != first);
    for seat in next {
        lose_server(&mut table, seat);
    }
    table.play_one();
    let (second, id) = table.open();
    table.pass_time(RECALL_TIME - ms(1));
    assert_eq!(table.open(), (second, id));
    table.attach(second);
    assert_eq!(table.core.time_left(table.now), (ms(1000), ms(500)));
}

#[test]
fn a_seat_whose_server_is_lost_and_that_stays_away_is_substituted_as_usual() {
    let mut table = measured();
    let (seat, id) = table.open();
    table.pass_time(ms(700));
    lose_server(&mut table, seat);
    // Its absence time, for which the others wait.
    table.pass_time(RECALL_TIME + ms(999));
    assert_eq!(table.open(), (seat, id));
    table.pass_time(ms(1));
    assert!(table.core.standing(seat).substituted);
    table.assert_replays();
}

#[test]
fn a_silent_decision_ends_at_the_same_time_whoever_decides_and_is_lost() {
    let ended = |measured: Seat, loses_server: bool| {
        let policy = Policy {
            decision_time: ms(1000),
            ..Policy::default()
        };
        let mut table = Table::with_jokers_at(policy, vec![OPEN; 4], [Seat::new(2); 2]);
        let (seat, _) = table.open();
        assert!(table.core.awaited().expect("the holder").is_silent());
        // Of the seats, one or another is connected through a server.
        table.core.expect_delays(measured);
        table.pass_time(ms(400));
        match loses_server {
            true => lose_server(&mut table, seat),
            false => table.lost(seat, first_connection(seat)),
        }
        table.attach(seat);
        table.pass_time(ms(599) + MAX_GATEWAY_DELAY);
        assert_eq!(table.core.decisions(), 0);
        table.pass_time(ms(1));
        table.core.decisions()
    };
    for measured in [2, 3] {
        for loses_server in [false, true] {
            assert_eq!(ended(Seat::new(measured), loses_server), 1);
        }
    }
}

#[test]
fn a_seat_that_was_lost_with_its_server_and_is_away_at_the_end_has_forfeited() {
    let mut table = measured();
    let (seat, _) = table.open();
    lose_server(&mut table, seat);
    table.core.close(table.now, []);
    let forfeited = |seat: &Seat| table.core.has_forfeited(*seat);
    let all: Vec<Seat> = table.core.all_seats().filter(forfeited).collect();
    assert_eq!(all, [seat]);
}

#[test]
fn earlier_absences_do_not_shorten_the_time_after_a_server_is_lost() {
    let mut table = measured();
    let (seat, _) = table.open();
    table.lost(seat, first_connection(seat));
    table.pass_time(ms(800));
    let again = table.attach(seat);
    table.core.lost_with_node(table.now, seat, again, None);
    table.commit();
    table.pass_time(RECALL_TIME + ms(1000));
    let decided = table.last_decision();
    assert_eq!(decided.source, Source::Disconnected);
    assert_eq!(decided.time_us, 1_000_000, "its whole absence time");
}

#[test]
fn an_answer_without_a_stream_is_in_time_while_the_clock_waits() {
    let mut table = measured();
    let (seat, id) = table.open();
    table.pass_time(ms(1400));
    lose_server(&mut table, seat);
    table.pass_time(ms(5000));
    let action = table.legal(0);
    let (answer, now) = (Answer::new(id, action), table.now);
    let answered = table.core.answer(now, seat, answer, now, None);
    table.commit();
    assert_eq!(
        (answered.verdict, answered.time),
        (Verdict::Accepted, ms(0))
    );
    assert_eq!(table.last_decision().bank_left_ms, 500);
}
