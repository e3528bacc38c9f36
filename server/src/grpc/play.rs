//! `PlayService`: streams of seats, and single commands without a stream. A stream's requests are read by a task of their own; its
//! responses come from its outbox, which rooms fill.

use std::collections::BTreeMap;
use std::future::poll_fn;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::task::Poll;

use chefshat_proto::v1::{self, act_request, seat_command::Command, seat_update::Update};
use chefshat_records::convert::FieldProblem;
use chefshat_records::seeds::MAX_ENTROPY;
use futures::{Stream, StreamExt as _};
use tokio::sync::mpsc;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tonic::{Code, Request, Response, Status, Streaming};

use super::status::{Refusal, field, refused, room_gone, status, ticket_unknown};
use crate::config::{
    HEARTBEAT, MAX_CALLS_WAITING, MAX_COMMANDS_PER_MESSAGE, MAX_SEATS_PER_STREAM,
    MAX_SEATS_PER_WATCH,
};
use crate::convert;
use crate::ids::{Id, Token};
use crate::outbox::{Outbox, OutboxStream};
use crate::room::core::ConnectionId;
use crate::room::delivery::Wishes;
use crate::room::{AttachRequest, Handle, RoomGone, SeatAction};
use crate::rooms::Rooms;
use crate::tournaments::{Call, Connection, Hosted, Tournaments};
use crate::wire::Updates;
use crate::wire::service::play_service_server::PlayService;

/// First handle of the seats that the server attaches by itself.
const FIRST_CALLED: u32 = 1 << 31;

/// Numbers of connections of participants.
static CONNECTIONS: AtomicU64 = AtomicU64::new(1);

/// The service.
#[derive(Debug, Clone)]
pub struct Play {
    rooms: Arc<Rooms>,
    tournaments: Arc<Tournaments>,
    /// Cancelled when all streams are to end.
    closing: CancellationToken,
}

impl Play {
    /// The service for these rooms and tournaments; `closing` ends its streams.
    pub fn new(
        rooms: Arc<Rooms>,
        tournaments: Arc<Tournaments>,
        closing: CancellationToken,
    ) -> Self {
        Self {
            rooms,
            tournaments,
            closing,
        }
    }

    /// The reader of a new stream.
    fn reader(&self, outbox: &Arc<Outbox<Updates>>, with_decisions: bool) -> Reader {
        let (calls, called) = mpsc::channel(MAX_CALLS_WAITING);
        Reader {
            rooms: Arc::clone(&self.rooms),
            tournaments: Arc::clone(&self.tournaments),
            outbox: Arc::clone(outbox),
            seats: BTreeMap::new(),
            participants: BTreeMap::new(),
            next_handle: 0,
            next_called: FIRST_CALLED,
            calls,
            called,
            with_decisions,
        }
    }
}

#[tonic::async_trait]
impl PlayService for Play {
    type PlayStream = OutboxStream<Updates>;
    type WatchStream = Pin<Box<dyn Stream<Item = Result<Updates, Status>> + Send>>;

    async fn play(
        &self,
        request: Request<Streaming<v1::PlayRequest>>,
    ) -> Result<Response<Self::PlayStream>, Status> {
        let (outbox, updates) = Outbox::new();
        let reader = self.reader(&outbox, true);
        tokio::spawn(reader.read(request.into_inner()));
        let closing = self.closing.clone();
        tokio::spawn(async move {
            tokio::select! {
                () = closing.cancelled() => outbox.hang_up(),
                () = outbox.abandoned() => {}
            }
        });
        Ok(Response::new(updates))
    }

    async fn watch(
        &self,
        request: Request<v1::PlayServiceWatchRequest>,
    ) -> Result<Response<Self::WatchStream>, Status> {
        let seats = request.into_inner().seats;
        if !(1..=MAX_SEATS_PER_WATCH).contains(&seats.len()) {
            return Err(field(
                "SEATS_REFUSED",
                &FieldProblem::new("seats", format!("name 1 to {MAX_SEATS_PER_WATCH} seats")),
            ));
        }
        let (outbox, updates) = Outbox::new();
        let mut reader = self.reader(&outbox, false);
        let closing = self.closing.clone();
        tokio::spawn(async move {
            for attach in seats {
                reader.attach(attach).await;
            }
            // The seats stay attached until the client goes or the server closes.
            tokio::select! {
                () = outbox.abandoned() => {}
                () = closing.cancelled() => outbox.end(Ok(())),
                () = reader.follow_calls() => {}
            }
            reader.leave_all().await;
        });
        Ok(Response::new(Box::pin(with_heartbeats(updates))))
    }

