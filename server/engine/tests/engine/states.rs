//! States as values: complete, and refused if no game can have them.

use chefshat_engine::{
    BySeat, Cards, Game, GameState, RuleSetSpec, Seat, SeatOrder, Seed, SpecialAction, Stage,
};
use proptest::prelude::*;

use crate::support::{Chance, any_rules};

/// Changes one value of a state: mostly to one that is close, sometimes to any.
fn change(state: &mut GameState, chance: &mut Chance) {
    let players = state.rules.players();
    let number = |chance: &mut Chance, value: u32| match chance.below(4) {
        0 => value.wrapping_add(1),
        1 => value.wrapping_sub(1),
        2 => chance.below(4) as u32,
        _ => u32::MAX,
    };
    let seat = Seat::new(chance.below(6));
    let own = Seat::new(chance.below(players));
    let other = Seat::new(chance.below(players));
    let reversed = |order: &mut Option<SeatOrder>| {
        if let Some(order) = order {
            order.reverse();
        }
    };
    match chance.below(22) {
        0 => state.shift = number(chance, state.shift),
        1 => state.turns = number(chance, state.turns),
        2 => state.laps = number(chance, state.laps),
        3 => state.pizza = number(chance, state.pizza),
        4 => state.idle = number(chance, state.idle),
        5 => state.starter = seat,
        6 => state.leader = seat,
        7 => state.last_to_play = [None, Some(seat)][chance.below(2)],
        8 => state.drawn = [None, Some(seat)][chance.below(2)],
        9 => state.passed[own] = !state.passed[own],
        10 => state.places[own] = chance.below(players + 2) as u8,
        11 => state.board.face = chance.below(18) as u8,
        12 => state.board.size = chance.below(8) as u8,
        13 => {
            let stages = [
                Stage::Special(seat),
                Stage::Turn(seat),
                Stage::Over,
                Stage::Exchange {
                    giver: seat,
                    chef_left: chance.below(3) as u8,
                    sous_chef_left: chance.below(2) as u8,
                },
            ];
            state.stage = stages[chance.below(4)];
        }
        14 => {
            let hand = state.hands[own];
            state.hands[own] = state.hands[other];
            state.hands[other] = hand;
        }
        15 => {
            let counts: Vec<u8> = (0..16).map(|_| chance.below(2) as u8).collect();
            let cards = Cards::from_counts(15, &counts, chance.below(2) == 0).unwrap_or_default();
            let kinds = [&mut state.hands, &mut state.gave, &mut state.received];
            kinds[chance.below(3)][own] = cards;
        }
        16 => state.played = state.hands[own],
        17 => {
            let specials = [SpecialAction::FoodFight, SpecialAction::DinnerIsServed];
            state.special = specials.get(chance.below(3)).copied();
        }
        18 => state.scores[own] = [0, 15, u64::MAX][chance.below(3)],
        19 => reversed(&mut state.ranking),
        20 => reversed(&mut state.last_order),
        _ => state.passed = BySeat::filled(chance.below(7), false),
    }
}

