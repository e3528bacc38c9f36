//! The handle of a room: sends messages to its mailbox and returns the answers.

use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use chefshat_engine::Seat;
use chefshat_proto::v1;
use tokio::sync::{mpsc, oneshot, watch};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

use super::markers::MarkerFollower;
use super::message::{
    AttachRequest, AttachedSeat, JoinRequest, Joined, Loss, MarkRequest, Message, NotAttached,
    Reply, ReportRefusal, RoomError, RoomGone, SeatAction, SpectateError, SpectateRequest,
};
use super::shared::SharedRoom;
use super::table_view::SentState;
use super::task::{self, Room, TaskContext};
use chefshat_admission::limits::{Hint, Key, Payer};
use chefshat_base::clock::RoomClock;
use chefshat_base::lock::Lock;
use chefshat_room::ids::RoomId;
use chefshat_room::journal::AbortReason;
use chefshat_room::{
    Answer, ConnectionId, Core, ExpressError, HintError, JoinError, LeaveError, MarkError,
};
use chefshat_store::Journal;

/// A handle to a room.
#[derive(Clone)]
pub struct Handle {
    id: RoomId,
    mailbox: mpsc::Sender<Message>,
    shared: Arc<SharedRoom<Room>>,
    fence: CancellationToken,
    clock: RoomClock,
    sharing: Arc<AtomicU32>,
    next_join_code: Arc<Lock<String>>,
}

/// Spectators who share a stream of a room at another node; they count until it is dropped.
#[derive(Debug)]
pub struct Sharing {
    all: Arc<AtomicU32>,
    others: u32,
}

impl Sharing {
    /// Sets how many they are besides the one for whom the stream counts.
    pub fn set(&mut self, others: u32) {
        // Wraps where fewer share it than before.
        let more = others.wrapping_sub(self.others);
        self.all.fetch_add(more, Ordering::Relaxed);
        self.others = others;
    }
}

impl Drop for Sharing {
    fn drop(&mut self) {
        self.set(0);
    }
}

/// Starts a room, with a new or a resumed game. `over_since`: the game is already over, and its end
/// has been processed.
pub fn spawn_room(
    core: Core,
    clock: RoomClock,
    over_since: Option<Duration>,
    journal: Box<dyn Journal>,
    context: TaskContext,
) -> Handle {
    let id = core.header().room_id;
    let fence = CancellationToken::new();
    let room_clock = clock.clone();
    let (mailbox, shared) = task::spawn(
        core,
        room_clock,
        over_since,
        journal,
        fence.clone(),
        context,
    );
    Handle {
        id,
        mailbox,
        shared,
        fence,
        clock,
        sharing: Arc::default(),
        next_join_code: Arc::default(),
    }
}

impl std::fmt::Debug for Handle {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "Handle({})", self.id)
    }
}

impl Handle {
    /// The id of the room.
    pub fn id(&self) -> RoomId {
        self.id
    }

    /// Its clock, which measures the times of its events.
    pub fn clock(&self) -> &RoomClock {
        &self.clock
    }

    /// Whether the room has stopped: it has ended, or its game resumes elsewhere or later.
    pub fn is_gone(&self) -> bool {
        self.mailbox.is_closed()
    }

    /// Number of messages in the mailbox.
    pub fn mailbox_depth(&self) -> usize {
        self.mailbox.max_capacity() - self.mailbox.capacity()
    }

    /// Takes a seat.
    ///
    /// # Errors
    /// The room is gone, or no seat can be taken.
    pub async fn join(&self, request: JoinRequest) -> Result<Joined, RoomError<JoinError>> {
        self.request(|reply| Message::Join(Box::new(request), reply))
            .await
    }

    /// Attaches a stream to a seat.
    ///
    /// # Errors
    /// The room is gone, or the stream is not attached.
    pub async fn attach(
        &self,
        request: AttachRequest,
    ) -> Result<AttachedSeat, RoomError<NotAttached>> {
        self.request(|reply| Message::Attach(Box::new(request), reply))
            .await
    }

