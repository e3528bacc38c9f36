//! Games from given hands, and the refused ones.

use chefshat_engine::{BySeat, Game, Opening, RuleSetSpec, Script, ScriptError, Seat, Seed};

use crate::support::{act, hands, order};

const HANDS: [&str; 3] = ["3 4 4 G", "1 2 2 J", "3 3 4 J"];

fn spec() -> RuleSetSpec {
    RuleSetSpec {
        players: 3,
        faces: 4,
        ..RuleSetSpec::default()
    }
}

fn script() -> Script {
    Script::first_shift(hands(4, &HANDS))
}

#[test]
fn invalid_scripts_are_refused() {
    let top_face = RuleSetSpec {
        opening: Opening::AnyTopFace,
        ..spec()
    };
    let with = |lines: &[&str]| Script::first_shift(hands(4, lines));
    let size = |seat| ScriptError::HandSize {
        seat: Seat::new(seat),
        expected: 4,
    };
    let later = Script {
        shift: 2,
        last_order: Some(order(&[0, 1, 2])),
        ..script()
    };
    let ended = Script {
        scores: BySeat::from_slice(&[0, 15, 0]).unwrap(),
        ..later.clone()
    };
    let drawn = Script {
        drawn: Some(Seat::new(3)),
        ..script()
    };
    let table = [
        (spec(), with(&HANDS[..2]), ScriptError::Seats(3)),
        (
            spec(),
            Script {
                scores: BySeat::filled(2, 0),
                ..script()
            },
            ScriptError::Seats(3),
        ),
        (
            spec(),
            Script {
                last_order: Some(order(&[1, 0])),
                ..later.clone()
            },
            ScriptError::Seats(3),
        ),
        (spec(), with(&["3 4 4 G", "1 2 2", "3 3 4 J"]), size(1)),
        (spec(), with(&["3 4 4 G", "1 2 2 J", "3 3 4 J J"]), size(2)),
        (
            spec(),
            with(&["3 4 4 G", "1 2 3 J", "3 3 4 J"]),
            ScriptError::NotInDeck,
        ),
        (
            RuleSetSpec {
                jokers: 1,
                faces: 5,
                ..spec()
            },
            Script::first_shift(hands(5, &["1 2 2 3 G", "3 3 4 4 J", "4 4 5 5 J"])),
            ScriptError::NotInDeck,
        ),
        (
            spec(),
            with(&["3 4 4 4", "1 2 2 J", "3 3 4 J"]),
            ScriptError::Golden,
        ),
        (
            spec(),
            with(&["3 4 4 G", "1 2 2 J", "3 3 G J"]),
            ScriptError::Golden,
        ),
        (
            spec(),
            Script {
                shift: 0,
                ..script()
            },
            ScriptError::Shift,
        ),
        (
            spec(),
            Script {
                shift: 2,
                ..script()
            },
            ScriptError::Shift,
        ),
        (
            spec(),
            Script {
                shift: 1,
                ..later.clone()
            },
            ScriptError::Shift,
        ),
        (spec(), ended, ScriptError::Ended),
        (spec(), drawn.clone(), ScriptError::Drawn),
        (
            spec(),
            Script {
                drawn: Some(Seat::new(0)),
                ..script()
            },
            ScriptError::Drawn,
        ),
        (top_face.clone(), script(), ScriptError::Drawn),
        (top_face, drawn, ScriptError::Drawn),
    ];
    for (line, (spec, script, expected)) in table.into_iter().enumerate() {
        let rules = spec.validate().unwrap();
        let error =
            Game::scripted(rules, Seed([0; 32]), &script, |event| panic!("{event:?}")).unwrap_err();
        assert_eq!(error, expected, "line {line}");
        assert!(!error.to_string().is_empty());
    }
    assert!(Game::scripted(spec().validate().unwrap(), Seed([0; 32]), &later, |_| {}).is_ok());
}

