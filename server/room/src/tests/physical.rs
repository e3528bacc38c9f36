//! Physical rooms: reports, their rulings and what follows, mixed tables, corrections, pauses.

use std::sync::Arc;
use std::time::Duration;

use chefshat_engine::{DecisionKind, Event, Seat, Viewer};
use chefshat_referee::{MAX_QUESTIONS, Question, Refusal, Stage, ViolatedRule};

use super::{Core, OPEN, ParticipantKind, Source, State, Table, ms};
use crate::journal::{AbortReason, Report, ReportSource, Reported};
use crate::log::RoomEvent;
use crate::testing::real_table::{MIXED, Mixed, PERSON, policy};
use crate::testing::shifts;
use crate::{CONFIRMATION_TIME, MAX_IDLE, MAX_REPORTS, ReportError, ReportVerdict};

/// A report with an id.
fn reported(id: &str, report: Report) -> Reported {
    Reported {
        id: id.into(),
        source: ReportSource::Attendant,
        age: Duration::ZERO,
        report,
    }
}

/// A question that a camera asks.
fn question(id: String) -> Report {
    Report::Question(Question {
        id,
        text: "7 or 9 at place 4?".into(),
        options: vec!["7".into(), "9".into()],
        seat: None,
    })
}

#[test]
fn a_mixed_game_is_the_one_at_the_table() {
    for seed in 0..6 {
        let mut mixed = Mixed::new(MIXED, 2, seed);
        mixed.finish();
        assert_eq!(mixed.table.core.state(), State::Finished);
        mixed.table.assert_replays();
        let sources = mixed.sources();
        for source in [Source::Table, Source::Agent] {
            assert!(sources.iter().any(|(it, _)| *it == source));
        }
        let violations = |it: &RoomEvent| matches!(it, RoomEvent::Violation(_));
        assert_eq!(mixed.table.happened(violations), 0);
    }
}

#[test]
fn players_at_the_table_are_present_and_nobody_can_join_for_them() {
    let mut table = Table::physical(policy(), vec![PERSON, PERSON, OPEN, PERSON], shifts(1));
    assert_eq!(table.core.state(), State::Waiting);
    assert_eq!(table.happened(|it| matches!(it, RoomEvent::Seated(..))), 3);
    let early = reported("a", Report::Cleared);
    let refused = table.core.report(table.now, early);
    assert_eq!(refused, Err(ReportError::GameNotStarted));
    // They keep their seats, however long the others take.
    table.pass_time(Duration::from_secs(600));
    assert_eq!(table.happened(|it| matches!(it, RoomEvent::Vacated(_))), 0);
    let seat = table.join(ParticipantKind::Agent).expect("the free seat");
    assert_eq!(seat, Seat::new(2));
    assert!(table.join(ParticipantKind::Human).is_err());
    table.attach(seat);
    assert_eq!(table.core.state(), State::Playing);
}

#[test]
fn all_at_the_table_start_at_once_and_no_clock_runs() {
    let mut mixed = Mixed::new([PERSON; 4], 1, 3);
    assert_eq!(mixed.table.core.state(), State::Playing);
    assert_eq!(mixed.table.core.deadline(), Some(MAX_IDLE));
    assert!(mixed.table.core.open().is_none());
    mixed.finish();
}

/// A game at the table whose last play has been reported.
fn at_the_end() -> Mixed {
    let mut mixed = Mixed::new([PERSON; 4], 1, 3);
    mixed.until(|it| it.stage() == Stage::Confirmation);
    assert_eq!(mixed.table.core.state(), State::Playing);
    mixed
}

#[test]
fn the_play_that_ends_a_game_can_be_corrected_until_its_end_is_confirmed() {
    let mut mixed = at_the_end();
    let table = mixed.table.core.table().expect("a physical room");
    let last = table.referee().accepted().last().expect("a play");
    let (number, instead) = (last.number, None);
    mixed.table.report(Report::Correction { number, instead });
    assert!(
        matches!(mixed.stage(), Stage::Turn(_)),
        "{:?}",
        mixed.stage()
    );
    let refused = Err(ReportError::Refused(Refusal::NotOver));
    let confirm = |id: &str| reported(id, Report::EndConfirmed);
    let now = mixed.table.now;
    assert_eq!(mixed.table.core.report(now, confirm("early")), refused);
    mixed.table.report(last.report);
    assert_eq!(mixed.stage(), Stage::Confirmation);
    mixed.table.report(Report::EndConfirmed);
    assert_eq!(mixed.table.core.state(), State::Finished);
    mixed.assert_same_end();
    let late = mixed.table.core.report(now, confirm("late"));
    assert_eq!(late, Err(ReportError::GameOver));
    mixed.table.assert_replays();
}

