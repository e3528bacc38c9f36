//! The messages for refused actions.

use chefshat_engine::{ActionId, Game, Opening, RuleSetSpec, Script, Seat, Seed, Stop};

use crate::support::{act, hands, order};

fn three() -> RuleSetSpec {
    RuleSetSpec {
        players: 3,
        faces: 4,
        stop: Stop::Shifts(1),
        max_idle_pizzas: 1,
        ..RuleSetSpec::default()
    }
}

fn game(spec: &RuleSetSpec, drawn: Option<usize>) -> Game {
    let script = Script {
        drawn: drawn.map(Seat::new),
        ..Script::first_shift(hands(4, &["3 4 4 G", "1 2 2 J", "3 3 4 J"]))
    };
    Game::scripted(spec.validate().unwrap(), Seed([0; 32]), &script, |_| {}).unwrap()
}

fn refusal(game: &Game, text: &str) -> String {
    let action = game.rules().actions().parse(text).unwrap();
    let mut tried = game.clone();
    let error = tried
        .apply(action, |event| panic!("{event:?}"))
        .unwrap_err();
    assert!(tried == *game);
    assert_eq!(game.check(action), Err(error));
    error.to_string()
}

#[test]
fn refused_turns() {
    let mut game = game(&three(), None);
    assert_eq!(
        refusal(&game, "C3;Q1;J0"),
        "`C3;Q1;J0` is not legal: the Shift's first turn must play cards of face 4, the Golden card among them"
    );
    assert_eq!(
        refusal(&game, "pass"),
        "`pass` is not legal: passing is not allowed on the Shift's first turn"
    );
    assert_eq!(
        refusal(&game, "C4;Q4;J0"),
        "`C4;Q4;J0` is not legal: the hand does not hold these cards"
    );
    assert_eq!(
        refusal(&game, "give C4"),
        "`give C4` does not fit the open decision: play or pass"
    );
    assert_eq!(
        refusal(&game, "declare"),
        "`declare` does not fit the open decision: play or pass"
    );
    act(&mut game, "C4;Q2;J0");
    assert_eq!(
        refusal(&game, "C1;Q1;J0"),
        "`C1;Q1;J0` is not legal: at least 2 cards must be played, the number on the board"
    );
    assert_eq!(
        refusal(&game, "C0;Q0;J1"),
        "`C0;Q0;J1` is not legal: a joker alone can only open a pizza"
    );
    act(&mut game, "C2;Q2;J0");
    assert_eq!(
        refusal(&game, "C3;Q2;J0"),
        "`C3;Q2;J0` is not legal: the face must be lower than the 2 on the board"
    );
    for _ in 0..5 {
        act(&mut game, "pass");
    }
    assert_eq!(
        refusal(&game, "pass"),
        "`pass` is not legal: passing is not allowed here: the last pizza ended without a play"
    );
    assert_eq!(
        refusal(&game, "C3;Q1;J2"),
        "`C3;Q1;J2` is not legal: the hand does not hold these cards"
    );

    let beyond = game.apply(ActionId::new(39), |_| {}).unwrap_err();
    assert_eq!(
        beyond.to_string(),
        "action 39 does not exist: actions are numbered below 39"
    );
}

#[test]
fn refused_openings_with_any_top_face() {
    let spec = RuleSetSpec {
        opening: Opening::AnyTopFace,
        ..three()
    };
    let game = game(&spec, Some(2));
    assert_eq!(
        refusal(&game, "C3;Q1;J0"),
        "`C3;Q1;J0` is not legal: the Shift's first turn must play cards of face 4"
    );
    assert_eq!(
        refusal(&game, "C0;Q0;J1"),
        "`C0;Q0;J1` is not legal: the Shift's first turn must play cards of face 4"
    );
}

#[test]
fn refused_special_actions_and_gifts() {
    let script = Script {
        shift: 2,
        last_order: Some(order(&[0, 1, 2])),
        ..Script::first_shift(hands(4, &["3 4 4 G", "1 2 2 4", "3 3 J J"]))
    };
    let spec = RuleSetSpec {
        stop: Stop::Shifts(2),
        ..three()
    };
    let mut game =
        Game::scripted(spec.validate().unwrap(), Seed([0; 32]), &script, |_| {}).unwrap();
    assert_eq!(
        refusal(&game, "pass"),
        "`pass` does not fit the open decision: declare or decline the special action"
    );
    act(&mut game, "decline");
    assert_eq!(
        refusal(&game, "decline"),
        "`decline` does not fit the open decision: give a card"
    );
    assert_eq!(
        refusal(&game, "give C1"),
        "`give C1` is not legal: the hand does not hold these cards"
    );
    assert_eq!(
        refusal(&game, "give J"),
        "`give J` is not legal: the hand does not hold these cards"
    );
    while let Some(action) = game.default_action() {
        game.apply(action, |_| {}).unwrap();
    }
    assert_eq!(refusal(&game, "pass"), "the game has ended");
}
