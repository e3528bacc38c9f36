//! Rewards, computed by hand.

use chefshat_engine::{Event, Game, RewardScheme, RuleSet, RuleSetSpec, Script, Seed, Stop};

use crate::support::{act, hands};

/// A Shift of two players with five cards each: seat 0 opens, seat 1 finishes first.
pub(crate) const TURNS: [&str; 6] = [
    "C4;Q2;J0", "C3;Q2;J0", "pass", "C4;Q2;J0", "pass", "C2;Q1;J0",
];

pub(crate) fn two_players(max_turns: u32) -> (RuleSet, Game) {
    let spec = RuleSetSpec {
        players: 2,
        faces: 4,
        jokers: 0,
        stop: Stop::Shifts(1),
        max_turns,
        ..RuleSetSpec::default()
    };
    let rules = spec.validate().unwrap();
    let script = Script::first_shift(hands(4, &["1 2 3 4 G", "2 3 3 4 4"]));
    (
        rules,
        Game::scripted(rules, Seed([0; 32]), &script, |_| {}).unwrap(),
    )
}

/// The rewards of each turn: (seat, reward, index of the event).
fn rewards(scheme: RewardScheme, max_turns: u32) -> Vec<Vec<(usize, f32, usize)>> {
    let (rules, mut game) = two_players(max_turns);
    let mut all = Vec::new();
    for text in TURNS.iter().take(max_turns as usize) {
        let events = act(&mut game, text);
        let mut given = Vec::new();
        scheme.of_events(&rules, &events, |seat, reward, index| {
            assert!(matches!(
                events[index],
                Event::Played { .. } | Event::Passed { .. } | Event::ShiftEnded(_)
            ));
            given.push((seat.index(), reward, index));
        });
        all.push(given);
    }
    all
}

fn check(scheme: RewardScheme, max_turns: u32, expected: &[&[(usize, f32, usize)]]) {
    let rewards = rewards(scheme, max_turns);
    assert_eq!(rewards.len(), expected.len());
    for (turn, (got, expected)) in rewards.iter().zip(expected).enumerate() {
        assert_eq!(
            got.len(),
            expected.len(),
            "{scheme:?}, turn {turn}: {got:?}"
        );
        for (&(seat, reward, index), &(to, value, by)) in got.iter().zip(expected.iter()) {
            assert_eq!((seat, index), (to, by), "{scheme:?}, turn {turn}");
            assert!(
                (reward - value).abs() < 1e-6,
                "{scheme:?}, turn {turn}: {reward} instead of {value}"
            );
        }
    }
}

#[test]
fn every_turn_of_a_shift() {
    // Cards left after each turn: 3 3 3 1 3 0, of five; the last turn yields Played, SeatFinished,
    // ShiftEnded, GameEnded.
    check(
        RewardScheme::Validity,
        10,
        &[
            &[(0, 1.0, 0)],
            &[(1, 1.0, 0)],
            &[(0, 1.0, 0)],
            &[(1, 1.0, 0)],
            &[(0, 1.0, 0)],
            &[(1, 1.0, 0)],
        ],
    );
    check(
        RewardScheme::Paper,
        10,
        &[
            &[(0, -0.28, 0)],
            &[(1, -0.28, 0)],
            &[(0, -0.28, 0)],
            &[(1, 0.0, 0)],
            &[(0, -0.28, 0)],
            &[(1, 0.14 + 0.3, 0), (0, 0.21, 2)],
        ],
    );
    check(
        RewardScheme::PaperIntended,
        10,
        &[
            &[(0, 0.28, 0)],
            &[(1, 0.28, 0)],
            &[(0, 0.28, 0)],
            &[(1, 0.56, 0)],
            &[(0, 0.28, 0)],
            &[(1, 0.7 + 0.3, 0), (0, 0.21, 2)],
        ],
    );
    check(
        RewardScheme::Winning,
        10,
        &[
            &[(0, -0.001, 0)],
            &[(1, -0.001, 0)],
            &[(0, -0.001, 0)],
            &[(1, -0.001, 0)],
            &[(0, -0.001, 0)],
            &[(1, 1.0, 0)],
        ],
    );
    check(
        RewardScheme::Points,
        10,
        &[
            &[(0, 0.0, 0)],
            &[(1, 0.0, 0)],
            &[(0, 0.0, 0)],
            &[(1, 0.0, 0)],
            &[(0, 0.0, 0)],
            &[(1, 0.0, 0), (1, 5.0, 2), (0, 0.0, 2)],
        ],
    );
}

