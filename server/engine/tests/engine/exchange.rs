//! The exchange, with small hands: who gives what, who chooses, and what is visible before it is
//! complete.

use chefshat_engine::{BySeat, Cards, DecisionKind, Event, Role, Seat, Viewer};

use crate::start::{HANDS, ORDER, exchanged, open, second_shift, spec};
use crate::support::{act, cards, hands, legal_texts};

#[test]
fn exchange_of_four() {
    let (mut game, events) = second_shift(&spec(4, 5), &HANDS, &ORDER);
    let roles =
        BySeat::from_slice(&[Role::SousChef, Role::Dishwasher, Role::Chef, Role::Waiter].map(Some))
            .unwrap();
    assert_eq!(events[1..], [Event::RolesAssigned { roles }]);

    // The Chef chooses from the hand as dealt, without the Dishwasher's 2 and 3.
    assert_eq!(open(&game), (2, DecisionKind::Exchange));
    assert_eq!(
        legal_texts(&game),
        ["give C1", "give C2", "give C4", "give C5"]
    );
    assert_eq!(act(&mut game, "give C4"), []);
    assert_eq!(open(&game), (2, DecisionKind::Exchange));
    assert_eq!(
        legal_texts(&game),
        ["give C1", "give C2", "give C5"],
        "a given card leaves the hand at once"
    );
    let chef = game.observe(Viewer::Seat(Seat::new(2)));
    assert_eq!(
        (chef.hand, chef.gave, chef.received),
        (cards(5, "1 2 G"), cards(5, "4"), Cards::EMPTY)
    );
    assert_eq!(
        (chef.pizza, chef.cards_left.as_slice()),
        (0, &[4, 4, 3, 4][..])
    );

    assert_eq!(act(&mut game, "give C5"), []);
    assert_eq!(open(&game), (0, DecisionKind::Exchange));
    assert_eq!(legal_texts(&game), ["give C3", "give C4", "give C5"]);
    let complete = [
        exchanged(1, 2, "2 3"),
        exchanged(2, 1, "4 G"),
        exchanged(3, 0, "3"),
        exchanged(0, 3, "5"),
    ];
    assert_eq!(act(&mut game, "give C5"), complete);

    assert_eq!(
        *game.hands(),
        hands(5, &["3 3 4 5", "4 5 G J", "1 2 2 3", "4 4 5 5"])
    );
    assert_eq!(
        open(&game),
        (1, DecisionKind::Turn),
        "the Golden card went to the Dishwasher, who opens"
    );
    assert_eq!(
        legal_texts(&game),
        ["C5;Q1;J0", "C5;Q1;J1", "C5;Q2;J0", "C5;Q2;J1"]
    );
    for (seat, gave, received) in [
        (0, "5", "3"),
        (1, "2 3", "4 G"),
        (2, "4 G", "2 3"),
        (3, "3", "5"),
    ] {
        let view = game.observe(Viewer::Seat(Seat::new(seat)));
        assert_eq!(
            (view.gave, view.received, view.pizza),
            (cards(5, gave), cards(5, received), 1)
        );
    }
}

#[test]
fn a_plain_card_is_given_before_the_golden_one() {
    let (mut game, _) = second_shift(
        &spec(4, 5),
        &["3 4 5 5", "2 3 4 J", "1 2 5 G", "3 4 4 5"],
        &ORDER,
    );
    act(&mut game, "give C5");
    assert_eq!(game.gave()[Seat::new(2)], cards(5, "5"));
    act(&mut game, "give C5");
    assert_eq!(game.gave()[Seat::new(2)], cards(5, "5 G"));
}

#[test]
fn forced_gifts_are_the_rarest_and_the_golden_card_last() {
    let (mut game, _) = second_shift(
        &spec(4, 5),
        &["2 2 3 3", "5 5 G J", "1 3 4 4", "4 4 5 5"],
        &ORDER,
    );
    act(&mut game, "give C1");
    act(&mut game, "give C3");
    act(&mut game, "give C2");
    assert_eq!(game.gave()[Seat::new(1)], cards(5, "5 5"));
    assert_eq!(game.gave()[Seat::new(3)], cards(5, "4"));
}

