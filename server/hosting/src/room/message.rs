//! The messages to a room: requests with the means to answer them.

use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use chefshat_engine::Seat;
use chefshat_proto::v1;
use tokio::sync::{mpsc, oneshot, watch};
use tokio::time::Instant;

use super::markers::MarkerFollower;
use super::subscriber::DeliveryOptions;
use super::table_view::SentState;
use chefshat_admission::limits::{Hint, Key, Payer};
use chefshat_record::convert::FieldProblem;
use chefshat_room::ids::RoomToken;
use chefshat_room::journal::{AbortReason, Marked, ParticipantKind};
use chefshat_room::{
    Answer, ConnectionId, ExpressError, Expression, HintError, JoinError, LeaveError, MarkError,
    ReportError,
};
use chefshat_wire::outbox::{HandStamp, OnSpace, Outbox};

/// The room is gone: closed, ended long ago, or stopped after a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the room is gone")]
pub struct RoomGone;

/// Why a room has not done what it was asked to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum RoomError<E> {
    /// The room is gone.
    #[error(transparent)]
    Gone(#[from] RoomGone),
    /// The secret is not that of a ticket or token of this room.
    #[error("this room has no such ticket or token")]
    SecretUnknown,
    /// The room refuses it.
    #[error("{0}")]
    Refused(E),
}

/// Where the answer to a request goes.
pub(super) type Reply<T, E> = oneshot::Sender<Result<T, RoomError<E>>>;

/// A request for a seat.
#[derive(Debug)]
pub struct JoinRequest {
    /// Display name.
    pub name: String,
    /// The fingerprint of its name and key; empty if it has no key.
    pub name_fingerprint: String,
    /// The kind of the participant.
    pub kind: ParticipantKind,
    /// The requested seat; `None` for any.
    pub seat: Option<u32>,
    /// Identifies repetitions of the request.
    pub request_id: Option<[u8; 32]>,
    /// Who asks, where the server can tell clients apart.
    pub client: Option<Payer>,
}

#[cfg(any(test, feature = "testing"))]
impl JoinRequest {
    /// An agent of this name that takes any seat, for tests.
    pub fn for_tests(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            name_fingerprint: String::new(),
            kind: ParticipantKind::Agent,
            seat: None,
            request_id: None,
            client: None,
        }
    }
}

/// A seat that was taken.
#[derive(Debug)]
pub struct Joined {
    /// The seat.
    pub seat: Seat,
    /// Its ticket.
    pub ticket: RoomToken,
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
    /// Who is charged for what it stores.
    pub charged: Payer,
    /// Number of the seat on the stream.
    pub handle: u32,
    /// How events and decisions are delivered to it.
    pub options: DeliveryOptions,
    /// Whether the client is connected to another node, which measures the time of its answers.
    pub by_gateway: bool,
    /// Which connection may lose the seat.
    pub supersedes: Supersedes,
    /// The seat's contribution to the game seed.
    pub entropy: Vec<u8>,
    /// When the request was read.
    pub arrived: Instant,
    /// Set when the seat has left the stream.
    pub detached: Arc<AtomicBool>,
    /// The seat's ticket, if the server attaches the client.
    pub assigned_ticket: Option<RoomToken>,
}

/// Which connection an attachment takes its seat or participant from. One that comes through another
/// node may be late: its client may have attached on a newer stream, which must keep the seat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Supersedes {
    /// Any.
    Any,
    /// This one alone. Its gateway knew of it when the client's stream was open.
    Only(Option<u64>),
}

impl Supersedes {
    /// The connection that keeps the seat, if this one has it now.
    pub fn kept_by(self, holder: Option<u64>) -> Option<u64> {
        match self {
            Self::Any => None,
            Self::Only(other) => holder.filter(|_| holder != other),
        }
    }
}

/// Why a stream was not attached to a seat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NotAttached {
    /// The client has left the stream.
    StreamOver,
    /// The connection with this number keeps the seat.
    HeldBy(u64),
}

/// A seat that was attached to a stream.
#[derive(Debug)]
pub struct AttachedSeat {
    /// The seat.
    pub seat: Seat,
    /// Number of the connection.
    pub connection: ConnectionId,
    /// Records when its decision requests are handed over.
    pub stamp: Arc<HandStamp>,
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
    /// Whether the owner of the room asks.
    pub is_owner: bool,
    /// Who is charged for it.
    pub charged: Key,
}

/// Why a room cannot be watched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SpectateError {
    /// The policy does not admit spectators.
    NotAdmitted,
    /// There are too many spectators, or too many of this caller.
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
    Express(Expression),
    /// Takes the seat back from its substitute.
    Resume,
}

/// Why a report from a physical table is refused.
#[derive(Debug)]
pub enum ReportRefusal {
    /// A field is malformed.
    Malformed(FieldProblem),
    /// The room takes no such report now.
    Refused(ReportError),
}

/// A request for a marker.
#[derive(Debug)]
pub struct MarkRequest {
    /// The secret of the owner's token.
    pub secret: [u8; 32],
    /// What is marked.
    pub marked: Marked,
}

/// How a seat loses its connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Loss {
    /// Its client has gone.
    Gone,
    /// Its client detaches it and is notified.
    Detached,
    /// The node that its client is connected to is lost, or stops.
    WithNode,
}

/// A message to a room.
pub(super) enum Message {
    Join(Box<JoinRequest>, Reply<Joined, JoinError>),
    Attach(Box<AttachRequest>, Reply<AttachedSeat, NotAttached>),
    Lost(Seat, ConnectionId, Loss),
    Do(Seat, ConnectionId, SeatAction, Instant),
    /// With the secret of the seat's ticket, and who is charged for what is stored.
    Act(
        ([u8; 32], Key),
        SeatAction,
        Instant,
        Reply<Option<v1::AnswerResult>, ExpressError>,
    ),
    /// Asks for a hint for a decision, with the secret of the seat's ticket and the id of the request,
    /// if it has one.
    Hint([u8; 32], u64, Option<[u8; 32]>, Reply<Hint, HintError>),
    Spectate(Box<SpectateRequest>, Reply<(), SpectateError>),
    Describe(oneshot::Sender<v1::Room>),
    HasTicket(Vec<[u8; 32]>, oneshot::Sender<bool>),
    /// The seat of a ticket, and whether the game has started.
    SeatOf([u8; 32], oneshot::Sender<Option<(Seat, bool)>>),
    /// Whether the game has started.
    HasStarted(oneshot::Sender<bool>),
    Close([u8; 32], Payer, Reply<v1::Room, Infallible>),
    Leave([u8; 32], Reply<v1::Room, LeaveError>),
    /// A report, with the secret of the table's ticket.
    Report(
        [u8; 32],
        Box<v1::ReportRequest>,
        Reply<Box<v1::ReportResponse>, ReportRefusal>,
    ),
    WatchTable([u8; 32], Reply<watch::Receiver<SentState>, SpectateError>),
    /// Adds a marker.
    Mark(Box<MarkRequest>, Reply<v1::Marker, MarkError>),
    /// Follows the markers from this position on, with the secret of the owner's token.
    FollowMarkers([u8; 32], usize, Reply<MarkerFollower, SpectateError>),
    /// The participant of a seat has left the tournament or study.
    Retire(Seat),
    Abort(AbortReason),
    Suspend,
    /// Delivers and sets the timer again: a stream has space, or an answer was handled in place.
    Wake,
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
