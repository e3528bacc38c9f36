//! Networks: features, outputs and actions equal those of the Python package (fixtures in
//! tests/fixtures/network, written by clients/python/tools/network_fixtures.py), and decisions
//! follow from the outputs. `network_file` tests files.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use chefshat_agents::{
    AgentKind, BuiltInAgent, Network, NetworkBatch, NetworkInput, NetworkOutput, table_features,
};
use chefshat_engine::{
    ActionId, Board, BySeat, Cards, DecisionKind, Game, Mask, Observation, Role, RuleSetSpec, Seat,
    Seed, Stop, Viewer,
};
use safetensors::Dtype;
use serde::Deserialize;

use crate::network_file::NetworkFile;

/// A row of a fixture: an observation and the results for it.
#[derive(Deserialize)]
struct Row {
    seat: usize,
    kind: String,
    pizza: u32,
    golden: bool,
    hands: Vec<u8>,
    boards: [u8; 3],
    cards_left: Vec<u8>,
    passed: Vec<u8>,
    places: Vec<u8>,
    roles: Vec<u8>,
    points: Vec<u64>,
    played: Vec<u8>,
    gave: Vec<u8>,
    received: Vec<u8>,
    legal: Vec<u16>,
    features: Vec<f32>,
    outputs: Vec<f32>,
    action: u16,
}

impl Row {
    fn observation(&self, hand_size: u8) -> Observation {
        let faces = u8::try_from(self.hands.len()).unwrap() - 1;
        let cards = |counts: &[u8]| Cards::from_counts(faces, counts, false).unwrap();
        let [face, size, jokers] = self.boards;
        let role = |value: u8| {
            Role::in_order(5)
                .chain([Role::Cook])
                .find(|role| *role as u8 == value)
        };
        Observation {
            seat: Some(Seat::new(self.seat)),
            kind: Some(match &*self.kind {
                "DECISION_KIND_TURN" => DecisionKind::Turn,
                "DECISION_KIND_EXCHANGE" => DecisionKind::Exchange,
                "DECISION_KIND_SPECIAL_ACTION" => DecisionKind::SpecialAction,
                other => panic!("{other}"),
            }),
            faces,
            hand_size,
            shift: 2,
            pizza: self.pizza,
            hand: Cards::from_counts(faces, &self.hands, self.golden).unwrap(),
            board: Board { face, size, jokers },
            board_owner: None,
            cards_left: BySeat::from_slice(&self.cards_left).unwrap(),
            passed: BySeat::from_slice(&self.passed)
                .unwrap()
                .map(|flag| flag == 1),
            places: BySeat::from_slice(&self.places).unwrap(),
            roles: BySeat::from_slice(&self.roles).unwrap().map(role),
            points: BySeat::from_slice(&self.points).unwrap(),
            played: cards(&self.played),
            gave: cards(&self.gave),
            received: cards(&self.received),
        }
    }

    fn mask(&self) -> Mask {
        self.legal.iter().copied().map(ActionId::new).collect()
    }
}

fn fixture(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/network");
    folder.join(name)
}

