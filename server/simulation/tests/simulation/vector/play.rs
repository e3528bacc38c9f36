//! Games in a vector environment equal games played alone, from any start.

use std::collections::BTreeMap;
use std::num::NonZeroU64;
use std::sync::Arc;

use chefshat_agents::{AgentKind, BuiltInAgent, Listener, agent_seed, game_seed};
use chefshat_engine::{
    ActionId, Cards, Decision, DecisionKind, Game, Observation, RewardScheme, Script, Seat, Viewer,
};
use chefshat_simulation::vector::{
    LEAVE_OPEN, Seeds, Situation, Start, StepError, VectorGames, VectorSetup,
};

use super::*;

#[test]
fn every_game_equals_the_same_game_played_alone() {
    let setup = against(
        [
            AgentKind::Greedy,
            AgentKind::Random,
            AgentKind::RandomUnmasked,
        ],
        5,
    )
    .with_total_games(NonZeroU64::new(23))
    .unwrap()
    .with_records(true);
    // Each decision and its action, by game.
    let mut rows: BTreeMap<u64, Vec<(Situation, ActionId)>> = BTreeMap::new();
    let mut indices: BTreeMap<u32, u64> = BTreeMap::new();
    let played = play_out(setup, |_, batch| {
        for (game, index) in u32s(&batch.beginnings.games)
            .into_iter()
            .zip(u64s(&batch.beginnings.indices))
        {
            indices.insert(game, index);
        }
        let actions = some_actions(batch);
        for (row, game) in u32s(&batch.games).iter().enumerate() {
            let situation = batch.situation(row, &rules()).unwrap();
            rows.entry(indices[game])
                .or_default()
                .push((situation, actions[row]));
        }
        assert_eq!(batch.situation(actions.len(), &rules()), None);
    });
    let mut found: Vec<u64> = played.iter().map(|game| game.index).collect();
    found.sort_unstable();
    assert_eq!(found, (0..23).collect::<Vec<_>>(), "each game once");
    for game in &played {
        assert_eq!(game.seed, game_seed(7, game.index));
        assert_eq!(u64::from(game.game), game.index % 5);
        let mut alone = Game::new(rules(), game.seed, |_| {});
        let mut seen = rows[&game.index].iter();
        for taken in &game.decisions {
            let open = alone.decision().unwrap();
            for attempt in &taken.attempts {
                assert!(!alone.legal_actions().contains(*attempt));
            }
            if open.seat == Seat::new(0) {
                let (situation, action) = seen.next().unwrap();
                assert_eq!(situation.legal, alone.legal_actions());
                assert_eq!(situation.observation, in_columns(&alone, open.seat));
                assert_eq!(*action, taken.action);
            }
            alone.apply(taken.action, |_| {}).unwrap();
        }
        assert!(alone.is_over() && seen.next().is_none());
    }
    let wrong = played.iter().flat_map(|game| &game.decisions);
    assert!(wrong.map(|taken| taken.attempts.len()).sum::<usize>() > 1000);
}

/// What a seat may know, as far as columns have it: which exchanged card is the Golden card they do
/// not say.
fn in_columns(game: &Game, seat: Seat) -> Observation {
    let seen = game.observe(Viewer::Seat(seat));
    let counts =
        |cards: Cards| Cards::from_counts(11, &cards.count_array(11)[..12], false).unwrap();
    Observation {
        gave: counts(seen.gave),
        received: counts(seen.received),
        ..seen
    }
}

