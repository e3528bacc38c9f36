//! Agents that play from a network file: what a network is and how it decides. What it is shown is in `features`, how it computes in
//! `layers`, how its file is read in `file`. Networks are trained elsewhere (the Python package does), never here.

mod features;
mod file;
mod layers;

use std::sync::{Arc, LazyLock};

use chefshat_engine::{ActionId, ActionSpace, DecisionKind, Mask, Observation, RuleSet};

use crate::greedy::greedy;
pub use features::table_features;
use layers::{Hidden, Output};

pub use file::{MAX_FILE_BYTES, NetworkError};

/// The network of the built-in agent `trained`, read once.
static TRAINED: LazyLock<Arc<Network>> = LazyLock::new(|| {
    let file = include_bytes!("trained.safetensors");
    Arc::new(Network::from_bytes(file).expect("the file within the program is sound"))
});

/// What a network is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NetworkInput {
    /// The paper's classic vector ([`Observation::classic_vector`]).
    Classic,
    /// Everything that a seat may know ([`table_features`]).
    Table,
}

/// What a network's outputs stand for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NetworkOutput {
    /// The T actions of a turn. Other decisions are taken by default.
    Turns,
    /// All A actions.
    Actions,
}

/// What a network's file says of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NetworkInfo {
    /// What it is shown.
    pub input: NetworkInput,
    /// What its outputs stand for.
    pub output: NetworkOutput,
    /// Whether its outputs go through tanh. What it plays does not depend on it.
    pub tanh: bool,
    /// Whether it was trained to choose among the legal actions alone. It always plays so.
    pub masked: bool,
    /// Number of players it was trained for.
    pub players: u8,
    /// Number of faces it was trained for.
    pub faces: u8,
    /// Number of jokers it was trained with.
    pub jokers: u8,
    /// Cards dealt to a hand in these games.
    pub hand_size: u8,
    /// The rule set it was trained under, as the protocol's JSON; empty if the file does not say. Shown to people, not looked at.
    pub rules: String,
    /// Its name; may be empty.
    pub name: String,
    /// The command that trained it; may be empty.
    pub trained_by: String,
}

/// A multilayer perceptron that plays: of the legal actions the one with the highest output.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    info: NetworkInfo,
    hidden: Vec<Hidden>,
    output: Output,
}

impl Network {
    /// The network of the built-in agent `trained`, which is part of the program.
    pub fn trained() -> &'static Arc<Network> {
        &TRAINED
    }

    /// What its file says of it.
    pub fn info(&self) -> &NetworkInfo {
        &self.info
    }

    /// Whether it was trained for games of this size. In others it plays as `greedy`.
    pub fn fits(&self, rules: &RuleSet) -> bool {
        usize::from(self.info.players) == rules.players()
            && self.info.faces == rules.faces()
            && self.info.hand_size == rules.hand_size()
    }

    /// What it is shown of a decision.
    ///
    /// # Panics
    /// If `observation` is not of a game that it [fits](Network::fits) by its numbers of seats, faces and cards dealt.
    pub fn features(&self, observation: &Observation, legal: &Mask) -> Vec<f32> {
        assert!(
            self.knows(observation),
            "the network was trained for such games"
        );
        match self.info.input {
            NetworkInput::Classic => observation.classic_vector(legal),
            NetworkInput::Table => table_features(observation, legal),
        }
    }

    /// Its outputs, T or A numbers, for what [`Network::features`] gives. After tanh the last digits may differ between platforms.
    ///
    /// # Panics
    /// If there are not as many features as it has inputs.
    pub fn outputs(&self, features: &[f32]) -> Vec<f32> {
        let last = self.last_hidden(features);
        (0..self.output.len())
            .map(|index| self.output.value(index, &last))
            .map(|sum| if self.info.tanh { sum.tanh() } else { sum })
            .collect()
    }

    /// Decides: of the legal actions the one with the highest output, of equal ones that with the lowest index. Outputs are compared
    /// before tanh; one that is no number, because weights are too large to be summed, counts as the lowest. A decision without an
    /// output is taken by default ([`Observation::default_action`]); in a game with other numbers of seats, faces or cards dealt than
    /// it was trained for it plays as the built-in agent `greedy`.
    ///
    /// # Panics
    /// When `legal` is empty: there is no decision to take.
    pub fn decide(&self, observation: &Observation, legal: &Mask) -> ActionId {
        if !self.knows(observation) {
            let space =
                ActionSpace::new(observation.faces).expect("an observation has 4 to 15 faces");
            return greedy(observation, legal, space);
        }
        if self.info.output == NetworkOutput::Turns && observation.kind != Some(DecisionKind::Turn)
        {
            return (observation.default_action(legal)).expect("a decision has a legal action");
        }
        let mut best = legal.nth(0).expect("a decision has a legal action");
        if legal.len() == 1 {
            return best;
        }
        let last = self.last_hidden(&self.features(observation, legal));
        let mut highest = f32::NEG_INFINITY;
        for action in legal.iter() {
            let index = usize::from(action.index());
            if index >= self.output.len() {
                continue;
            }
            // Not tanh of it: that changes no order, but differs between platforms and makes equal what is far from 0. What is no
            // number is not above anything.
            let sum = self.output.value(index, &last);
            if sum > highest {
                (best, highest) = (action, sum);
            }
        }
        best
    }

    /// Whether an observation has the numbers of seats, faces and cards dealt that it was trained for.
    fn knows(&self, observation: &Observation) -> bool {
        observation.cards_left.len() == usize::from(self.info.players)
            && observation.faces == self.info.faces
            && observation.hand_size == self.info.hand_size
    }

    /// The values of the last hidden layer, or the features themselves if there is none.
    fn last_hidden(&self, features: &[f32]) -> Vec<f32> {
        let mut values = features.to_vec();
        let mut next = Vec::new();
        for layer in &self.hidden {
            layer.forward(&values, &mut next);
            std::mem::swap(&mut values, &mut next);
        }
        assert_eq!(
            values.len(),
            self.output.inputs(),
            "there are as many features as the network has inputs"
        );
        values
    }
}

impl NetworkInput {
    /// Both.
    const ALL: [NetworkInput; 2] = [NetworkInput::Classic, NetworkInput::Table];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            NetworkInput::Classic => "classic",
            NetworkInput::Table => "table",
        }
    }

    /// How many numbers a network is shown in games of `rules`.
    fn len(self, rules: &RuleSet) -> usize {
        match self {
            NetworkInput::Classic => {
                usize::from(rules.faces())
                    + usize::from(rules.hand_size())
                    + usize::from(rules.actions().turn_actions())
            }
            NetworkInput::Table => features::table_len(rules.players(), rules.actions()),
        }
    }
}

impl NetworkOutput {
    /// Both.
    const ALL: [NetworkOutput; 2] = [NetworkOutput::Turns, NetworkOutput::Actions];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            NetworkOutput::Turns => "turns",
            NetworkOutput::Actions => "actions",
        }
    }

    /// How many outputs that is.
    fn len(self, space: ActionSpace) -> usize {
        usize::from(match self {
            NetworkOutput::Turns => space.turn_actions(),
            NetworkOutput::Actions => space.size(),
        })
    }
}