#[test]
fn features_outputs_and_actions_are_those_of_the_python_package() {
    use NetworkInput::{Classic, Table};
    use NetworkOutput::{Actions, Turns};
    for (name, input, output, tanh, masked, players, hand_size) in [
        ("table-actions", Table, Actions, false, true, 4, 17),
        ("classic-turns", Classic, Turns, true, false, 4, 17),
        ("small-table", Table, Actions, false, true, 3, 5),
    ] {
        let network = Network::load(&fixture(&format!("{name}.safetensors"))).unwrap();
        let info = network.info();
        assert_eq!((info.input, info.output), (input, output), "{name}");
        assert_eq!((info.tanh, info.masked), (tanh, masked), "{name}");
        assert_eq!(
            (info.players, info.hand_size),
            (players, hand_size),
            "{name}"
        );
        assert_eq!((&*info.name, &*info.trained_by), (name, "chance"));

        let rows = std::fs::read_to_string(fixture(&format!("{name}.json"))).unwrap();
        let rows: Vec<Row> = serde_json::from_str(&rows).unwrap();
        assert!(rows.len() >= 10, "{name}");
        for kind in ["TURN", "EXCHANGE", "SPECIAL_ACTION"] {
            let kind = format!("DECISION_KIND_{kind}");
            assert!(
                rows.iter().any(|row| row.kind == kind),
                "{name} has no {kind}"
            );
        }
        for (number, row) in rows.iter().enumerate() {
            let (observation, legal) = (row.observation(hand_size), row.mask());
            let features = network.features(&observation, &legal);
            // Exact: all values are 0, 1 or a quotient of small numbers.
            assert_eq!(features, row.features, "{name}, row {number}");
            if input == Table {
                assert_eq!(table_features(&observation, &legal), features);
            }
            let outputs = network.outputs(&features);
            assert_eq!(outputs.len(), row.outputs.len(), "{name}, row {number}");
            for (ours, theirs) in outputs.iter().zip(&row.outputs) {
                assert!(
                    (ours - theirs).abs() < 1e-4,
                    "{name}, row {number}: {ours} {theirs}"
                );
            }
            let chosen = network.decide(&observation, &legal);
            assert_eq!(chosen.index(), row.action, "{name}, row {number}");
        }
    }
}

/// Every decision of a game of greedy agents, with its observation.
fn decisions(spec: &RuleSetSpec) -> Vec<(Observation, Mask)> {
    let rules = spec.validate().unwrap();
    let mut game = Game::new(rules, Seed([8; 32]), |_| {});
    let mut agent = BuiltInAgent::new(AgentKind::Greedy, [0; 32]);
    let mut seen = Vec::new();
    while let Some(decision) = game.decision() {
        let observation = game.observe(Viewer::Seat(decision.seat));
        let legal = game.legal_actions();
        seen.push((observation, legal));
        let action = agent.decide(&observation, &legal);
        game.apply(action, |_| {}).unwrap();
    }
    seen
}

fn shifts(count: u32) -> RuleSetSpec {
    RuleSetSpec {
        stop: Stop::Shifts(count),
        ..RuleSetSpec::default()
    }
}

#[test]
fn the_highest_output_is_played_and_the_first_of_equals() {
    let ascending: Vec<f32> = (0..214u8).map(f32::from).collect();
    let highest = NetworkFile::preferring(&ascending).network();
    let lowest = NetworkFile::preferring(&[0.5; 214]).network();
    // Saturated: tanh makes all outputs equal, so the choice must precede it.
    let saturated =
        NetworkFile::preferring(&ascending.iter().map(|n| 20.0 + n).collect::<Vec<_>>());
    let saturated = saturated.with("output_activation", "tanh").network();
    let outputs = saturated.outputs(&[0.0; 228]);
    assert!(outputs.iter().all(|output| (output - 1.0).abs() < 1e-6));

    let seen = decisions(&shifts(6));
    assert!(seen.len() > 200, "{} decisions", seen.len());
    for (observation, legal) in &seen {
        let last = legal.iter().last().unwrap();
        assert_eq!(highest.decide(observation, legal), last);
        assert_eq!(Some(lowest.decide(observation, legal)), legal.nth(0));
        assert_eq!(saturated.decide(observation, legal), last);
    }
}

/// A network with the constant outputs 0, 1, 2 and so on, and NaN for the actions in `broken`.
fn overflowing(broken: Range<usize>) -> Network {
    let mut file = NetworkFile::new("classic", "actions");
    file.layer(0, 228, &[0.0; 2 * 228], &[f32::MAX; 2]);
    // Infinity minus infinity, although every number of the file is finite.
    let mut weights = [0.0; 2 * 214];
    for row in broken.clone() {
        (weights[2 * row], weights[2 * row + 1]) = (f32::MAX, -f32::MAX);
    }
    let ascending: Vec<f32> = (0..214u8).map(f32::from).collect();
    file.layer(1, 2, &weights, &ascending);
    let network = file.network();
    for (row, output) in network.outputs(&[0.0; 228]).iter().enumerate() {
        assert_eq!(output.is_nan(), broken.contains(&row), "output {row}");
    }
    network
}

