//! The policy of a room, validated: times, limits and manners.

use std::time::Duration;

use chefshat_agents::AgentKind;
use chefshat_engine::RewardScheme;

use crate::journal::ParticipantKind;

/// When a game is given up because its participants are gone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AbortPolicy {
    /// When every seat that is not a built-in agent's has been substituted.
    AllLost,
    /// When one seat would be substituted.
    AnyLost,
    /// Never.
    Never,
}

/// What a game outlives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Durability {
    /// The death of the server.
    Durable,
    /// Nothing: it is kept when it ends.
    Ephemeral,
}

/// Times for participants of one kind, in place of the room's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KindClock {
    /// The kind.
    pub kind: ParticipantKind,
    /// Time for a decision, if it is another.
    pub decision_time: Option<Duration>,
    /// The bank, if it is another.
    pub bank: Option<Duration>,
}

impl KindClock {
    /// The standard times of people.
    pub const PEOPLE: Self = Self {
        kind: ParticipantKind::Human,
        decision_time: Some(Duration::from_secs(60)),
        bank: Some(Duration::from_secs(300)),
    };
}

/// What a built-in agent or substitute waits before it decides where a person plays and nobody says otherwise.
const PACE_WITH_PEOPLE: Duration = Duration::from_secs(1);

/// A room's policy. Made by `convert::policy`, which checks the ranges stated in `room.proto`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Policy {
    /// Time for a decision.
    pub decision_time: Duration,
    /// What each seat may use beyond that over the whole game.
    pub bank: Duration,
    /// Invalid attempts after which the default decision is taken; `None`: unlimited.
    pub max_invalid_attempts: Option<u32>,
    /// Decisions in a row lost to the clock before a seat is substituted.
    pub max_timeouts: u32,
    /// Who plays for a substituted seat.
    pub substitute: AgentKind,
    /// When the game is aborted instead.
    pub abort: AbortPolicy,
    /// Rewards told to seats.
    pub reward_scheme: Option<RewardScheme>,
    /// How long a built-in agent or substitute waits before it decides; `None`: as suits who plays.
    pub pace: Option<Duration>,
    /// How long the room waits for its seats.
    pub waiting_time: Duration,
    /// Whether spectators may watch.
    pub spectators: bool,
    /// By how many decisions spectators are behind.
    pub spectator_delay_decisions: usize,
    /// Whether spectators see all hands.
    pub spectators_see_hands: bool,
    /// What the game outlives.
    pub durability: Durability,
    /// Other times for participants of some kinds, each at most once.
    pub clocks: Vec<KindClock>,
}

impl Policy {
    /// Time for a decision of a participant; of a built-in agent (`None`) it is the room's.
    pub fn decision_time_of(&self, kind: Option<ParticipantKind>) -> Duration {
        (self.clock_of(kind).and_then(|clock| clock.decision_time)).unwrap_or(self.decision_time)
    }

    /// What a participant may use beyond that over the whole game.
    pub fn bank_of(&self, kind: Option<ParticipantKind>) -> Duration {
        (self.clock_of(kind).and_then(|clock| clock.bank)).unwrap_or(self.bank)
    }

    /// How long a built-in agent or substitute waits before it decides, in a game that a person plays in or not.
    pub fn pace_of(&self, with_people: bool) -> Duration {
        let standard = match with_people {
            true => PACE_WITH_PEOPLE,
            false => Duration::ZERO,
        };
        self.pace.unwrap_or(standard)
    }

    fn clock_of(&self, kind: Option<ParticipantKind>) -> Option<&KindClock> {
        self.clocks.iter().find(|clock| Some(clock.kind) == kind)
    }
}

impl Default for Policy {
    fn default() -> Self {
        Self {
            decision_time: Duration::from_secs(10),
            bank: Duration::from_secs(60),
            max_invalid_attempts: Some(10),
            max_timeouts: 3,
            substitute: AgentKind::Random,
            abort: AbortPolicy::AllLost,
            reward_scheme: None,
            pace: None,
            waiting_time: Duration::from_secs(3600),
            spectators: true,
            spectator_delay_decisions: 0,
            spectators_see_hands: false,
            durability: Durability::Durable,
            clocks: vec![KindClock::PEOPLE],
        }
    }
}
