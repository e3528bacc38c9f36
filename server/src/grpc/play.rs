//! `PlayService`: streams of seats, and single commands without a stream. A stream's requests are read by a task of their own; its
//! responses come from its outbox, which rooms fill.

use std::collections::BTreeMap;
use std::future::poll_fn;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::Poll;

use chefshat_proto::v1::{self, act_request, seat_command::Command, seat_update::Update};
use chefshat_records::convert::FieldProblem;
use chefshat_records::seeds::MAX_ENTROPY;
use futures::{Stream, StreamExt as _};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tonic::{Code, Request, Response, Status, Streaming};

use super::status::{Refusal, field, refused, room_gone, status, ticket_unknown};
use crate::config::{
    HEARTBEAT, MAX_COMMANDS_PER_MESSAGE, MAX_SEATS_PER_STREAM, MAX_SEATS_PER_WATCH,
};
use crate::convert;
use crate::ids::Token;
use crate::outbox::{Outbox, OutboxStream};
use crate::room::core::ConnectionId;
use crate::room::delivery::Wishes;
use crate::room::{AttachRequest, Handle, RoomGone, SeatAction};
use crate::rooms::Rooms;
use crate::wire::Updates;
use crate::wire::service::play_service_server::PlayService;

/// The service.
#[derive(Debug, Clone)]
pub struct Play {
    rooms: Arc<Rooms>,
    /// Cancelled when all streams are to end.
    closing: CancellationToken,
}

impl Play {
    /// The service for these rooms; `closing` ends its streams.
    pub fn new(rooms: Arc<Rooms>, closing: CancellationToken) -> Self {
        Self { rooms, closing }
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
        let reader = Reader::new(Arc::clone(&self.rooms), Arc::clone(&outbox), true);
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
        let mut reader = Reader::new(Arc::clone(&self.rooms), Arc::clone(&outbox), false);
        let closing = self.closing.clone();
        tokio::spawn(async move {
            for attach in seats {
                reader.attach(attach).await;
            }
            // The seats stay attached until the client goes or the server closes.
            tokio::select! {
                () = outbox.abandoned() => {}
                () = closing.cancelled() => outbox.end(Ok(())),
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
    /// Set when the room has told the seat that it has left the stream.
    ended: Arc<AtomicBool>,
}

/// Reads the requests of one stream.
struct Reader {
    rooms: Arc<Rooms>,
    outbox: Arc<Outbox<Updates>>,
    /// Those attached, by handle.
    seats: BTreeMap<u32, BoundSeat>,
    next_handle: u32,
    /// What unspecified delivery means: on Play with decisions, on Watch at once.
    with_decisions: bool,
}

impl Reader {
    fn new(rooms: Arc<Rooms>, outbox: Arc<Outbox<Updates>>, with_decisions: bool) -> Self {
        Self {
            rooms,
            outbox,
            seats: BTreeMap::new(),
            next_handle: 0,
            with_decisions,
        }
    }

    async fn read(mut self, mut requests: Streaming<v1::PlayRequest>) {
        let outbox = Arc::clone(&self.outbox);
        let end = loop {
            let message = poll_fn(|context| {
                if outbox.poll_hung_up(context) {
                    return Poll::Ready(None);
                }
                requests.poll_next_unpin(context)
            });
            let message = message.await.transpose();
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
        if self.seats.len() >= MAX_SEATS_PER_STREAM {
            self.seats
                .retain(|_, bound| !bound.ended.load(Ordering::Relaxed));
        }
        if self.seats.len() >= MAX_SEATS_PER_STREAM {
            let refusal = status(
                Code::ResourceExhausted,
                "TOO_MANY_SEATS",
                format!(
                    "a stream takes at most {MAX_SEATS_PER_STREAM} seats at a time; detach those that are over, or open another"
                ),
                [("max_seats_per_stream", &MAX_SEATS_PER_STREAM.to_string())],
            );
            return self.refuse(handle, request_id, &refusal);
        }
        if attach.entropy.len() > MAX_ENTROPY {
            let problem = FieldProblem::new("entropy", format!("at most {MAX_ENTROPY} bytes"));
            return self.refuse_field(handle, request_id, "ENTROPY_REFUSED", &problem);
        }
        match self.bind(attach, handle).await {
            Ok(Some(bound)) => {
                self.seats.insert(handle, bound);
            }
            Ok(None) => self.refuse(handle, request_id, &ticket_unknown()),
            // A seat that is refused is given up by its agent; a stream that ends so is opened again until the room is back.
            Err(RoomGone) => self.outbox.end(Err(room_gone())),
        }
    }

    /// Attaches a seat; `None` if nobody has such a ticket.
    async fn bind(&self, attach: v1::Attach, handle: u32) -> Result<Option<BoundSeat>, RoomGone> {
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
        };
        let attached = room.attach(request).await?;
        Ok(attached.map(|(seat, connection)| BoundSeat {
            room,
            seat,
            connection,
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
    }

    async fn leave_all(&mut self) {
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
        let mut updates = Updates::default();
        updates.add(handle, Update::Refused(refused(request_id, refusal)));
        // A client that does not read its refusals does not get more of them.
        self.outbox.push(&mut updates, None, None);
    }
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
