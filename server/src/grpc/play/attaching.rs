//! How seats attach to a stream. An attachment that comes through another node may be late: its client
//! may have left that stream and attached on a newer one. So it takes no seat from another stream
//! until the gateway, asked after it had arrived, says that the client's stream is open.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use chefshat_engine::MAX_ENTROPY;
use chefshat_proto::v1;
use chefshat_record::convert::FieldProblem;
use tokio::time::Instant;
use tonic::{Code, Status};

use super::reader::{BoundSeat, Contested, Reader};
use super::remote::NodeGone;
use crate::config::MAX_SEATS_PER_STREAM;
use crate::grpc::reach::Reach;
use crate::grpc::status::{is_elsewhere, status, ticket_unknown};
use crate::outbox::StreamEnd;
use crate::room::subscriber::DeliveryOptions;
use crate::room::{AttachRequest, NotAttached, RoomGone, Supersedes};
use crate::wire::Updates;
use chefshat_room::ids::Token;

impl Reader {
    /// Attaches the next seat or participant of the client.
    pub(super) async fn attach(&mut self, attach: v1::Attach) {
        let handle = self.next_handle;
        self.next_handle = self.next_handle.wrapping_add(1);
        self.attach_as(handle, attach).await;
    }

    pub(super) async fn attach_as(&mut self, handle: u32, mut attach: v1::Attach) {
        // The client may have attached on its next stream already, which this one would supersede.
        if !self.outbox.is_open() {
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
        self.bind(attach, handle, None, self.supersedes()).await;
    }

    /// Whether a seat or participant is attached to the stream.
    pub(super) fn has_attached(&self) -> bool {
        self.count() > 0
    }

    /// Whether the stream can take one more seat.
    pub(super) fn has_space(&mut self) -> bool {
        if self.count() >= MAX_SEATS_PER_STREAM {
            self.seats.retain(|_, bound| !bound.is_detached());
        }
        self.count() < MAX_SEATS_PER_STREAM
    }

    fn count(&self) -> usize {
        let remote = self.remote.as_ref().map_or(0, |remote| remote.count());
        self.seats.len() + self.contested.len() + self.participants.len() + remote
    }

    /// What may lose a seat to an attachment about which nobody has been asked.
    pub(super) fn supersedes(&self) -> Supersedes {
        match self.by_gateway {
            true => Supersedes::Only(None),
            false => Supersedes::Any,
        }
    }

    /// Attaches a seat, or asks the gateway first if another stream has it.
    pub(super) async fn bind(
        &mut self,
        attach: v1::Attach,
        handle: u32,
        assigned_ticket: Option<Token>,
        supersedes: Supersedes,
    ) {
        let request_id = attach.request_id;
        let bound = (self.try_bind(attach, handle, assigned_ticket, supersedes)).await;
        match bound {
            Ok(true) => {}
            // The game ended before the server attached its seat: there is nothing left to play.
            _ if assigned_ticket.is_some() => {}
            Ok(false) => self.refuse(handle, request_id, &ticket_unknown()),
            // An agent gives up a refused seat, but reopens a stream that ends with this error.
            Err(RoomGone) => self.outbox.end(StreamEnd::RoomGone),
        }
    }

    /// Returns `false` if the ticket is unknown.
    async fn try_bind(
        &mut self,
        attach: v1::Attach,
        handle: u32,
        assigned_ticket: Option<Token>,
        supersedes: Supersedes,
    ) -> Result<bool, RoomGone> {
        let Some(token) = Token::parse(&attach.ticket) else {
            return Ok(false);
        };
        let Some(room) = self.rooms.get(token.room) else {
            return Ok(false);
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
            supersedes,
            entropy: attach.entropy.clone(),
            arrived: Instant::now(),
            detached: Arc::clone(&detached),
            assigned_ticket,
        };
        match room.attach(request).await? {
            Ok(attached) => {
                let bound = BoundSeat {
                    room,
                    seat: attached.seat,
                    connection: attached.connection,
                    stamp: attached.stamp,
                    secret: token.secret,
                    detached,
                };
                self.seats.insert(handle, bound);
            }
            Err(NotAttached::TicketUnknown) => return Ok(false),
            Err(NotAttached::StreamOver) => {}
            Err(NotAttached::HeldBy(holder)) => {
                let contested = Contested {
                    attach,
                    assigned_ticket,
                    holder,
                    commands: Vec::new(),
                };
                self.contested.insert(handle, contested);
                self.ask_gateway(handle);
            }
        }
        Ok(true)
    }

    /// Asks the gateway whether the client's stream is open.
    pub(super) fn ask_gateway(&self, handle: u32) {
        let mut question = Updates::default();
        question.add_contested(handle);
        // At most one at a time for each seat: even a full outbox has space for it.
        self.outbox.push_last(&mut question);
    }

    /// Attaches a contested seat or participant: the gateway says that the client's stream is open.
    pub(super) async fn still_open(&mut self, handle: u32) {
        let Some(contested) = self.contested.remove(&handle) else {
            return self.take_over(handle).await;
        };
        let Contested {
            attach,
            assigned_ticket,
            holder,
            commands,
        } = contested;
        let supersedes = Supersedes::Only(Some(holder));
        self.bind(attach, handle, assigned_ticket, supersedes).await;
        if let Some(again) = self.contested.get_mut(&handle) {
            again.commands = commands;
            return;
        }
        for (command, arrived) in commands {
            self.execute_command(handle, command, arrived).await;
        }
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
