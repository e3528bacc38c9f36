//! What of the hands of a real table counts as known: what was told, and what follows from it. It must be so, and nothing else is shown.

use chefshat_dataset::{Export, Filter, Format, Layout};
use chefshat_engine::{BySeat, Cards, RuleSet, RuleSetSpec, Stop};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::files::find_records;
use chefshat_record::jsonl;
use chefshat_record::replay::walk;
use chefshat_record::table::import;
use chefshat_render::{Card, Eyes, Film, Hand};
use serde_json::Value;

use super::super::made::Making;
use super::{EVERYTHING, NOTHING, Told, spec, transcript};

/// Which hands are known, and for which decisions there are masks, by seat.
pub(super) fn knowledge(record: &[v1::RecordLine]) -> Vec<(u32, bool, bool)> {
    let mut known = Vec::new();
    walk(record, |moment| {
        if let Line::Decision(decision) = moment.entry {
            let seat = chefshat_engine::Seat::new(decision.seat as usize);
            let hand_known = moment.hands_known[seat];
            known.push((decision.seat, hand_known, !decision.action_mask.is_empty()));
        }
    })
    .unwrap();
    known
}

#[test]
fn a_hand_is_known_where_it_is_told_or_follows_from_what_is_told() {
    let rules = spec(4, 11, 2).validate().unwrap();
    let played = Making::dealt(rules, 5, 9).record(|_| v1::DecisionSource::Agent);
    // Watched to the end, all hands of the standard game follow from the cards that were played.
    let whole = import(transcript(&rules, &played, NOTHING).as_bytes()).unwrap();
    let known = knowledge(&whole);
    assert!(known.len() > 50, "{} decisions", known.len());
    assert!(known.iter().all(|(_, hand, mask)| *hand && *mask));
    // Broken off early, only the hand that was told is known.
    let told = Told {
        hands: 0b0100,
        turns: 20,
        ..NOTHING
    };
    let broken_off = import(transcript(&rules, &played, told).as_bytes()).unwrap();
    let known = knowledge(&broken_off);
    assert_eq!(known.len(), 20);
    for (seat, hand, mask) in known {
        assert_eq!((hand, mask), (seat == 2, seat == 2));
    }
    let hands: Vec<usize> = broken_off
        .iter()
        .filter_map(|line| match &line.line {
            Some(Line::Event(event)) => match &event.kind {
                Some(Kind::ShiftStarted(started)) => Some(started.hands.len()),
                _ => None,
            },
            _ => None,
        })
        .collect();
    assert_eq!(hands, [1]);
}

/// The hands before each turn, whose are known, and of whose it is known whether the Golden card is in them.
fn before_turns(lines: &[v1::RecordLine]) -> Vec<(BySeat<Cards>, BySeat<bool>, BySeat<bool>)> {
    let mut all = Vec::new();
    walk(lines, |moment| {
        if let (Line::Decision(decision), Some(game)) = (moment.entry, moment.game)
            && decision.kind() == v1::DecisionKind::Turn
        {
            all.push((*game.hands(), moment.hands_known, moment.golden_known));
        }
    })
    .unwrap();
    all
}

/// Hands without what tells the Golden card from others of its face.
fn counts(cards: Cards, rules: &RuleSet) -> Vec<u8> {
    cards.counts(rules.faces()).collect()
}

#[test]
fn what_counts_as_known_was_so() {
    let original = |players, faces| RuleSetSpec {
        stop: Stop::Shifts(2),
        points: Vec::new(),
        players,
        faces,
        ..RuleSetSpec::preset("original2020").unwrap()
    };
    let specs = [
        spec(4, 11, 2),
        original(4, 11),
        spec(6, 15, 2),
        original(6, 15),
        spec(4, 5, 3),
        original(2, 4),
    ];
    let (mut whole, mut without_golden) = (0, 0);
    for (number, spec) in (0u8..).zip(specs) {
        let rules = spec.validate().unwrap();
        let played = Making::dealt(rules, 40 + number, 3).record(|_| v1::DecisionSource::Agent);
        let course = before_turns(&played);
        // Others are seen, and the game is broken off elsewhere, each time.
        for (hands, gifts) in [
            (0, 0),
            (0b1011, 0),
            (0b10_0110, 0b1001),
            (0b1101, 0b11_0110),
            (0b11_1101, 0),
        ] {
            for part in 1..=4 {
                let told = Told {
                    hands,
                    gifts,
                    turns: course.len() * part / 4,
                    ..NOTHING
                };
                let text = transcript(&rules, &played, told);
                let record = import(text.as_bytes())
                    .unwrap_or_else(|error| panic!("{error}\n{told:?}\n{text}"));
                let found = before_turns(&record);
                assert_eq!(found.len(), told.turns);
                for ((right, ..), (hands, known, golden)) in course.iter().zip(found) {
                    for seat in known.seats() {
                        let at = || format!("seat {seat}, {told:?}\n{text}");
                        assert!(known[seat] || !golden[seat], "{}", at());
                        if golden[seat] {
                            assert_eq!(hands[seat], right[seat], "{}", at());
                            whole += 1;
                        } else if known[seat] {
                            let hand = counts(hands[seat], &rules);
                            assert_eq!(hand, counts(right[seat], &rules), "{}", at());
                            without_golden += 1;
                        }
                    }
                }
            }
        }
    }
    assert!(whole > 1000, "{whole}");
    assert!(without_golden > 1000, "{without_golden}");
}