    async fn act(
        &self,
        request: Request<v1::ActRequest>,
    ) -> Result<Response<v1::ActResponse>, Status> {
        let arrived = Instant::now();
        let request = request.into_inner();
        let token = Token::parse(&request.ticket).ok_or_else(ticket_unknown)?;
        let room = self.rooms.get(token.room).ok_or_else(ticket_unknown)?;
        let action = match request.command {
            Some(act_request::Command::Answer(answer)) => answer_action(answer),
            Some(act_request::Command::Express(expression)) => express_action(&expression)
                .map_err(|problem| field("EXPRESSION_REFUSED", &problem))?,
            Some(act_request::Command::Resume(_)) => SeatAction::Resume,
            None => {
                return Err(field(
                    "COMMAND_MISSING",
                    &FieldProblem::new("command", "say what the seat does"),
                ));
            }
        };
        let result = room
            .act(token.secret, action, arrived)
            .await
            .map_err(Refusal::from)?
            .ok_or_else(ticket_unknown)?
            .map_err(Refusal::from)?;
        Ok(Response::new(v1::ActResponse { result }))
    }
}

/// Updates as Watch sends them, with heartbeats when nothing happens.
fn with_heartbeats(updates: OutboxStream<Updates>) -> impl Stream<Item = Result<Updates, Status>> {
    tokio_stream::StreamExt::timeout_repeating(updates, tokio::time::interval(HEARTBEAT))
        .map(|message| message.unwrap_or_else(|_| Ok(Updates::default())))
}

/// A seat that is attached to a stream.
struct BoundSeat {
    room: Handle,
    seat: chefshat_engine::Seat,
    connection: ConnectionId,
    secret: [u8; 32],
    /// Set when the room has told the seat that it has left the stream.
    ended: Arc<AtomicBool>,
}

impl BoundSeat {
    fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }
}

/// A participant of a tournament that is attached to a stream.
struct BoundParticipant {
    tournament: Arc<Hosted>,
    participant: usize,
    connection: u64,
    /// How it asked to be attached, which holds for its seats too.
    attach: v1::Attach,
}

/// Reads the requests of one stream, and attaches seats that participants of tournaments are called to.
struct Reader {
    rooms: Arc<Rooms>,
    tournaments: Arc<Tournaments>,
    outbox: Arc<Outbox<Updates>>,
    /// Those attached, by handle.
    seats: BTreeMap<u32, BoundSeat>,
    participants: BTreeMap<u32, BoundParticipant>,
    next_handle: u32,
    next_called: u32,
    /// Where tournaments call participants of this stream, and what they have called.
    calls: mpsc::Sender<(u32, Call)>,
    called: mpsc::Receiver<(u32, Call)>,
    /// What unspecified delivery means: on Play with decisions, on Watch at once.
    with_decisions: bool,
}

impl BoundParticipant {
    async fn leave(self) {
        self.tournament
            .left(self.participant, self.connection)
            .await;
    }
}

/// What a reader does next.
enum Next {
    Message(Option<Result<v1::PlayRequest, Status>>),
    Call(u32, Call),
}

