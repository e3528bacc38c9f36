//! How seats attach to a stream. An attachment that comes through another node may be late: its client
//! may have left that stream and attached on a newer one. So it takes no seat from another stream
//! until the gateway, asked after it had arrived, says that the client's stream is open.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::task::{Context, Poll};

use chefshat_engine::MAX_ENTROPY;
use chefshat_proto::v1;
use tokio::time::Instant;
use tokio_util::task::AbortOnDropHandle;
use tonic::{Code, Status};

use super::parked::{Found, Parked, Parking, search};
use super::reader::{BoundSeat, Contested, DETACHED_KEPT, Reader};
use super::remote::NotPassedOn;
use super::waiting::WaitingCommand;
use crate::grpc::lookup::Lookup;
use crate::grpc::status::{invalid, is_elsewhere, owner_unreachable, status, ticket_unknown};
use crate::grpc::takeover::{is_changing, waits};
use chefshat_admission::access::Caller;
use chefshat_admission::limits::Payer;
use chefshat_base::tasks::short;
use chefshat_hosting::config::MAX_SEATS_PER_STREAM;
use chefshat_hosting::room::subscriber::DeliveryOptions;
use chefshat_hosting::room::{AttachRequest, NotAttached, RoomError, RoomGone, Supersedes};
use chefshat_room::ids::{RoomToken, UnitToken};
use chefshat_wire::encoded::Updates;
use chefshat_wire::outbox::StreamEnd;

