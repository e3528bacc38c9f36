//! Inputs and outputs of the core of a room: answers, their results, and why a request is refused.

use std::time::Duration;

use crate::journal::{Fill, SeatedParticipant};
use crate::limits::{MAX_EXPRESSIONS_PER_SEAT, MAX_HINTS, MAX_SEATINGS};
use chefshat_referee::Refusal;
pub use chefshat_referee::Verdict as ReportVerdict;

/// The public state of a seat.
#[derive(Debug, Clone, Copy)]
pub struct SeatStanding<'a> {
    /// What fills it.
    pub fill: Fill,
    /// The participant who has taken it.
    pub participant: Option<&'a SeatedParticipant>,
    /// Whether an agent is attached.
    pub connected: bool,
    /// Whether a substitute plays for it.
    pub substituted: bool,
}

/// Why a seat cannot be taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum JoinError {
    /// All seats are taken.
    #[error("every seat of this room is taken")]
    RoomFull,
    /// Seats were taken and freed too often.
    #[error("seats of this room were taken {MAX_SEATINGS} times; create a new room")]
    TooManySeatings,
    /// The requested seat is taken.
    #[error("this seat is taken; leave `seat` unset to take any free one")]
    SeatTaken,
    /// There is no such seat.
    #[error("this room has no such seat")]
    NoSuchSeat,
    /// The free seats are reserved for other kinds.
    #[error("the free seats of this room are reserved for participants of another kind")]
    KindNotAdmitted,
    /// The client has a seat, and the room's policy gives each client one.
    #[error("this client has a seat of this room, whose policy gives each client one")]
    ClientHasSeat,
    /// The request id was used for another participant.
    #[error("this request id was used with another name, kind or seat; draw a new one")]
    RequestIdUsed,
    /// The game has started.
    #[error("the game of this room has already started; joining is no longer possible")]
    GameStarted,
    /// The game has ended.
    #[error(
        "the game of this room is over; create a new room, or ask its creator for the new join code"
    )]
    GameOver,
}

/// Why a seat cannot be freed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum LeaveError {
    /// The game has started.
    #[error(
        "the game of this room has already started; the seat stays yours, and a substitute plays for it while you are away"
    )]
    GameStarted,
    /// The game has ended.
    #[error("the game of this room is over; there is nothing to leave")]
    GameOver,
    /// The seat is that of a study's participant.
    #[error(
        "a study has assigned this seat, which stays yours; withdraw from the study on its page"
    )]
    Assigned,
}

/// What a participant expresses.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Expression {
    /// For the record only.
    pub record_only: bool,
    /// The seat that it is about, if it is about one.
    pub about: Option<u32>,
    /// Whether it says something in words.
    pub in_words: bool,
    /// The expression, encoded.
    pub encoded: Box<[u8]>,
}

/// Why an expression is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ExpressError {
    /// The game is over.
    #[error("the game is over")]
    GameOver,
    /// It is about a seat that the room does not have.
    #[error("the room has no seat with this number")]
    NoSuchSeat,
    /// People may not write in this room.
    #[error("people may not write in this room; its creator decides that")]
    ChatOff,
    /// The seat has sent too many expressions.
    #[error("a seat may express itself at most {MAX_EXPRESSIONS_PER_SEAT} times in a game")]
    TooMany,
    /// More is stored in a second than the creator of the room may have stored.
    #[error("too many bytes to store in a second; send fewer expressions and annotations")]
    TooFast,
    /// The disk of the server has no space for it.
    #[error("the disk of the server is nearly full; the rest is reserved for decisions")]
    DiskNearlyFull,
}

/// Why there is no hint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum HintError {
    /// The policy does not allow hints.
    #[error("this room gives no hints; its creator decides that")]
    Off,
    /// The decision is not open for the seat.
    #[error("this decision is not open; ask while it is the seat's turn")]
    Closed,
    /// There were too many for the decision, or another one is being computed.
    #[error("at most {MAX_HINTS} hints for a decision, one at a time")]
    TooMany,
}

/// Why a report from a physical table is not accepted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ReportError {
    /// The game has not started.
    #[error("the game has not started: seats are free or not attached yet")]
    GameNotStarted,
    /// The game is over.
    #[error("the game is over")]
    GameOver,
    /// The id was used for another report.
    #[error("this report id was used for another report; choose a new one")]
    IdUsed,
    /// The referee does not judge it.
    #[error(transparent)]
    Refused(#[from] Refusal),
}

/// The referee's ruling on a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReportOutcome {
    /// Number of the report.
    pub number: u64,
    /// The verdict.
    pub verdict: ReportVerdict,
    /// Of a correction: the reports that no longer fit.
    pub void_reports: Vec<u64>,
}

/// An answer to a decision.
#[derive(Debug)]
pub struct Answer {
    /// The decision it answers.
    pub decision_id: u64,
    /// The action, as it was sent.
    pub action: u32,
    /// Annotations, encoded.
    pub annotations: Option<Box<[u8]>>,
    /// The annotations say that another agent decided, the participant's fallback.
    pub by_fallback: bool,
    /// Annotations were sent that cannot be recorded.
    pub annotations_refused: bool,
    /// Time from handing over the decision request until the answer was read, if both happened at
    /// another server, which measured it.
    pub measured: Option<Duration>,
}

impl Answer {
    /// An answer without annotations.
    pub fn new(decision_id: u64, action: u32) -> Self {
        Self {
            decision_id,
            action,
            annotations: None,
            by_fallback: false,
            annotations_refused: false,
            measured: None,
        }
    }
}

/// The result of an answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Answered {
    /// The verdict.
    pub verdict: Verdict,
    /// Measured decision time; zero if there is none.
    pub time: Duration,
    /// Annotations exceeded their limit and were dropped.
    pub annotations_dropped: bool,
}

/// Whether an answer was accepted.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// The action was taken.
    Accepted,
    /// The action is not legal.
    Invalid {
        /// The reason, in words.
        detail: String,
        /// Attempts left; `None` when unlimited.
        attempts_left: Option<u32>,
        /// Reward of the attempt, if the room has a reward scheme.
        reward: Option<f32>,
    },
    /// The decision is closed.
    Closed,
    /// The decision does not exist yet.
    Unknown,
}

impl Answered {
    pub(super) fn closed(verdict: Verdict) -> Self {
        Self {
            verdict,
            time: Duration::ZERO,
            annotations_dropped: false,
        }
    }
}
