//! What a game is kept as: its header and every change that moved it. Everything else (events, records) follows by folding the changes
//! again. The form on disk belongs to the store that writes one; here are the values.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use chefshat_agents::{AgentKind, RecordedPlayer};
use chefshat_engine::SeedPlan;
pub use chefshat_engine::TakenOver;
use chefshat_engine::{ActionId, RuleSet, Script, Seat};

use crate::ids::{Id, SecretHash};
use crate::policy::Policy;

/// What fills a seat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fill {
    /// Open to join, to one kind of participant or to all.
    Open {
        /// The kind, if reserved.
        reserved_for: Option<ParticipantKind>,
    },
    /// A built-in agent.
    BuiltIn(AgentKind),
    /// A built-in agent that plays what a recorded player played.
    Replay(RecordedSeat),
}

impl Fill {
    /// Whether a built-in agent has the seat.
    pub fn is_built_in(&self) -> bool {
        !matches!(self, Self::Open { .. })
    }
}

/// A seat of a recorded game.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RecordedSeat {
    /// The recorded game.
    pub game: Id,
    /// The seat in it.
    pub seat: Seat,
}

/// How a game begins. The standard is a deal.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct GameStart {
    /// The first Shift, where its hands are given.
    pub script: Option<Script>,
    /// The record it branches from.
    pub branch: Option<Branch>,
}

/// What a game takes over from the record of another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Branch {
    /// The recorded game.
    pub game: Id,
    /// Whether later Shifts are dealt as in the recorded game.
    pub same_deals: bool,
    /// What is taken over, in order; not empty, so that the seed of its first Shift is known.
    pub taken_over: Vec<TakenOver>,
}

/// What a participant is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParticipantKind {
    /// A program.
    Agent,
    /// A person.
    Human,
    /// A robot.
    Robot,
}

/// The tournament a game belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TournamentGame {
    /// The tournament.
    pub tournament: Id,
    /// The games that are dealt like it; until all of them have ended, what could tell the deals is withheld.
    pub series: Option<Id>,
}

/// Everything about a game that stands before it begins.
#[derive(Debug, Clone)]
pub struct GameHeader {
    /// The room.
    pub room_id: Id,
    /// The game.
    pub game_id: Id,
    /// Name to show.
    pub name: String,
    /// The rules.
    pub rules: RuleSet,
    /// Version of the rules it is played by.
    pub rules_version: u32,
    /// The policy.
    pub policy: Policy,
    /// What fills each seat.
    pub fills: Vec<Fill>,
    /// Names of built-in agents that go by others than their own, by seat.
    pub called: BTreeMap<usize, String>,
    /// The recorded players of the seats that are filled by one, by seat.
    pub recorded: BTreeMap<usize, Arc<RecordedPlayer>>,
    /// How the game begins.
    pub start: GameStart,
    /// Where the game seed comes from.
    pub seed: SeedPlan,
    /// When the room was created, milliseconds since the Unix epoch.
    pub created_at_ms: u64,
    /// The join code, in its normal form.
    pub join_code: String,
    /// The creator's token, hashed.
    pub owner: SecretHash,
    /// The tournament it belongs to.
    pub tournament: Option<TournamentGame>,
}

impl GameHeader {
    /// The games that are dealt like this one.
    pub fn series(&self) -> Option<Id> {
        self.tournament.and_then(|game| game.series)
    }
}

/// One change of a game.
#[derive(Debug, Clone)]
pub struct Entry {
    /// When, since the room was created.
    pub at: Duration,
    /// What.
    pub change: Change,
}

/// Who or what took a decision.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// The seat's own agent.
    Agent,
    /// The default: time ran out while the agent was connected.
    Timeout,
    /// The default: invalid attempts were exhausted.
    Invalid,
    /// The default: time ran out while no agent was connected.
    Disconnected,
    /// A built-in agent in place of the seat's own.
    Substitute,
    /// Taken over from the record that the game branches from.
    Recorded,
}

/// Why a game has no result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AbortReason {
    /// Closed by its owner.
    Closed,
    /// The server shut down.
    Shutdown,
    /// Participants were lost.
    ParticipantsLost,
    /// It waited too long for its seats.
    NeverStarted,
    /// It grew beyond the limit of events.
    TooLong,
}

/// What happened.
#[derive(Debug, Clone)]
pub enum Change {
    /// A participant took a seat.
    Seated {
        /// The seat.
        seat: Seat,
        /// Who.
        participant: Box<SeatedParticipant>,
    },
    /// A seat that was never attached became free again.
    Vacated(Seat),
    /// The game began, with what the seats added to its seed.
    Started {
        /// Each seat's bytes, in seat order.
        entropy: Vec<Vec<u8>>,
    },
    /// A seat's agent lost its connection.
    Disconnected(Seat),
    /// A seat's agent plays again.
    Returned(Seat),
    /// A built-in agent plays for a seat from now on.
    Substituted(Seat),
    /// An action that is not legal was answered.
    Attempted {
        /// The seat.
        seat: Seat,
        /// The action, as it was sent.
        action: u32,
    },
    /// A decision was taken.
    Decided(Decided),
    /// Somebody expressed something.
    Expressed {
        /// By whom.
        seat: Seat,
        /// For the record only.
        record_only: bool,
        /// The message `chefshat.v1.Expression`, encoded.
        expression: Box<[u8]>,
    },
    /// The game ended without a result.
    Aborted(AbortReason),
    /// The server was restarted; all connections were lost.
    ServerRestarted,
}

/// A participant that took a seat.
#[derive(Debug, Clone)]
pub struct SeatedParticipant {
    /// Name to show.
    pub name: String,
    /// What it is.
    pub kind: ParticipantKind,
    /// Its ticket, hashed.
    pub ticket: SecretHash,
}

/// A decision that was taken.
#[derive(Debug, Clone)]
pub struct Decided {
    /// The seat.
    pub seat: Seat,
    /// The action.
    pub action: ActionId,
    /// Who or what took it.
    pub source: Source,
    /// Measured decision time, microseconds; 0 for built-in agents.
    pub time_us: u64,
    /// What is left in the seat's bank, milliseconds.
    pub bank_left_ms: u32,
    /// The message `chefshat.v1.Annotations`, encoded.
    pub annotations: Option<Box<[u8]>>,
}
