//! The record of a physical room: the game as it counts at its end, after all corrections, with
//! everything that is known by then.

use std::collections::BTreeMap;
use std::sync::Arc;

use chefshat_engine::{Action, Event, Seat, Viewer};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::convert::seat_number;
use chefshat_record::import::{PhysicalRoom, RoomEntry};
use chefshat_referee::{Fact, ShiftFacts, ShiftStory};
use prost::Message as _;
use tracing::error;

use super::event::event_to_proto;
use super::marker::last_marker;
use super::mirrored::Mirrored as _;
use super::policy::millis;
use super::room::state_to_proto;
use super::summary::{elapsed_ms, record_header};
use chefshat_room::Core;
use chefshat_room::journal::{Change, Decided, Entry, Fill, GameHeader};
use chefshat_room::log::RoomEvent;

/// Where an entry of the record stands: after the changes before, and among what follows from the
/// same change.
type Place = (u64, Phase);

/// The order of what follows from one change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Phase {
    /// What became known, or was wrong.
    Known,
    /// Decisions.
    Decided,
    /// Other events.
    After,
}

/// All lines of the record of a physical room.
pub(super) fn physical_record_lines(
    header: &Arc<GameHeader>,
    journal: &[Entry],
) -> Vec<v1::RecordLine> {
    let room = Room::of(header, journal);
    let shifts = room.story();
    room.record(&shifts).unwrap_or_else(|problem| {
        // The decisions alone are a game in any case.
        error!(game = %header.game_id, problem, "a record lacks the hands and gifts");
        let turns = shifts.into_iter().map(without_cards).collect::<Vec<_>>();
        room.record(&turns).unwrap_or_else(|problem| {
            error!(game = %header.game_id, problem, "a record is only the log of its room");
            room.log()
        })
    })
}

/// A room at the end of its game.
struct Room {
    core: Core,
    /// Everything but decisions.
    entries: Vec<Placed>,
    /// Decisions of participants and built-in agents, by the number of their change.
    decided: BTreeMap<u64, v1::DecisionRecord>,
}

/// An entry of a room and its place in the record.
struct Placed {
    place: Place,
    /// The report that made a hand known.
    hand: Option<u64>,
    entry: RoomEntry,
}

impl Room {
    /// Folds a journal.
    fn of(header: &Arc<GameHeader>, journal: &[Entry]) -> Self {
        let mut room = Self {
            core: Core::new(Arc::clone(header)),
            entries: Vec::new(),
            decided: BTreeMap::new(),
        };
        // Invalid attempts at the open decision, which a correction may close.
        let mut attempts: (Option<(Seat, u64)>, Vec<u32>) = (None, Vec::new());
        for (number, entry) in (1..).zip(journal) {
            let open = room.core.open().map(|open| (open.decision.seat, open.id));
            if attempts.0 != open {
                attempts = (open, Vec::new());
            }
            match &entry.change {
                Change::Attempted { action, .. } => attempts.1.push(*action),
                Change::Decided(decided) => {
                    let record = decision(entry, decided, std::mem::take(&mut attempts.1));
                    room.decided.insert(number, record);
                }
                Change::Expressed {
                    seat,
                    record_only: true,
                    expression,
                } => {
                    let private = v1::PrivateExpression {
                        seat: seat_number(*seat),
                        elapsed_ms: elapsed_ms(entry),
                        expression: v1::Expression::decode(expression.as_ref()).ok(),
                    };
                    room.entries.push(Placed {
                        place: (number, Phase::After),
                        hand: None,
                        entry: RoomEntry::Private(private),
                    });
                }
                _ => {}
            }
            room.fold(number, entry);
            if let Change::Marked(_) = entry.change {
                let marker = last_marker(&room.core);
                room.entries.extend(marker.map(|marker| Placed {
                    place: (number, Phase::After),
                    hand: None,
                    entry: RoomEntry::Marker(marker),
                }));
            }
        }
        room
    }

    fn fold(&mut self, number: u64, entry: &Entry) {
        let before = self.core.log().len();
        self.core.refold(entry);
        for position in before..self.core.log().len() {
            let (phase, hand) = match self.core.log().get(position).map(|it| &it.event) {
                Some(RoomEvent::Game(game)) => match game.event {
                    Event::GameEnded { .. } => (Phase::After, None),
                    // Follows from the decisions.
                    _ => continue,
                },
                Some(RoomEvent::HandReported(hand)) => (Phase::Known, Some(hand.report)),
                Some(RoomEvent::Correction(correction)) => {
                    let void = |report| {
                        report == correction.report || correction.void_reports.contains(&report)
                    };
                    (self.entries).retain(|entry| !entry.hand.is_some_and(void));
                    (Phase::Known, None)
                }
                _ => (Phase::After, None),
            };
            let event = event_to_proto(&self.core, position, Viewer::Everything);
            let Some((elapsed_ms, Some(mut kind))) = event.map(|it| (it.elapsed_ms, it.kind))
            else {
                continue;
            };
            if let Kind::Correction(correction) = &mut kind {
                correction.first_void = 0;
            }
            self.entries.push(Placed {
                place: (number, phase),
                hand,
                entry: RoomEntry::Event { elapsed_ms, kind },
            });
        }
    }

