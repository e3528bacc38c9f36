//! Networks as opponents: they decide together for many games, each as it would alone.

use std::num::NonZeroU64;
use std::path::Path;
use std::sync::Arc;

use chefshat_agents::{AgentKind, Network};
use chefshat_engine::{Game, Seat, Viewer};
use chefshat_simulation::vector::{SavedGame, Seeds, SetupError, VectorGames, VectorSetup};
use safetensors::Dtype;
use safetensors::tensor::{TensorView, serialize};

use super::*;

fn network(name: &str) -> Arc<Network> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/network");
    Arc::new(Network::load(&folder.join(name)).unwrap())
}

/// Games against `trained` on seat 1, a network on seats 2 and 3.
fn setup(games: u32, network: &Arc<Network>) -> VectorSetup {
    against(
        [AgentKind::Trained, AgentKind::Greedy, AgentKind::Greedy],
        games,
    )
    .with_network(Seat::new(2), Arc::clone(network))
    .unwrap()
    .with_network(Seat::new(3), Arc::clone(network))
    .unwrap()
}

#[test]
fn networks_play_as_they_would_alone_on_any_number_of_threads() {
    let network = network("table-actions.safetensors");
    // Several blocks of games.
    let setup = setup(70, &network)
        .with_total_games(NonZeroU64::new(75))
        .unwrap()
        .with_statistics(true)
        .with_records(true);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build();
    let pool = Some(Arc::new(pool.unwrap()));
    let (mut threaded, first) = VectorGames::on(setup.clone(), pool);
    let mut next = Some(first);
    let (mut shifts, mut unlike_trained) = (0, 0);
    let played = play_out(setup, |_, batch| {
        let others = next.take().unwrap();
        assert_eq!(others, *batch);
        if !batch.done {
            next = Some(threaded.step(&some_actions(batch)).unwrap());
        }
        let tables = [
            &batch.endings.games,
            &batch.beginnings.games,
            &batch.shifts.games,
        ];
        assert!(tables.iter().all(|games| u32s(games).is_sorted()));
        assert!(batch.played.is_sorted_by_key(|played| played.game));
        shifts += batch.shifts.rows;
    });
    assert_eq!(played.len(), 75);
    assert!(shifts > 75);
    for game in &played {
        let mut alone = Game::new(rules(), game.seed, |_| {});
        for taken in &game.decisions {
            let open = alone.decision().unwrap();
            let (seen, legal) = (
                alone.observe(Viewer::Seat(open.seat)),
                alone.legal_actions(),
            );
            let expected = match open.seat.index() {
                0 => taken.action,
                1 => Network::trained().decide(&seen, &legal),
                _ => network.decide(&seen, &legal),
            };
            assert_eq!(taken.action, expected, "game {}", game.index);
            let trained = Network::trained().decide(&seen, &legal);
            unlike_trained += u32::from(open.seat.index() > 1 && expected != trained);
            alone.apply(taken.action, |_| {}).unwrap();
        }
        assert!(alone.is_over());
    }
    assert!(unlike_trained > 100, "the two networks differ");
}

#[test]
fn states_continue_against_the_same_network_alone() {
    let network = network("table-actions.safetensors");
    let (mut games, mut batch) = VectorGames::new(setup(3, &network));
    for _ in 0..20 {
        batch = games.step(&some_actions(&batch)).unwrap();
    }
    let bytes = games.save(&[2]).unwrap()[0].to_bytes();
    let restored = || SavedGame::from_bytes(&bytes).unwrap();

    let (mut copies, _) = games.fork(&[2], 2, None).unwrap();
    let (mut others, _) = VectorGames::new(setup(2, &network));
    let mut batch = others
        .restore(&[0, 1], vec![restored(), restored()])
        .unwrap();
    for _ in 0..20 {
        let actions = some_actions(&batch);
        batch = others.step(&actions).unwrap();
        let forked = copies.step(&actions).unwrap();
        assert_eq!(
            (&batch.masks, &batch.rewards),
            (&forked.masks, &forked.rewards)
        );
    }

    // Another network takes the seat over.
    let (mut others, _) = VectorGames::new(setup(1, Network::trained()));
    let batch = others.restore(&[0], vec![restored()]).unwrap();
    others.step(&some_actions(&batch)).unwrap();
}

/// A network with hidden layers of these numbers of units, whose weights are all 0.
fn of_zeros(hidden: &[usize]) -> Arc<Network> {
    let metadata = [
        ("format", "chefshat-network-1"),
        ("input", "table"),
        ("output", "actions"),
        ("output_activation", "none"),
        ("masked", "true"),
        ("players", "4"),
        ("faces", "11"),
        ("jokers", "2"),
    ];
    let metadata = metadata.map(|(key, value)| (key.to_owned(), value.to_owned()));
    let lengths = [&[334], hidden, &[214]].concat();
    let zeros = vec![
        0;
        2 * lengths
            .windows(2)
            .map(|pair| pair[0] * pair[1])
            .max()
            .unwrap()
    ];
    let mut tensors = Vec::new();
    for (layer, pair) in lengths.windows(2).enumerate() {
        let shapes = [("weight", vec![pair[1], pair[0]]), ("bias", vec![pair[1]])];
        for (name, shape) in shapes {
            let bytes = &zeros[..2 * shape.iter().product::<usize>()];
            let view = TensorView::new(Dtype::F16, shape, bytes).unwrap();
            tensors.push((format!("layer{layer}.{name}"), view));
        }
    }
    let file = serialize(tensors, Some(metadata.into())).unwrap();
    Arc::new(Network::from_bytes(&file).unwrap())
}

#[test]
fn large_networks_take_several_steps_in_which_all_games_advance() {
    let network = of_zeros(&[1, 8192, 1024]);
    // The units of a hidden layer count up to a multiple of 32.
    let expected = 334 * 32 + 8192 + 8192 * 1024 + 1024 * 214;
    assert_eq!(network.multiplications(), expected);
    let (mut games, mut batch) = VectorGames::new(setup(2048, &network));
    let mut rows = vec![0; 2048];
    for _ in 0..16 {
        assert!(!batch.done && u32s(&batch.games).is_sorted());
        for game in u32s(&batch.games) {
            rows[game as usize] += 1;
        }
        batch = games.step(&some_actions(&batch)).unwrap();
    }
    let (all, fewest) = (rows.iter().sum::<u32>(), rows.iter().min().unwrap());
    assert!(all < 16 * 2048, "the limit was never reached");
    assert!(*fewest > 1, "{rows:?}");
}

#[test]
fn networks_for_other_games_and_seats_are_refused() {
    let small = network("small-table.safetensors");
    let agents = [None, Some(AgentKind::Greedy), None, None];
    let setup = VectorSetup::new(rules(), 1, &agents, Seeds::Base(7)).unwrap();
    let add = |setup: &VectorSetup, seat: usize, network: &Arc<Network>| {
        let added = setup
            .clone()
            .with_network(Seat::new(seat), Arc::clone(network));
        added.err()
    };
    let error = add(&setup, 1, &small).unwrap();
    assert_eq!(
        error.to_string(),
        "it is for 3 players, 5 faces and hands of 5, and these games have 4 players, 11 faces and hands of 17: use one that was trained under such rules"
    );
    let fits = Network::trained();
    assert_eq!(add(&setup, 1, fits), None);
    for seat in [0, 4] {
        let error = SetupError::ClientsSeat(Seat::new(seat));
        assert_eq!(add(&setup, seat, fits), Some(error));
    }
}
