//! Reads the requests of one stream of `PlayService` and executes them: seats act and leave. How
//! they attach is in `attaching`, and what participants of tournaments do in `participants`.

use std::collections::BTreeMap;
use std::future::{Future as _, poll_fn};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::task::{Context, Poll};

use chefshat_proto::v1::{self, seat_command::Command, seat_update::Update};
use futures::StreamExt as _;
use tokio::sync::mpsc;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tonic::{Code, Status, Streaming};

use super::parked::{Found, Parking};
use super::remote::{FIRST_ASSIGNED_HANDLE, NodeGone, RemoteSeats};
use super::waiting::{WaitingCommand, WaitingMemory};
use crate::grpc::forward::Gateway;
use crate::grpc::refusals::count;
use crate::grpc::status::{command_missing, field, invalid, refused, room_gone, status};
use chefshat_admission::access::Caller;
use chefshat_hosting::config::FIRST_MESSAGE_TIMEOUT;
use chefshat_hosting::room::{Handle, Loss, SeatAction};
use chefshat_hosting::rooms::Rooms;
use chefshat_hosting::tournaments::{Call, TournamentHandle, Tournaments};
use chefshat_room::ids::RoomToken;
use chefshat_room::{Answer, ConnectionId};
use chefshat_wire::convert;
use chefshat_wire::encoded::Updates;
use chefshat_wire::outbox::{HandStamp, Outbox, StreamEnd};

/// Most calls to games that may wait for one stream; a further one ends the stream.
const MAX_CALLS_WAITING: usize = 4_096;

/// Detached seats that a stream may keep in any case, whose late answers are judged by their room.
pub(super) const DETACHED_KEPT: usize = 64;

/// A seat that is attached to a stream.
pub(super) struct BoundSeat {
    pub(super) room: Handle,
    pub(super) seat: chefshat_engine::Seat,
    pub(super) connection: ConnectionId,
    pub(super) stamp: Arc<HandStamp>,
    pub(super) secret: [u8; 32],
    /// Set when the seat has left the stream.
    pub(super) detached: Arc<AtomicBool>,
}

impl BoundSeat {
    pub(super) fn is_detached(&self) -> bool {
        self.detached.load(Ordering::Relaxed)
    }

    /// Passes an answer to the room, `in_place` or through its mailbox. Returns the answer if the
    /// room cannot accept it now.
    pub(super) fn answer_now(
        &self,
        answer: Answer,
        arrived: Instant,
        in_place: bool,
    ) -> Result<(), Answer> {
        if !in_place {
            return (self.room).send_answer(self.seat, self.connection, answer, arrived);
        }
        let given_back = (self.room).answer_in_place(self.seat, self.connection, answer, arrived);
        given_back
            .or_else(|answer| (self.room).send_answer(self.seat, self.connection, answer, arrived))
    }
}

/// A participant of a tournament that is attached to a stream.
pub(super) struct BoundParticipant {
    pub(super) tournament: Arc<TournamentHandle>,
    pub(super) participant: usize,
    pub(super) connection: u64,
    /// The request that attached it. Its options apply to its seats too.
    pub(super) attach: v1::Attach,
    /// The connection that keeps it until the gateway says that the client's stream is open.
    pub(super) held_by: Option<u64>,
}

impl BoundParticipant {
    pub(super) async fn leave(self) {
        self.tournament
            .left(self.participant, self.connection)
            .await;
    }
}

/// A seat that another stream keeps until the gateway says that the client's stream is open.
pub(super) struct Contested {
    pub(super) attach: v1::Attach,
    /// Its ticket, if the server attaches it.
    pub(super) assigned_ticket: Option<RoomToken>,
    /// The number of the connection that has it.
    pub(super) holder: u64,
    /// Its commands that have been read meanwhile.
    pub(super) commands: Vec<WaitingCommand>,
}

