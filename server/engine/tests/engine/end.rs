//! The ends of turns, pizzas, Shifts and games, with small hands.

use chefshat_engine::{
    BySeat, DecisionKind, Event, Game, PassScope, RuleSetSpec, Script, Seat, Seed, ShiftEnd, Stop,
};

use crate::rewards::TURNS;
use crate::support::{act, hands, legal_texts, order};

fn seat(index: usize) -> Seat {
    Seat::new(index)
}

fn first_shift(spec: &RuleSetSpec, lines: &[&str]) -> Game {
    let script = Script::first_shift(hands(spec.faces, lines));
    Game::scripted(spec.validate().unwrap(), Seed([0; 32]), &script, |_| {}).unwrap()
}

fn three() -> RuleSetSpec {
    RuleSetSpec {
        players: 3,
        faces: 4,
        stop: Stop::Shifts(1),
        ..RuleSetSpec::default()
    }
}

fn turn_of(game: &Game) -> usize {
    let decision = game.decision().unwrap();
    assert_eq!(decision.kind, DecisionKind::Turn);
    decision.seat.index()
}

#[test]
fn a_finished_seat_can_be_answered_and_its_left_neighbour_leads_next() {
    let mut game = first_shift(&three(), &["4 4 4 G", "1 2 2 J", "3 3 3 J"]);
    let events = act(&mut game, "C4;Q4;J0");
    assert_eq!(events.len(), 2);
    assert_eq!(
        events[1],
        Event::SeatFinished {
            seat: seat(0),
            place: 1
        }
    );
    assert_eq!(turn_of(&game), 1);
    assert_eq!(
        legal_texts(&game),
        ["pass"],
        "two cards and a joker do not beat four cards"
    );
    assert_eq!(act(&mut game, "pass").len(), 1);
    assert_eq!(
        legal_texts(&game),
        ["C3;Q3;J1", "pass"],
        "the last to play has finished: all others may answer"
    );
    let events = act(&mut game, "pass");
    assert_eq!(
        events[1],
        Event::PizzaDone {
            pizza: 1,
            last_to_play: Some(seat(0)),
            next_leader: seat(1)
        }
    );
    assert_eq!(turn_of(&game), 1);
    assert!(
        legal_texts(&game).contains(&"C0;Q0;J1".to_owned()),
        "a joker alone opens a pizza"
    );
    act(&mut game, "C0;Q0;J1");
    assert_eq!(
        legal_texts(&game),
        [
            "C3;Q1;J0", "C3;Q1;J1", "C3;Q2;J0", "C3;Q2;J1", "C3;Q3;J0", "C3;Q3;J1", "pass"
        ]
    );
}

#[test]
fn pizzas_without_a_play_move_the_lead_then_force_a_play() {
    let spec = RuleSetSpec {
        max_idle_pizzas: 2,
        ..three()
    };
    let mut game = first_shift(&spec, &["3 4 4 G", "1 2 2 J", "3 3 4 J"]);
    act(&mut game, "C4;Q1;J0");
    act(&mut game, "pass");
    act(&mut game, "pass");
    for leader in [0, 1] {
        assert_eq!(turn_of(&game), leader);
        act(&mut game, "pass");
        act(&mut game, "pass");
        let events = act(&mut game, "pass");
        let next_leader = seat(leader + 1);
        let pizza = leader as u32 + 2;
        assert_eq!(
            events[1],
            Event::PizzaDone {
                pizza,
                last_to_play: None,
                next_leader
            }
        );
    }
    assert_eq!(turn_of(&game), 2);
    assert!(
        !legal_texts(&game).contains(&"pass".to_owned()),
        "two pizzas without a play"
    );
    assert_eq!(game.default_action(), game.legal_actions().nth(0));
    act(&mut game, "C3;Q1;J0");
    assert!(
        legal_texts(&game).contains(&"pass".to_owned()),
        "somebody has played"
    );
}

#[test]
fn a_pass_that_binds_for_one_turn_can_be_followed_by_a_play() {
    let lines = ["3 4 4 G", "1 2 2 J", "3 3 4 J"];
    let mut bound = first_shift(&three(), &lines);
    let mut free = first_shift(
        &RuleSetSpec {
            pass_scope: PassScope::Turn,
            ..three()
        },
        &lines,
    );
    for game in [&mut bound, &mut free] {
        act(game, "C4;Q1;J0");
        act(game, "pass");
        act(game, "C3;Q1;J0");
        act(game, "pass");
    }
    // In both games seat 0 has passed since the last play. Seat 1 passed before it, which binds in
    // one of the games only.
    assert_eq!(turn_of(&bound), 2);
    assert_eq!(turn_of(&free), 1);
    assert_eq!(legal_texts(&free)[0], "C1;Q1;J0");
}