    /// Reports that a seat has lost its connection.
    pub async fn lost(&self, seat: Seat, connection: ConnectionId, loss: Loss) {
        // If the room is gone, there is nothing to do.
        let _ = self
            .mailbox
            .send(Message::Lost(seat, connection, loss))
            .await;
    }

    /// Handles an answer in the calling task if the room is resting; the result is sent on the
    /// stream of its seat. Otherwise returns the answer.
    pub fn answer_in_place(
        &self,
        seat: Seat,
        connection: ConnectionId,
        answer: Answer,
        arrived: Instant,
    ) -> Result<(), Answer> {
        // Messages that wait come first.
        let is_first = || self.mailbox.capacity() == self.mailbox.max_capacity();
        let needs_task = self.shared.handle(
            answer,
            |room| is_first() && room.may_answer_in_place(),
            |room, answer| room.answer_in_place(seat, connection, answer, arrived),
        )?;
        if needs_task {
            // If the mailbox is full, the task will run anyway.
            let _ = self.mailbox.try_send(Message::Wake);
        }
        Ok(())
    }

    /// Sends an answer to the mailbox; the result is sent on the stream of its seat. Returns the
    /// answer if the mailbox is full or the room is gone.
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

    /// Executes a command of a seat without a stream, by the secret of its ticket and by who is charged
    /// for what is stored.
    ///
    /// # Errors
    /// The room is gone, has no such ticket, or refuses the expression.
    pub async fn act(
        &self,
        by: ([u8; 32], Key),
        action: SeatAction,
        arrived: Instant,
    ) -> Result<Option<v1::AnswerResult>, RoomError<ExpressError>> {
        self.request(|reply| Message::Act(by, action, arrived, reply))
            .await
    }

    /// Asks for a hint for a decision. The same `request_id` again gets the same hint.
    ///
    /// # Errors
    /// The room is gone, has no such ticket, or has no hint.
    pub async fn hint(
        &self,
        secret: [u8; 32],
        decision: u64,
        request_id: Option<[u8; 32]>,
    ) -> Result<Hint, RoomError<HintError>> {
        self.request(|reply| Message::Hint(secret, decision, request_id, reply))
            .await
    }

    /// Adds a spectator.
    ///
    /// # Errors
    /// The room is gone, or cannot be watched.
    pub async fn spectate(&self, request: SpectateRequest) -> Result<(), RoomError<SpectateError>> {
        self.request(|reply| Message::Spectate(Box::new(request), reply))
            .await
    }

    /// The public view of the room.
    ///
    /// # Errors
    /// The room is gone.
    pub async fn describe(&self) -> Result<v1::Room, RoomGone> {
        let mut room = self.ask(Message::Describe).await?;
        let sharing = self.sharing.load(Ordering::Relaxed);
        room.spectators = room.spectators.saturating_add(sharing);
        Ok(room)
    }

    /// The join code of the room in which the participants play again; empty if there is none.
    pub fn next_join_code(&self) -> String {
        self.next_join_code.lock().clone()
    }

    /// Sets the join code of the room in which the participants play again, if it is still this one.
    /// Returns whether it was.
    pub fn replace_next_join_code(&self, earlier: &str, join_code: String) -> bool {
        let mut code = self.next_join_code.lock();
        let is_earlier = *code == earlier;
        if is_earlier {
            *code = join_code;
        }
        is_earlier
    }

    /// Counts spectators who share one of its streams at another node.
    pub fn sharing(&self) -> Sharing {
        Sharing {
            all: Arc::clone(&self.sharing),
            others: 0,
        }
    }

    /// Whether one of these secrets is the ticket of a seat.
    ///
    /// # Errors
    /// The room is gone.
    pub async fn has_ticket(&self, secrets: Vec<[u8; 32]>) -> Result<bool, RoomGone> {
        self.ask(|reply| Message::HasTicket(secrets, reply)).await
    }