#[test]
fn nan_outputs_never_win() {
    let seen = decisions(&shifts(6));
    // Only the pass, which is the last action of a turn; all or some before it; everything.
    for broken in [199..200, 0..199, 0..40, 0..214] {
        let network = overflowing(broken.clone());
        let (mut mixed, mut without) = (0, 0);
        for (observation, legal) in &seen {
            let sound = |action: &ActionId| !broken.contains(&usize::from(action.index()));
            let count = legal.iter().filter(sound).count();
            mixed += u32::from(count > 0 && count < legal.len());
            without += u32::from(count == 0 && legal.len() > 1);
            // If all are NaN, all are equal.
            let expected = legal.iter().filter(sound).last().or(legal.nth(0));
            let chosen = network.decide(observation, legal);
            assert_eq!(Some(chosen), expected, "{broken:?} of {legal:?}");
        }
        let all = broken.len() == 214;
        assert!(all || mixed > 50, "{broken:?}: {mixed} decisions");
        assert!(!all || without > 50, "{broken:?}: {without} decisions");
    }
}

#[test]
fn decisions_without_an_output_are_taken_by_default() {
    let ascending: Vec<f32> = (0..200u8).map(f32::from).collect();
    let network = NetworkFile::preferring(&ascending).network();
    let mut others = 0;
    for (observation, legal) in &decisions(&shifts(12)) {
        let chosen = network.decide(observation, legal);
        if observation.kind == Some(DecisionKind::Turn) {
            assert_eq!(Some(chosen), legal.iter().last());
        } else {
            others += 1;
            assert_eq!(Some(chosen), observation.default_action(legal));
        }
    }
    assert!(others >= 33, "{others} gifts and special actions");
}

/// A rule set, and whether a network of the fixtures fits it.
#[derive(Deserialize)]
struct Fit {
    network: String,
    players: u8,
    faces: u8,
    jokers: u8,
    hand_size: u8,
    fits: bool,
}

/// Jokers matter only through the number of cards dealt: nothing else in the features depends on
/// them.
#[test]
fn a_network_fits_rules_with_as_many_players_faces_and_cards_dealt() {
    let rows = std::fs::read_to_string(fixture("fits.json")).unwrap();
    for row in serde_json::from_str::<Vec<Fit>>(&rows).unwrap() {
        let network = Network::load(&fixture(&format!("{}.safetensors", row.network))).unwrap();
        let rules = RuleSetSpec {
            players: row.players,
            faces: row.faces,
            jokers: row.jokers,
            ..shifts(1)
        };
        let rules = rules.validate().unwrap();
        assert_eq!(rules.hand_size(), row.hand_size);
        assert_eq!(network.fits(&rules), row.fits, "{} {rules:?}", row.network);
    }
}

#[test]
fn games_that_do_not_fit_are_played_as_greedy() {
    let network = NetworkFile::preferring(&[0.5; 214]).network();
    let network = Arc::new(network);
    for spec in [
        RuleSetSpec {
            players: 3,
            ..shifts(3)
        },
        RuleSetSpec {
            faces: 12,
            ..shifts(3)
        },
        RuleSetSpec {
            jokers: 0,
            ..shifts(3)
        },
    ] {
        assert!(!network.fits(&spec.validate().unwrap()), "{spec:?}");
        let mut agent = BuiltInAgent::network(Arc::clone(&network));
        let mut greedy = BuiltInAgent::new(AgentKind::Greedy, [0; 32]);
        let seen = decisions(&spec);
        assert!(seen.len() > 100);
        for (observation, legal) in &seen {
            let expected = greedy.decide(observation, legal);
            assert_eq!(agent.decide(observation, legal), expected, "{spec:?}");
        }
    }
    assert!(network.fits(&shifts(1).validate().unwrap()));
}

