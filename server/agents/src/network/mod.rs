//! Agents that play by a network: what a network is. `features` computes the inputs, `layers` the
//! outputs, `batch` decides from them, `file` reads network files. The Python package trains
//! networks.

mod batch;
mod features;
mod file;
mod layers;
mod sparse;

use std::sync::{Arc, LazyLock};

use chefshat_engine::{ActionId, ActionSpace, DecisionKind, Mask, Observation, RuleSet};

use crate::greedy::greedy;
pub use batch::NetworkBatch;
pub use features::table_features;
use layers::{Hidden, Output};

pub use file::{MAX_FILE_BYTES, NetworkError};

/// The network of the built-in agent `trained`, loaded once.
static TRAINED: LazyLock<Arc<Network>> = LazyLock::new(|| {
    Arc::new(Network::from_bytes(Network::TRAINED_FILE).expect("the embedded file is valid"))
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

/// Identifies a network: the first 16 bytes of the SHA-256 of its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NetworkId(pub [u8; 16]);

/// A multilayer perceptron that plays the legal action with the highest output.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    id: NetworkId,
    info: NetworkInfo,
    /// Length of the input.
    inputs: usize,
    hidden: Vec<Hidden>,
    output: Output,
}

impl Network {
    /// The file of the network of the built-in agent `trained`.
    pub const TRAINED_FILE: &[u8] = include_bytes!("trained.safetensors");

    /// The network of the built-in agent `trained`, which is part of the program.
    pub fn trained() -> &'static Arc<Network> {
        &TRAINED
    }

    /// Identifies its file.
    pub fn id(&self) -> NetworkId {
        self.id
    }

    /// The metadata of its file.
    pub fn info(&self) -> &NetworkInfo {
        &self.info
    }

    /// The most multiplications for a decision: all weights, where the units of each hidden layer
    /// are counted up to the next multiple of 32.
    pub fn multiplications(&self) -> u64 {
        let hidden: usize = self.hidden.iter().map(Hidden::weights).sum();
        (hidden + self.output.weights()) as u64
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

    /// The action that [`Network::decide`] takes, if it depends on no output: there is no choice, no
    /// output for the decision, or the network does not fit the game.
    ///
    /// # Panics
    /// If `legal` is empty.
    fn decide_without_outputs(&self, observation: &Observation, legal: &Mask) -> Option<ActionId> {
        if !self.knows(observation) {
            let space =
                ActionSpace::new(observation.faces).expect("an observation has 4 to 15 faces");
            return Some(greedy(observation, legal, space));
        }
        if self.info.output == NetworkOutput::Turns && observation.kind != Some(DecisionKind::Turn)
        {
            let action = observation.default_action(legal);
            return Some(action.expect("a decision has a legal action"));
        }
        let first = legal.nth(0).expect("a decision has a legal action");
        (legal.len() == 1).then_some(first)
    }

    /// Whether the observation's numbers of seats, faces and cards dealt are those of training.
    fn knows(&self, observation: &Observation) -> bool {
        observation.cards_left.len() == usize::from(self.info.players)
            && observation.faces == self.info.faces
            && observation.hand_size == self.info.hand_size
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