/// Reads the requests of one stream, and attaches seats that participants of tournaments are called
/// to.
pub(super) struct Reader {
    pub(super) rooms: Arc<Rooms>,
    pub(super) tournaments: Arc<Tournaments>,
    pub(super) waiting: WaitingMemory,
    pub(super) caller: Caller,
    pub(super) outbox: Arc<Outbox>,
    /// The attached seats, by handle.
    pub(super) seats: BTreeMap<u32, BoundSeat>,
    /// The number of seats at which detached ones are removed.
    pub(super) prune_at: usize,
    /// The seats that other streams have, by handle.
    pub(super) contested: BTreeMap<u32, Contested>,
    /// The attachments to what this node does not have in memory. Boxed, because it is rare.
    pub(super) parked: Option<Box<Parking>>,
    pub(super) participants: BTreeMap<u32, BoundParticipant>,
    pub(super) next_handle: u32,
    /// The handles of seats that the server attaches start here.
    pub(super) first_called: u32,
    pub(super) next_called: u32,
    /// The seats that other nodes have. Boxed, because a single server has none.
    pub(super) remote: Option<Box<RemoteSeats>>,
    /// Whether the stream comes from another node, at which its client is connected.
    pub(super) by_gateway: bool,
    /// Whether that node is asked before a seat is taken from another stream.
    pub(super) asks_gateway: bool,
    /// What an end of the stream means.
    pub(super) loss: Loss,
    /// Calls to games for the participants of this stream.
    pub(super) calls: mpsc::Sender<(u32, Call)>,
    pub(super) called: mpsc::Receiver<(u32, Call)>,
    /// Whether unspecified delivery means with decisions (Play) or at once (Watch).
    pub(super) with_decisions: bool,
}

/// The next input of a reader.
enum Next<R> {
    Message(Option<Result<R, Status>>),
    Own(Own),
}

/// What a stream has to do without a message of its client.
pub(super) enum Own {
    /// A participant is called.
    Call(u32, Call),
    /// A search for parked attachments has ended.
    Found(Vec<Found>),
}

/// A message of a stream, for its reader.
pub(super) trait Requests: Send {
    /// Executes the commands of the message, which was read at `arrived`.
    ///
    /// # Errors
    /// The message breaks a rule.
    fn execute(
        self,
        reader: &mut Reader,
        arrived: Instant,
    ) -> impl Future<Output = Result<(), Status>> + Send;
}

impl Reader {
    /// Creates the reader of a stream whose responses go into `outbox`.
    pub(super) fn new(
        rooms: &Arc<Rooms>,
        tournaments: &Arc<Tournaments>,
        waiting: WaitingMemory,
        caller: Caller,
        outbox: &Arc<Outbox>,
        with_decisions: bool,
    ) -> Self {
        let (calls, called) = mpsc::channel(MAX_CALLS_WAITING);
        Self {
            rooms: Arc::clone(rooms),
            tournaments: Arc::clone(tournaments),
            waiting,
            caller,
            outbox: Arc::clone(outbox),
            seats: BTreeMap::new(),
            prune_at: DETACHED_KEPT,
            contested: BTreeMap::new(),
            parked: None,
            participants: BTreeMap::new(),
            next_handle: 0,
            first_called: FIRST_ASSIGNED_HANDLE,
            next_called: FIRST_ASSIGNED_HANDLE,
            remote: None,
            by_gateway: false,
            asks_gateway: false,
            loss: Loss::Gone,
            calls,
            called,
            with_decisions,
        }
    }

    /// Lets the stream have seats at other nodes.
    pub(super) fn with_remote(mut self, gateway: Option<Gateway>) -> Self {
        self.remote = gateway.map(|gateway| {
            let (clock, waiting) = (self.rooms.process_clock(), self.waiting.clone());
            Box::new(RemoteSeats::new(gateway, &self.outbox, clock, waiting))
        });
        self
    }

    /// Marks the stream as one of another node.
    pub(super) fn by_gateway(mut self) -> Self {
        self.by_gateway = true;
        self
    }

