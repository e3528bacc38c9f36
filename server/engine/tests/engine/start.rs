//! The start of a Shift, with small hands: roles, special action and opening. The exchange is in
//! `exchange`.

use chefshat_engine::{
    BySeat, DecisionKind, Event, Game, Opening, Role, RuleSetSpec, Script, Seat, Seed,
    SpecialAction, Stop,
};

use crate::support::{act, cards, hands, legal_texts, order};

pub(crate) fn spec(players: u8, faces: u8) -> RuleSetSpec {
    RuleSetSpec {
        players,
        faces,
        ..RuleSetSpec::default()
    }
}

/// The second Shift of a game: hands, and the order of the first.
pub(crate) fn second_shift(
    spec: &RuleSetSpec,
    lines: &[&str],
    last_order: &[usize],
) -> (Game, Vec<Event>) {
    let script = Script {
        shift: 2,
        last_order: Some(order(last_order)),
        drawn: (spec.opening == Opening::AnyTopFace).then(|| Seat::new(0)),
        ..Script::first_shift(hands(spec.faces, lines))
    };
    let mut events = Vec::new();
    let rules = spec.validate().unwrap();
    let game = Game::scripted(rules, Seed([0; 32]), &script, |event| events.push(event)).unwrap();
    (game, events)
}

pub(crate) fn open(game: &Game) -> (usize, DecisionKind) {
    let decision = game.decision().unwrap();
    (decision.seat.index(), decision.kind)
}

pub(crate) fn exchanged(giver: usize, receiver: usize, line: &str) -> Event {
    let cards = cards(5, line);
    Event::CardsExchanged {
        giver: Seat::new(giver),
        receiver: Seat::new(receiver),
        count: cards.len(),
        cards: Some(cards),
    }
}

/// Chef is seat 2, Sous-Chef seat 0, Waiter seat 3, Dishwasher seat 1.
pub(crate) const ORDER: [usize; 4] = [2, 0, 3, 1];
pub(crate) const HANDS: [&str; 4] = ["3 4 5 5", "2 3 5 J", "1 2 4 G", "3 4 4 5"];

#[test]
fn food_fight_reverses_the_roles_and_the_exchange() {
    let (mut game, _) = second_shift(
        &spec(4, 5),
        &["3 4 5 5", "2 3 J J", "1 2 4 G", "3 4 4 5"],
        &ORDER,
    );
    assert_eq!(open(&game), (1, DecisionKind::SpecialAction));
    let events = act(&mut game, "declare");
    let roles =
        BySeat::from_slice(&[Role::Waiter, Role::Chef, Role::Dishwasher, Role::SousChef].map(Some))
            .unwrap();
    let declared = Event::SpecialActionDeclared {
        seat: Seat::new(1),
        special: SpecialAction::FoodFight,
    };
    assert_eq!(events, [declared, Event::RolesAssigned { roles }]);
    assert_eq!(
        open(&game),
        (1, DecisionKind::Exchange),
        "the former Dishwasher chooses"
    );
    act(&mut game, "give J");
    act(&mut game, "give C3");
    assert_eq!(
        open(&game),
        (3, DecisionKind::Exchange),
        "then the former Waiter"
    );
    let complete = [
        exchanged(2, 1, "1 2"),
        exchanged(1, 2, "3 J"),
        exchanged(0, 3, "3"),
        exchanged(3, 0, "4"),
    ];
    assert_eq!(act(&mut game, "give C4"), complete);
}

#[test]
fn dinner_is_served_skips_the_exchange() {
    let (mut game, _) = second_shift(
        &spec(4, 5),
        &["3 4 J J", "2 3 5 5", "1 2 4 G", "3 4 4 5"],
        &ORDER,
    );
    let dealt = *game.hands();
    assert_eq!(open(&game), (0, DecisionKind::SpecialAction));
    let declared = Event::SpecialActionDeclared {
        seat: Seat::new(0),
        special: SpecialAction::DinnerIsServed,
    };
    assert_eq!(act(&mut game, "declare"), [declared]);
    assert_eq!(open(&game), (2, DecisionKind::Turn));
    assert_eq!(*game.hands(), dealt);
    assert_eq!(game.roles()[Seat::new(2)], Some(Role::Chef), "roles stay");
}

