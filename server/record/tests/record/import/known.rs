//! Which hands of a real table are known, because they were stated or follow. Known hands must be
//! right, and no others are in the record.

use chefshat_engine::{BySeat, Cards, RuleSet, RuleSetSpec, Stop};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::import::import;
use chefshat_record::replay::walk;

use chefshat_record::testing::{HiddenGolden, Observed, TestGame, events, transcript};

use super::spec;

/// The seat of each decision, whether its hand is known and whether it has a mask.
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
fn stated_hands_and_those_that_follow_are_known() {
    let rules = spec(4, 11, 2).validate().unwrap();
    let played = TestGame::dealt(rules, 5, 9).played();
    // All turns of the default game determine all hands.
    let complete = import(transcript(&rules, &played, Observed::TURNS).as_bytes()).unwrap();
    let known = knowledge(&complete);
    assert!(known.len() > 50, "{} decisions", known.len());
    assert!(known.iter().all(|(_, hand, mask)| *hand && *mask));
    // After the first turns, only the stated hand is known.
    let observed = Observed {
        hands: 0b0100,
        turns: 20,
        ..Observed::TURNS
    };
    let broken_off = import(transcript(&rules, &played, observed).as_bytes()).unwrap();
    let known = knowledge(&broken_off);
    assert_eq!(known.len(), 20);
    for (seat, hand, mask) in known {
        assert_eq!((hand, mask), (seat == 2, seat == 2));
    }
    let hands = events(&broken_off).filter_map(|(_, kind)| match kind {
        Kind::ShiftStarted(started) => Some(started.hands.len()),
        _ => None,
    });
    assert_eq!(hands.collect::<Vec<_>>(), [1]);
}

/// The hands before each turn, which of them are known, and which including the Golden card.
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

/// The counts of a hand, without the mark of the Golden card.
fn counts(cards: Cards, rules: &RuleSet) -> Vec<u8> {
    cards.counts(rules.faces()).collect()
}

#[test]
fn known_hands_are_right() {
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
    let (mut with_golden, mut without_golden) = (0, 0);
    for (number, spec) in (0u8..).zip(specs) {
        let rules = spec.validate().unwrap();
        let played = TestGame::dealt(rules, 40 + number, 3).played();
        let expected = before_turns(&played);
        // Other hands and gifts are observed each time, and other numbers of turns.
        for (hands, gifts) in [
            (0, 0),
            (0b1011, 0),
            (0b10_0110, 0b1001),
            (0b1101, 0b11_0110),
            (0b11_1101, 0),
        ] {
            for part in 1..=4 {
                let observed = Observed {
                    hands,
                    gifts,
                    turns: expected.len() * part / 4,
                    ..Observed::TURNS
                };
                let text = transcript(&rules, &played, observed);
                let record = import(text.as_bytes())
                    .unwrap_or_else(|error| panic!("{error}\n{observed:?}\n{text}"));
                let found = before_turns(&record);
                assert_eq!(found.len(), observed.turns);
                for ((right, ..), (hands, known, golden)) in expected.iter().zip(found) {
                    for seat in known.seats() {
                        let at = || format!("seat {seat}, {observed:?}\n{text}");
                        assert!(known[seat] || !golden[seat], "{}", at());
                        if golden[seat] {
                            assert_eq!(hands[seat], right[seat], "{}", at());
                            with_golden += 1;
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
    assert!(with_golden > 1000, "{with_golden}");
    assert!(without_golden > 1000, "{without_golden}");
}

#[test]
fn the_golden_card_is_not_inferred_from_plays() {
    let HiddenGolden {
        rules,
        lines: played,
        ..
    } = HiddenGolden::record();
    // The turns of the Shift determine every hand, but not which top-face card is Golden.
    let record = import(transcript(&rules, &played, Observed::TURNS).as_bytes()).unwrap();
    let found = before_turns(&record);
    let top = chefshat_engine::Face::new(rules.faces()).unwrap();
    for (hands, known, golden) in &found {
        for (seat, hand) in hands.iter() {
            assert!(known[seat]);
            assert_eq!(golden[seat], hand.count(top) == 0);
        }
    }
}
