//! Agents that play by a network: what a network is and how it decides. `features` computes the
//! inputs, `layers` the outputs, `file` reads network files. The Python package trains networks.

mod features;
mod file;
mod layers;

use std::sync::{Arc, LazyLock};

use chefshat_engine::{ActionId, ActionSpace, DecisionKind, Mask, Observation, RuleSet};

use crate::greedy::greedy;
pub use features::table_features;
use layers::{Hidden, Output};

pub use file::{MAX_FILE_BYTES, NetworkError};

/// The network of the built-in agent `trained`, loaded once.
static TRAINED: LazyLock<Arc<Network>> = LazyLock::new(|| {
    let file = include_bytes!("trained.safetensors");
    Arc::new(Network::from_bytes(file).expect("the embedded file is valid"))
});

/// The input of a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NetworkInput {
    /// The paper's classic vector ([`Observation::classic_vector`]).
    Classic,
    /// Everything that a seat may know ([`table_features`]).
    Table,
}

/// The outputs of a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NetworkOutput {
    /// The T actions of a turn. For other decisions the default is taken.
    Turns,
    /// All A actions.
    Actions,
}

/// The metadata of a network file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NetworkInfo {
    /// The input.
    pub input: NetworkInput,
    /// The outputs.
    pub output: NetworkOutput,
    /// Whether outputs pass through tanh. Does not affect play.
    pub tanh: bool,
    /// Whether it was trained on legal actions only. It always plays legal actions.
    pub masked: bool,
    /// Number of players it was trained for.
    pub players: u8,
    /// Number of faces it was trained for.
    pub faces: u8,
    /// Number of jokers it was trained with.
    pub jokers: u8,
    /// Cards dealt to a hand in these games.
    pub hand_size: u8,
    /// The rule set it was trained under, as the protocol's JSON, for display only. May be empty.
    pub rules: String,
    /// Display name. May be empty.
    pub name: String,
    /// The training command. May be empty.
    pub trained_by: String,
}

/// A multilayer perceptron that plays the legal action with the highest output.
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

    /// The metadata of its file.
    pub fn info(&self) -> &NetworkInfo {
        &self.info
    }

    /// Whether it was trained for as many players, faces and cards dealt, whatever the jokers. In
    /// other games it plays as `greedy`.
    pub fn fits(&self, rules: &RuleSet) -> bool {
        usize::from(self.info.players) == rules.players()
            && self.info.faces == rules.faces()
            && self.info.hand_size == rules.hand_size()
    }

    /// The input for an observation.
    ///
    /// # Panics
    /// If the observation's game does not [fit](Network::fits) the network.
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

    /// The T or A outputs for an input from [`Network::features`]. After tanh the last digits may
    /// differ between platforms.
    ///
    /// # Panics
    /// If the input has the wrong length.
    pub fn outputs(&self, features: &[f32]) -> Vec<f32> {
        let last = self.last_hidden(features);
        (0..self.output.len())
            .map(|index| self.output.value(index, &last))
            .map(|sum| if self.info.tanh { sum.tanh() } else { sum })
            .collect()
    }

    /// Chooses the legal action with the highest output before tanh, the lowest index of equals.
    /// NaN, from weights too large to sum, counts as the lowest. Without an output for the decision
    /// takes the default action ([`Observation::default_action`]). In a game that the network does
    /// not fit plays as the built-in agent `greedy`.
    ///
    /// # Panics
    /// If `legal` is empty.
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
            // Before tanh, which keeps the order but differs between platforms and saturates. NaN
            // compares as not greater.
            let sum = self.output.value(index, &last);
            if sum > highest {
                (best, highest) = (action, sum);
            }
        }
        best
    }

    /// Whether the observation's numbers of seats, faces and cards dealt are those of training.
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
    /// Both inputs.
    const ALL: [NetworkInput; 2] = [NetworkInput::Classic, NetworkInput::Table];

    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            NetworkInput::Classic => "classic",
            NetworkInput::Table => "table",
        }
    }

    /// The length of the input in games of `rules`.
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
    /// Both kinds.
    const ALL: [NetworkOutput; 2] = [NetworkOutput::Turns, NetworkOutput::Actions];

    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            NetworkOutput::Turns => "turns",
            NetworkOutput::Actions => "actions",
        }
    }

    /// The number of outputs.
    fn len(self, space: ActionSpace) -> usize {
        usize::from(match self {
            NetworkOutput::Turns => space.turn_actions(),
            NetworkOutput::Actions => space.size(),
        })
    }
}
