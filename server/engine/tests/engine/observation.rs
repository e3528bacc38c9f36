//! Observations and classic vectors.

use chefshat_engine::{
    BySeat, Cards, DecisionKind, Event, Game, RuleSetSpec, Script, Seat, Seed, Stop, Viewer,
};

use crate::support::{Chance, act, cards, hands};

fn seat(index: usize) -> Seat {
    Seat::new(index)
}

fn two(jokers: u8, lines: &[&str]) -> Game {
    let spec = RuleSetSpec {
        players: 2,
        faces: 4,
        jokers,
        stop: Stop::Shifts(1),
        ..RuleSetSpec::default()
    };
    let script = Script::first_shift(hands(4, lines));
    Game::scripted(spec.validate().unwrap(), Seed([0; 32]), &script, |_| {}).unwrap()
}

#[test]
fn the_standard_vector_has_228_numbers() {
    let game = Game::new(
        RuleSetSpec::default().validate().unwrap(),
        Seed([3; 32]),
        |_| {},
    );
    let leader = game.decision().unwrap().seat;
    let view = game.observe(Viewer::Seat(leader));
    let mask = game.legal_actions();
    let vector = view.classic_vector(&mask);
    assert_eq!(vector.len(), 228);
    assert_eq!(vector[0], 1.0, "13/13: an empty board");
    assert!(vector[1..11].iter().all(|&number| number == 0.0));
    let hand: Vec<f32> = view
        .hand
        .ascending(11)
        .map(|card| f32::from(card) / 13.0)
        .collect();
    assert_eq!(vector[11..28], hand[..]);
    let legal: Vec<f32> = (0..200)
        .map(|index| {
            f32::from(u8::from(
                mask.contains(chefshat_engine::ActionId::new(index)),
            ))
        })
        .collect();
    assert_eq!(vector[28..], legal[..]);
    assert_eq!(vector[28..].iter().sum::<f32>(), mask.len() as f32);
}

#[test]
fn the_owner_of_the_board_is_the_seat_that_played_last() {
    for (number, players) in [(1, 2), (2, 4), (3, 6)] {
        let spec = RuleSetSpec {
            players,
            stop: Stop::Shifts(3),
            ..RuleSetSpec::default()
        };
        let mut game = Game::new(spec.validate().unwrap(), Seed([number; 32]), |_| {});
        let (mut owner, mut finished) = (None, 0);
        let mut chance = Chance(u64::from(number));
        while !game.is_over() {
            let action = chance.legal_action(&game);
            game.apply(action, |event| match event {
                Event::Played { seat, .. } => owner = Some(seat),
                Event::PizzaDone { .. } | Event::ShiftStarted { .. } => owner = None,
                _ => {}
            })
            .unwrap();
            for viewer in (0..players).map(|index| Viewer::Seat(seat(index.into()))) {
                let seen = game.observe(viewer);
                assert_eq!(seen.board_owner, owner);
                assert_eq!(seen.board_owner.is_none(), seen.board.size == 0);
                finished += u32::from(owner.is_some_and(|owner| seen.places[owner] > 0));
            }
        }
        assert!(players == 2 || finished > 0);
    }
}

#[test]
fn vectors_by_hand() {
    let mut game = two(0, &["1 2 3 4 G", "2 3 3 4 4"]);
    act(&mut game, "C4;Q2;J0");
    let view = game.observe(Viewer::Seat(seat(1)));
    let sixths = |numbers: &[u8]| {
        numbers
            .iter()
            .map(|&number| f32::from(number) / 6.0)
            .collect::<Vec<f32>>()
    };
    let vector = view.classic_vector(&game.legal_actions());
    assert_eq!(vector.len(), 4 + 5 + 32);
    assert_eq!(vector[..9], sixths(&[4, 4, 0, 0, 2, 3, 3, 4, 4]));
    // C3;Q2;J0 is action 3 * (3 + 1), passing the last.
    let ones: Vec<usize> = (0..32).filter(|&index| vector[9 + index] == 1.0).collect();
    assert_eq!(ones, [12, 31]);

    act(&mut game, "C3;Q2;J0");
    let view = game.observe(Viewer::Seat(seat(0)));
    let vector = view.classic_vector(&game.legal_actions());
    assert_eq!(
        vector[..9],
        sixths(&[3, 3, 0, 0, 0, 0, 1, 2, 3]),
        "zeros first in the hand"
    );
}

