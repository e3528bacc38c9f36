//! Messages to the task of a tournament: requests with their refusals, and streams that come and go.

use std::sync::Arc;

use chefshat_agents::NamedAgent;
use chefshat_tournament::{BeginProblem, ByHandProblem, Entrant, JoinProblem, MAX_GAMES_AT_A_TIME};
use tokio::sync::{mpsc, oneshot};

use crate::journaled::Stopped;
use crate::room::Supersedes;
use chefshat_admission::limits::Key;
use chefshat_room::ids::{RoomId, SecretHash, TournamentToken};
use chefshat_room::journal::ParticipantKind;
use chefshat_wire::outbox::{Outbox, StreamEnd};

/// A message to a stream that is attached to a participant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Call {
    /// Its game is played in this room.
    Seat(RoomId),
    /// The connection with this number keeps the participant.
    HeldBy(u64),
    /// A newer connection has taken over the participant.
    Superseded,
    /// The tournament is over.
    Over,
}

/// A stream that is attached to a participant.
#[derive(Clone)]
pub struct Connection {
    /// Number of the participant's attachment on the stream.
    pub handle: u32,
    /// Sends the participant's calls.
    pub calls: mpsc::Sender<(u32, Call)>,
    /// Cancels the stream.
    pub outbox: Arc<Outbox>,
    /// Which connection may lose the participant.
    pub supersedes: Supersedes,
}

impl Connection {
    /// Sends a call; `false` if the stream is gone or too many calls wait. In the latter case the
    /// stream is ended, so that its client reconnects.
    pub(super) fn call(&self, call: Call) -> bool {
        let sent = self.calls.try_send((self.handle, call)).is_ok();
        if !sent {
            self.outbox.cut(StreamEnd::CallsNotTaken);
        }
        sent
    }
}

/// A request to join.
#[derive(Debug)]
pub struct Entry {
    /// Display name.
    pub name: String,
    /// The fingerprint of its name and key; empty if it has no key.
    pub name_fingerprint: String,
    /// Kind of participant.
    pub kind: ParticipantKind,
    /// Most games it can play at a time.
    pub max_games: usize,
    /// Declares that it is stateless.
    pub stateless: bool,
    /// Whether it plays at a physical table. Then nobody uses its ticket.
    pub at_table: bool,
    /// Identifies repetitions of the request.
    pub request_id: Option<[u8; 32]>,
}

impl Entry {
    pub(super) fn entrant(&self) -> Entrant {
        Entrant {
            name: self.name.clone(),
            name_fingerprint: self.name_fingerprint.clone(),
            kind: self.kind,
            built_in: None,
            filler: false,
            stateless: self.stateless,
            max_games: self.max_games,
            at_table: self.at_table,
        }
    }
}

/// Why a participant cannot join.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JoinRefusal {
    /// The rules of the tournament refuse it.
    #[error(transparent)]
    Rules(#[from] JoinProblem),
    /// The request id was used for another participant.
    #[error(
        "this request id was used with another name, kind, number of games or statelessness; draw a new one"
    )]
    RequestIdUsed,
    /// It has stopped.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// Why a tournament does not begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum BeginRefusal {
    /// The rules of the tournament refuse it.
    #[error(transparent)]
    Rules(#[from] BeginProblem),
    /// It has stopped.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// A change by hand.
#[derive(Debug)]
pub enum ByHand {
    /// A participant leaves.
    Withdraw {
        /// Who.
        who: Who,
        /// Who is charged for it.
        charged: Key,
    },
    /// The organiser removes a participant.
    Remove {
        /// The participant.
        participant: usize,
    },
    /// Somebody else takes the place of a participant.
    Replace {
        /// The participant.
        participant: usize,
        /// Who takes it.
        by: Newcomer,
    },
    /// Pauses (`true`) or resumes the tournament.
    SetPaused(bool),
    /// Postpones a game.
    Postpone {
        /// The game.
        game: usize,
        /// The ticket of the participant who asks for it; `None`: the organiser.
        by: Option<SecretHash>,
    },
    /// Calls a game again, before all others.
    Recall {
        /// The game.
        game: usize,
    },
}

/// A participant who is to leave.
#[derive(Debug, Clone, Copy)]
pub enum Who {
    /// The one that has this ticket when the message is processed.
    Ticket(SecretHash),
    /// The one with this number, on behalf of the organiser.
    Number(usize),
}

/// Who takes the place of a participant.
#[derive(Debug)]
pub enum Newcomer {
    /// A built-in agent. Without a name it is named after the agent.
    BuiltIn {
        /// The agent.
        agent: NamedAgent,
        /// Display name, or empty.
        name: String,
        /// Identifies repetitions of the request.
        request_id: Option<[u8; 32]>,
    },
    /// Somebody else, who connects, or sits at the physical table if the former participant does.
    Somebody {
        /// Display name.
        name: String,
        /// Kind of participant; `None`: that of the former one.
        kind: Option<ParticipantKind>,
        /// Most games it can play at a time.
        max_games: usize,
        /// Declares that it is stateless.
        stateless: bool,
        /// Identifies repetitions of the request.
        request_id: Option<[u8; 32]>,
    },
}

impl Newcomer {
    /// Identifies repetitions of the request.
    pub(super) fn request_id(&self) -> Option<&[u8; 32]> {
        match self {
            Newcomer::BuiltIn { request_id, .. } | Newcomer::Somebody { request_id, .. } => {
                request_id.as_ref()
            }
        }
    }

    /// The entrant that takes the place of `former`.
    pub(super) fn entrant(&self, former: &Entrant) -> Entrant {
        match self {
            Newcomer::BuiltIn { agent, name, .. } => Entrant {
                name: name.clone(),
                name_fingerprint: String::new(),
                kind: ParticipantKind::Agent,
                built_in: Some(*agent),
                filler: false,
                stateless: true,
                max_games: MAX_GAMES_AT_A_TIME,
                at_table: false,
            },
            Newcomer::Somebody {
                name,
                kind,
                max_games,
                stateless,
                ..
            } => Entrant {
                name: name.clone(),
                name_fingerprint: String::new(),
                kind: kind.unwrap_or(former.kind),
                built_in: None,
                filler: false,
                stateless: *stateless,
                max_games: *max_games,
                at_table: former.at_table,
            },
        }
    }
}

/// Why a change by hand is refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ByHandRefusal {
    /// The rules of the tournament refuse it.
    #[error(transparent)]
    Rules(#[from] ByHandProblem),
    /// The request id was used for another participant.
    #[error(
        "this request id was used for another participant, name, kind, number of games or statelessness; draw a new one"
    )]
    RequestIdUsed,
    /// No participant has the ticket (any more).
    #[error("no participant of this tournament has this ticket")]
    TicketUnknown,
    /// It has stopped.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// A message to the task of a tournament.
pub enum Message {
    /// Joins.
    Join(
        Entry,
        oneshot::Sender<Result<(usize, TournamentToken), JoinRefusal>>,
    ),
    /// Starts it.
    Begin(oneshot::Sender<Result<(), BeginProblem>>),
    /// Closes it.
    Close(oneshot::Sender<()>),
    /// Changes something by hand.
    ByHand(
        ByHand,
        oneshot::Sender<Result<Option<TournamentToken>, ByHandRefusal>>,
    ),
    /// Attaches the stream with this number to a participant who has a ticket.
    Enter(usize, SecretHash, u64, Connection),
    /// Detaches the stream with this number from a participant.
    Left(usize, u64),
}
