//! How others reach a room: the messages of its mailbox, and a handle that sends them and returns the answers.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use chefshat_engine::Seat;
use chefshat_proto::v1;
use tokio::sync::{mpsc, oneshot};
use tokio::time::Instant;

use super::subscriber::DeliveryOptions;
use crate::outbox::{OnSpace, Outbox};
use chefshat_room::ids::{Id, Token};
use chefshat_room::journal::{AbortReason, ParticipantKind};
use chefshat_room::{Answer, ConnectionId, ExpressError, JoinError, LeaveError};

/// The room is gone: closed, ended long ago, or stopped after a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the room is gone")]
pub struct RoomGone;

/// A request for a seat.
#[derive(Debug)]
pub struct JoinRequest {
    /// Name to show.
    pub name: String,
    /// The kind of the participant.
    pub kind: ParticipantKind,
    /// The seat wanted; `None` for any.
    pub seat: Option<u32>,
    /// Identifies the request when it is repeated.
    pub request_id: Option<[u8; 32]>,
}

/// A seat that was taken.
#[derive(Debug)]
pub struct Joined {
    /// The seat.
    pub seat: Seat,
    /// Its ticket.
    pub ticket: Token,
    /// The room with it.
    pub room: Box<v1::Room>,
}

/// A request to attach a stream to a seat.
#[derive(Debug)]
pub struct AttachRequest {
    /// The ticket's secret.
    pub secret: [u8; 32],
    /// The client's number for the request.
    pub request_id: u32,
    /// The stream.
    pub outbox: Arc<Outbox>,
    /// Number of the seat on the stream.
    pub handle: u32,
    /// How events and decisions reach it.
    pub options: DeliveryOptions,
    /// The seat's part of the game seed.
    pub entropy: Vec<u8>,
    /// When the request was read.
    pub arrived: Instant,
    /// Set when the seat has left the stream.
    pub detached: Arc<AtomicBool>,
    /// The seat's ticket, for a client that the server attaches by itself.
    pub assigned_ticket: Option<Token>,
}

/// A request to watch.
#[derive(Debug)]
pub struct SpectateRequest {
    /// The stream.
    pub outbox: Arc<Outbox>,
    /// Position in the log from which events are wanted.
    pub from: usize,
    /// Start with a snapshot.
    pub snapshot: bool,
}

/// Why a room cannot be watched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SpectateError {
    /// The policy does not admit spectators.
    NotAdmitted,
    /// There are too many spectators.
    Full,
    /// A snapshot of a delayed room would reveal the present.
    SnapshotDelayed,
}

/// A command of a seat.
#[derive(Debug)]
pub enum SeatAction {
    /// Answers a decision.
    Answer(Answer),
    /// Expresses something.
    Express {
        /// For the record only.
        record_only: bool,
        /// The expression, encoded.
        expression: Box<[u8]>,
    },
    /// Takes the seat back from its substitute.
    Resume,
}

/// The result of a command that was sent without a stream.
pub type Acted = Result<Option<v1::AnswerResult>, ExpressError>;

/// A message to a room.
pub(super) enum Message {
    Join(Box<JoinRequest>, oneshot::Sender<Result<Joined, JoinError>>),
    Attach(
        Box<AttachRequest>,
        oneshot::Sender<Option<(Seat, ConnectionId)>>,
    ),
    Lost(Seat, ConnectionId, Option<v1::DetachReason>),
    Do(Seat, ConnectionId, SeatAction, Instant),
    Act(
        [u8; 32],
        SeatAction,
        Instant,
        oneshot::Sender<Option<Acted>>,
    ),
    Spectate(
        Box<SpectateRequest>,
        oneshot::Sender<Result<(), SpectateError>>,
    ),
    Describe(oneshot::Sender<v1::Room>),
    Close([u8; 32], oneshot::Sender<Option<v1::Room>>),
    Leave(
        [u8; 32],
        oneshot::Sender<Option<Result<v1::Room, LeaveError>>>,
    ),
    Abort(AbortReason),
    Suspend,
    Space,
}

/// A handle to a room.
#[derive(Clone)]
pub struct Handle {
    pub(super) id: Id,
    pub(super) mailbox: mpsc::Sender<Message>,
}

impl std::fmt::Debug for Handle {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "Handle({})", self.id)
    }
}

impl Handle {
    /// The id of the room.
    pub fn id(&self) -> Id {
        self.id
    }