#[test]
fn an_agent_of_a_network_has_a_name_and_no_generator() {
    let agent = BuiltInAgent::network(Arc::new(NetworkFile::preferring(&[0.0; 214]).network()));
    assert_eq!(agent.name(), "network");
    assert!(!agent.has_generator());
}

#[test]
fn the_trained_agent_plays_by_its_network_and_fits_the_default_rules() {
    let network = Network::trained();
    let standard = RuleSetSpec::default().validate().unwrap();
    assert!(network.fits(&standard), "{:?}", network.info());
    let mut agent = BuiltInAgent::new(AgentKind::Trained, [0; 32]);
    assert_eq!(agent.name(), "trained");
    assert!(!agent.has_generator());
    for (observation, legal) in &decisions(&shifts(3)) {
        let expected = network.decide(observation, legal);
        assert_eq!(agent.decide(observation, legal), expected);
    }
}

#[test]
fn hidden_layers_and_half_floats_count() {
    // One hidden unit for whether action 0 is legal (the last 200 of the classic vector), twice,
    // cut off below 0.
    let mut file = NetworkFile::new("classic", "turns");
    let mut weights = vec![0.0; 2 * 228];
    (weights[28], weights[228 + 28]) = (3.0, -3.0);
    file.layer(0, 228, &weights, &[0.5, 0.25]);
    let halves: Vec<u8> = (0..400u16)
        .flat_map(|index| half::f16::from_f32(f32::from(index % 2)).to_le_bytes())
        .collect();
    file.tensor("layer1.weight", Dtype::F16, &[200, 2], halves);
    file.floats("layer1.bias", &[200], &[1.0; 200]);
    let network = file.network();
    let mut features = vec![0.0; 228];
    // The output layer uses the second unit alone.
    assert_eq!(network.outputs(&features), [1.25; 200]);
    features[28] = 1.0;
    assert_eq!(network.outputs(&features), [1.0; 200]);
}

#[test]
fn decisions_taken_together_are_those_taken_alone() {
    let seen = decisions(&shifts(12));
    let fixtures = ["table-actions", "classic-turns", "small-table"]
        .map(|name| Network::load(&fixture(&format!("{name}.safetensors"))).unwrap());
    // Without a hidden layer.
    let mut linear = NetworkFile::new("classic", "actions");
    let weights: Vec<f32> = (0..228 * 214u32).map(|n| (n % 97) as f32 / 97.0).collect();
    linear.layer(0, 228, &weights, &[0.0; 214]);
    let linear = linear.network();
    for network in [&**Network::trained(), &linear]
        .into_iter()
        .chain(&fixtures)
    {
        let alone: Vec<ActionId> = (seen.iter())
            .map(|(observation, legal)| network.decide(observation, legal))
            .collect();
        let mut batch = NetworkBatch::default();
        for size in [1, 2, 7, 64, seen.len()] {
            let mut together = Vec::new();
            for chunk in seen.chunks(size) {
                let mut actions: Vec<Option<ActionId>> = Vec::new();
                let mut waiting = Vec::new();
                for (place, (observation, legal)) in chunk.iter().enumerate() {
                    let action = network.decide_or_wait(observation, legal, &mut batch);
                    waiting.extend(action.is_none().then_some(place));
                    actions.push(action);
                }
                assert_eq!(batch.len(), waiting.len());
                network.decide_all(&mut batch, |place, action| {
                    assert_eq!(actions[waiting[place]].replace(action), None);
                });
                assert!(batch.is_empty());
                together.extend(actions.into_iter().map(Option::unwrap));
            }
            let name = &network.info().name;
            assert_eq!(together, alone, "{name:?} in batches of {size}");
        }
    }
}