#[test]
fn with_built_in_agents_as_client_games_equal_a_batch() {
    struct Taken(Vec<ActionId>);
    impl Listener for Taken {
        fn on_decision(&mut self, _: Decision, action: ActionId) {
            self.0.push(action);
        }
    }
    let kinds = [
        AgentKind::Random,
        AgentKind::Greedy,
        AgentKind::Random,
        AgentKind::Greedy,
    ];
    let alone = chefshat_simulation::Batch::new(rules(), &kinds, 6, 7).unwrap();
    let agents = [None, Some(kinds[1]), None, Some(kinds[3])];
    let setup = VectorSetup::new(rules(), 3, &agents, Seeds::Base(7))
        .unwrap()
        .with_total_games(NonZeroU64::new(6))
        .unwrap()
        .with_records(true);
    let (mut games, mut batch) = VectorGames::new(setup);
    let mut minds: BTreeMap<(u32, usize), BuiltInAgent> = BTreeMap::new();
    let mut played = Vec::new();
    // The client's agents need full observations, so the games are replayed alongside.
    let mut tables: BTreeMap<u32, Game> = BTreeMap::new();
    let mut others: BTreeMap<(u32, usize), BuiltInAgent> = BTreeMap::new();
    while !batch.done {
        for (game, index) in u32s(&batch.beginnings.games)
            .into_iter()
            .zip(u64s(&batch.beginnings.indices))
        {
            let seed = game_seed(7, index);
            tables.insert(game, Game::new(rules(), seed, |_| {}));
            for (seat, kind) in kinds.into_iter().enumerate() {
                let mind = BuiltInAgent::new(kind, agent_seed(seed, Seat::new(seat)));
                let whose = if seat % 2 == 0 {
                    &mut minds
                } else {
                    &mut others
                };
                whose.insert((game, seat), mind);
            }
        }
        let mut actions = Vec::new();
        for game in u32s(&batch.games) {
            let table = tables.get_mut(&game).unwrap();
            loop {
                let open = table.decision().unwrap();
                let key = (game, open.seat.index());
                let view = table.observe(Viewer::Seat(open.seat));
                let legal = table.legal_actions();
                if let Some(mind) = minds.get_mut(&key) {
                    let action = mind.decide(&view, &legal);
                    table.apply(action, |_| {}).unwrap();
                    actions.push(action);
                    break;
                }
                let action = others.get_mut(&key).unwrap().decide(&view, &legal);
                table.apply(action, |_| {}).unwrap();
            }
        }
        batch = games.step(&actions).unwrap();
        played.append(&mut batch.played);
    }
    assert_eq!(played.len(), 6);
    for game in played {
        let mut taken = Taken(Vec::new());
        alone.play_game(game.index, &mut taken);
        let actions: Vec<ActionId> = game.decisions.iter().map(|taken| taken.action).collect();
        assert_eq!(actions, taken.0);
    }
}

#[test]
fn games_restart_on_request() {
    let setup = all_client(3);
    let (mut games, first) = VectorGames::new(setup.clone());
    let mut batch = games.step(&some_actions(&first)).unwrap();
    for _ in 0..7 {
        batch = games.step(&some_actions(&batch)).unwrap();
    }
    let some = games.reset_some(&[1]).unwrap();
    assert_eq!(u32s(&some.beginnings.games), [1]);
    assert_eq!(
        u64s(&some.beginnings.indices),
        [4],
        "game 1 continues with index 1 + 3"
    );
    assert_eq!(some.rows, 3);
    let part = |batch: &Batch, row: usize| batch.observations.hands[row * 12..][..12].to_vec();
    assert_eq!(part(&some, 0), part(&batch, 0));
    assert_ne!(part(&some, 1), part(&batch, 1));
    let again = games.reset(None);
    assert_eq!(
        u64s(&again.beginnings.indices),
        [3, 7, 5],
        "each continues with its next index"
    );
    let again = games.reset(Some(Seeds::Base(7)));
    assert_eq!(u64s(&again.beginnings.indices), [0, 1, 2]);
    assert_eq!(again.observations.hands, first.observations.hands);
    let other = games.reset(Some(Seeds::List(vec![game_seed(7, 2)].into())));
    assert_eq!(part(&other, 0), part(&first, 2));
    assert_eq!(part(&other, 1), part(&first, 2));
    assert_eq!(
        games.reset_some(&[3]).unwrap_err(),
        StepError::NoGame { game: 3, last: 2 }
    );
    for wrong in [[1, 1], [2, 1]] {
        let error = games.reset_some(&wrong).unwrap_err();
        assert_eq!(error, StepError::Order { game: 1 });
    }
    let none = games.reset_some(&[]).unwrap();
    assert_eq!((none.rows, none.beginnings.rows), (3, 0));
    assert_eq!(none.observations.hands, other.observations.hands);

    // No more games begin than the total.
    let setup = all_client(3).with_total_games(NonZeroU64::new(4)).unwrap();
    let (mut games, _) = VectorGames::new(setup);
    let next = games.reset(None);
    assert_eq!(u64s(&next.beginnings.indices), [3]);
    assert_eq!((u32s(&next.games), next.done), (vec![0], false));
    let over = games.reset_some(&[0]).unwrap();
    assert!(over.done && over.rows == 0);
}

