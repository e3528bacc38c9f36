//! Games that begin with hands and actions of their own.

use chefshat_agents::game_seed;
use chefshat_engine::{Game, Script, Seat, Viewer};
use chefshat_simulation::vector::{SetupError, Start, StartPoint, VectorGames};

use super::*;

/// A dealt first Shift as a script, with its first `count` default actions, and the game there.
fn point(seed: u64, count: usize) -> (StartPoint, Game) {
    let script = Script::first_shift(*Game::new(rules(), game_seed(seed, 0), |_| {}).hands());
    let mut game = Game::scripted(rules(), game_seed(seed, 1), &script, |_| {}).unwrap();
    let mut actions = Vec::new();
    for _ in 0..count {
        let action = game.legal_actions().nth(0).unwrap();
        game.apply(action, |_| {}).unwrap();
        actions.push(action);
    }
    (StartPoint { script, actions }, game)
}

#[test]
fn games_begin_with_the_entries_in_turn() {
    let (points, at): (Vec<_>, Vec<_>) = [0, 7, 13]
        .map(|count| point(count, count as usize))
        .into_iter()
        .unzip();
    let setup = all_client(5)
        .with_history(32)
        .unwrap()
        .with_start(Start::Listed(points.into()))
        .unwrap();
    let (mut games, batch) = VectorGames::new(setup);
    let (counts, hands) = (
        u32s(&batch.observations.history_counts),
        batch.observations.hands.chunks(12),
    );
    assert_eq!(counts, [0, 7, 13, 0, 7]);
    for (row, hand) in hands.enumerate() {
        let game = &at[row % 3];
        let seat = game.decision().unwrap().seat;
        assert_eq!(batch.seats[row], seat.index() as u8);
        let seen = game.observe(Viewer::Seat(seat));
        assert!(seen.hand.counts(11).eq(hand.iter().copied()));
    }
    // After a reset game 0 has the index 5, whose entry is the last.
    let batch = games.reset_some(&[0]).unwrap();
    assert_eq!(u32s(&batch.observations.history_counts)[0], 13);
}

#[test]
fn invalid_entries_are_refused_by_entry_and_action() {
    let refused = |change: fn(&mut StartPoint)| {
        let (mut wrong, _) = point(3, 9);
        change(&mut wrong);
        let points = vec![point(1, 0).0, wrong];
        let start = Start::Listed(points.into());
        all_client(2).with_start(start).unwrap_err().to_string()
    };
    let illegal = refused(|point| point.actions[4] = ActionId::new(201));
    assert!(
        illegal.starts_with("start 1, action 4 of its list: "),
        "{illegal}"
    );
    let hands =
        refused(|point| point.script.hands[Seat::new(2)] = point.script.hands[Seat::new(1)]);
    assert!(hands.starts_with("start 1: "), "{hands}");
    let (mut long, mut game) = point(3, 0);
    while game.shift() == 1 {
        let action = game.legal_actions().nth(0).unwrap();
        game.apply(action, |_| {}).unwrap();
        long.actions.push(action);
    }
    let place = long.actions.len() - 1;
    let error = all_client(2)
        .with_start(Start::Listed(vec![long].into()))
        .unwrap_err();
    assert_eq!(error, SetupError::ListedEnd { entry: 0, place });
    let none = all_client(2)
        .with_start(Start::Listed(Vec::new().into()))
        .unwrap_err();
    assert_eq!(none, SetupError::NoStarts);
}