impl Reader {
    async fn read(mut self, mut requests: Streaming<v1::PlayRequest>) {
        let outbox = Arc::clone(&self.outbox);
        let end = loop {
            let next = poll_fn(|context| {
                if outbox.poll_hung_up(context) {
                    return Poll::Ready(Next::Message(None));
                }
                // The sender is the reader's own: there is always one.
                if let Poll::Ready(Some((handle, call))) = self.called.poll_recv(context) {
                    return Poll::Ready(Next::Call(handle, call));
                }
                requests.poll_next_unpin(context).map(Next::Message)
            });
            let message = match next.await {
                Next::Message(message) => message.transpose(),
                Next::Call(handle, call) => {
                    self.follow_call(handle, call).await;
                    continue;
                }
            };
            let arrived = Instant::now();
            match message {
                Ok(Some(request)) if request.commands.len() > MAX_COMMANDS_PER_MESSAGE => {
                    break Err(status(
                        Code::InvalidArgument,
                        "TOO_MANY_COMMANDS",
                        format!("a message holds at most {MAX_COMMANDS_PER_MESSAGE} commands"),
                        [("field", "commands")],
                    ));
                }
                Ok(Some(request)) => {
                    for command in request.commands {
                        self.obey(command, arrived).await;
                    }
                }
                Ok(None) => break Ok(()),
                Err(status) => break Err(status),
            }
        };
        self.leave_all().await;
        self.outbox.end(end);
    }