#[test]
fn an_adjudicated_shift_gives_the_finishing_part_to_seats_with_cards() {
    // After three turns both hold three cards; seat 0 acted last, so seat 1 is first.
    check(
        RewardScheme::Paper,
        3,
        &[
            &[(0, -0.28, 0)],
            &[(1, -0.28, 0)],
            &[(0, -0.28, 0), (1, 0.3, 1), (0, 0.21, 1)],
        ],
    );
    check(
        RewardScheme::Winning,
        3,
        &[
            &[(0, -0.001, 0)],
            &[(1, -0.001, 0)],
            &[(0, -0.001, 0), (1, 1.0, 1)],
        ],
    );
    check(
        RewardScheme::Points,
        3,
        &[
            &[(0, 0.0, 0)],
            &[(1, 0.0, 0)],
            &[(0, 0.0, 0), (1, 5.0, 1), (0, 0.0, 1)],
        ],
    );
    check(
        RewardScheme::Validity,
        3,
        &[&[(0, 1.0, 0)], &[(1, 1.0, 0)], &[(0, 1.0, 0)]],
    );
}

#[test]
fn single_turns_of_the_standard_game() {
    let rules = RuleSetSpec::default().validate().unwrap();
    // Hands of 17 cards. As printed, an empty hand gives 1/17 of 0.7, a full one nearly -0.66.
    let table = [
        (RewardScheme::Paper, 0, Some(1), 0.7 / 17.0 + 0.3),
        (RewardScheme::Paper, 0, Some(3), 0.7 / 17.0 + 0.12),
        (RewardScheme::Paper, 17, None, -16.0 / 17.0 * 0.7),
        (RewardScheme::PaperIntended, 0, Some(2), 0.7 + 0.21),
        (RewardScheme::PaperIntended, 17, None, 0.0),
        (RewardScheme::Winning, 0, Some(1), 1.0),
        (RewardScheme::Winning, 0, Some(2), -0.001),
        (RewardScheme::Points, 0, Some(1), 0.0),
        (RewardScheme::Validity, 5, None, 1.0),
    ];
    for (scheme, left, place, expected) in table {
        let reward = scheme.turn(&rules, left, place);
        assert!(
            (reward - expected).abs() < 1e-6,
            "{scheme:?} {left} {place:?}: {reward}"
        );
    }
    assert!((RewardScheme::Paper.shift_end(4, 0, false).unwrap() - 0.03).abs() < 1e-6);
    assert_eq!(RewardScheme::Paper.shift_end(4, 0, true), None);
    assert_eq!(RewardScheme::Winning.shift_end(4, 0, false), None);
}

#[test]
fn invalid_attempts_and_names() {
    let table = [
        (RewardScheme::Validity, "validity", -1.0),
        (RewardScheme::Paper, "paper", -1.0),
        (RewardScheme::PaperIntended, "paper_intended", -1.0),
        (RewardScheme::Winning, "winning", -0.001),
        (RewardScheme::Points, "points", 0.0),
    ];
    assert_eq!(table.map(|(scheme, ..)| scheme), RewardScheme::ALL);
    for (scheme, name, invalid) in table {
        assert_eq!((scheme.name(), scheme.invalid()), (name, invalid));
        assert_eq!(RewardScheme::from_name(name), Some(scheme));
    }
    assert_eq!(RewardScheme::from_name("none"), None);
}

#[test]
fn exchange_and_special_action_are_not_rewarded() {
    let rules = RuleSetSpec {
        stop: Stop::Shifts(4),
        ..RuleSetSpec::default()
    }
    .validate()
    .unwrap();
    let mut others = 0;
    let mut chance = crate::support::Chance(1);
    let mut game = Game::new(rules, Seed([9; 32]), |_| {});
    while let Some(decision) = game.decision() {
        let action = chance.legal_action(&game);
        let mut events = Vec::new();
        game.apply(action, |event| events.push(event)).unwrap();
        let mut given = 0;
        RewardScheme::Validity.of_events(&rules, &events, |_, _, _| given += 1);
        if decision.kind == chefshat_engine::DecisionKind::Turn {
            assert_eq!(given, 1);
        } else {
            assert_eq!(given, 0);
            others += 1;
        }
    }
    assert!(
        others >= 3,
        "Shifts after the first have gifts or a special action: {others}"
    );
}