#[test]
fn a_long_play_is_truncated_and_a_joker_is_above_all_faces() {
    let mut game = two(2, &["3 4 4 G J J", "1 2 2 3 3 4"]);
    let mut long = game.clone();
    act(&mut long, "C4;Q3;J2");
    let sixths = |numbers: [u8; 4]| numbers.map(|number| f32::from(number) / 6.0);
    assert_eq!(
        long.observe(Viewer::Spectator)
            .classic_vector(&long.legal_actions())[..4],
        sixths([4, 4, 4, 5])
    );
    act(&mut game, "C4;Q1;J0");
    act(&mut game, "pass");
    act(&mut game, "C0;Q0;J1");
    let view = game.observe(Viewer::Seat(seat(1)));
    assert_eq!(
        view.classic_vector(&game.legal_actions())[..4],
        sixths([5, 0, 0, 0])
    );
    assert_eq!(
        (view.board.face, view.board.size, view.board.jokers),
        (5, 1, 1)
    );
}

#[test]
fn the_mask_of_another_kind_of_decision_is_not_in_the_vector() {
    let spec = RuleSetSpec {
        players: 2,
        faces: 4,
        jokers: 0,
        ..RuleSetSpec::default()
    };
    let mut script = Script::first_shift(hands(4, &["1 2 3 4 G", "2 3 3 4 4"]));
    script.shift = 2;
    script.last_order = Some(crate::support::order(&[0, 1]));
    let game = Game::scripted(spec.validate().unwrap(), Seed([0; 32]), &script, |_| {}).unwrap();
    let view = game.observe(Viewer::Seat(seat(0)));
    assert_eq!(view.kind, Some(DecisionKind::Exchange));
    assert!(!game.legal_actions().is_empty());
    assert!(
        view.classic_vector(&game.legal_actions())[9..]
            .iter()
            .all(|&number| number == 0.0)
    );
}

#[test]
fn observations_of_seats_and_spectators() {
    let mut game = two(0, &["1 2 3 4 G", "2 3 3 4 4"]);
    act(&mut game, "C4;Q2;J0");
    act(&mut game, "C3;Q2;J0");
    let own = game.observe(Viewer::Seat(seat(0)));
    assert_eq!(
        (own.seat, own.kind, own.hand),
        (Some(seat(0)), Some(DecisionKind::Turn), cards(4, "1 2 3"))
    );
    assert_eq!(
        (own.faces, own.hand_size, own.shift, own.pizza),
        (4, 5, 1, 1)
    );
    assert_eq!(
        (own.board.face, own.board.size, own.board.jokers),
        (3, 2, 0)
    );
    assert_eq!(own.cards_left.as_slice(), [3, 3]);
    assert_eq!(
        own.played,
        cards(4, "3 3 4 4"),
        "by face: the Golden card is not marked"
    );
    assert_eq!(own.roles.as_slice(), [None, None]);
    assert_eq!(own.points.as_slice(), [0, 0]);

    let other = game.observe(Viewer::Seat(seat(1)));
    assert_eq!(
        (other.seat, other.kind, other.hand),
        (Some(seat(1)), None, cards(4, "2 4 4"))
    );
    for viewer in [Viewer::Spectator, Viewer::Everything] {
        let view = game.observe(viewer);
        assert_eq!(
            (view.seat, view.kind, view.hand),
            (None, None, Cards::EMPTY)
        );
        assert_eq!(
            (view.gave, view.received, view.played),
            (Cards::EMPTY, Cards::EMPTY, own.played)
        );
    }

    act(&mut game, "pass");
    let next = game.observe(Viewer::Seat(seat(1)));
    assert_eq!(
        (next.pizza, next.board.face, next.passed),
        (2, 0, BySeat::from_slice(&[false, false]).unwrap())
    );
    act(&mut game, "C4;Q2;J0");
    act(&mut game, "pass");
    act(&mut game, "C2;Q1;J0");
    let end = game.observe(Viewer::Seat(seat(1)));
    assert_eq!(
        (end.places.as_slice(), end.points.as_slice(), end.kind),
        (&[2, 1][..], &[0, 5][..], None)
    );
}

#[test]
fn passes_are_visible_until_the_next_pizza() {
    let spec = RuleSetSpec {
        players: 3,
        faces: 4,
        ..RuleSetSpec::default()
    };
    let script = Script::first_shift(hands(4, &["3 4 4 G", "1 2 2 J", "3 3 4 J"]));
    let mut game =
        Game::scripted(spec.validate().unwrap(), Seed([0; 32]), &script, |_| {}).unwrap();
    act(&mut game, "C4;Q1;J0");
    act(&mut game, "pass");
    act(&mut game, "C3;Q1;J0");
    assert_eq!(
        game.observe(Viewer::Spectator).passed.as_slice(),
        [false, true, false]
    );
    act(&mut game, "pass");
    assert_eq!(
        game.observe(Viewer::Spectator).passed.as_slice(),
        [false, false, false]
    );
}