    /// The log with all that was void, as a record without decisions.
    fn log(&self) -> Vec<v1::RecordLine> {
        let log = &self.core.log();
        let events = (0..log.len())
            .filter_map(|position| event_to_proto(&self.core, position, Viewer::Everything))
            .map(Line::Event);
        let footer = v1::RecordFooter {
            state: state_to_proto(self.core.state()).into(),
            events: u64::try_from(log.len()).unwrap_or(u64::MAX),
            decisions: 0,
            ..v1::RecordFooter::default()
        };
        std::iter::once(Line::Header(Box::new(record_header(&self.core))))
            .chain(events)
            .chain(std::iter::once(Line::Footer(footer)))
            .map(|line| v1::RecordLine { line: Some(line) })
            .collect()
    }

    /// The Shifts as they count.
    fn story(&self) -> Vec<ShiftStory> {
        (self.core.table()).map_or_else(Vec::new, |table| table.referee().story())
    }

    /// The lines of the record.
    fn record(&self, shifts: &[ShiftStory]) -> Result<Vec<v1::RecordLine>, String> {
        let entries = self.entries.iter();
        let mut entries: Vec<_> = entries.map(|it| (it.place, it.entry.clone())).collect();
        let mut latest = 0;
        for (number, seat, action) in shifts.iter().flat_map(|shift| &shift.decisions) {
            // A report that had to wait counts when the one before it does.
            latest = latest.max(*number);
            let record = Box::new(self.decision(*number, *seat));
            let entry = RoomEntry::Decision {
                seat: *seat,
                action: *action,
                record,
            };
            entries.push(((latest, Phase::Decided), entry));
        }
        entries.sort_by_key(|(place, _)| *place);
        PhysicalRoom {
            header: record_header(&self.core),
            rules: self.core.header().rules,
            shifts: shifts.iter().map(facts).collect(),
            entries: entries.into_iter().map(|(_, entry)| entry).collect(),
        }
        .record()
    }

    /// What is recorded of a decision besides the game.
    fn decision(&self, number: u64, seat: Seat) -> v1::DecisionRecord {
        let own = self.decided.get(&number);
        if let Some(own) = own.filter(|own| own.seat == seat_number(seat)) {
            return own.clone();
        }
        let made = self.core.table().and_then(|table| table.made(number));
        let kind = match self.core.standing(seat).fill {
            Fill::AtTable(kind) => Some(kind),
            _ => None,
        };
        v1::DecisionRecord {
            source: v1::DecisionSource::Table.into(),
            decision_time_us: made.map_or(0, |made| made.time_us),
            bank_left_ms: millis(self.core.header().policy.bank_of(kind)),
            elapsed_ms: made.map_or(0, |made| {
                u64::try_from(made.at.as_millis()).unwrap_or(u64::MAX)
            }),
            ..v1::DecisionRecord::default()
        }
    }
}

/// The decision of a participant or built-in agent.
fn decision(entry: &Entry, decided: &Decided, attempts: Vec<u32>) -> v1::DecisionRecord {
    let annotations = decided.annotations.as_ref();
    v1::DecisionRecord {
        seat: seat_number(decided.seat),
        source: decided.source.to_proto().into(),
        decision_time_us: decided.time_us,
        bank_left_ms: decided.bank_left_ms,
        invalid_attempts: attempts,
        annotations: annotations.and_then(|bytes| v1::Annotations::decode(bytes.as_ref()).ok()),
        elapsed_ms: elapsed_ms(entry),
        ..v1::DecisionRecord::default()
    }
}

/// The facts of a Shift.
fn facts(shift: &ShiftStory) -> ShiftFacts {
    let hands = shift.hands.iter();
    let hands = hands.filter_map(|(seat, hand)| Some(Fact::Hand(seat, (*hand)?)));
    let gifts = (shift.gifts.iter()).map(|(seat, cards)| Fact::Given(*seat, *cards));
    let decisions = shift
        .decisions
        .iter()
        .map(|(_, seat, action)| match action {
            Action::Declare | Action::Decline => Fact::Special {
                seat: *seat,
                declared: *action == Action::Declare,
            },
            Action::Give(_) | Action::GiveJoker => Fact::Gives(*seat, *action),
            turn => Fact::Turn(*seat, *turn),
        });
    ShiftFacts {
        facts: hands
            .chain(gifts)
            .chain(decisions)
            .map(|fact| (0, fact))
            .collect(),
        ..ShiftFacts::default()
    }
}