/// What a dataset says of the Golden card, decision by decision.
fn exported(record: &[v1::RecordLine]) -> Vec<Value> {
    let folder = tempfile::tempdir().unwrap();
    jsonl::write(&folder.path().join("records/table.jsonl"), record).unwrap();
    let out = folder.path().join("out");
    let export = Export {
        out: out.clone(),
        replace: false,
        layout: Layout::Tables,
        formats: vec![Format::Jsonl],
        filter: Filter::default(),
        skip_damaged: false,
        licence: "CC-BY-4.0".into(),
        version: "test".into(),
    };
    let records = find_records(&[folder.path().join("records")]).unwrap();
    export.run(&records, |_| {}).unwrap();
    let text = std::fs::read_to_string(out.join("decisions.jsonl")).unwrap();
    text.lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap()["golden"].clone())
        .collect()
}

/// How often the Golden card is drawn in a hand.
fn drawn(record: &[v1::RecordLine]) -> usize {
    let film = Film::new(record, Eyes::All).unwrap();
    let seats = film.frames().iter().flat_map(|frame| &frame.scene.seats);
    seats
        .filter(|seat| {
            matches!(&seat.hand, Hand::Open(cards) if cards.iter().any(|card| matches!(card, Card::Golden(_))))
        })
        .count()
}

#[test]
fn where_the_golden_card_is_is_not_made_up() {
    let any_top_face = RuleSetSpec {
        stop: Stop::Shifts(1),
        ..RuleSetSpec::preset("original2020").unwrap()
    };
    let rules = any_top_face.validate().unwrap();
    let played = Making::dealt(rules, 7, 1).record(|_| v1::DecisionSource::Agent);
    // Watched to the end all hands follow, but not which of the cards of the top face was the Golden one.
    let watched = import(transcript(&rules, &played, NOTHING).as_bytes()).unwrap();
    let found = before_turns(&watched);
    let top = chefshat_engine::Face::new(rules.faces()).unwrap();
    for (hands, known, golden) in &found {
        for (seat, hand) in hands.iter() {
            assert!(known[seat]);
            assert_eq!(golden[seat], hand.count(top) == 0);
        }
    }
    let said = exported(&watched);
    let unknown = said.iter().filter(|golden| golden.is_null()).count();
    assert!(
        unknown > 0 && unknown < said.len(),
        "{unknown} of {}",
        said.len()
    );
    assert!(said.iter().all(|golden| golden.as_bool() != Some(true)));
    assert_eq!(drawn(&watched), 0);

    // One hand that was seen tells it: the holder's, and that of anybody else does not.
    let holder = played.iter().find_map(|line| match &line.line {
        Some(Line::Event(event)) => match &event.kind {
            Some(Kind::ShiftStarted(started)) => started.hands.iter().find(|hand| hand.golden),
            _ => None,
        },
        _ => None,
    });
    let holder = holder.unwrap().seat;
    for seat in 0..4 {
        let told = Told {
            hands: 1 << seat,
            ..NOTHING
        };
        let record = import(transcript(&rules, &played, told).as_bytes()).unwrap();
        let nulls = exported(&record)
            .iter()
            .filter(|golden| golden.is_null())
            .count();
        assert_eq!(
            (nulls == 0, drawn(&record) > 0),
            (seat == holder, seat == holder)
        );
    }

    // Who opens by the rules of the standard game holds it.
    let rules = spec(4, 11, 1).validate().unwrap();
    let played = Making::dealt(rules, 7, 1).record(|_| v1::DecisionSource::Agent);
    let watched = import(transcript(&rules, &played, NOTHING).as_bytes()).unwrap();
    assert_eq!(
        exported(&watched),
        exported(&import(transcript(&rules, &played, EVERYTHING).as_bytes()).unwrap())
    );
    assert!(exported(&watched).iter().all(Value::is_boolean));
    assert!(drawn(&watched) > 0);
}