#[test]
fn adjudication_places_by_cards_left_then_by_distance() {
    let spec = RuleSetSpec {
        max_turns: 4,
        ..three()
    };
    let mut game = first_shift(&spec, &["3 4 4 G", "1 2 2 J", "3 3 4 J"]);
    act(&mut game, "C4;Q1;J0");
    act(&mut game, "C2;Q1;J0");
    act(&mut game, "pass");
    let events = act(&mut game, "pass");
    let Event::ShiftEnded(end) = &events[1] else {
        panic!("{events:?}");
    };
    let ShiftEnd {
        order: placed,
        finished,
        turns,
        pizzas,
        adjudicated,
        points,
        ..
    } = **end;
    assert_eq!(
        (finished, turns, pizzas, adjudicated),
        (0, 4, 1, true),
        "and no pizza follows the one that ended"
    );
    // Seats 0 and 1 hold three cards, seat 2 four; seat 0 acted last, so it is a full circle away.
    assert_eq!(placed, order(&[1, 0, 2]));
    assert_eq!(points.as_slice(), [3, 5, 0]);
    assert!(matches!(events[2], Event::GameEnded { .. }));
}

#[test]
fn the_last_turn_allowed_may_end_the_shift() {
    let spec = RuleSetSpec {
        players: 2,
        jokers: 0,
        max_turns: 6,
        ..three()
    };
    let mut game = first_shift(&spec, &["1 2 3 4 G", "2 3 3 4 4"]);
    for text in &TURNS[..5] {
        act(&mut game, text);
    }
    let events = act(&mut game, TURNS[5]);
    let Event::ShiftEnded(end) = &events[2] else {
        panic!("{events:?}")
    };
    let ShiftEnd {
        turns,
        adjudicated,
        finished,
        ..
    } = **end;
    assert_eq!((turns, adjudicated, finished), (6, false, 1));
}

#[test]
fn laps_count_reaching_and_passing_over_the_starter() {
    // Seat 0 starts and finishes at once, so the turn then passes over it.
    let mut game = first_shift(&three(), &["4 4 4 G", "1 2 2 J", "3 3 3 J"]);
    for text in [
        "C4;Q4;J0", "pass", "pass", "C2;Q1;J0", "pass", "C2;Q1;J0", "pass", "C1;Q1;J0", "pass",
    ] {
        act(&mut game, text);
    }
    let events = act(&mut game, "C0;Q0;J1");
    let Event::ShiftEnded(end) = &events[2] else {
        panic!("{events:?}")
    };
    let ShiftEnd {
        laps,
        turns,
        pizzas,
        starter,
        order: placed,
        ..
    } = **end;
    // Turns of seats 0 1 2 | 1 2 | 1 2 | 1 2 | 1: from 2 to 1 passes over seat 0 each time.
    assert_eq!((laps, turns, pizzas, starter), (5, 10, 5, seat(0)));
    assert_eq!(placed, order(&[0, 1, 2]));
}

#[test]
fn the_last_shift_breaks_ties() {
    let spec = RuleSetSpec {
        players: 2,
        jokers: 0,
        exchange: false,
        stop: Stop::Points(6),
        points: vec![5, 3],
        ..three()
    };
    // Seat 1 is first in this Shift and gets 5 points, seat 0 gets 3.
    for (before, after, winner) in [
        ([3, 1], [6, 6], 1),
        ([5, 1], [8, 6], 0),
        ([2, 1], [5, 6], 1),
    ] {
        let script = Script {
            shift: 2,
            last_order: Some(order(&[0, 1])),
            scores: BySeat::from_slice(&before).unwrap(),
            ..Script::first_shift(hands(4, &["1 2 3 4 G", "2 3 3 4 4"]))
        };
        let mut game =
            Game::scripted(spec.validate().unwrap(), Seed([0; 32]), &script, |_| {}).unwrap();
        assert_eq!(game.standings(), None);
        let events: Vec<Event> = TURNS.iter().flat_map(|text| act(&mut game, text)).collect();
        let standings = game.standings().unwrap();
        assert_eq!(
            events.last(),
            Some(&Event::GameEnded {
                standings: Box::new(standings)
            })
        );
        assert_eq!(standings.points.as_slice(), after);
        assert_eq!(standings.winner(), seat(winner));
        let lines = [
            (1, seat(winner), after[winner]),
            (2, seat(1 - winner), after[1 - winner]),
        ];
        assert_eq!(standings.iter().collect::<Vec<_>>(), lines);
    }
}
