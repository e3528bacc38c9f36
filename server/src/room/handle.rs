//! The handle of a room: sends messages to its mailbox and returns the answers.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use chefshat_engine::Seat;
use chefshat_proto::v1;
use tokio::sync::{mpsc, oneshot};
use tokio::time::Instant;

use super::subscriber::DeliveryOptions;
use super::task::Resting;
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
    /// Display name.
    pub name: String,
    /// The kind of the participant.
    pub kind: ParticipantKind,
    /// The requested seat; `None` for any.
    pub seat: Option<u32>,
    /// Identifies repetitions of the request.
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
    /// How events and decisions are delivered to it.
    pub options: DeliveryOptions,
    /// The seat's contribution to the game seed.
    pub entropy: Vec<u8>,
    /// When the request was read.
    pub arrived: Instant,
    /// Set when the seat has left the stream.
    pub detached: Arc<AtomicBool>,
    /// The seat's ticket, if the server attaches the client.
    pub assigned_ticket: Option<Token>,
}

/// A request to watch.
#[derive(Debug)]
pub struct SpectateRequest {
    /// The stream.
    pub outbox: Arc<Outbox>,
    /// Position in the log of the first event to send.
    pub from: usize,
    /// Whether to start with a snapshot.
    pub snapshot: bool,
}

/// Why a room cannot be watched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SpectateError {
    /// The policy does not admit spectators.
    NotAdmitted,
    /// There are too many spectators.
    Full,
    /// A snapshot of a delayed room would reveal its present state.
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

/// The result of a command without a stream.
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
    /// Delivers and sets the timer again: a stream has space, or an answer was handled in place.
    Wake,
}

/// A handle to a room.
#[derive(Clone)]
pub struct Handle {
    pub(super) id: Id,
    pub(super) mailbox: mpsc::Sender<Message>,
    pub(super) resting: Arc<Resting>,
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
    /// The room is gone, or (inner result) no seat can be taken.
    pub async fn join(&self, request: JoinRequest) -> Result<Result<Joined, JoinError>, RoomGone> {
        self.ask(|reply| Message::Join(Box::new(request), reply))
            .await
    }

    /// Attaches a stream to a seat; `None` if the room has no such ticket.
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

    /// Reports that a seat's connection is lost or leaves. `reason` is sent to one that leaves.
    pub async fn lost(
        &self,
        seat: Seat,
        connection: ConnectionId,
        reason: Option<v1::DetachReason>,
    ) {
        // If the room is gone, there is nothing to do.
        let _ = self
            .mailbox
            .send(Message::Lost(seat, connection, reason))
            .await;
    }

    /// Handles an answer in the calling task if the room is resting; the result is sent on the stream
    /// of its seat. Otherwise returns the answer.
    pub fn answer_in_place(
        &self,
        seat: Seat,
        connection: ConnectionId,
        answer: Answer,
        arrived: Instant,
    ) -> Result<(), Answer> {
        let mailbox = &self.mailbox;
        let needs_task = (self.resting).answer(mailbox, (seat, connection), answer, arrived)?;
        if needs_task {
            // If the mailbox is full, the task will run anyway.
            let _ = self.mailbox.try_send(Message::Wake);
        }
        Ok(())
    }

    /// Sends an answer to the mailbox; the result is sent on the stream of its seat. Returns the answer
    /// if the mailbox is full or the room is gone.
    pub fn send_answer(
        &self,
        seat: Seat,
        connection: ConnectionId,
        answer: Answer,
        arrived: Instant,
    ) -> Result<(), Answer> {
        let Ok(slot) = self.mailbox.try_reserve() else {
            return Err(answer);
        };
        slot.send(Message::Do(
            seat,
            connection,
            SeatAction::Answer(answer),
            arrived,
        ));
        Ok(())
    }

    /// Executes a command of a seat; the result is sent on its stream.
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

    /// Executes a command of a seat without a stream; `None` if the room has no such ticket.
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
    /// The room is gone, or (inner result) it cannot be watched.
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

    /// Frees a seat; `None` if the room has no such ticket.
    ///
    /// # Errors
    /// The room is gone, or (inner result) the seat cannot be freed.
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

    /// Ends the room because the server stops, unless its game is over: suspends a durable game,
    /// aborts any other.
    pub async fn end(&self, durable: bool) {
        let message = if durable {
            Message::Suspend
        } else {
            Message::Abort(AbortReason::Shutdown)
        };
        // If the room is gone, there is nothing to do.
        let _ = self.mailbox.send(message).await;
    }

    /// Closes the room because its tournament is closed; a running game is aborted.
    pub async fn close_for_tournament(&self) {
        // If the room is gone, there is nothing to do.
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

/// Tells a room that a stream has space again.
pub(super) struct NotifySpace(pub(super) mpsc::WeakSender<Message>);

impl OnSpace for NotifySpace {
    fn space(&self) {
        if let Some(mailbox) = self.0.upgrade() {
            // If the mailbox is full, the room will deliver anyway.
            let _ = mailbox.try_send(Message::Wake);
        }
    }
}
