//! Records of games whose seats come and go: they verify, and do not when the time of an absence is
//! changed.

use std::collections::BTreeMap;

use chefshat_engine::{OwnChoices, RuleSetSpec, Seat, Stop};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::outcome::FALLBACK;
use chefshat_record::replay::replay;
use chefshat_record::summary::summary;
use chefshat_room::ConnectionId;
use chefshat_room::journal::ParticipantKind;
use chefshat_room::policy::{AbortPolicy, KindClock, Policy};
use chefshat_room::testing::{Chance, OPEN, Table, ms};

use super::{answer_from_proto, record_lines};

fn policy(chance: &mut Chance) -> Policy {
    let absence_time = match chance.below(4) {
        0 => None,
        _ => Some(ms(chance.below(1_200))),
    };
    Policy {
        decision_time: ms(1_000),
        bank: ms(chance.below(3) * 700),
        max_timeouts: 3,
        // With a pace, the time for special actions is that of the phase.
        pace: Some(ms(chance.below(2) * 50)),
        abort: AbortPolicy::Never,
        clocks: vec![KindClock {
            kind: ParticipantKind::Human,
            decision_time: Some(ms(1_500)),
            bank: None,
            absence_time: absence_time.map(|_| ms(400)),
        }],
        absence_time,
        ..Policy::default()
    }
}

/// Plays a random game to its end. Seats lose their connections and return at any time.
fn played(chance: &mut Chance) -> Table {
    let policy = policy(chance);
    played_with(chance, policy, 0)
}

/// As [`played`]. Of a thousand moments, at this many the owner closes the room, who has a seat.
fn played_with(chance: &mut Chance, policy: Policy, closes: u64) -> Table {
    let rules = RuleSetSpec {
        stop: Stop::Shifts(2),
        ..RuleSetSpec::default()
    };
    let mut table = Table::with_rules(policy, vec![OPEN; 4], rules);
    for seat in 0..4 {
        let kind = match seat % 2 {
            0 => ParticipantKind::Agent,
            _ => ParticipantKind::Human,
        };
        table.join(kind).expect("a seat is free");
    }
    let mut connections: Vec<Option<ConnectionId>> = (0..4)
        .map(|seat| Some(table.attach(Seat::new(seat))))
        .collect();
    while !table.core.state().is_over() {
        let open = table.core.awaited().map(|open| open.decision.seat);
        let seat = chance.index(4);
        if chance.below(1_000) < closes {
            table.core.close(table.now, [Seat::new(seat)]);
            table.commit();
            break;
        }
        match chance.below(12) {
            0 => {
                if let Some(connection) = connections[seat].take() {
                    table.lost(Seat::new(seat), connection);
                }
            }
            1..3 => connections[seat] = Some(table.attach(Seat::new(seat))),
            3..5 => table.pass_time(ms(chance.below(900))),
            // Microseconds are truncated, too.
            5 => table.now += std::time::Duration::from_micros(chance.below(1_000)),
            _ => match open {
                Some(open) if connections[open.index()].is_some() => {
                    let (seat, id) = table.open();
                    let action = table.legal(chance.index(9));
                    answer(
                        &mut table,
                        seat,
                        (id, action),
                        (id + seat.index() as u64).is_multiple_of(8),
                    );
                }
                _ => table.pass_time(ms(chance.below(300))),
            },
        }
        // What is due happens before anything else.
        table.pass_time(ms(0));
    }
    table
}

/// Answers a decision, or lets the participant's fallback answer it.
fn answer(table: &mut Table, seat: Seat, (decision_id, action): (u64, u32), by_fallback: bool) {
    let why = (FALLBACK.to_owned(), "greedy: no answer in time".to_owned());
    let annotations = by_fallback.then(|| v1::Annotations {
        extra: [why].into(),
        ..v1::Annotations::default()
    });
    let answer = answer_from_proto(v1::Answer {
        decision_id,
        action,
        annotations,
    });
    table.core.answer(table.now, seat, answer, table.now, None);
    table.commit();
}

#[test]
fn who_lets_its_fallback_play_has_lost_to_all() {
    for (one_in, is_own) in [(OwnChoices::ONE_IN, true), (5, false)] {
        let mut table = Table::with_rules(Policy::default(), vec![OPEN; 4], RuleSetSpec::default());
        table.fill();
        let mut choices = 0;
        while !table.core.state().is_over() {
            let (seat, id) = table.open();
            let has_choice = seat.index() == 0 && table.core.legal_actions().len() > 1;
            choices += u32::from(has_choice);
            let by_fallback = has_choice && choices % one_in == 0;
            let action = table.legal(0);
            answer(&mut table, seat, (id, action), by_fallback);
        }
        table.assert_replays();
        let own = super::summary(&table.core);
        let lost = own.seats.iter().filter(|seat| seat.substituted).count();
        assert_eq!(lost, usize::from(!is_own));
        assert_ne!(own.seats[0].substituted, is_own);
        let lines = record_of(&table);
        let replayed = replay(&lines).expect("it verifies");
        let read = summary(&lines, &replayed).expect("something was dealt");
        assert_ne!(read.seats[0].substituted, is_own);
    }
}

fn record_of(table: &Table) -> Vec<v1::RecordLine> {
    record_lines(table.core.header(), &table.journal)
}

