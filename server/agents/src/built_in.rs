//! The built-in agents. An agent's choice depends only on what its seat may know and on its own
//! generator. `play` (offline) and the server's rooms ask them; `greedy`, `recorded` and `network`
//! hold the larger policies.

use std::sync::Arc;

use chefshat_engine::{
    ActionId, ActionSpace, DecisionKind, Event, Mask, Observation, RuleSet, Seat,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

use crate::greedy::greedy;
use crate::{Network, RecordedPlayer};

/// The built-in agents that need nothing but a seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum AgentKind {
    /// Uniform over the legal actions.
    #[default]
    Random,
    /// At a turn uniform over all T actions of a turn, legal or not (the paper's random agent);
    /// otherwise like `Random`.
    RandomUnmasked,
    /// Plays as many of its commonest cards as it can, keeps jokers, gives away its commonest card.
    Greedy,
    /// Plays by a network trained in self-play that is part of the program ([`Network::trained`]).
    Trained,
}

impl AgentKind {
    /// All kinds.
    pub const ALL: [Self; 4] = [
        Self::Random,
        Self::RandomUnmasked,
        Self::Greedy,
        Self::Trained,
    ];

    /// The name in messages and commands.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::RandomUnmasked => "random_unmasked",
            Self::Greedy => "greedy",
            Self::Trained => "trained",
        }
    }

    /// The kind with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// The kind with this name that may play rollouts, in which all actions are legal.
    pub fn of_rollouts(name: &str) -> Option<Self> {
        Self::from_name(name).filter(|kind| *kind != Self::RandomUnmasked)
    }
}

/// An agent of an upper crate, which follows the events of the game besides its observations.
pub trait Following: std::fmt::Debug + Send + Sync {
    /// The name in messages and commands.
    fn name(&self) -> &'static str;

    /// Called for every event of the game. The agent may use only what `seat`, which it plays, may
    /// see of it ([`Event::seen_by`]).
    fn on_event(&mut self, seat: Seat, event: &Event);

    /// Chooses one of the legal actions.
    fn decide(&mut self, observation: &Observation, legal: &Mask) -> ActionId;

    /// A copy that decides alike.
    fn boxed_clone(&self) -> Box<dyn Following>;
}

impl Clone for Box<dyn Following> {
    fn clone(&self) -> Self {
        self.boxed_clone()
    }
}

/// Creates agents of an upper crate: [`BuiltInAgent::following`] ones.
pub trait AgentMaker: std::fmt::Debug + Send + Sync {
    /// The agent for a seat of a game under these rules. `seed` determines its random choices.
    fn agent(&self, rules: &RuleSet, seed: [u8; 32]) -> BuiltInAgent;
}

/// A built-in agent.
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
    /// An agent that needs nothing but a seed, with its generator.
    Kind(AgentKind, Chance),
    /// Imitates a recorded player.
    Replay(Arc<RecordedPlayer>),
    /// Plays by a network.
    Network(Arc<Network>),
    /// An agent of an upper crate.
    Following(Box<dyn Following>),
}

impl BuiltInAgent {
    /// Name of agents created by [`BuiltInAgent::replay`].
    pub const REPLAY: &str = "replay";
    /// Name of agents created by [`BuiltInAgent::network`].
    pub const NETWORK: &str = "network";

    /// An agent of a kind. `seed` determines its random choices.
    pub fn new(kind: AgentKind, seed: [u8; 32]) -> Self {
        Self {
            mind: Mind::Kind(kind, Chance(ChaCha8Rng::from_seed(seed))),
        }
    }

    /// An agent that imitates a recorded player. It has no generator.
    pub fn replay(player: Arc<RecordedPlayer>) -> Self {
        Self {
            mind: Mind::Replay(player),
        }
    }

    /// An agent that plays by a network. It has no generator.
    pub fn network(network: Arc<Network>) -> Self {
        Self {
            mind: Mind::Network(network),
        }
    }

    /// An agent of an upper crate.
    pub fn following(agent: Box<dyn Following>) -> Self {
        Self {
            mind: Mind::Following(agent),
        }
    }

    /// The name in messages and commands.
    pub fn name(&self) -> &'static str {
        match &self.mind {
            Mind::Kind(kind, _) => kind.name(),
            Mind::Replay(_) => Self::REPLAY,
            Mind::Network(_) => Self::NETWORK,
            Mind::Following(agent) => agent.name(),
        }
    }

    /// Whether it must see the events of the game ([`BuiltInAgent::on_event`]).
    pub fn follows_events(&self) -> bool {
        matches!(self.mind, Mind::Following(_))
    }

    /// Shows an event of the game to the agent of a seat, which uses only what the seat may see.
    pub fn on_event(&mut self, seat: Seat, event: &Event) {
        if let Mind::Following(agent) = &mut self.mind {
            agent.on_event(seat, event);
        }
    }

    /// Whether its choices depend on how often it was asked before. If not, they depend on the
    /// observation alone.
    pub fn has_generator(&self) -> bool {
        match &self.mind {
            Mind::Kind(kind, _) => matches!(kind, AgentKind::Random | AgentKind::RandomUnmasked),
            Mind::Replay(_) | Mind::Network(_) => false,
            Mind::Following(_) => true,
        }
    }

    /// How many random words the agent has drawn; `None` if it has no generator. With its seed, this
    /// is its complete state.
    pub fn position(&self) -> Option<u128> {
        match &self.mind {
            Mind::Kind(_, chance) if self.has_generator() => Some(chance.0.get_word_pos()),
            _ => None,
        }
    }

    /// Continues after this many random words, modulo 2^68, the period of the generator. Does
    /// nothing without a generator.
    pub fn set_position(&mut self, position: u128) {
        if let Mind::Kind(_, chance) = &mut self.mind {
            chance.0.set_word_pos(position);
        }
    }

    /// Chooses an action: one of `legal`, except that `random_unmasked` may choose any of the T
    /// actions at a turn.
    ///
    /// # Panics
    /// If `legal` is empty.
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
            Mind::Following(agent) => agent.decide(observation, legal),
        }
    }
}

/// The random numbers of an agent.
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

    /// A number below `n`. Implemented here so that no library update changes seeded results. The
    /// bias is below 400 / 2^32.
    fn below(&mut self, n: u16) -> u16 {
        let number = (u64::from(self.0.next_u32()) * u64::from(n)) >> 32;
        u16::try_from(number).expect("the number is below n")
    }
}