#[test]
fn a_scripted_shift_is_followed_by_dealt_ones() {
    let rules = spec().validate().unwrap();
    let mut game = Game::scripted(rules, Seed([8; 32]), &script(), |_| {}).unwrap();
    let mut chance = crate::support::Chance(2);
    while game.shift() == 1 {
        let action = chance.legal_action(&game);
        game.apply(action, |_| {}).unwrap();
    }
    let dealt = chefshat_engine::Deal::new(&rules, Seed([8; 32]), 2).hands();
    assert_eq!(*game.hands(), dealt);
}

#[test]
fn another_seed_deals_the_later_shifts() {
    let rules = spec().validate().unwrap();
    let (first, second) = (Seed([8; 32]), Seed([9; 32]));
    let mut original = Game::new(rules, first, |_| {});
    let mut branch = original.clone();
    branch.reseed(second);
    let mut chance = crate::support::Chance(2);
    while original.shift() == 1 {
        assert_eq!(
            (branch.hands(), branch.decision(), branch.legal_actions()),
            (
                original.hands(),
                original.decision(),
                original.legal_actions()
            ),
            "the Shift being played stays as it was dealt"
        );
        let action = chance.legal_action(&original);
        original.apply(action, |_| {}).unwrap();
        branch.apply(action, |_| {}).unwrap();
    }
    let dealt = |seed| chefshat_engine::Deal::new(&rules, seed, 2).hands();
    assert_eq!((branch.seed(), branch.shift()), (second, 2));
    assert_eq!(*original.hands(), dealt(first));
    assert_eq!(*branch.hands(), dealt(second));
    assert_ne!(branch.hands(), original.hands());
    assert_eq!(branch.scores(), original.scores());
}

#[test]
fn hidden_cards_can_be_replaced_while_a_turn_is_open() {
    let rules = spec().validate().unwrap();
    let mut game = Game::scripted(rules, Seed([0; 32]), &script(), |_| {}).unwrap();
    let other = |lines: &[&str]| hands(4, lines);
    assert_eq!(
        game.with_hands(other(&["3 4 4 G", "1 2 3 J", "2 3 4 J"]))
            .unwrap()
            .hands()[Seat::new(1)]
        .jokers(),
        1
    );
    assert_eq!(
        game.with_hands(other(&["3 4 4 4", "1 2 2 J", "3 3 G J"])),
        Err(ScriptError::Leader)
    );
    assert_eq!(
        game.with_hands(other(&["3 4 4 4", "1 2 2 J", "3 3 4 J"])),
        Err(ScriptError::Golden)
    );
    assert_eq!(
        game.with_hands(other(&["3 4 4 G", "1 2 2 J"])),
        Err(ScriptError::Seats(3))
    );
    act(&mut game, "C4;Q2;J0");
    let size = ScriptError::HandSize {
        seat: Seat::new(0),
        expected: 2,
    };
    assert_eq!(game.with_hands(other(&HANDS)), Err(size));
    assert_eq!(
        game.with_hands(other(&["3 4", "1 2 2 J", "3 3 4 4"])),
        Err(ScriptError::NotInDeck),
        "two have been played"
    );
    assert_eq!(
        game.with_hands(other(&["3 G", "1 2 2 J", "3 3 4 J"])),
        Err(ScriptError::Golden),
        "it has been played"
    );
    let twin = game
        .with_hands(other(&["3 J", "1 2 2 J", "3 3 4 4"]))
        .unwrap();
    assert!(twin != game && twin.decision() == game.decision());

    let later = Script {
        shift: 2,
        last_order: Some(order(&[0, 1, 2])),
        ..script()
    };
    let exchange = Game::scripted(rules, Seed([0; 32]), &later, |_| {}).unwrap();
    assert_eq!(
        exchange.with_hands(other(&HANDS)),
        Err(ScriptError::NotATurn)
    );
}