#[test]
fn an_end_that_nobody_corrects_is_confirmed_by_time_unless_the_game_is_paused() {
    let mut mixed = at_the_end();
    mixed.table.pass_time(CONFIRMATION_TIME - ms(1));
    mixed.table.report(Report::Pause(true));
    mixed.table.pass_time(CONFIRMATION_TIME * 10);
    assert_eq!(mixed.table.core.state(), State::Playing);
    mixed.table.report(Report::Pause(false));
    mixed.table.pass_time(CONFIRMATION_TIME - ms(1));
    assert_eq!(mixed.table.core.state(), State::Playing);
    assert_eq!(mixed.table.core.deadline(), Some(mixed.table.now + ms(1)));
    mixed.table.pass_time(ms(1));
    assert_eq!(mixed.table.core.state(), State::Finished);
    mixed.table.assert_replays();
}

#[test]
fn a_room_that_is_closed_before_its_end_is_confirmed_has_a_result() {
    let mut mixed = at_the_end();
    mixed.table.core.close(mixed.table.now, []);
    assert_eq!(mixed.table.core.state(), State::Finished);
}

#[test]
fn a_remote_seat_decides_only_when_its_hand_is_known() {
    let mut mixed = Mixed::new(MIXED, 1, 1);
    assert_eq!(mixed.stage(), Stage::Hand(Seat::new(1)));
    assert!(mixed.table.core.open().is_none());
    let seat = Seat::new(1);
    let hand = |table: &Table| {
        let observed = table.core.observe(Viewer::Seat(seat));
        observed.expect("a game").hand
    };
    assert!(hand(&mixed.table).is_empty(), "an assumed hand");
    let report = mixed.real.hand(seat);
    mixed.table.report(report);
    assert_eq!(hand(&mixed.table), mixed.real.truth.hands()[seat]);
    let hands = |it: &RoomEvent| matches!(it, RoomEvent::HandReported(_));
    assert_eq!(mixed.table.happened(hands), 1);
}

#[test]
fn a_repeated_report_gets_the_same_ruling_and_changes_nothing() {
    let mut mixed = Mixed::new([PERSON; 4], 1, 2);
    let stage = mixed.stage();
    let report = mixed.real.next_report(stage).expect("the opening");
    let reported = reported("once", report);
    let now = mixed.table.now;
    let first = mixed.table.core.report(now, reported.clone());
    mixed.table.commit();
    let changes = mixed.table.core.changes();
    let later = Reported {
        age: ms(50),
        ..reported.clone()
    };
    let again = mixed.table.core.report(now + ms(50), later);
    assert_eq!(first, again);
    let other = Reported {
        report: Report::Pause(true),
        ..reported
    };
    let refused = mixed.table.core.report(now, other);
    assert_eq!(refused, Err(ReportError::IdUsed));
    assert!(matches!(first, Ok(outcome) if outcome.number == changes));
    assert_eq!(mixed.table.core.changes(), changes);
}

#[test]
fn the_time_at_the_table_counts_from_the_turn_to_the_event() {
    let mut mixed = Mixed::new([PERSON; 4], 1, 2);
    mixed.until(|it| it.sources().len() == 3);
    // The last turn was reported when it happened; the next one late.
    mixed.table.now += ms(2_000);
    let stage = mixed.stage();
    let report = mixed.real.next_report(stage).expect("a turn");
    mixed.table.report_late(report, ms(300));
    assert_eq!(mixed.sources().last(), Some(&(Source::Table, 1_700_000)));
    // That turn began when the one before happened, not when it was reported.
    mixed.table.now += ms(400);
    let stage = mixed.stage();
    let report = mixed.real.next_report(stage).expect("a turn");
    mixed.table.report_late(report, ms(100));
    assert_eq!(mixed.sources().last(), Some(&(Source::Table, 600_000)));
}