    async fn obey(&mut self, command: v1::SeatCommand, arrived: Instant) {
        let handle = command.handle;
        let action = match command.command {
            Some(Command::Attach(attach)) => return self.attach(attach).await,
            Some(Command::Detach(_)) => return self.detach(handle).await,
            Some(Command::Answer(answer)) => answer_action(answer),
            Some(Command::Express(expression)) => match express_action(&expression) {
                Ok(action) => action,
                Err(problem) => {
                    return self.refuse_field(handle, 0, "EXPRESSION_REFUSED", &problem);
                }
            },
            Some(Command::Resume(_)) => SeatAction::Resume,
            None => {
                let problem = FieldProblem::new("command", "say what the seat does");
                return self.refuse_field(handle, 0, "COMMAND_MISSING", &problem);
            }
        };
        let Some(bound) = self.bound(handle) else {
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

    async fn attach(&mut self, attach: v1::Attach) {
        let handle = self.next_handle;
        self.next_handle = self.next_handle.wrapping_add(1);
        let request_id = attach.request_id;
        if !self.has_space() {
            return self.refuse(handle, request_id, &too_many_seats());
        }
        if attach.entropy.len() > MAX_ENTROPY {
            let problem = FieldProblem::new("entropy", format!("at most {MAX_ENTROPY} bytes"));
            return self.refuse_field(handle, request_id, "ENTROPY_REFUSED", &problem);
        }
        if let Some(token) = Token::parse(&attach.ticket)
            && let Some(tournament) = self.tournaments.get(token.room)
        {
            return self.enter(tournament, token, attach, handle).await;
        }
        match self.bind(attach, handle, None).await {
            Ok(Some(bound)) => {
                self.seats.insert(handle, bound);
            }
            Ok(None) => self.refuse(handle, request_id, &ticket_unknown()),
            // A seat that is refused is given up by its agent; a stream that ends so is opened again until the room is back.
            Err(RoomGone) => self.outbox.end(Err(room_gone())),
        }
    }

    /// Whether the stream can take one more seat.
    fn has_space(&mut self) -> bool {
        let full =
            |reader: &Self| reader.seats.len() + reader.participants.len() >= MAX_SEATS_PER_STREAM;
        if full(self) {
            self.seats.retain(|_, bound| !bound.has_ended());
        }
        !full(self)
    }

    /// Attaches a participant of a tournament, which then calls it to its games.
    async fn enter(
        &mut self,
        tournament: Arc<Hosted>,
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
        if !self.tell(handle, entered) {
            // Who does not read what it is told is not entered.
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
        let way = Connection {
            handle,
            calls: self.calls.clone(),
            outbox: Arc::clone(&self.outbox),
        };
        tournament.enter(participant, connection, way).await;
    }

    /// Follows calls to games for as long as it is let.
    async fn follow_calls(&mut self) {
        while let Some((handle, call)) = self.called.recv().await {
            self.follow_call(handle, call).await;
        }
    }

    /// Does what a tournament has called a participant of this stream to.
    async fn follow_call(&mut self, handle: u32, call: Call) {
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
            ticket: ticket.word(),
            request_id: 0,
            ..bound.attach.clone()
        };
        // A seat that the client attached by itself with the same ticket stays where it is.
        let is_there = (self.seats.values()).any(|seat| {
            seat.secret == ticket.secret && seat.room.id() == room && !seat.has_ended()
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
        self.next_called = self.next_called.wrapping_add(1).max(FIRST_CALLED);
        // Otherwise the game ended before its seat was taken: there is nothing left to play.
        if let Ok(Some(bound)) = self.bind(attach, handle, Some(ticket)).await {
            self.seats.insert(handle, bound);
        }
    }

    /// Tells a participant that it will not be seated again on this stream. Its seats stay.
    fn dismiss(&mut self, handle: u32, reason: v1::DetachReason) {
        if self.participants.remove(&handle).is_some() {
            let reason = reason.into();
            let mut last = Updates::default();
            last.add(handle, Update::Detached(v1::Detached { reason }));
            // There is one for each participant: it has its place even in an outbox that is full.
            self.outbox.push_last(&mut last);
        }
    }

    /// Attaches a seat; `None` if nobody has such a ticket.
    async fn bind(
        &self,
        attach: v1::Attach,
        handle: u32,
        told_ticket: Option<Token>,
    ) -> Result<Option<BoundSeat>, RoomGone> {
        let Some(token) = Token::parse(&attach.ticket) else {
            return Ok(None);
        };
        let Some(room) = self.rooms.get(token.room) else {
            return Ok(None);
        };
        let at_once = match attach.delivery() {
            v1::EventDelivery::Unspecified => !self.with_decisions,
            v1::EventDelivery::WithDecisions => false,
            v1::EventDelivery::AtOnce => true,
        };
        let ended = Arc::new(AtomicBool::new(false));
        let from = attach.from_sequence.saturating_sub(1);
        let request = AttachRequest {
            secret: token.secret,
            request_id: attach.request_id,
            outbox: Arc::clone(&self.outbox),
            handle,
            wishes: Wishes {
                at_once,
                no_mask: attach.no_mask,
                snapshot: attach.snapshot,
                from: usize::try_from(from).unwrap_or(usize::MAX),
            },
            entropy: attach.entropy,
            arrived: Instant::now(),
            ended: Arc::clone(&ended),
            told_ticket,
        };
        let attached = room.attach(request).await?;
        Ok(attached.map(|(seat, connection)| BoundSeat {
            room,
            seat,
            connection,
            secret: token.secret,
            ended,
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
            self.tell(handle, Update::Detached(v1::Detached { reason: requested }));
            bound.leave().await;
        }
    }

    async fn leave_all(&mut self) {
        for bound in std::mem::take(&mut self.participants).into_values() {
            bound.leave().await;
        }
        for bound in std::mem::take(&mut self.seats).into_values() {
            bound.room.lost(bound.seat, bound.connection, None).await;
        }
    }

    fn bound(&self, handle: u32) -> Option<&BoundSeat> {
        self.seats.get(&handle)
    }

    fn refuse_field(&self, handle: u32, request_id: u32, reason: &str, problem: &FieldProblem) {
        self.refuse(handle, request_id, &field(reason, problem));
    }

    fn refuse(&self, handle: u32, request_id: u32, refusal: &Status) {
        self.tell(handle, Update::Refused(refused(request_id, refusal)));
    }

    /// Tells the client; `false` if it does not read what it was told before.
    fn tell(&self, handle: u32, update: Update) -> bool {
        let mut updates = Updates::default();
        updates.add(handle, update);
        self.outbox.push(&mut updates, None, None)
    }
}

fn too_many_seats() -> Status {
    status(
        Code::ResourceExhausted,
        "TOO_MANY_SEATS",
        format!(
            "a stream takes at most {MAX_SEATS_PER_STREAM} seats at a time; detach those that are over, or open another"
        ),
        [("max_seats_per_stream", &MAX_SEATS_PER_STREAM.to_string())],
    )
}

fn answer_action(answer: v1::Answer) -> SeatAction {
    let annotations = convert::annotations_from_proto(answer.annotations);
    SeatAction::Answer {
        decision_id: answer.decision_id,
        action: answer.action,
        annotations_refused: annotations.is_err(),
        annotations: annotations.unwrap_or_default(),
    }
}

fn express_action(expression: &v1::Expression) -> Result<SeatAction, FieldProblem> {
    Ok(SeatAction::Express {
        record_only: expression.record_only,
        expression: convert::expression_from_proto(expression)?,
    })
}