#[test]
fn jokers_may_be_chosen() {
    let (mut game, _) = second_shift(
        &spec(4, 5),
        &["3 4 5 J", "2 3 5 5", "1 2 G J", "3 4 4 5"],
        &ORDER,
    );
    assert_eq!(
        legal_texts(&game),
        ["give C1", "give C2", "give C5", "give J"]
    );
    act(&mut game, "give J");
    assert_eq!(legal_texts(&game), ["give C1", "give C2", "give C5"]);
    act(&mut game, "give C1");
    act(&mut game, "give J");
    assert_eq!(
        *game.hands(),
        hands(5, &["3 3 4 5", "1 5 5 J", "2 2 3 G", "4 4 5 J"])
    );
}

#[test]
fn a_giver_short_of_ingredient_cards_gives_all_and_receives_as_many() {
    let lines = ["2 3 4", "3 J J", "1 2 G", "3 4 4"];
    let (mut game, _) = second_shift(&spec(4, 4), &lines, &ORDER);
    assert_eq!(open(&game), (1, DecisionKind::SpecialAction));
    assert_eq!(legal_texts(&game), ["decline", "declare"]);
    assert_eq!(
        act(&mut game, "decline"),
        [],
        "declining is known to nobody"
    );
    assert_eq!(open(&game), (2, DecisionKind::Exchange));
    act(&mut game, "give C2");
    assert_eq!(
        open(&game),
        (0, DecisionKind::Exchange),
        "the Chef gives as many as it receives"
    );
    let events = act(&mut game, "give C4");
    let counts: Vec<u8> = events
        .iter()
        .map(|event| match event {
            Event::CardsExchanged { count, .. } => *count,
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(counts, [1, 1, 1, 1]);
    assert_eq!(
        *game.hands(),
        hands(4, &["2 3 3", "2 J J", "1 3 G", "4 4 4"])
    );
}

#[test]
fn two_and_three_players_exchange_two_cards() {
    let (mut game, _) = second_shift(&spec(2, 4), &["1 3 3 4 4 J", "2 2 3 4 G J"], &[1, 0]);
    assert_eq!(open(&game), (1, DecisionKind::Exchange));
    act(&mut game, "give C4");
    act(&mut game, "give C4");
    assert_eq!(*game.hands(), hands(4, &["3 4 4 4 G J", "1 2 2 3 3 J"]));
    assert_eq!(open(&game), (0, DecisionKind::Turn));

    let (mut game, _) = second_shift(&spec(3, 4), &["1 3 3 4", "2 2 3 4", "4 G J J"], &[0, 2, 1]);
    act(&mut game, "decline");
    assert_eq!(open(&game), (0, DecisionKind::Exchange));
    act(&mut game, "give C3");
    act(&mut game, "give C4");
    assert_eq!(
        *game.hands(),
        hands(4, &["1 2 2 3", "3 3 4 4", "4 G J J"]),
        "the Cook gives nothing"
    );
}

#[test]
fn default_gifts() {
    let table = [
        (["2 3 3 4", "2 5 5 J", "1 4 5 G", "3 4 4 5"], "give C5"),
        (["2 3 3 4", "5 5 5 J", "1 2 4 G", "3 4 4 5"], "give C4"),
        (["2 3 3 4", "5 5 G J", "1 2 4 5", "3 4 4 5"], "give C5"),
    ];
    for (lines, expected) in table {
        let (game, _) = second_shift(&spec(4, 5), &lines, &ORDER);
        let action = game.default_action().unwrap();
        assert_eq!(
            game.rules().actions().text(action).as_deref(),
            Some(expected),
            "{lines:?}"
        );
    }
    // Only the Golden card and jokers: the Golden card first, then a joker.
    let (mut game, _) = second_shift(&spec(4, 4), &["2 3 4", "3 4 4", "G J J", "1 2 3"], &ORDER);
    let mut defaults = Vec::new();
    for _ in 0..3 {
        let text = game
            .rules()
            .actions()
            .text(game.default_action().unwrap())
            .unwrap();
        act(&mut game, &text);
        defaults.push(text);
    }
    assert_eq!(defaults, ["decline", "give C4", "give J"]);
}