    /// Takes a seat.
    ///
    /// # Errors
    /// The room is gone, or (inside) why no seat can be taken.
    pub async fn join(&self, request: JoinRequest) -> Result<Result<Joined, JoinError>, RoomGone> {
        self.ask(|reply| Message::Join(Box::new(request), reply))
            .await
    }

    /// Attaches a stream to a seat; `None` if the ticket is not of this room.
    ///
    /// # Errors
    /// The room is gone.
    pub async fn attach(
        &self,
        request: AttachRequest,
    ) -> Result<Option<(Seat, ConnectionId)>, RoomGone> {
        self.ask(|reply| Message::Attach(Box::new(request), reply))
            .await
    }

    /// Notes that a seat's connection is lost or leaves. `reason` is sent to one that leaves.
    pub async fn lost(
        &self,
        seat: Seat,
        connection: ConnectionId,
        reason: Option<v1::DetachReason>,
    ) {
        // A room that is gone has nobody to miss.
        let _ = self
            .mailbox
            .send(Message::Lost(seat, connection, reason))
            .await;
    }

    /// Performs a command of a seat; the result is sent on its stream.
    ///
    /// # Errors
    /// The room is gone.
    pub async fn perform(
        &self,
        seat: Seat,
        connection: ConnectionId,
        action: SeatAction,
        arrived: Instant,
    ) -> Result<(), RoomGone> {
        self.mailbox
            .send(Message::Do(seat, connection, action, arrived))
            .await
            .map_err(|_| RoomGone)
    }

    /// Performs a command of a seat without a stream; `None` if the ticket is not of this room.
    ///
    /// # Errors
    /// The room is gone.
    pub async fn act(
        &self,
        secret: [u8; 32],
        action: SeatAction,
        arrived: Instant,
    ) -> Result<Option<Acted>, RoomGone> {
        self.ask(|reply| Message::Act(secret, action, arrived, reply))
            .await
    }

    /// Adds a spectator.
    ///
    /// # Errors
    /// The room is gone, or (inside) why it cannot be watched.
    pub async fn spectate(
        &self,
        request: SpectateRequest,
    ) -> Result<Result<(), SpectateError>, RoomGone> {
        self.ask(|reply| Message::Spectate(Box::new(request), reply))
            .await
    }

    /// The public view of the room.
    ///
    /// # Errors
    /// The room is gone.
    pub async fn describe(&self) -> Result<v1::Room, RoomGone> {
        self.ask(Message::Describe).await
    }

    /// Gives a seat back; `None` if the ticket is not of this room.
    ///
    /// # Errors
    /// The room is gone, or (inside) why the seat cannot be given back.
    pub async fn leave(
        &self,
        secret: [u8; 32],
    ) -> Result<Option<Result<v1::Room, LeaveError>>, RoomGone> {
        self.ask(|reply| Message::Leave(secret, reply)).await
    }

    /// Closes the room; `None` if the token is not its owner's.
    ///
    /// # Errors
    /// The room is gone.
    pub async fn close(&self, secret: [u8; 32]) -> Result<Option<v1::Room>, RoomGone> {
        self.ask(|reply| Message::Close(secret, reply)).await
    }

    /// Ends the room because the server stops, if its game is not over: suspends a durable game, aborts any other.
    pub async fn end(&self, durable: bool) {
        let message = if durable {
            Message::Suspend
        } else {
            Message::Abort(AbortReason::Shutdown)
        };
        // A room that is gone has nothing left to end.
        let _ = self.mailbox.send(message).await;
    }

    /// Closes the room for a tournament that is closed; a running game is aborted.
    pub async fn give_up(&self) {
        // A room that is gone has nothing left to end.
        let _ = self.mailbox.send(Message::Abort(AbortReason::Closed)).await;
    }

    async fn ask<T>(
        &self,
        message: impl FnOnce(oneshot::Sender<T>) -> Message,
    ) -> Result<T, RoomGone> {
        let (reply, answer) = oneshot::channel();
        self.mailbox
            .send(message(reply))
            .await
            .map_err(|_| RoomGone)?;
        answer.await.map_err(|_| RoomGone)
    }
}

/// Notifies a room that a stream has space again.
pub(super) struct TellSpace(pub(super) mpsc::WeakSender<Message>);

impl OnSpace for TellSpace {
    fn space(&self) {
        if let Some(mailbox) = self.0.upgrade() {
            // A full mailbox means that the room is about to deliver anyway.
            let _ = mailbox.try_send(Message::Space);
        }
    }
}