    /// Reads requests until the stream ends. Sets `failure` if they break off or break a rule.
    pub(super) async fn read<R: Requests>(
        mut self,
        mut requests: Streaming<R>,
        failure: Arc<OnceLock<Status>>,
        closing: CancellationToken,
    ) {
        let outbox = Arc::clone(&self.outbox);
        // Boxed and dropped soon: the future of a stream stays small.
        let mut silence = Some(Box::pin(tokio::time::sleep(FIRST_MESSAGE_TIMEOUT)));
        let end = loop {
            let next = poll_fn(|context| {
                if let Some(silence) = &mut silence
                    && silence.as_mut().poll(context).is_ready()
                {
                    return Poll::Ready(Next::Message(Some(Err(silent()))));
                }
                if outbox.poll_reading_stopped(context) {
                    return Poll::Ready(Next::Message(None));
                }
                if let Poll::Ready(own) = self.poll_own(context) {
                    return Poll::Ready(Next::Own(own));
                }
                requests.poll_next_unpin(context).map(Next::Message)
            });
            let message = match next.await {
                Next::Message(message) => message.transpose(),
                Next::Own(own) => {
                    Box::pin(self.do_own(own)).await;
                    continue;
                }
            };
            silence = None;
            let arrived = Instant::now();
            match message {
                Ok(Some(request)) => {
                    if let Err(status) = request.execute(&mut self, arrived).await {
                        self.loss = Loss::Gone;
                        break Err(status);
                    }
                }
                Ok(None) => break Ok(()),
                Err(status) => break Err(status),
            }
        };
        Box::pin(self.leave_at_end(&closing)).await;
        self.outbox.end(match end {
            Ok(()) => StreamEnd::Complete,
            Err(status) => {
                failure.get_or_init(|| status);
                StreamEnd::RequestsFailed
            }
        });
    }

    /// Waits for something to do without a message of the client.
    pub(super) fn poll_own(&mut self, context: &mut Context<'_>) -> Poll<Own> {
        // Only participants are called. The reader has a sender itself, so the channel never closes.
        if !self.participants.is_empty()
            && let Poll::Ready(Some((handle, call))) = self.called.poll_recv(context)
        {
            return Poll::Ready(Own::Call(handle, call));
        }
        self.poll_found(context).map(Own::Found)
    }

    /// Does what [`Reader::poll_own`] has waited for.
    pub(super) async fn do_own(&mut self, own: Own) {
        match own {
            Own::Call(handle, call) => self.follow_call(handle, call).await,
            Own::Found(found) => self.attach_parked(found).await,
        }
    }

    pub(super) async fn execute(
        &mut self,
        command: v1::SeatCommand,
        arrived: Instant,
        in_place: bool,
    ) {
        // A flood of answers, which are handled without waiting, must not hold the thread.
        tokio::task::consume_budget().await;
        let v1::SeatCommand { handle, command } = command;
        match (command, self.seats.get(&handle)) {
            (Some(Command::Answer(answer)), Some(bound)) => {
                let answer = convert::answer_from_proto(answer);
                if let Err(answer) = bound.answer_now(answer, arrived, in_place) {
                    let action = SeatAction::Answer(answer);
                    Box::pin(self.perform(handle, action, arrived)).await;
                }
            }
            // Boxed because it is rare: the future of a stream stays small.
            (Some(Command::Attach(attach)), _) => Box::pin(self.attach(attach)).await,
            (command, _) => {
                let command = v1::SeatCommand { handle, command };
                Box::pin(self.execute_elsewhere(command, arrived)).await;
            }
        }
    }

    /// Executes a command for a seat of another node there, and any other here. One for a seat that
    /// waits to be attached waits with it.
    pub(super) async fn execute_elsewhere(
        &mut self,
        mut command: v1::SeatCommand,
        arrived: Instant,
    ) {
        if self.hold_back(&mut command, arrived) {
            return;
        }
        let command = match &self.remote {
            None => Ok(Some(command)),
            Some(remote) => remote.pass_on(command, arrived).await,
        };
        match command {
            Ok(Some(v1::SeatCommand { handle, command })) => {
                self.execute_command(handle, command, arrived).await;
            }
            Ok(None) => {}
            Err(NodeGone) => self.outbox.end(StreamEnd::RoomGone),
        }
    }