    /// The seat of a ticket, and whether the game has started; `None` if the room has no such
    /// ticket.
    ///
    /// # Errors
    /// The room is gone.
    pub async fn seat_of(&self, secret: [u8; 32]) -> Result<Option<(Seat, bool)>, RoomGone> {
        self.ask(|reply| Message::SeatOf(secret, reply)).await
    }

    /// Whether the game has started.
    ///
    /// # Errors
    /// The room is gone.
    pub async fn has_started(&self) -> Result<bool, RoomGone> {
        self.ask(Message::HasStarted).await
    }

    /// Frees a seat.
    ///
    /// # Errors
    /// The room is gone, has no such ticket, or the seat cannot be freed.
    pub async fn leave(&self, secret: [u8; 32]) -> Result<v1::Room, RoomError<LeaveError>> {
        self.request(|reply| Message::Leave(secret, reply)).await
    }

    /// Closes the room. `client`: who asks for it, and has broken the game off for the seats that it took.
    ///
    /// # Errors
    /// The room is gone, or the token is not its owner's.
    pub async fn close(
        &self,
        secret: [u8; 32],
        client: Payer,
    ) -> Result<v1::Room, RoomError<Infallible>> {
        self.request(|reply| Message::Close(secret, client, reply))
            .await
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

    /// Stops the room at once, unless its game is over: another node of the cluster may have it.
    /// Nothing more is published.
    pub fn fence(&self) {
        self.fence.cancel();
        // If the mailbox is full, the task will run anyway.
        let _ = self.mailbox.try_send(Message::Wake);
    }

    /// Reports something from the physical table.
    ///
    /// # Errors
    /// The room is gone, its table has another ticket, or the report is refused.
    pub async fn report(
        &self,
        secret: [u8; 32],
        request: v1::ReportRequest,
    ) -> Result<Box<v1::ReportResponse>, RoomError<ReportRefusal>> {
        self.request(|reply| Message::Report(secret, Box::new(request), reply))
            .await
    }

    /// Watches the physical table: its states, from the current one on.
    ///
    /// # Errors
    /// The room is gone, its table has another ticket, or too many watch it.
    pub async fn watch_table(
        &self,
        secret: [u8; 32],
    ) -> Result<watch::Receiver<SentState>, RoomError<SpectateError>> {
        self.request(|reply| Message::WatchTable(secret, reply))
            .await
    }

    /// Adds a marker.
    ///
    /// # Errors
    /// The room is gone, the token is not its owner's, or the marker is refused.
    pub async fn mark(&self, request: MarkRequest) -> Result<v1::Marker, RoomError<MarkError>> {
        self.request(|reply| Message::Mark(Box::new(request), reply))
            .await
    }

    /// Follows the markers from a position on.
    ///
    /// # Errors
    /// The room is gone, the token is not its owner's, or too many follow them.
    pub async fn follow_markers(
        &self,
        secret: [u8; 32],
        position: usize,
    ) -> Result<MarkerFollower, RoomError<SpectateError>> {
        self.request(|reply| Message::FollowMarkers(secret, position, reply))
            .await
    }

    /// Gives up a seat whose participant has left the tournament or study: a substitute plays until the end. A
    /// game that has not started is aborted.
    pub async fn retire(&self, seat: Seat) {
        // If the room is gone, there is nothing to do.
        let _ = self.mailbox.send(Message::Retire(seat)).await;
    }

    /// Closes the room because its tournament is closed, its participant has left the study, or for the server's operator; a running
    /// game is aborted.
    pub async fn close_without_token(&self) {
        // If the room is gone, there is nothing to do.
        let _ = self.mailbox.send(Message::Abort(AbortReason::Closed)).await;
    }

    /// Asks for something that the room may refuse.
    async fn request<T, E>(
        &self,
        message: impl FnOnce(Reply<T, E>) -> Message,
    ) -> Result<T, RoomError<E>> {
        self.ask(message).await?
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
