//! A stored game: its header and its changes. Events and records follow from folding the changes
//! again. Each store has its own encoding of these values.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use chefshat_agents::{NamedAgent, RecordedPlayer};
use chefshat_engine::SeedPlan;
pub use chefshat_engine::TakenOver;
use chefshat_engine::{ActionId, RuleSet, Script, Seat};
pub use chefshat_referee::Report;

use crate::ids::{GameId, RoomId, SecretHash, SeriesId, StudyId, TournamentId, UnitId};
use crate::policy::Policy;
pub use chefshat_agents::ParticipantKind;

/// What fills a seat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fill {
    /// Open to join, to one kind of participant or to all.
    Open {
        /// The kind, if reserved.
        reserved_for: Option<ParticipantKind>,
    },
    /// A built-in agent.
    BuiltIn(NamedAgent),
    /// A built-in agent that imitates a recorded player.
    Replay(RecordedSeat),
    /// A player of this kind who sits at the physical table with real cards. Nobody connects.
    AtTable(ParticipantKind),
}

impl Fill {
    /// Whether a built-in agent has the seat.
    pub fn is_built_in(&self) -> bool {
        matches!(self, Self::BuiltIn(_) | Self::Replay(_))
    }
}

/// A seat of a recorded game.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RecordedSeat {
    /// The recorded game.
    pub game: GameId,
    /// The seat in it.
    pub seat: Seat,
}

/// How a game starts; by default with a deal.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct GameStart {
    /// The first Shift, if its hands are given.
    pub script: Option<Script>,
    /// The record it branches from.
    pub branch: Option<Branch>,
}

/// What a game takes over from the record of another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Branch {
    /// The recorded game.
    pub game: GameId,
    /// Whether later Shifts are dealt as in the recorded game.
    pub same_deals: bool,
    /// The decisions taken over, in order. Not empty, because the first Shift's seed comes with
    /// them.
    pub taken_over: Vec<TakenOver>,
}

/// The tournament a game belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TournamentGame {
    /// The tournament.
    pub tournament: TournamentId,
    /// The series of games with the same deals. Until all of them have ended, nothing that could
    /// reveal the deals is published.
    pub series: Option<SeriesId>,
}

/// The study a game belongs to. Nothing of it reaches the game's participants.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyGame {
    /// The study.
    pub study: StudyId,
    /// Name of the study for researchers.
    pub name: String,
    /// Id of the condition.
    pub condition: String,
    /// The condition's level of each factor.
    pub levels: BTreeMap<String, String>,
    /// Its participants, in the order of their numbers: one, or those of a group.
    pub members: Vec<StudyMember>,
    /// Number of the group that plays it, from 1; `None`: somebody plays it alone.
    pub group: Option<u32>,
    /// The step in which it is played, from 0.
    pub step: u32,
    /// Whether it is practice.
    pub practice: bool,
    /// Index of its seed in the preregistered list; `None` for practice.
    pub seed_index: Option<u32>,
    /// Attempt at this game, from 1.
    pub attempt: u32,
    /// What everybody but the study's owner learns about the seats.
    pub labels: SeatLabels,
}

impl StudyGame {
    /// Whether one of its participants has this seat.
    pub fn has(&self, seat: Seat) -> bool {
        self.members.iter().any(|member| member.seat == seat)
    }
}

/// A participant of a study in a game.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyMember {
    /// Number of the participant, from 1.
    pub number: u32,
    /// Pseudonym of the participant.
    pub participant: String,
    /// Number of the session in which the participant began the game, from 1.
    pub session: u32,
    /// The participant's seat.
    pub seat: Seat,
}

/// What is shown of the participants of a room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SeatLabels {
    /// Names and kinds.
    #[default]
    AsTheyAre,
    /// Kinds: "Agent 1".
    Kinds,
    /// Not even kinds: "Player 1".
    Players,
}

/// Everything about a game that is fixed before it starts.
#[derive(Debug, Clone)]
pub struct GameHeader {
    /// The room.
    pub room_id: RoomId,
    /// The game.
    pub game_id: GameId,
    /// Display name.
    pub name: String,
    /// The rules.
    pub rules: RuleSet,
    /// Version of the rules it is played by.
    pub rules_version: u32,
    /// Version of the server that created it.
    pub server_version: String,
    /// The policy.
    pub policy: Policy,
    /// What fills each seat.
    pub fills: Vec<Fill>,
    /// Open seats that a person plays as the kind that they are reserved for (Wizard of Oz).
    /// Nothing depends on it but the record.
    pub wizards: BTreeSet<usize>,
    /// Display names of built-in agents, by seat, if set.
    pub display_names: BTreeMap<usize, String>,
    /// Recorded players, by seat.
    pub recorded: BTreeMap<usize, Arc<RecordedPlayer>>,
    /// How the game starts.
    pub start: GameStart,
    /// Where the game seed comes from.
    pub seed: SeedPlan,
    /// When the room was created, milliseconds since the Unix epoch.
    pub created_at_ms: u64,
    /// The join code, in its normal form.
    pub join_code: String,
    /// The creator's token, hashed.
    pub owner: SecretHash,
    /// The tournament it belongs to, if any.
    pub tournament: Option<TournamentGame>,
    /// The ticket of the physical table, hashed; `None`: the server deals the cards.
    pub table: Option<SecretHash>,
    /// The study it belongs to, if any.
    pub study: Option<Arc<StudyGame>>,
    /// Whether a participant was deleted from it after it had ended.
    pub participant_removed: bool,
}

