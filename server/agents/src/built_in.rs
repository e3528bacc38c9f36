//! The built-in agents. Each is a function of what its seat may know and of its own generator or its own past, and of nothing else. Who asks
//! them, and what follows from an answer, is decided in `play` (offline) and by the server's rooms; what `replay` does is in `recorded`, how a
//! network decides in `network`.

use std::sync::Arc;

use chefshat_engine::{ActionId, ActionSpace, DecisionKind, Mask, Observation};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

use crate::greedy::greedy;
use crate::{Network, RecordedPlayer};

/// Which built-in agent, of those that need nothing but a seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum AgentKind {
    /// Uniform over the legal actions.
    #[default]
    Random,
    /// At a turn uniform over all T actions of a turn, valid or not (the paper's random agent); elsewhere as `Random`.
    RandomUnmasked,
    /// Sheds as many of its least rare cards as it can, keeps jokers, gives away its worst.
    Greedy,
    /// Plays by a network that was trained by self-play and is part of the program ([`Network::trained`]).
    Trained,
}

impl AgentKind {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::Random,
        Self::RandomUnmasked,
        Self::Greedy,
        Self::Trained,
    ];

    /// The name by which people and messages call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::RandomUnmasked => "random_unmasked",
            Self::Greedy => "greedy",
            Self::Trained => "trained",
        }
    }

    /// The agent of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// A built-in agent, ready to decide.
#[derive(Debug, Clone)]
pub struct BuiltInAgent {
    mind: Mind,
}

#[derive(Debug, Clone)]
#[allow(
    clippy::large_enum_variant,
    reason = "nearly all are of the large variant, and a box would cost offline games an allocation for each agent"
)]
enum Mind {
    /// An agent of a kind, with its generator.
    Kind(AgentKind, Chance),
    /// One that plays as a recorded player.
    Replay(Arc<RecordedPlayer>),
    /// One that plays from a network file.
    Network(Arc<Network>),
}

impl BuiltInAgent {
    /// Name of the agents that [`BuiltInAgent::replay`] makes.
    pub const REPLAY: &str = "replay";
    /// Name of the agents that [`BuiltInAgent::network`] makes.
    pub const NETWORK: &str = "network";

    /// An agent whose choices follow from `seed` alone.
    pub fn new(kind: AgentKind, seed: [u8; 32]) -> Self {
        Self {
            mind: Mind::Kind(kind, Chance(ChaCha8Rng::from_seed(seed))),
        }
    }

    /// An agent that plays as a recorded player. Its choices follow from what it sees alone.
    pub fn replay(player: Arc<RecordedPlayer>) -> Self {
        Self {
            mind: Mind::Replay(player),
        }
    }

    /// An agent that plays by a network. Its choices follow from what it sees alone.
    pub fn network(network: Arc<Network>) -> Self {
        Self {
            mind: Mind::Network(network),
        }
    }

    /// The name by which people and messages call it.
    pub fn name(&self) -> &'static str {
        match &self.mind {
            Mind::Kind(kind, _) => kind.name(),
            Mind::Replay(_) => Self::REPLAY,
            Mind::Network(_) => Self::NETWORK,
        }
    }

    /// Whether its choices depend on how often it was asked before. Otherwise they follow from what it sees alone.
    pub fn has_generator(&self) -> bool {
        match &self.mind {
            Mind::Kind(kind, _) => matches!(kind, AgentKind::Random | AgentKind::RandomUnmasked),
            Mind::Replay(_) | Mind::Network(_) => false,
        }
    }

    /// Decides. The action is one of `legal`, except that `random_unmasked` may answer a turn with any of its T actions.
    ///
    /// # Panics
    /// When `legal` is empty: there is no decision to take.
    pub fn decide(&mut self, observation: &Observation, legal: &Mask) -> ActionId {
        let space = ActionSpace::new(observation.faces).expect("an observation has 4 to 15 faces");
        let turn = observation.kind == Some(DecisionKind::Turn);
        match &mut self.mind {
            Mind::Kind(AgentKind::RandomUnmasked, chance) if turn => {
                ActionId::new(chance.below(space.turn_actions()))
            }
            Mind::Kind(AgentKind::Random | AgentKind::RandomUnmasked, chance) => {
                chance.uniform(legal)
            }
            Mind::Kind(AgentKind::Greedy, _) => greedy(observation, legal, space),
            Mind::Kind(AgentKind::Trained, _) => Network::trained().decide(observation, legal),
            Mind::Replay(player) => player.decide(observation, legal),
            Mind::Network(network) => network.decide(observation, legal),
        }
    }
}

/// Where the choices of an agent come from.
#[derive(Debug, Clone)]
struct Chance(ChaCha8Rng);

impl Chance {
    fn uniform(&mut self, legal: &Mask) -> ActionId {
        assert!(!legal.is_empty(), "a decision has a legal action");
        let count = u16::try_from(legal.len()).expect("a mask has below 400 actions");
        legal
            .nth(usize::from(self.below(count)))
            .expect("the index is below the number of actions")
    }

    /// A number below `n`. Spelled out, so that no library's next version changes what a seed brings about. Its bias, that of a
    /// multiplication with 32 random bits, is below 400 / 2^32.
    fn below(&mut self, n: u16) -> u16 {
        let number = (u64::from(self.0.next_u32()) * u64::from(n)) >> 32;
        u16::try_from(number).expect("the number is below n")
    }
}
