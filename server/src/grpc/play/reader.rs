//! Reads the requests of one stream of `PlayService` and executes them: seats attach, act and
//! leave. Participants of tournaments attach once and are then seated in each of their games.

use std::collections::BTreeMap;
use std::future::{Future as _, poll_fn};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::task::Poll;

use chefshat_engine::MAX_ENTROPY;
use chefshat_proto::v1::{self, seat_command::Command, seat_update::Update};
use chefshat_record::convert::FieldProblem;
use futures::StreamExt as _;
use tokio::sync::mpsc;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tonic::{Code, Status, Streaming};

use super::remote::{CALLED, FIRST_CALLED, NodeGone, RemoteSeats};
use crate::access::Caller;
use crate::config::{FIRST_MESSAGE_TIMEOUT, MAX_CALLS_WAITING, MAX_SEATS_PER_STREAM};
use crate::convert;
use crate::grpc::forward::Gateway;
use crate::grpc::reach::Reach;
use crate::grpc::refusals::count;
use crate::grpc::status::{field, is_elsewhere, refused, room_gone, status, ticket_unknown};
use crate::outbox::{HandStamp, Outbox, StreamEnd};
use crate::room::subscriber::DeliveryOptions;
use crate::room::{AttachRequest, Handle, RoomGone, SeatAction};
use crate::rooms::Rooms;
use crate::tournaments::{Call, Connection, TournamentHandle, Tournaments};
use crate::wire::Updates;
use chefshat_room::ids::{Id, Token};
use chefshat_room::{Answer, ConnectionId};

/// A seat that is attached to a stream.
pub(super) struct BoundSeat {
    pub(super) room: Handle,
    seat: chefshat_engine::Seat,
    connection: ConnectionId,
    pub(super) stamp: Arc<HandStamp>,
    pub(super) secret: [u8; 32],
    /// Set when the seat has left the stream.
    detached: Arc<AtomicBool>,
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

/// Reads the requests of one stream, and attaches seats that participants of tournaments are called
/// to.
pub(super) struct Reader {
    rooms: Arc<Rooms>,
    tournaments: Arc<Tournaments>,
    caller: Caller,
    pub(super) outbox: Arc<Outbox>,
    /// The attached seats, by handle.
    pub(super) seats: BTreeMap<u32, BoundSeat>,
    pub(super) participants: BTreeMap<u32, BoundParticipant>,
    next_handle: u32,
    /// The handles of seats that the server attaches start here.
    pub(super) first_called: u32,
    pub(super) next_called: u32,
    /// The seats that other nodes have. Boxed, because a single server has none.
    remote: Option<Box<RemoteSeats>>,
    /// Whether the stream comes from another node, at which its client is connected.
    by_gateway: bool,
    /// Calls to games for the participants of this stream.
    pub(super) calls: mpsc::Sender<(u32, Call)>,
    pub(super) called: mpsc::Receiver<(u32, Call)>,
    /// Whether unspecified delivery means with decisions (Play) or at once (Watch).
    with_decisions: bool,
}

/// The next input of a reader.
enum Next<R> {
    Message(Option<Result<R, Status>>),
    Call(u32, Call),
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
        caller: Caller,
        outbox: &Arc<Outbox>,
        with_decisions: bool,
    ) -> Self {
        let (calls, called) = mpsc::channel(MAX_CALLS_WAITING);
        Self {
            rooms: Arc::clone(rooms),
            tournaments: Arc::clone(tournaments),
            caller,
            outbox: Arc::clone(outbox),
            seats: BTreeMap::new(),
            participants: BTreeMap::new(),
            next_handle: 0,
            first_called: FIRST_CALLED,
            next_called: FIRST_CALLED,
            remote: None,
            by_gateway: false,
            calls,
            called,
            with_decisions,
        }
    }