#[test]
fn a_pause_stops_the_clock_and_gives_the_full_time_again() {
    let mut mixed = Mixed::new(MIXED, 1, 1);
    mixed.until(|it| it.table.core.awaited().is_some());
    let (seat, id) = mixed.table.open();
    mixed.table.pass_time(ms(900));
    mixed.table.report(Report::Pause(true));
    assert!(mixed.table.core.is_paused());
    assert_eq!(
        mixed.table.core.deadline(),
        Some(mixed.table.now + MAX_IDLE)
    );
    mixed.table.pass_time(Duration::from_secs(3_600));
    assert_eq!(mixed.table.open(), (seat, id));
    mixed.table.report(Report::Pause(false));
    let (left, bank) = mixed.table.core.time_left(mixed.table.now);
    assert_eq!((left, bank), (ms(1_000), ms(500)));
    mixed.table.pass_time(ms(1_499));
    assert_eq!(mixed.table.open(), (seat, id));
    mixed.table.pass_time(ms(1));
    assert_ne!(mixed.table.core.open().map(|open| open.id), Some(id));
    let timed_out = (mixed.table.journal.iter()).any(|entry| {
        matches!(&entry.change, crate::journal::Change::Decided(decided)
            if decided.seat == seat && decided.source == Source::Timeout)
    });
    assert!(timed_out);
    let pauses = |it: &RoomEvent| matches!(it, RoomEvent::Paused(_));
    assert_eq!(mixed.table.happened(pauses), 2);
    mixed.table.assert_replays();
}

#[test]
fn a_violation_is_an_event_and_the_game_stands() {
    let mut mixed = Mixed::new([PERSON; 4], 1, 2);
    mixed.until(|it| it.sources().len() == 2);
    let (events, open) = (mixed.events(), mixed.stage());
    let report = Report::Laid {
        seat: None,
        cards: chefshat_referee::SeenCards {
            counts: {
                let mut counts = [0; 16];
                counts[10] = 11;
                counts
            },
            golden: None,
        },
    };
    let outcome = mixed.table.report(report);
    assert!(
        matches!(outcome.verdict, ReportVerdict::Violation(_)),
        "{outcome:?}"
    );
    assert_eq!((mixed.events(), mixed.stage()), (events, open));
    let violations = mixed.table.happened(
        |it| matches!(it, RoomEvent::Violation(violation) if violation.0 == outcome.number),
    );
    assert_eq!(violations, 1);
}

#[test]
fn a_correction_voids_what_followed_and_reopens_the_decision() {
    let mut reopened = 0;
    for seed in 0..12 {
        let mut mixed = Mixed::new([PERSON, PERSON, OPEN, PERSON], 1, seed);
        let (number, right) = mixed.misread();
        let open = mixed.table.core.open();
        let before = open.map(|open| (open.decision.seat, open.id));
        let outcome = mixed.table.report(Report::Correction {
            number,
            instead: Some(Box::new(right)),
        });
        assert_eq!(outcome.verdict, ReportVerdict::Accepted);
        let corrections = |it: &RoomEvent| matches!(it, RoomEvent::Correction(_));
        assert_eq!(mixed.table.happened(corrections), 1);
        if let (Some((seat, id)), Some(open)) = (before, mixed.table.core.open())
            && open.decision.seat == seat
        {
            reopened += 1;
            assert_eq!(open.id, id + 1, "a new decision, because the board changed");
            let action = mixed.table.legal(0);
            let closed = mixed.table.answer(seat, id, action);
            assert_eq!(closed.verdict, crate::Verdict::Closed);
        }
        mixed.finish();
        let plays = |events: &[Event]| {
            let turn = |it: &&Event| matches!(it, Event::Played { .. } | Event::Passed { .. });
            events.iter().filter(turn).count()
        };
        let turns = (mixed.real.decisions.len(), plays(&mixed.events()));
        assert_eq!(turns.0, turns.1, "each turn stands once");
        mixed.table.assert_replays();
    }
    assert!(reopened > 0, "no correction met an open decision");
}