    pub(super) async fn execute_command(
        &mut self,
        handle: u32,
        command: Option<Command>,
        arrived: Instant,
    ) {
        let action = match command {
            Some(Command::Attach(attach)) => return self.attach_as(handle, attach).await,
            Some(Command::Detach(_)) => return self.detach(handle).await,
            Some(Command::Answer(answer)) => SeatAction::Answer(convert::answer_from_proto(answer)),
            Some(Command::Express(expression)) => match express_action(&expression) {
                Ok(action) => action,
                Err(refusal) => return self.refuse(handle, 0, &refusal),
            },
            Some(Command::Resume(_)) => SeatAction::Resume,
            None => return self.refuse(handle, 0, &command_missing()),
        };
        self.perform(handle, action, arrived).await;
    }

    /// Sends an action to the room of a seat and waits for space in its mailbox.
    pub(super) async fn perform(&mut self, handle: u32, action: SeatAction, arrived: Instant) {
        let Some(bound) = self.seats.get(&handle) else {
            let problem = "no seat of this stream has this handle; attach first";
            let refusal = invalid("HANDLE_UNKNOWN", "handle", problem);
            return self.refuse(handle, 0, &refusal);
        };
        let (room, seat, connection) = (bound.room.clone(), bound.seat, bound.connection);
        if room
            .perform(seat, connection, action, arrived)
            .await
            .is_err()
        {
            self.refuse(handle, 0, &room_gone());
        }
    }

    async fn detach(&mut self, handle: u32) {
        if let Some(bound) = self.seats.remove(&handle) {
            bound
                .room
                .lost(bound.seat, bound.connection, Loss::Detached)
                .await;
        }
        if let Some(bound) = self.participants.remove(&handle) {
            let requested = v1::DetachReason::Requested.into();
            self.send_update(handle, Update::Detached(v1::Detached { reason: requested }));
            bound.leave().await;
        }
    }

    /// Leaves all seats at the end of the stream, which says nothing of the client if the server closes
    /// its streams (`closing`) or another node was lost.
    pub(super) async fn leave_at_end(&mut self, closing: &CancellationToken) {
        if closing.is_cancelled() {
            self.announce_stop();
            self.loss = Loss::WithNode;
        } else if self.remote.as_ref().is_some_and(|it| it.has_lost_a_node()) {
            self.loss = Loss::WithNode;
        }
        let loss = self.loss;
        for bound in std::mem::take(&mut self.participants).into_values() {
            bound.leave().await;
        }
        for bound in std::mem::take(&mut self.seats).into_values() {
            bound.room.lost(bound.seat, bound.connection, loss).await;
        }
        // Last, because it may wait for other nodes.
        if let Some(remote) = &mut self.remote {
            remote.leave(loss).await;
        }
    }

    /// Tells the participants of tournaments that the server stops. Rooms tell their seats.
    fn announce_stop(&self) {
        for handle in self.participants.keys() {
            self.detached(*handle, v1::DetachReason::ServerStopping);
        }
        // The seats of other nodes stay where they are, and their client connects to one of these.
        let remote = self.remote.as_ref().map_or(0, |remote| remote.count());
        let parked = self.parked.as_ref().map_or(0, |parking| parking.count());
        if remote + parked > 0 {
            self.outbox.end(StreamEnd::ShuttingDown);
        }
    }

    pub(super) fn refuse(&self, handle: u32, request_id: u32, refusal: &Status) {
        count(self.rooms.metrics(), refusal);
        self.send_update(handle, Update::Refused(refused(request_id, refusal)));
    }

    /// Tells a participant that it is detached.
    pub(super) fn detached(&self, handle: u32, reason: v1::DetachReason) {
        let reason = reason.into();
        let mut last = Updates::default();
        last.add(handle, Update::Detached(v1::Detached { reason }));
        // At most one for each participant: even a full outbox has space for it.
        self.outbox.push_last(&mut last);
    }