#[test]
pub(crate) fn special_action_and_exchange_can_be_switched_off() {
    let lines = ["3 4 J J", "2 3 5 5", "1 2 4 G", "3 4 4 5"];
    let (game, _) = second_shift(
        &RuleSetSpec {
            special_actions: false,
            ..spec(4, 5)
        },
        &lines,
        &ORDER,
    );
    assert_eq!(open(&game), (2, DecisionKind::Exchange));

    let without_exchange = RuleSetSpec {
        exchange: false,
        ..spec(4, 5)
    };
    let (mut game, _) = second_shift(&without_exchange, &lines, &ORDER);
    assert_eq!(
        open(&game),
        (0, DecisionKind::SpecialAction),
        "offered although there is no exchange"
    );
    act(&mut game, "decline");
    assert_eq!(open(&game), (2, DecisionKind::Turn));

    let (game, events) = second_shift(&without_exchange, &HANDS, &ORDER);
    assert_eq!(open(&game), (2, DecisionKind::Turn));
    assert_eq!(events.len(), 2, "the deal and the roles");
}

#[test]
fn roles_by_number_of_players() {
    use Role::{Chef, Cook, Dishwasher, SousChef, Waiter};
    let table: [&[Role]; 5] = [
        &[Chef, Dishwasher],
        &[Chef, Cook, Dishwasher],
        &[Chef, SousChef, Waiter, Dishwasher],
        &[Chef, SousChef, Cook, Waiter, Dishwasher],
        &[Chef, SousChef, Cook, Cook, Waiter, Dishwasher],
    ];
    for expected in table {
        let players = expected.len();
        let rules = RuleSetSpec {
            players: players as u8,
            ..RuleSetSpec::default()
        }
        .validate()
        .unwrap();
        let hands = chefshat_engine::Deal::new(&rules, Seed([1; 32]), 2).hands();
        // The seats by number: seat 0 was first.
        let seats: Vec<usize> = (0..players).collect();
        let script = Script {
            shift: 2,
            last_order: Some(order(&seats)),
            ..Script::first_shift(hands)
        };
        let game = Game::scripted(rules, Seed([1; 32]), &script, |_| {}).unwrap();
        let roles: Vec<Role> = game.roles().values().map(|role| role.unwrap()).collect();
        assert_eq!(roles, expected);
    }
}

#[test]
fn any_top_face_opens_from_the_drawn_seat() {
    let spec = RuleSetSpec {
        opening: Opening::AnyTopFace,
        stop: Stop::Shifts(1),
        ..spec(3, 4)
    };
    let rules = spec.validate().unwrap();
    let lines = ["2 3 3 J", "1 2 4 G", "3 4 4 J"];
    for (drawn, starter) in [(0, 1), (1, 1), (2, 2)] {
        let script = Script {
            drawn: Some(Seat::new(drawn)),
            ..Script::first_shift(hands(4, &lines))
        };
        let mut game = Game::scripted(rules, Seed([0; 32]), &script, |_| {}).unwrap();
        assert_eq!(open(&game), (starter, DecisionKind::Turn), "drawn {drawn}");
        if starter == 1 {
            assert_eq!(legal_texts(&game), ["C4;Q1;J0", "C4;Q2;J0"]);
            act(&mut game, "C4;Q1;J0");
            assert!(
                game.hands()[Seat::new(1)].has_golden(),
                "the plain card goes first"
            );
        } else {
            assert_eq!(
                legal_texts(&game),
                ["C4;Q1;J0", "C4;Q1;J1", "C4;Q2;J0", "C4;Q2;J1"]
            );
        }
    }
}

#[test]
fn the_golden_card_opens_even_if_passing_is_legal() {
    let spec = RuleSetSpec {
        opening_pass: true,
        ..spec(3, 4)
    };
    let script = Script::first_shift(hands(4, &["2 3 3 J", "1 2 4 G", "3 4 4 J"]));
    let mut game =
        Game::scripted(spec.validate().unwrap(), Seed([0; 32]), &script, |_| {}).unwrap();
    assert_eq!(legal_texts(&game), ["C4;Q1;J0", "C4;Q2;J0", "pass"]);
    let mut passed = game.clone();
    act(&mut game, "C4;Q1;J0");
    assert!(
        !game.hands()[Seat::new(1)].has_golden(),
        "the opening plays the Golden card"
    );
    act(&mut passed, "pass");
    assert_eq!(open(&passed), (2, DecisionKind::Turn));
    let expected = [
        "C3;Q1;J0", "C3;Q1;J1", "C4;Q1;J0", "C4;Q1;J1", "C4;Q2;J0", "C4;Q2;J1", "C0;Q0;J1", "pass",
    ];
    assert_eq!(
        legal_texts(&passed),
        expected,
        "only the first turn is bound"
    );
}