#[test]
fn questions_are_bounded_and_answered() {
    let mut table = Table::physical(policy(), vec![PERSON; 4], shifts(1));
    for number in 0..MAX_QUESTIONS {
        let asked = table.report(question(format!("question {number}")));
        assert_eq!(asked.verdict, ReportVerdict::Accepted);
    }
    let one_more = reported("one more", question("one more".into()));
    let refused = table.core.report(table.now, one_more);
    assert_eq!(refused, Err(Refusal::TooManyQuestions.into()));
    table.report(Report::Answer {
        id: "question 3".into(),
        option: Some(1),
    });
    let open = table.core.table().expect("a table").referee().questions();
    assert_eq!(open.len(), MAX_QUESTIONS - 1);
    table.assert_replays();
}

#[test]
fn a_restart_resumes_the_table() {
    for seed in 0..4 {
        let mut mixed = Mixed::new(MIXED, 2, seed);
        for steps in [3, 20, 25] {
            for _ in 0..steps {
                if !mixed.table.core.state().is_over() {
                    mixed.step();
                }
            }
            if mixed.table.core.state().is_over() {
                break;
            }
            let stage = mixed.stage();
            let header = Arc::clone(mixed.table.core.header());
            mixed.table.core = Core::revived(header, &mixed.table.journal, mixed.table.now)
                .expect("a consistent journal");
            mixed.table.commit();
            assert_eq!(mixed.stage(), stage);
            mixed.table.attach(Seat::new(1));
        }
        mixed.finish();
        mixed.table.assert_replays();
    }
}

#[test]
fn what_cannot_be_judged_is_no_violation() {
    let mut mixed = Mixed::new([PERSON; 4], 1, 2);
    mixed.until(|it| it.sources().len() == 2);
    mixed.table.report(question("camera".into()));
    let changes = mixed.table.core.changes();
    let no_option = Report::Answer {
        id: "camera".into(),
        option: Some(2),
    };
    let not_a_report = Report::Correction {
        number: 99,
        instead: None,
    };
    for (report, refusal) in [
        (no_option, Refusal::NoSuchOption),
        (not_a_report, Refusal::NotCorrectable),
    ] {
        let reported = reported("refused", report);
        let refused = mixed.table.core.report(mixed.table.now, reported);
        assert_eq!(refused, Err(refusal.into()));
    }
    assert_eq!(mixed.table.core.changes(), changes);
}

#[test]
fn a_table_where_nothing_is_reported_is_given_up() {
    let aborted = State::Aborted(AbortReason::ParticipantsLost);
    for paused in [false, true] {
        let mut mixed = Mixed::new([PERSON; 4], 1, 2);
        mixed.table.pass_time(MAX_IDLE - ms(1));
        mixed.table.report(Report::Pause(paused));
        mixed.table.pass_time(MAX_IDLE - ms(1));
        assert_eq!(mixed.table.core.state(), State::Playing);
        mixed.table.pass_time(ms(1));
        assert_eq!(mixed.table.core.state(), aborted);
        mixed.table.assert_replays();
    }
}

#[test]
fn a_table_with_too_many_reports_is_given_up() {
    let mut mixed = Mixed::new([PERSON; 4], 1, 2);
    for number in 1..MAX_REPORTS {
        mixed.table.report(Report::Pause(number % 2 == 0));
    }
    assert_eq!(mixed.table.core.state(), State::Playing);
    mixed.table.report(Report::Pause(true));
    let aborted = State::Aborted(AbortReason::TooLong);
    assert_eq!(mixed.table.core.state(), aborted);
}

#[test]
fn a_play_for_a_remote_seat_that_it_did_not_decide_is_a_violation() {
    let mut mixed = Mixed::new(MIXED, 1, 1);
    mixed.until(|it| {
        let turn = it.table.core.awaited();
        turn.is_some_and(|open| open.decision.kind == DecisionKind::Turn)
    });
    let (seat, _) = mixed.table.open();
    let legal = mixed.table.core.legal_actions();
    let action = legal.nth(0).expect("one is legal");
    let outcome = mixed.table.report(mixed.real.turn(seat, action));
    let ReportVerdict::Violation(violation) = outcome.verdict else {
        panic!("{:?}", outcome.verdict);
    };
    assert_eq!(violation.rule, ViolatedRule::Decision);
    assert_eq!(mixed.table.open().0, seat, "its decision is still open");
}