/// Plays a game with random actions and checks that it stays a game.
fn plays_on(mut game: Game, chance: &mut Chance) {
    let most = 40 * (u64::from(game.rules().max_turns()) + 4);
    let mut decisions = 0;
    while !game.is_over() && decisions < most.min(2_000) {
        let seat = game.decision().unwrap().seat;
        let view = game.observe(chefshat_engine::Viewer::Seat(seat));
        assert_eq!(
            view.default_action(&game.legal_actions()),
            game.default_action()
        );
        assert!(game.requirement().is_some());
        game.apply(chance.legal_action(&game), |_| {}).unwrap();
        assert_eq!(Game::from_state(&game.state()).unwrap(), game);
        decisions += 1;
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 192,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn every_state_of_a_game_leads_back_to_it(
        rules in any_rules(), seed in any::<[u8; 32]>(), chance in any::<u64>()
    ) {
        let mut chance = Chance(chance);
        let mut game = Game::new(rules, Seed(seed), |_| {});
        loop {
            let again = Game::from_state(&game.state());
            prop_assert_eq!(again.as_ref(), Ok(&game));
            let closing = game.closing_copy();
            prop_assert_eq!(Game::from_state(&closing.state()), Ok(closing));
            if game.is_over() {
                break;
            }
            game.apply(chance.legal_action(&game), |_| {}).unwrap();
        }
    }

    #[test]
    fn changed_states_are_refused_or_are_games(
        rules in any_rules(), seed in any::<[u8; 32]>(), chance in any::<u64>()
    ) {
        let mut chance = Chance(chance);
        let mut game = Game::new(rules, Seed(seed), |_| {});
        let (mut accepted, mut refused) = (0, 0);
        while !game.is_over() && accepted < 8 {
            let mut state = game.state();
            (0..=chance.below(2)).for_each(|_| change(&mut state, &mut chance));
            match Game::from_state(&state) {
                Ok(changed) => {
                    prop_assert_eq!(changed.state(), state);
                    plays_on(changed, &mut chance);
                    accepted += 1;
                }
                Err(error) => {
                    prop_assert!(error.to_string().contains("no game can have this state"));
                    refused += 1;
                }
            }
            game.apply(chance.legal_action(&game), |_| {}).unwrap();
        }
        prop_assert!(accepted + refused > 0);
    }
}

#[test]
fn impossible_states_are_refused_with_a_reason() {
    let rules = RuleSetSpec::default().validate().unwrap();
    let mut game = Game::new(rules, Seed([3; 32]), |_| {});
    let mut chance = Chance(5);
    while game.shift() < 2 || game.shift_turns() < 9 {
        game.apply(chance.legal_action(&game), |_| {}).unwrap();
    }
    type Change = fn(&mut GameState);
    let cases: [(Change, &str); 8] = [
        (|state| state.shift = 0, "Shifts are numbered from 1"),
        (|state| state.ranking = None, "there is a ranking"),
        (
            |state| state.hands[Seat::new(0)] = state.hands[Seat::new(1)],
            "more cards than the deck has",
        ),
        (|state| state.turns = u32::MAX, "limit of turns"),
        (|state| state.pizza = 100_000, "pizzas do not fit"),
        (
            |state| state.scores[Seat::new(1)] = 15,
            "was decided before",
        ),
        (|state| state.drawn = Some(Seat::new(1)), "a seat is drawn"),
        (
            |state| state.places = BySeat::filled(3, 0),
            "one value for each seat",
        ),
    ];
    for (change, expected) in cases {
        let mut state = game.state();
        change(&mut state);
        let error = Game::from_state(&state).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

/// A state of the first Shift in which all seats have played their cards, which nobody can: the
/// Shift ends with the last seat's cards in its hand.
fn nobody_holds_cards() -> GameState {
    let rules = RuleSetSpec::default().validate().unwrap();
    let mut game = Game::new(rules, Seed([3; 32]), |_| {});
    while game.shift_turns() == 0 {
        game.apply(game.default_action().unwrap(), |_| {}).unwrap();
    }
    let mut state = game.state();
    let dealt = state.hands.values().chain([&state.played]);
    let counts = dealt.fold(vec![0; 12], |counts, cards| {
        let more = cards.counts(11);
        counts.iter().zip(more).map(|(a, b)| a + b).collect()
    });
    state.played = Cards::from_counts(11, &counts, false).unwrap();
    state.hands = BySeat::filled(4, Cards::EMPTY);
    state.passed = BySeat::filled(4, false);
    state.places = BySeat::from_slice(&[1, 2, 3, 4]).unwrap();
    state.board = chefshat_engine::Board::default();
    state.last_to_play = None;
    (state.turns, state.laps, state.pizza, state.idle) = (40, 1, 1, 0);
    state
}

#[test]
fn states_without_cards_in_any_hand_are_refused_at_every_stage() {
    let seat = Seat::new(0);
    let exchange = Stage::Exchange {
        giver: seat,
        chef_left: 2,
        sous_chef_left: 1,
    };
    let ended = "fewer than two seats hold cards";
    let cases = [
        (Stage::Turn(seat), ended),
        (Stage::Special(seat), "no special action is possible"),
        (exchange, "no cards are exchanged"),
        (Stage::Over, "the game is over but not decided"),
    ];
    let order = SeatOrder::from_slice(&[0, 1, 2, 3].map(Seat::new)).unwrap();
    for (stage, expected) in cases {
        let mut state = nobody_holds_cards();
        state.stage = stage;
        let error = Game::from_state(&state).unwrap_err().to_string();
        assert!(error.contains(expected), "{stage:?}: {error}");
    }
    let later = [
        (Stage::Special(seat), "two jokers"),
        (exchange, "the exchange asks for the wrong gift"),
        (Stage::Over, "a seat keeps its cards"),
    ];
    for (stage, expected) in later {
        let mut state = nobody_holds_cards();
        state.stage = stage;
        state.shift = 2;
        state.ranking = Some(order);
        if stage == Stage::Over {
            state.special = Some(SpecialAction::DinnerIsServed);
            state.scores[seat] = 15;
            state.last_order = Some(order);
        }
        let error = Game::from_state(&state).unwrap_err().to_string();
        assert!(error.contains(expected), "{stage:?}: {error}");
    }
}