/// Most commands of a seat that wait for its attachment while another stream has it.
const MAX_COMMANDS_CONTESTED: usize = 64;

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
            let problem = format!("at most {MAX_ENTROPY} bytes");
            let refusal = invalid("ENTROPY_REFUSED", "entropy", problem);
            return self.refuse(handle, request_id, &refusal);
        }
        let Some(token) = UnitToken::parse(&attach.ticket) else {
            return self.refuse(handle, request_id, &ticket_unknown());
        };
        if !self.lookup().has_in_memory(token.subject) && waits(&self.rooms) {
            let parking = self.parked.get_or_insert_with(|| Box::new(Parking::new()));
            return parking.park(handle, attach);
        }
        let in_scope = look(&self.lookup(), &self.caller, token).await;
        let parked = Parked::new(attach);
        self.attach_found(handle, parked, in_scope).await;
    }

    fn lookup(&self) -> Lookup {
        Lookup::new(Arc::clone(&self.rooms), Arc::clone(&self.tournaments))
    }

    /// Attaches a seat or participant whose room or tournament has been found, here or at another
    /// node, if the caller reaches it.
    async fn attach_found(&mut self, handle: u32, parked: Parked, in_scope: Result<(), Status>) {
        let attach = &parked.attach;
        let request_id = attach.request_id;
        if let Err(status) = in_scope {
            return match (is_elsewhere(&status), &mut self.remote) {
                (Some(elsewhere), Some(remote)) => {
                    match remote.attach(elsewhere, handle, parked).await {
                        Ok(()) => {}
                        Err(NotPassedOn::NodeGone(parked)) => self.park_again(handle, *parked),
                        Err(NotPassedOn::TooManyNodes) => self.outbox.end(StreamEnd::RoomGone),
                    }
                }
                // Another node is about to take over.
                _ if status.code() == Code::Unavailable => {
                    self.outbox.end(StreamEnd::RoomGone);
                }
                _ => self.refuse(handle, request_id, &status),
            };
        }
        let token = UnitToken::parse(&attach.ticket).expect("it was parsed to find its room");
        match self.tournaments.by_unit(token.subject) {
            Some(tournament) => {
                let attach = parked.attach;
                self.enter(tournament, &token.secret, attach, handle).await;
            }
            None => {
                let supersedes = self.supersedes();
                self.bind(parked.attach, handle, None, supersedes).await;
            }
        }
    }

    fn park_again(&mut self, handle: u32, parked: Parked) {
        let parking = self.parked.get_or_insert_with(|| Box::new(Parking::new()));
        parking.park_again(handle, parked);
    }

    /// Waits until a search for parked attachments has ended.
    pub(super) fn poll_found(&mut self, context: &mut Context<'_>) -> Poll<Vec<Found>> {
        while let Some(remote) = &mut self.remote
            && let Poll::Ready((handle, parked)) = remote.poll_given_back(context)
        {
            // Its node cannot be reached from here, but perhaps from another one.
            if parked.is_overdue() && !self.has_live_seats() {
                self.outbox.end(StreamEnd::RoomGone);
            }
            self.park_again(handle, *parked);
        }
        let Some(parking) = &mut self.parked else {
            return Poll::Pending;
        };
        let (rooms, tournaments, caller) = (&self.rooms, &self.tournaments, &self.caller);
        parking.poll_found(context, |first, all| {
            let lookup = Lookup::new(Arc::clone(rooms), Arc::clone(tournaments));
            let caller = caller.clone();
            AbortOnDropHandle::new(tokio::spawn(short(
                "one search for a room, within its time limit",
                async move { search(first, all, |token| look_once(&lookup, &caller, token)).await },
            )))
        })
    }

    /// Attaches what a search has found, in the order of the client.
    pub(super) async fn attach_parked(&mut self, found: Vec<Found>) {
        // As for one that comes late.
        if !self.outbox.is_open() {
            return;
        }
        for (handle, in_scope) in found {
            if self.waits_for_seats(handle, &in_scope) {
                continue;
            }
            let Some(mut parked) = (self.parked.as_mut()).and_then(|it| it.take(handle)) else {
                continue;
            };
            let commands = std::mem::take(&mut parked.commands);
            self.attach_found(handle, parked, in_scope).await;
            if let Some(held_back) = self.held_back(handle) {
                *held_back = commands;
                continue;
            }
            for held in commands {
                let command = held.command;
                let command = v1::SeatCommand { handle, command };
                self.execute_elsewhere(command, held.arrived).await;
            }
        }
        let Some(parking) = self.parked.as_ref().filter(|it| it.count() > 0) else {
            return;
        };
        // An agent gives up a refused seat, but reopens a stream that ends with this error, perhaps
        // at a node that knows more. That would cost other seats their connection.
        if !waits(&self.rooms) || (parking.is_overdue() && !self.has_live_seats()) {
            self.outbox.end(StreamEnd::RoomGone);
        }
    }

    /// Whether a parked attachment that has been found is that of a participant one of whose seats,
    /// which its client attaches first, is not attached yet. The tournament would attach that seat
    /// itself, and it would then be lost to the client's own attachment.
    fn waits_for_seats(&self, handle: u32, in_scope: &Result<(), Status>) -> bool {
        let Some(parking) = &self.parked else {
            return false;
        };
        let token =
            (parking.get(handle)).and_then(|parked| UnitToken::parse(&parked.attach.ticket));
        let to = (in_scope.as_ref().err())
            .and_then(is_elsewhere)
            .map(|it| &it.peer);
        token.is_some_and(|UnitToken { secret, .. }| {
            let remote = self.remote.as_ref();
            parking.has_before(handle, &secret)
                || remote.is_some_and(|it| it.has_before(handle, &secret, to))
        })
    }

    /// Lets a command wait if its seat waits to be attached, and has space for it. Returns whether it
    /// does.
    pub(super) fn hold_back(&mut self, command: &mut v1::SeatCommand, arrived: Instant) -> bool {
        let has_space =
            (self.held_back(command.handle)).is_some_and(|it| it.len() < MAX_COMMANDS_CONTESTED);
        if !has_space {
            return false;
        }
        let held = self.waiting.hold(&mut command.command, arrived);
        let is_held = held.is_some();
        if let Some(held_back) = self.held_back(command.handle) {
            held_back.extend(held);
        }
        is_held
    }

    /// The commands that are read until a seat is attached, if it waits for something.
    fn held_back(&mut self, handle: u32) -> Option<&mut Vec<WaitingCommand>> {
        if let Some(contested) = self.contested.get_mut(&handle) {
            return Some(&mut contested.commands);
        }
        let parked = self.parked.as_mut()?.get_mut(handle)?;
        Some(&mut parked.commands)
    }

    /// Whether something of the stream is attached that its end would cost a connection.
    fn has_live_seats(&self) -> bool {
        self.seats.values().any(|bound| !bound.is_detached())
            || !self.contested.is_empty()
            || !self.participants.is_empty()
            || self.remote.as_ref().is_some_and(|it| it.has_attached())
    }

    /// Whether a seat or participant is attached to the stream.
    pub(super) fn has_attached(&self) -> bool {
        self.count() > 0
    }

    /// Whether the stream can take one more seat.
    pub(super) fn has_space(&mut self) -> bool {
        // A long stream keeps no more rooms that are over than live ones, or a few.
        if self.seats.len() >= self.prune_at || self.count() >= MAX_SEATS_PER_STREAM {
            self.seats.retain(|_, bound| !bound.is_detached());
            self.prune_at = 2 * self.seats.len() + DETACHED_KEPT;
        }
        self.count() < MAX_SEATS_PER_STREAM
    }

    fn count(&self) -> usize {
        let remote = self.remote.as_ref().map_or(0, |remote| remote.count());
        let parked = self.parked.as_ref().map_or(0, |parking| parking.count());
        self.seats.len() + self.contested.len() + self.participants.len() + remote + parked
    }

    /// What may lose a seat to an attachment about which nobody has been asked.
    pub(super) fn supersedes(&self) -> Supersedes {
        match self.asks_gateway {
            true => Supersedes::Only(None),
            false => Supersedes::Any,
        }
    }

    /// Attaches a seat, or asks the gateway first if another stream has it.
    pub(super) async fn bind(
        &mut self,
        attach: v1::Attach,
        handle: u32,
        assigned_ticket: Option<RoomToken>,
        supersedes: Supersedes,
    ) {
        let request_id = attach.request_id;
        let again = waits(&self.rooms).then(|| attach.clone());
        let bound = (self.try_bind(attach, handle, assigned_ticket, supersedes)).await;
        match bound {
            Ok(true) => {}
            // The game ended before the server attached its seat: there is nothing left to play.
            _ if assigned_ticket.is_some() => {}
            Ok(false) => self.refuse(handle, request_id, &ticket_unknown()),
            Err(RoomGone) => match again {
                // It has just stopped, to be resumed here or elsewhere.
                Some(attach) => self.park_again(handle, Parked::new(attach)),
                // An agent gives up a refused seat, but reopens a stream that ends with this error.
                None => self.outbox.end(StreamEnd::RoomGone),
            },
        }
    }

    /// Returns `false` if the ticket is unknown.
    async fn try_bind(
        &mut self,
        attach: v1::Attach,
        handle: u32,
        assigned_ticket: Option<RoomToken>,
        supersedes: Supersedes,
    ) -> Result<bool, RoomGone> {
        let Some(token) = RoomToken::parse(&attach.ticket) else {
            return Ok(false);
        };
        // It was found before. A node that has just stopped it is about to resume it, or another is.
        let room = self.rooms.get(token.subject).ok_or(RoomGone)?;
        let detached = Arc::new(AtomicBool::new(false));
        let from = attach.from_sequence.saturating_sub(1);
        let request = AttachRequest {
            secret: token.secret,
            request_id: attach.request_id,
            outbox: Arc::clone(&self.outbox),
            charged: Payer::of_caller(&self.caller),
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
        match room.attach(request).await {
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
            Err(RoomError::Gone(gone)) => return Err(gone),
            Err(RoomError::SecretUnknown) => return Ok(false),
            Err(RoomError::Refused(NotAttached::StreamOver)) => {}
            Err(RoomError::Refused(NotAttached::HeldBy(holder))) => {
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
        if let Some(held_back) = self.held_back(handle) {
            *held_back = commands;
            return;
        }
        for held in commands {
            self.execute_command(handle, held.command, held.arrived)
                .await;
        }
    }
}

/// Looks for the room or tournament of a ticket, which is still to be compared. An error says who
/// else has it, that nobody can be asked now, or why the caller does not reach it.
async fn look(lookup: &Lookup, caller: &Caller, token: UnitToken) -> Result<(), Status> {
    look_once(lookup, caller, token)
        .await
        .unwrap_or_else(|| Err(owner_unreachable()))
}

/// As [`look`]; `None` if it changes hands.
async fn look_once(
    lookup: &Lookup,
    caller: &Caller,
    token: UnitToken,
) -> Option<Result<(), Status>> {
    if let Some(in_scope) = lookup.tournament_of_ticket(caller, token.subject, ticket_unknown) {
        return Some(in_scope);
    }
    let room = lookup
        .look_for_ticket(caller, token.subject, ticket_unknown)
        .await;
    // This node may have taken a tournament over meanwhile.
    if let Some(in_scope) = lookup.tournament_of_ticket(caller, token.subject, ticket_unknown) {
        return Some(in_scope);
    }
    (!is_changing(&room)).then(|| room.map(drop))
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