/// A Shift of which only special actions that were declared and turns are known.
fn without_cards(mut shift: ShiftStory) -> ShiftStory {
    shift.hands = shift.hands.map(|_| None);
    shift.gifts.clear();
    shift.decisions.retain(|(_, _, action)| {
        !matches!(
            action,
            Action::Give(_) | Action::GiveJoker | Action::Decline
        )
    });
    shift
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use chefshat_engine::{ActionId, Cards, DecisionKind, Seat};
    use chefshat_record::jsonl;
    use chefshat_record::replay::replay;
    use chefshat_referee::{Question, Stage};
    use chefshat_room::ReportVerdict;
    use chefshat_room::journal::{AbortReason, Report};
    use chefshat_room::testing::OPEN;
    use chefshat_room::testing::real_table::{MIXED, Mixed, PERSON};

    use super::*;

    fn record_of(mixed: &Mixed) -> Vec<v1::RecordLine> {
        physical_record_lines(mixed.table.core.header(), &mixed.table.journal)
    }

    /// The decisions of a record.
    fn decisions(lines: &[v1::RecordLine]) -> Vec<&v1::DecisionRecord> {
        let lines = lines.iter();
        lines
            .filter_map(|line| match &line.line {
                Some(Line::Decision(decision)) => Some(decision),
                _ => None,
            })
            .collect()
    }

    /// Sorts the cards of each gift: at a table they have no order.
    fn sort_gifts(decisions: &mut [(u32, u32)], mixed: &Mixed) {
        let actions = mixed.table.core.header().rules.actions();
        let is_gift = |action: u32| {
            let action = ActionId::new(u16::try_from(action).expect("an action"));
            let action = actions.decode(action);
            matches!(action, Some(Action::Give(_) | Action::GiveJoker))
        };
        let gift = |a: &(u32, u32), b: &(u32, u32)| a.0 == b.0 && is_gift(a.1) && is_gift(b.1);
        (decisions.chunk_by_mut(gift)).for_each(<[(u32, u32)]>::sort_unstable);
    }

    fn check(mixed: &Mixed) {
        let lines = record_of(mixed);
        let replayed = replay(&lines).expect("the record verifies");
        let mut recorded: Vec<(u32, u32)> = (decisions(&lines).iter())
            .map(|decision| (decision.seat, decision.action))
            .collect();
        // A decline at the table is seen by nobody.
        let decline = |action| {
            let actions = mixed.table.core.header().rules.actions();
            actions.decode(action) == Some(Action::Decline)
        };
        let mut truth: Vec<(u32, u32)> = (mixed.real.decisions.iter())
            .filter(|(seat, action)| {
                let fill = mixed.table.core.standing(*seat).fill;
                !(decline(*action) && matches!(fill, Fill::AtTable(_)))
            })
            .map(|(seat, action)| (seat_number(*seat), action.index().into()))
            .collect();
        sort_gifts(&mut recorded, mixed);
        sort_gifts(&mut truth, mixed);
        assert_eq!(recorded, truth);
        let summary = crate::convert::summary(&mixed.table.core);
        assert_eq!(summary.decisions, replayed.decisions);
        assert_eq!(summary.standings, replayed.standings);
        assert_eq!(summary.origin(), v1::GameOrigin::Physical);
        // Hands that are known are right.
        let mut shift = 0;
        for line in &lines {
            let Some(Line::Event(event)) = &line.line else {
                continue;
            };
            if let Some(Kind::ShiftStarted(started)) = &event.kind {
                assert!(!started.hands.is_empty(), "hands of remote seats are known");
                for hand in &started.hands {
                    let seat = Seat::new(usize::try_from(hand.seat).expect("small"));
                    assert_eq!(
                        Some(mixed.real.dealt[shift][seat]),
                        cards(hand),
                        "Shift {shift}"
                    );
                }
                shift += 1;
            }
        }
        assert!(shift > 0);
    }

    fn cards(hand: &v1::SeatCards) -> Option<Cards> {
        chefshat_record::convert::cards_from_numbers(&hand.cards, hand.golden, 11)
    }

    #[test]
    fn records_are_the_games_at_the_table() {
        for seed in 0..6 {
            let mut mixed = Mixed::new(MIXED, 2, seed);
            mixed.until(|it| it.table.core.state().is_over());
            check(&mixed);
            let lines = record_of(&mixed);
            let sources: Vec<v1::DecisionSource> =
                decisions(&lines).iter().map(|it| it.source()).collect();
            assert!(sources.contains(&v1::DecisionSource::Table));
            assert!(sources.contains(&v1::DecisionSource::Agent));
        }
    }

    #[test]
    fn a_record_has_the_game_as_corrected() {
        for seed in 0..6 {
            let mut mixed = Mixed::new([PERSON, PERSON, OPEN, PERSON], 2, seed);
            let (number, right) = mixed.misread();
            mixed.table.report(Report::Correction {
                number,
                instead: Some(Box::new(right)),
            });
            mixed.until(|it| it.table.core.state().is_over());
            check(&mixed);
            let corrections = record_of(&mixed).into_iter().filter(|line| {
                matches!(&line.line, Some(Line::Event(event))
                    if matches!(&event.kind, Some(Kind::Correction(it)) if it.first_void == 0))
            });
            assert_eq!(corrections.count(), 1);
        }
    }

    /// Lets the next thing happen. A pass at the table is reported only if it does not follow from
    /// the turn after it. Returns whether it does.
    fn step_without_passes(mixed: &mut Mixed) -> bool {
        mixed.follow();
        let at_table = |mixed: &Mixed| {
            let open = mixed.real.truth.decision();
            open.is_some_and(|open| {
                let fill = mixed.table.core.standing(open.seat).fill;
                open.kind == DecisionKind::Turn && matches!(fill, Fill::AtTable(_))
            })
        };
        let stage = mixed.stage();
        if !matches!(stage, Stage::Turn(_)) || !at_table(mixed) {
            mixed.step();
            return false;
        }
        let next = |mixed: &mut Mixed| {
            let report = mixed.real.next_report(stage);
            report.expect("a turn at the table")
        };
        let report = next(mixed);
        if matches!(report, Report::Pass { .. }) && at_table(mixed) {
            let after = next(mixed);
            match mixed.table.report(after.clone()).verdict {
                ReportVerdict::Accepted => return true,
                ReportVerdict::Held { question } => {
                    mixed.table.report(Report::Answer {
                        id: question,
                        option: Some(0),
                    });
                }
                _ => {
                    mixed.table.report(report);
                    mixed.table.report(after);
                }
            }
            return false;
        }
        mixed.table.report(report);
        false
    }

    #[test]
    fn the_record_of_a_game_stays_the_same() {
        let mut mixed = Mixed::new([PERSON, PERSON, OPEN, PERSON], 2, 5);
        let (number, right) = mixed.misread();
        let question = Question {
            id: "camera 1".into(),
            text: "Were the cards misread?".into(),
            options: vec!["Yes".into(), "No".into()],
            seat: None,
        };
        for report in [
            Report::Question(question),
            Report::Answer {
                id: "camera 1".into(),
                option: Some(0),
            },
            Report::Correction {
                number,
                instead: Some(Box::new(right)),
            },
        ] {
            assert_eq!(mixed.table.report(report).verdict, ReportVerdict::Accepted);
        }
        let mut passes = 0;
        while !mixed.table.core.state().is_over() {
            passes += u32::from(step_without_passes(&mut mixed));
        }
        let gifts = (mixed.table.journal.iter()).filter(|entry| {
            matches!(&entry.change, Change::Reported(it) if matches!(it.report, Report::Gift { .. }))
        });
        assert!(passes > 0 && gifts.count() > 0, "{passes} passes followed");
        let lines = record_of(&mixed);
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../tests/fixtures/physical.jsonl"
        );
        let folder = tempfile::tempdir().expect("a folder");
        let made = folder.path().join("physical.jsonl");
        jsonl::write(&made, &lines).expect("written");
        let text = |path: &Path| std::fs::read_to_string(path).unwrap_or_default();
        if text(&made) != text(Path::new(path)) {
            let kept = folder.keep().join("physical.jsonl");
            panic!("{path} has another record than {}", kept.display());
        }
    }

    #[test]
    fn a_game_that_is_closed_has_a_record_at_any_moment() {
        for steps in 0..60 {
            let mut mixed = Mixed::new(MIXED, 2, 1);
            (0..steps).for_each(|_| mixed.step());
            mixed.table.core.abort(mixed.table.now, AbortReason::Closed);
            mixed.table.commit();
            let replayed = replay(&record_of(&mixed)).expect("the record verifies");
            assert_eq!(replayed.state, v1::RoomState::Aborted);
        }
    }
}