#[test]
fn games_with_absences_verify() {
    let mut substituted = 0;
    for seed in 0..300 {
        let mut chance = Chance(seed);
        let table = played(&mut chance);
        let lines = record_of(&table);
        replay(&lines).unwrap_or_else(|error| panic!("game {seed}: {error}"));
        substituted += lines.iter().filter(|line| is_substitution(line)).count();
    }
    assert!(substituted > 100, "only {substituted} substitutions");
}

#[test]
fn a_record_says_who_forfeited_a_game_as_its_summary_does() {
    let (mut reasons, mut forfeits) = (BTreeMap::new(), 0);
    for seed in 0..300 {
        let mut chance = Chance(seed);
        let policy = Policy {
            abort: match seed % 3 {
                0 => AbortPolicy::Never,
                1 => AbortPolicy::AnyLost,
                _ => AbortPolicy::AllLost,
            },
            ..policy(&mut chance)
        };
        let table = played_with(&mut chance, policy, 5);
        let lines = record_of(&table);
        let replayed = replay(&lines).unwrap_or_else(|error| panic!("game {seed}: {error}"));
        let read = summary(&lines, &replayed).expect("something was dealt");
        let own = super::summary(&table.core);
        let forfeited = |summary: &v1::RecordSummary| {
            let seats = summary.seats.iter();
            seats.map(|seat| seat.substituted).collect::<Vec<_>>()
        };
        assert_eq!(forfeited(&read), forfeited(&own), "game {seed}");
        let of = |it: &v1::RecordSummary| (it.state, it.abort_reason, it.substituted, it.hinted);
        assert_eq!(of(&read), of(&own), "game {seed}");
        *reasons.entry(own.abort_reason()).or_insert(0) += 1;
        forfeits += forfeited(&own).iter().filter(|it| **it).count();
        if own.abort_reason() != v1::AbortReason::Unspecified {
            assert!(forfeited(&own).contains(&true), "game {seed}: {own:?}");
        }
    }
    assert!(
        reasons.len() == 3 && reasons.values().all(|games| *games > 20),
        "{reasons:?}"
    );
    assert!(forfeits > 200, "only {forfeits}");
}

fn is_substitution(line: &v1::RecordLine) -> bool {
    matches!(&line.line, Some(Line::Event(event)) if matches!(event.kind, Some(Kind::Substituted(_))))
}

/// The record of a game in which the first seat to decide is away for its absence time.
fn record_with_an_absence(absence_time: Option<std::time::Duration>) -> Vec<v1::RecordLine> {
    let rules = RuleSetSpec {
        stop: Stop::Shifts(1),
        ..RuleSetSpec::default()
    };
    let policy = Policy {
        decision_time: ms(1_000),
        bank: ms(500),
        abort: AbortPolicy::Never,
        absence_time,
        ..Policy::default()
    };
    let mut table = Table::with_rules(policy, vec![OPEN; 4], rules);
    table.fill();
    let (seat, _) = table.open();
    let connection = u64::try_from(seat.index()).expect("small") + 1;
    table.lost(seat, ConnectionId(connection));
    while !table.core.state().is_over() {
        match table.core.awaited().map(|open| open.decision.seat) {
            Some(open) if open != seat => {
                table.play_one();
            }
            _ => table.pass_time(ms(100)),
        }
    }
    record_of(&table)
}

/// The first decision that was taken because its seat was away.
fn absent(lines: &mut [v1::RecordLine]) -> &mut v1::DecisionRecord {
    let mut decisions = lines.iter_mut().filter_map(|line| match &mut line.line {
        Some(Line::Decision(decision)) => Some(decision),
        _ => None,
    });
    let source = v1::DecisionSource::Disconnected;
    decisions
        .find(|decision| decision.source() == source)
        .expect("a seat was away")
}

/// Moves the first loss of a connection.
fn lost_at(lines: &mut [v1::RecordLine], elapsed_ms: u64) {
    let lost = lines.iter_mut().find_map(|line| match &mut line.line {
        Some(Line::Event(event)) if matches!(event.kind, Some(Kind::Disconnected(_))) => {
            Some(event)
        }
        _ => None,
    });
    lost.expect("a lost connection").elapsed_ms = elapsed_ms;
}

#[test]
fn the_record_of_an_absence_cannot_be_changed() {
    let lines = record_with_an_absence(Some(ms(400)));
    replay(&lines).expect("the record verifies");
    type Edit = fn(&mut Vec<v1::RecordLine>);
    let edits: [(Edit, &str); 5] = [
        (|lines| absent(lines).bank_left_ms -= 1, "bankLeftMs"),
        (
            |lines| absent(lines).decision_time_us = 399_999,
            "the time was not up: the seat had 400 ms",
        ),
        (
            |lines| lost_at(lines, 399),
            "the time was not up: the seat had 1500 ms",
        ),
        (
            |lines| absent(lines).source = v1::DecisionSource::Timeout.into(),
            "by the events the seat was not connected",
        ),
        (
            |lines| {
                let given = lines.iter().position(is_substitution);
                lines.remove(given.expect("a substitution"));
            },
            "`substituted` must come here",
        ),
    ];
    for (edit, problem) in edits {
        let mut edited = lines.clone();
        edit(&mut edited);
        let error = replay(&edited).expect_err(problem).to_string();
        assert!(error.contains(problem), "{error}");
    }
    // Without an absence time, the same absence is judged as earlier servers did.
    let earlier = record_with_an_absence(None);
    replay(&earlier).expect("the record verifies");
    let mut lines = earlier;
    assert_eq!(absent(&mut lines).bank_left_ms, 0);
    assert_eq!(lines.iter().filter(|line| is_substitution(line)).count(), 1);
}
