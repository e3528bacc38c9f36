//! Requirements of decisions agree with the mask of legal actions and reveal no hidden card.

use chefshat_engine::{
    Action, Cards, Event, Game, GiftRequirement, Opening, PlayRequirement, Requirement,
    RuleSetSpec, Seat, Seed, SpecialAction,
};
use proptest::prelude::*;

use crate::start::{HANDS, ORDER, second_shift, spec};
use crate::support::{Chance, act, any_rules, hands};

/// Whether a hand holds the cards of a play or a gift.
fn holds(hand: Cards, action: Action) -> bool {
    match action {
        Action::Play {
            face,
            quantity,
            jokers,
        } => hand.count(face) >= quantity && hand.jokers() >= jokers,
        Action::LoneJoker | Action::GiveJoker => hand.jokers() > 0,
        Action::Give(face) => hand.count(face) > 0,
        Action::Pass | Action::Decline | Action::Declare => true,
    }
}

fn allows(requirement: Requirement, action: Action) -> bool {
    match requirement {
        Requirement::Play(play) => play.allows(action),
        Requirement::Gift(_) => matches!(action, Action::Give(_) | Action::GiveJoker),
        Requirement::SpecialAction(_) => matches!(action, Action::Declare | Action::Decline),
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 192,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn an_action_is_legal_if_it_meets_the_requirement_and_the_hand_holds_its_cards(
        rules in any_rules(), seed in any::<[u8; 32]>(), chance in any::<u64>()
    ) {
        let mut chance = Chance(chance);
        let mut game = Game::new(rules, Seed(seed), |_| {});
        let space = rules.actions();
        let mut due: Vec<(Seat, GiftRequirement)> = Vec::new();
        while let Some(decision) = game.decision() {
            let (mask, requirement) = (game.legal_actions(), game.requirement().unwrap());
            let hand = game.hands()[decision.seat];
            for action in space.iter() {
                let meaning = space.decode(action).unwrap();
                let legal = allows(requirement, meaning) && holds(hand, meaning);
                prop_assert_eq!(mask.contains(action), legal, "{} for {:?}", meaning, requirement);
            }
            if let Requirement::Gift(gift) = requirement {
                due.push((decision.seat, gift));
            }
            let action = chance.legal_action(&game);
            let shift = game.shift();
            let mut events = Vec::new();
            game.apply(action, |event| events.push(event)).unwrap();
            let golden_is_due = matches!(requirement, Requirement::Play(play) if play.golden_card);
            let played = events.iter().any(|event| matches!(event, Event::Played { .. }));
            if golden_is_due && played && game.shift() == shift {
                prop_assert!(game.hands().values().all(|hand| !hand.has_golden()));
            }
            for event in events {
                match event {
                    // Each gift was announced with its number, the total and the receiver.
                    Event::CardsExchanged { giver, receiver, count, .. } => {
                        let gifts: Vec<_> = due.iter().filter(|(seat, _)| *seat == giver).collect();
                        prop_assert!(gifts.is_empty() || gifts.len() == usize::from(count));
                        for ((_, gift), number) in gifts.into_iter().zip(1..) {
                            prop_assert_eq!(gift.number, number);
                            prop_assert_eq!(gift.receiver, receiver);
                            prop_assert!(gift.total.is_none_or(|total| total == count));
                        }
                    }
                    Event::ShiftStarted { .. } => due.clear(),
                    Event::SpecialActionDeclared { special, .. } => {
                        prop_assert_eq!(requirement, Requirement::SpecialAction(special));
                    }
                    _ => {}
                }
            }
        }
        prop_assert_eq!(game.requirement(), None);
    }
}

fn play(game: &Game) -> PlayRequirement {
    match game.requirement() {
        Some(Requirement::Play(play)) => play,
        other => panic!("{other:?} is not a turn"),
    }
}

#[test]
fn plays_are_required_to_open_then_to_beat_the_board() {
    let opening = PlayRequirement {
        lowest_face: 5,
        highest_face: 5,
        fewest_cards: 1,
        golden_card: true,
        lone_joker: false,
        may_pass: false,
    };
    let without_exchange = RuleSetSpec {
        exchange: false,
        ..spec(4, 5)
    };
    let (mut game, _) = second_shift(&without_exchange, &HANDS, &ORDER);
    assert_eq!(play(&game), opening);
    act(&mut game, "C5;Q1;J0");
    let beat = |highest_face, fewest_cards| PlayRequirement {
        lowest_face: 1,
        highest_face,
        fewest_cards,
        golden_card: false,
        lone_joker: false,
        may_pass: true,
    };
    assert_eq!(play(&game), beat(4, 1));
    act(&mut game, "C4;Q2;J0");
    assert_eq!(play(&game), beat(3, 2));
    for text in ["pass", "pass", "pass"] {
        act(&mut game, text);
    }
    let anything = PlayRequirement {
        lone_joker: true,
        ..beat(5, 1)
    };
    assert_eq!(play(&game), anything);

    let free_opening = RuleSetSpec {
        opening: Opening::AnyTopFace,
        opening_pass: true,
        ..without_exchange
    };
    let (game, _) = second_shift(&free_opening, &HANDS, &ORDER);
    let any_top_face = PlayRequirement {
        golden_card: false,
        may_pass: true,
        ..opening
    };
    assert_eq!(play(&game), any_top_face);
}

#[test]
fn nothing_beats_the_lowest_face_and_every_face_beats_a_lone_joker() {
    let without_exchange = RuleSetSpec {
        exchange: false,
        ..spec(4, 5)
    };
    let lines = ["3 4 4 5", "2 3 5 J", "1 2 G J", "3 4 4 5"];
    let (mut game, _) = second_shift(&without_exchange, &lines, &ORDER);
    for text in ["C5;Q1;J0", "pass", "pass", "pass", "C0;Q0;J1"] {
        act(&mut game, text);
    }
    let lone = play(&game);
    assert_eq!((lone.highest_face, lone.fewest_cards), (5, 1));
    for text in ["pass", "pass", "pass", "C1;Q1;J0"] {
        act(&mut game, text);
    }
    assert_eq!((play(&game).highest_face, play(&game).may_pass), (0, true));
}

fn gift(number: u8, total: Option<u8>, receiver: usize) -> Option<Requirement> {
    Some(Requirement::Gift(GiftRequirement {
        number,
        total,
        receiver: Seat::new(receiver),
    }))
}

#[test]
fn gifts_are_numbered_and_name_their_receiver() {
    let (mut game, _) = second_shift(&spec(4, 5), &HANDS, &ORDER);
    assert_eq!(game.requirement(), gift(1, Some(2), 1));
    act(&mut game, "give C4");
    assert_eq!(game.requirement(), gift(2, Some(2), 1));
    act(&mut game, "give C5");
    assert_eq!(game.requirement(), gift(1, Some(1), 3));
}

#[test]
fn the_number_of_gifts_does_not_reveal_the_dishwashers_jokers() {
    let small = RuleSetSpec {
        special_actions: false,
        ..spec(4, 4)
    };
    let short = ["3 3 4", "2 J J", "1 3 G", "2 4 4"];
    let full = ["3 J J", "2 3 4", "1 3 G", "2 4 4"];
    let (mut short, _) = second_shift(&small, &short, &ORDER);
    let (mut full, _) = second_shift(&small, &full, &ORDER);
    assert_eq!(short.requirement(), gift(1, None, 1));
    assert_eq!(full.requirement(), gift(1, None, 1));
    act(&mut short, "give C3");
    act(&mut full, "give C3");
    // A second gift reveals the total.
    assert_eq!(short.requirement(), gift(1, Some(1), 3));
    assert_eq!(full.requirement(), gift(2, Some(2), 1));
}

#[test]
fn the_role_determines_the_special_action() {
    let special = |special| Some(Requirement::SpecialAction(special));
    let fight = ["3 4 5 5", "2 3 J J", "1 2 4 G", "3 4 4 5"];
    let (game, _) = second_shift(&spec(4, 5), &fight, &ORDER);
    assert_eq!(game.requirement(), special(SpecialAction::FoodFight));
    let dinner = ["3 4 J J", "2 3 5 5", "1 2 4 G", "3 4 4 5"];
    let (game, _) = second_shift(&spec(4, 5), &dinner, &ORDER);
    assert_eq!(game.requirement(), special(SpecialAction::DinnerIsServed));
}

#[test]
fn requirements_do_not_depend_on_hands() {
    let without_exchange = RuleSetSpec {
        exchange: false,
        ..spec(4, 5)
    };
    let (mut game, _) = second_shift(&without_exchange, &HANDS, &ORDER);
    act(&mut game, "C5;Q1;J0");
    let swapped = hands(5, &["3 4 5 5", "3 4 4 5", "1 2 4", "2 3 5 J"]);
    let other = game.with_hands(swapped).unwrap();
    assert_eq!(other.requirement(), game.requirement());
}