    /// Lets the stream have seats at other nodes.
    pub(super) fn with_remote(mut self, gateway: Option<Gateway>) -> Self {
        self.remote = gateway.map(|gateway| Box::new(RemoteSeats::new(gateway, &self.outbox)));
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
                // Only participants are called. The reader has a sender itself, so the channel
                // never closes.
                if !self.participants.is_empty()
                    && let Poll::Ready(Some((handle, call))) = self.called.poll_recv(context)
                {
                    return Poll::Ready(Next::Call(handle, call));
                }
                requests.poll_next_unpin(context).map(Next::Message)
            });
            let message = match next.await {
                Next::Message(message) => message.transpose(),
                Next::Call(handle, call) => {
                    Box::pin(self.follow_call(handle, call)).await;
                    continue;
                }
            };
            silence = None;
            let arrived = Instant::now();
            match message {
                Ok(Some(request)) => {
                    if let Err(status) = request.execute(&mut self, arrived).await {
                        break Err(status);
                    }
                }
                Ok(None) => break Ok(()),
                Err(status) => break Err(status),
            }
        };
        if closing.is_cancelled() {
            self.announce_stop();
        }
        Box::pin(self.leave_all()).await;
        self.outbox.end(match end {
            Ok(()) => StreamEnd::Complete,
            Err(status) => {
                failure.get_or_init(|| status);
                StreamEnd::RequestsFailed
            }
        });
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

    /// Executes a command for a seat of another node there, and any other here.
    async fn execute_elsewhere(&mut self, command: v1::SeatCommand, arrived: Instant) {
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
                Err(problem) => {
                    return self.refuse_field(handle, 0, "EXPRESSION_REFUSED", &problem);
                }
            },
            Some(Command::Resume(_)) => SeatAction::Resume,
            None => {
                let problem = FieldProblem::new("command", "set a command");
                return self.refuse_field(handle, 0, "COMMAND_MISSING", &problem);
            }
        };
        self.perform(handle, action, arrived).await;
    }

    /// Sends an action to the room of a seat and waits for space in its mailbox.
    pub(super) async fn perform(&mut self, handle: u32, action: SeatAction, arrived: Instant) {
        let Some(bound) = self.seats.get(&handle) else {
            let problem = FieldProblem::new(
                "handle",
                "no seat of this stream has this handle; attach first",
            );
            return self.refuse_field(handle, 0, "HANDLE_UNKNOWN", &problem);
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

    /// Attaches the next seat or participant of the client.
    pub(super) async fn attach(&mut self, attach: v1::Attach) {
        let handle = self.next_handle;
        self.next_handle = self.next_handle.wrapping_add(1);
        self.attach_as(handle, attach).await;
    }

    pub(super) async fn attach_as(&mut self, handle: u32, mut attach: v1::Attach) {
        // The client may have attached on its next stream already, which this one would supersede.
        if self.outbox.is_abandoned() {
            return;
        }
        let request_id = attach.request_id;
        if attach.delivery() == v1::EventDelivery::Unspecified {
            attach.set_delivery(match self.with_decisions {
                true => v1::EventDelivery::WithDecisions,
                false => v1::EventDelivery::AtOnce,
            });
        }
        if !self.has_space() {
            return self.refuse(handle, request_id, &too_many_seats());
        }
        if attach.entropy.len() > MAX_ENTROPY {
            let problem = FieldProblem::new("entropy", format!("at most {MAX_ENTROPY} bytes"));
            return self.refuse_field(handle, request_id, "ENTROPY_REFUSED", &problem);
        }
        if let Some(token) = Token::parse(&attach.ticket) {
            let mut tournament = self.tournaments.get(token.room);
            let reach = Reach::new(Arc::clone(&self.rooms), Arc::clone(&self.tournaments));
            let mut in_scope = Ok(());
            if tournament.is_none() {
                let room = reach.room_of_ticket(&self.caller, token.room, ticket_unknown);
                in_scope = room.await.map(drop);
                // This node may have taken it over meanwhile.
                tournament = self.tournaments.get(token.room);
            }
            if let Some(handle) = &tournament {
                in_scope = reach.check_ticket_of(&self.caller, handle, ticket_unknown);
            }
            if let Err(status) = in_scope {
                return match (is_elsewhere(&status), &mut self.remote) {
                    (Some(elsewhere), Some(remote)) => {
                        if let Err(NodeGone) = remote.attach(elsewhere, handle, attach).await {
                            self.outbox.end(StreamEnd::RoomGone);
                        }
                    }
                    // Another node is about to take over.
                    _ if status.code() == Code::Unavailable => {
                        self.outbox.end(StreamEnd::RoomGone);
                    }
                    _ => self.refuse(handle, request_id, &status),
                };
            }
            if let Some(tournament) = tournament {
                return self.enter(tournament, token, attach, handle).await;
            }
        }
        match self.bind(attach, handle, None).await {
            Ok(Some(bound)) => {
                self.seats.insert(handle, bound);
            }
            Ok(None) => self.refuse(handle, request_id, &ticket_unknown()),
            // An agent gives up a refused seat, but reopens a stream that ends with this error.
            Err(RoomGone) => self.outbox.end(StreamEnd::RoomGone),
        }
    }

    /// Whether a seat or participant is attached to the stream.
    pub(super) fn has_attached(&self) -> bool {
        let remote = self.remote.as_ref().map_or(0, |remote| remote.count());
        !(self.seats.is_empty() && self.participants.is_empty()) || remote > 0
    }

    /// Whether the stream can take one more seat.
    pub(super) fn has_space(&mut self) -> bool {
        let remote = self.remote.as_ref().map_or(0, |remote| remote.count());
        let full = |reader: &Self| {
            reader.seats.len() + reader.participants.len() + remote >= MAX_SEATS_PER_STREAM
        };
        if full(self) {
            self.seats.retain(|_, bound| !bound.is_detached());
        }
        !full(self)
    }

    /// Attaches a seat; `None` if the ticket is unknown.
    pub(super) async fn bind(
        &self,
        attach: v1::Attach,
        handle: u32,
        assigned_ticket: Option<Token>,
    ) -> Result<Option<BoundSeat>, RoomGone> {
        let Some(token) = Token::parse(&attach.ticket) else {
            return Ok(None);
        };
        let Some(room) = self.rooms.get(token.room) else {
            return Ok(None);
        };
        let detached = Arc::new(AtomicBool::new(false));
        let from = attach.from_sequence.saturating_sub(1);
        let request = AttachRequest {
            secret: token.secret,
            request_id: attach.request_id,
            outbox: Arc::clone(&self.outbox),
            handle,
            options: DeliveryOptions {
                at_once: attach.delivery() == v1::EventDelivery::AtOnce,
                no_mask: attach.no_mask,
                snapshot: attach.snapshot,
                from: usize::try_from(from).unwrap_or(usize::MAX),
            },
            by_gateway: self.by_gateway,
            entropy: attach.entropy,
            arrived: Instant::now(),
            detached: Arc::clone(&detached),
            assigned_ticket,
        };
        let attached = room.attach(request).await?;
        Ok(attached.map(|attached| BoundSeat {
            room,
            seat: attached.seat,
            connection: attached.connection,
            stamp: attached.stamp,
            secret: token.secret,
            detached,
        }))
    }

    async fn detach(&mut self, handle: u32) {
        if let Some(bound) = self.seats.remove(&handle) {
            bound
                .room
                .lost(
                    bound.seat,
                    bound.connection,
                    Some(v1::DetachReason::Requested),
                )
                .await;
        }
        if let Some(bound) = self.participants.remove(&handle) {
            let requested = v1::DetachReason::Requested.into();
            self.send_update(handle, Update::Detached(v1::Detached { reason: requested }));
            bound.leave().await;
        }
    }

    pub(super) async fn leave_all(&mut self) {
        if let Some(remote) = &mut self.remote {
            remote.leave().await;
        }
        for bound in std::mem::take(&mut self.participants).into_values() {
            bound.leave().await;
        }
        for bound in std::mem::take(&mut self.seats).into_values() {
            bound.room.lost(bound.seat, bound.connection, None).await;
        }
    }

    /// Tells the participants of tournaments that the server stops. Rooms tell their seats.
    pub(super) fn announce_stop(&self) {
        for handle in self.participants.keys() {
            self.detach_participant(*handle, v1::DetachReason::ServerStopping);
        }
        // The seats of other nodes stay where they are, and their client connects to one of these.
        if self
            .remote
            .as_ref()
            .is_some_and(|remote| remote.count() > 0)
        {
            self.outbox.end(StreamEnd::ShuttingDown);
        }
    }

    fn refuse_field(&self, handle: u32, request_id: u32, reason: &str, problem: &FieldProblem) {
        self.refuse(handle, request_id, &field(reason, problem));
    }

    pub(super) fn refuse(&self, handle: u32, request_id: u32, refusal: &Status) {
        count(self.rooms.metrics(), refusal);
        self.send_update(handle, Update::Refused(refused(request_id, refusal)));
    }

    /// Sends an update; `false` if the client does not read its stream.
    pub(super) fn send_update(&self, handle: u32, update: Update) -> bool {
        let mut updates = Updates::default();
        updates.add(handle, update);
        self.outbox.push(&mut updates, None, None)
    }
}

pub(super) fn too_many_seats() -> Status {
    status(
        Code::ResourceExhausted,
        "TOO_MANY_SEATS",
        format!(
            "a stream takes at most {MAX_SEATS_PER_STREAM} seats at a time; detach seats of ended games, or open another stream"
        ),
        [("max_seats_per_stream", &MAX_SEATS_PER_STREAM.to_string())],
    )
}

/// Ids of connections of participants.
static CONNECTIONS: AtomicU64 = AtomicU64::new(1);

/// A participant of a tournament that is attached to a stream.
pub(super) struct BoundParticipant {
    tournament: Arc<TournamentHandle>,
    participant: usize,
    connection: u64,
    /// The request that attached it. Its options apply to its seats too.
    attach: v1::Attach,
}

impl BoundParticipant {
    pub(super) async fn leave(self) {
        self.tournament
            .left(self.participant, self.connection)
            .await;
    }
}

impl Reader {
    /// Attaches a participant of a tournament, which then calls it to its games.
    pub(super) async fn enter(
        &mut self,
        tournament: Arc<TournamentHandle>,
        token: Token,
        attach: v1::Attach,
        handle: u32,
    ) {
        let request_id = attach.request_id;
        let Some(participant) = tournament.participant_of(&token.secret) else {
            return self.refuse(handle, request_id, &ticket_unknown());
        };
        let entered = Update::Entered(v1::Entered {
            request_id,
            tournament_id: tournament.id().to_string(),
            participant: convert::number(participant),
        });
        if !self.send_update(handle, entered) {
            // A client that does not read its stream is not attached.
            return;
        }
        let connection = CONNECTIONS.fetch_add(1, Ordering::Relaxed);
        let bound = BoundParticipant {
            tournament: Arc::clone(&tournament),
            participant,
            connection,
            attach,
        };
        self.participants.insert(handle, bound);
        let stream = Connection {
            handle,
            calls: self.calls.clone(),
            outbox: Arc::clone(&self.outbox),
        };
        tournament.enter(participant, connection, stream).await;
    }

    /// Executes a call of a tournament.
    pub(super) async fn follow_call(&mut self, handle: u32, call: Call) {
        match call {
            Call::Seat(room) => self.take_seat(handle, room).await,
            Call::Superseded => self.dismiss(handle, v1::DetachReason::Superseded),
            Call::Over => self.dismiss(handle, v1::DetachReason::TournamentOver),
        }
    }

    /// Attaches a participant to its seat in the room of one of its games.
    async fn take_seat(&mut self, participant: u32, room: Id) {
        let Some(bound) = self.participants.get(&participant) else {
            return;
        };
        let Some(token) = Token::parse(&bound.attach.ticket) else {
            return;
        };
        let ticket = Token { room, ..token };
        let attach = v1::Attach {
            ticket: ticket.to_text(),
            request_id: 0,
            ..bound.attach.clone()
        };
        // A seat that the client attached with the same ticket stays attached.
        let is_there = (self.seats.values()).any(|seat| {
            seat.secret == ticket.secret && seat.room.id() == room && !seat.is_detached()
        });
        let is_newest = (bound.tournament).is_newest(bound.participant, bound.connection);
        if is_there || !is_newest {
            return;
        }
        if !self.has_space() {
            self.refuse(participant, 0, &too_many_seats());
            if let Some(bound) = self.participants.remove(&participant) {
                bound.leave().await;
            }
            return;
        }
        let handle = self.next_called;
        let next = (self.next_called - self.first_called + 1) % CALLED;
        self.next_called = self.first_called + next;
        // Otherwise the game ended before its seat was attached: there is nothing left to play.
        if let Ok(Some(bound)) = self.bind(attach, handle, Some(ticket)).await {
            self.seats.insert(handle, bound);
        }
    }

    /// Detaches a participant from this stream. Its seats stay attached.
    fn dismiss(&mut self, handle: u32, reason: v1::DetachReason) {
        if self.participants.remove(&handle).is_some() {
            self.detach_participant(handle, reason);
        }
    }

    fn detach_participant(&self, handle: u32, reason: v1::DetachReason) {
        let reason = reason.into();
        let mut last = Updates::default();
        last.add(handle, Update::Detached(v1::Detached { reason }));
        // At most one for each participant: even a full outbox has space for it.
        self.outbox.push_last(&mut last);
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
pub(super) fn express_action(expression: &v1::Expression) -> Result<SeatAction, FieldProblem> {
    Ok(SeatAction::Express {
        record_only: expression.record_only,
        expression: convert::expression_from_proto(expression)?,
    })
}

#[cfg(test)]
mod tests {
    use tokio_util::task::TaskTracker;

    use chefshat_room::journal::ParticipantKind;

    use super::*;
    use crate::config::ServerConfig;
    use crate::limits::Key;
    use crate::store::MemoryStore;
    use crate::tournaments::Entry;

    #[tokio::test]
    async fn a_flood_of_commands_yields_to_other_tasks() {
        let store = Arc::new(MemoryStore::default());
        let rooms =
            Rooms::new(&ServerConfig::default(), store, TaskTracker::new()).expect("threads");
        let tournaments = Tournaments::new(Arc::clone(&rooms), TaskTracker::new());
        let (outbox, _updates) = Outbox::new();
        let mut reader = Reader::new(&rooms, &tournaments, Caller::default(), &outbox, true);
        let flood = tokio::spawn(async move {
            for _ in 0..10_000 {
                let command = v1::SeatCommand {
                    handle: 7,
                    command: Some(Command::Answer(v1::Answer::default())),
                };
                let commands = vec![command];
                let request = v1::PlayRequest { commands };
                let executed = request.execute(&mut reader, Instant::now());
                executed.await.expect("few commands");
            }
        });
        // The only thread runs the flood until it yields.
        tokio::task::yield_now().await;
        assert!(!flood.is_finished());
        flood.abort();
    }

    #[tokio::test]
    async fn a_stream_whose_client_has_gone_attaches_nothing() {
        let store = Arc::new(MemoryStore::default());
        let rooms =
            Rooms::new(&ServerConfig::default(), store, TaskTracker::new()).expect("threads");
        let tournaments = Tournaments::new(Arc::clone(&rooms), TaskTracker::new());
        let settings = v1::TournamentSettings {
            format: v1::TournamentFormat::Swiss.into(),
            ..v1::TournamentSettings::default()
        };
        let plan = convert::tournament_plan(&settings, [7; 32]).expect("valid settings");
        let created = tournaments.create("Coppa", plan, None, Key::Local).await;
        let (tournament, _owner) = created.expect("a tournament");
        let entry = Entry {
            name: "Ada".into(),
            kind: ParticipantKind::Agent,
            max_games: 1,
            stateless: true,
            at_table: false,
            request_id: None,
        };
        let joined = tournament.join(entry).await.expect("it runs");
        let (_participant, ticket) = joined.expect("it is open");
        let attach = v1::Attach {
            ticket: ticket.to_text(),
            ..v1::Attach::default()
        };
        let (outbox, _updates) = Outbox::new();
        let mut newer = Reader::new(&rooms, &tournaments, Caller::default(), &outbox, true);
        newer.attach(attach.clone()).await;
        assert_eq!(newer.participants.len(), 1);
        // The messages of a lost connection may be read after those of the next.
        let (outbox, updates) = Outbox::new();
        let mut older = Reader::new(&rooms, &tournaments, Caller::default(), &outbox, true);
        drop(updates);
        older.attach(attach).await;
        assert!(
            older.participants.is_empty(),
            "it would supersede the newer"
        );
    }
}