#[test]
fn games_start_from_a_script_or_a_position() {
    let dealt = Game::new(rules(), game_seed(1, 1), |_| {});
    let script = Script::first_shift(*dealt.hands());
    let setup = all_client(3)
        .with_start(Start::Script(Box::new(script)))
        .unwrap();
    let (_, batch) = VectorGames::new(setup);
    let opener = dealt.decision().unwrap().seat;
    let hand: Vec<u8> = dealt.hands()[opener].counts(11).collect();
    assert_eq!(batch.observations.hands, hand.repeat(3));

    let mut game = dealt;
    while game.shift() < 2 || game.decision().unwrap().kind != DecisionKind::Turn {
        let legal = game.legal_actions();
        game.apply(some_action(&legal, 1, 1), |_| {}).unwrap();
    }
    for (same_deals, differ) in [(true, false), (false, true)] {
        let setup = all_client(2)
            .with_start(Start::Point {
                game: Box::new(game.clone()),
                same_deals,
            })
            .unwrap();
        let (mut games, mut batch) = VectorGames::new(setup);
        let seen: Vec<u8> = game.hands()[game.decision().unwrap().seat]
            .counts(11)
            .collect();
        assert_eq!(batch.observations.hands, seen.repeat(2));
        // Both games are equal up to the next deal, which is shared or each game's own.
        while u32s(&batch.observations.shifts) == [2, 2] {
            let action = some_action(&masks(&batch)[0], 1, 1);
            batch = games.step(&[action, action]).unwrap();
        }
        let (one, two) = batch.observations.hands.split_at(12);
        assert_eq!(one != two, differ);
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let agents = [
        AgentKind::RandomUnmasked,
        AgentKind::Greedy,
        AgentKind::Random,
    ];
    let setup = against(agents, 300).with_statistics(true);
    let pools = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        Arc::new(pool.build().unwrap())
    });
    let (mut alone, mut expected) = VectorGames::new(setup.clone());
    let mut others = pools.map(|pool| VectorGames::on(setup.clone(), Some(pool)));
    for step in 0..120 {
        for (_, batch) in &others {
            assert_eq!(*batch, expected, "step {step}");
        }
        if step % 50 == 49 {
            expected = alone.reset_some(&[0, 70, 299]).unwrap();
            for (games, batch) in &mut others {
                *batch = games.reset_some(&[0, 70, 299]).unwrap();
            }
            continue;
        }
        let actions = some_actions(&expected);
        expected = alone.step(&actions).unwrap();
        for (games, batch) in &mut others {
            *batch = games.step(&actions).unwrap();
        }
    }
    assert!(expected.totals.games > 0 || expected.totals.shifts > 300);
}

#[test]
fn decisions_left_open_come_again_unchanged() {
    let setup = all_client(4).with_rewards(Some(RewardScheme::Validity));
    let (mut games, mut batch) = VectorGames::new(setup.clone());
    let (mut others, mut expected) = VectorGames::new(setup);
    for _ in 0..300 {
        assert_eq!(batch.observations, expected.observations);
        assert_eq!(
            (&batch.masks, &batch.rewards),
            (&expected.masks, &expected.rewards)
        );
        let actions = some_actions(&expected);
        expected = others.step(&actions).unwrap();
        // The games with even numbers first.
        let first = |(row, action): (usize, &ActionId)| [*action, LEAVE_OPEN][row % 2];
        let half: Vec<ActionId> = actions.iter().enumerate().map(first).collect();
        let between = games.step(&half).unwrap();
        assert_eq!(between.rows, 4);
        let second = |(row, action): (usize, &ActionId)| [LEAVE_OPEN, *action][row % 2];
        let half: Vec<ActionId> = actions.iter().enumerate().map(second).collect();
        batch = games.step(&half).unwrap();
    }
    assert_eq!(batch.totals, expected.totals);
    assert!(expected.totals.shifts > 0);
}