impl GameHeader {
    /// What is shown of its participants, other than in its record.
    pub fn labels(&self) -> SeatLabels {
        (self.study.as_ref()).map_or(SeatLabels::AsTheyAre, |game| game.labels)
    }

    /// Whether the participants of seats are hidden: in a study that shows labels.
    pub fn hides_seats(&self) -> bool {
        self.labels() != SeatLabels::AsTheyAre
    }

    /// Whether a seat's participant is hidden: in a study that shows labels, every seat but that of
    /// the study's participant, and of a group every seat, because nobody may know which are of
    /// people. What is shown of such a seat, and when, does not depend on what fills it.
    pub fn is_hidden(&self, seat: Seat) -> bool {
        let study = self.study.as_ref();
        self.hides_seats() && study.is_some_and(|game| game.group.is_some() || !game.has(seat))
    }

    /// Whether a participant of a study has the seat.
    pub fn is_of_study(&self, seat: Seat) -> bool {
        self.study.as_ref().is_some_and(|game| game.has(seat))
    }

    /// The series of games with the same deals.
    pub fn series(&self) -> Option<SeriesId> {
        self.tournament.and_then(|game| game.series)
    }

    /// What changes hands together in a cluster: its tournament or study, or the room alone.
    pub fn unit(&self) -> UnitId {
        let study = self.study.as_ref().map(|game| game.study.unit());
        let tournament = self.tournament.map(|game| game.tournament.unit());
        tournament.or(study).unwrap_or(self.room_id.unit())
    }

    /// Whether the cards are real.
    pub fn is_physical(&self) -> bool {
        self.table.is_some()
    }
}

/// One change of a game.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Time since the room was created.
    pub at: Duration,
    /// The change.
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
    /// Reported from the physical table.
    Table,
}

/// Why a game has no result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AbortReason {
    /// Closed by its owner.
    Closed,
    /// The server shut down.
    Shutdown,
    /// Participants were lost, or nothing was reported from the physical table for too long.
    ParticipantsLost,
    /// It waited too long for its seats.
    NeverStarted,
    /// It grew beyond the limit of events.
    TooLong,
}

/// A change of a game.
#[derive(Debug, Clone)]
pub enum Change {
    /// A participant took a seat.
    Seated {
        /// The seat.
        seat: Seat,
        /// The participant.
        participant: Box<SeatedParticipant>,
    },
    /// A seat that was never attached became free again.
    Vacated(Seat),
    /// The game started.
    Started {
        /// The seats' contributions to the game seed, in seat order.
        entropy: Vec<Vec<u8>>,
    },
    /// A seat's agent lost its connection.
    Disconnected {
        /// The seat.
        seat: Seat,
        /// Whether it was lost together with the node that it was connected to.
        with_node: bool,
    },
    /// A seat's agent plays again.
    Returned(Seat),
    /// A built-in agent plays for a seat from now on.
    Substituted(Seat),
    /// The participant of a seat has left the tournament or study: a built-in agent plays for it until the
    /// end.
    Retired(Seat),
    /// A seat answered with an illegal action.
    Attempted {
        /// The seat.
        seat: Seat,
        /// The action, as it was sent.
        action: u32,
    },
    /// A seat was given a hint for its open decision.
    Hinted(Seat),
    /// A decision was taken.
    Decided(Decided),
    /// A seat expressed something.
    Expressed {
        /// The seat.
        seat: Seat,
        /// For the record only.
        record_only: bool,
        /// The message `chefshat.v1.Expression`, encoded.
        expression: Box<[u8]>,
    },
    /// The owner marked a moment.
    Marked(Box<Marked>),
    /// The game ended without a result.
    Aborted(AbortReason),
    /// The server was restarted; all connections were lost.
    ServerRestarted,
    /// Something was reported from the physical table.
    Reported(Box<Reported>),
    /// At a physical table, nobody corrected the play that ended the game in time.
    EndConfirmed,
}

/// A moment that the owner of the room marked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Marked {
    /// What the marker says.
    pub label: String,
    /// The time since the room was created.
    pub moment: Duration,
}

/// A marker of a room.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Marker {
    /// Time since the room was created, when the marker was received.
    pub received: Duration,
    /// What it marks.
    pub marked: Marked,
}

/// Something reported from the physical table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reported {
    /// Chosen by the client; identifies the report in its room.
    pub id: String,
    /// Who reports.
    pub source: ReportSource,
    /// The time between the event and the report.
    pub age: Duration,
    /// The report.
    pub report: Report,
}

impl Reported {
    /// Whether a report with the same id says the same. A repetition may be older.
    pub(super) fn is_repeated_by(&self, other: &Self) -> bool {
        self.source == other.source && self.report == other.report
    }
}

/// Who reports from a physical table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReportSource {
    /// A camera.
    Camera,
    /// A person who attends to the table.
    Attendant,
    /// A robot, by what it did itself.
    Robot,
}

/// A participant that took a seat.
#[derive(Debug, Clone)]
pub struct SeatedParticipant {
    /// Display name.
    pub name: String,
    /// The fingerprint of its name and key; empty if it has no key.
    pub name_fingerprint: String,
    /// Its kind.
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
    /// Time left in the seat's bank, milliseconds.
    pub bank_left_ms: u32,
    /// The message `chefshat.v1.Annotations`, encoded.
    pub annotations: Option<Box<[u8]>>,
    /// The annotations say that another agent decided, the participant's fallback.
    pub by_fallback: bool,
}
