//! Seats whose clients are connected to another server, which measures the time of their answers.

use super::*;
use crate::{Answered, MAX_GATEWAY_DELAY};

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
        (2400, 400, Some(0), 1400),
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