    /// Sends an update that nobody repeats. If the client does not read its stream, `false`: the
    /// stream is ended, so that its client reconnects.
    pub(super) fn send_update(&self, handle: u32, update: Update) -> bool {
        let mut updates = Updates::default();
        updates.add(handle, update);
        let sent = self.outbox.push(&mut updates, None, None);
        if !sent {
            self.outbox.cut(StreamEnd::UpdatesNotTaken);
        }
        sent
    }
}

/// A stream was opened and nothing was sent on it.
fn silent() -> Status {
    let seconds = FIRST_MESSAGE_TIMEOUT.as_secs();
    status(
        Code::DeadlineExceeded,
        "STREAM_SILENT",
        format!("nothing was sent within {seconds} s; open the stream again and attach a seat"),
        [],
    )
}

/// The action for an expression.
///
/// # Errors
/// A field is out of its range.
pub(super) fn express_action(expression: &v1::Expression) -> Result<SeatAction, Status> {
    if expression.source() == v1::ExpressionSource::Wizard {
        // It would betray the seat.
        let problem = "the server sets WIZARD in records; send what a robot would";
        return Err(invalid("EXPRESSION_REFUSED", "source", problem));
    }
    let expression = convert::expression_from_proto(expression);
    let action = expression.map(SeatAction::Express);
    action.map_err(|problem| field("EXPRESSION_REFUSED", &problem))
}

#[cfg(test)]
mod tests {
    use tokio_util::task::TaskTracker;

    use super::*;
    use chefshat_hosting::config::ServerConfig;
    use chefshat_store::MemoryStore;
    use chefshat_wire::outbox::OUTBOX_CAPACITY;

    fn reader(outbox: &Arc<Outbox>) -> Reader {
        let store = Arc::new(MemoryStore::default());
        let rooms = Rooms::new(&ServerConfig::default(), store, TaskTracker::new());
        let rooms = rooms.expect("threads");
        let tournaments = Tournaments::new(Arc::clone(&rooms), TaskTracker::new());
        let waiting = WaitingMemory::for_tests();
        Reader::new(
            &rooms,
            &tournaments,
            waiting,
            Caller::default(),
            outbox,
            true,
        )
    }

    /// A command for a seat that there is not: it is refused.
    fn answer() -> Option<v1::SeatCommand> {
        Some(v1::SeatCommand {
            handle: 7,
            command: Some(Command::Answer(v1::Answer::default())),
        })
    }

    /// Executes messages with this command, or without any.
    async fn flood(reader: &mut Reader, command: Option<v1::SeatCommand>, messages: usize) {
        for _ in 0..messages {
            let commands = command.clone().into_iter().collect();
            let request = v1::PlayRequest { commands };
            let executed = request.execute(reader, Instant::now());
            executed.await.expect("few commands");
        }
    }

    #[tokio::test]
    async fn a_flood_of_messages_yields_to_other_tasks() {
        for command in [answer(), None] {
            let (outbox, _updates) = Outbox::new();
            let mut reader = reader(&outbox);
            let flooding = async move { flood(&mut reader, command, 10_000).await };
            let flooding = tokio::spawn(flooding);
            // The only thread runs the flood until it yields.
            tokio::task::yield_now().await;
            assert!(!flooding.is_finished());
            flooding.abort();
        }
    }

    #[tokio::test]
    async fn a_stream_whose_replies_are_not_read_ends() {
        let (outbox, updates) = Outbox::new();
        let mut reader = reader(&outbox);
        flood(&mut reader, answer(), OUTBOX_CAPACITY).await;
        assert!(outbox.is_open());
        flood(&mut reader, answer(), 1).await;
        let ends = updates.filter_map(async |it| it.err());
        let ends: Vec<StreamEnd> = ends.collect().await;
        assert_eq!(ends, [StreamEnd::UpdatesNotTaken]);
    }
}
