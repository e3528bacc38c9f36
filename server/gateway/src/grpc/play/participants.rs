//! What participants of tournaments do on a stream: they attach once and are then seated in each of
//! their games.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use chefshat_proto::v1::{self, seat_update::Update};

use super::attaching::too_many_seats;
use super::reader::{BoundParticipant, Reader};
use super::remote::HANDLES_PER_NODE;
use crate::grpc::status::ticket_unknown;
use chefshat_hosting::room::Supersedes;
use chefshat_hosting::tournaments::{Call, Connection, TournamentHandle};
use chefshat_room::ids::{RoomId, RoomToken, TournamentToken};
use chefshat_wire::convert;

/// Ids of connections of participants.
static CONNECTIONS: AtomicU64 = AtomicU64::new(1);

impl Reader {
    /// Attaches a participant of a tournament, which then calls it to its games.
    pub(super) async fn enter(
        &mut self,
        tournament: Arc<TournamentHandle>,
        secret: &[u8; 32],
        attach: v1::Attach,
        handle: u32,
    ) {
        let request_id = attach.request_id;
        let Some(participant) = tournament.participant_of(secret) else {
            return self.refuse(handle, request_id, &ticket_unknown());
        };
        let entered = Update::Entered(v1::Entered {
            request_id,
            tournament_id: tournament.id().to_string(),
            participant: convert::number(participant),
        });
        if !self.send_update(handle, entered) {
            return;
        }
        let bound = BoundParticipant {
            tournament,
            participant,
            connection: CONNECTIONS.fetch_add(1, Ordering::Relaxed),
            attach,
            held_by: None,
        };
        self.participants.insert(handle, bound);
        self.take_part(handle, self.supersedes()).await;
    }

    /// Lets the tournament call the participant on this stream.
    async fn take_part(&self, handle: u32, supersedes: Supersedes) {
        let Some(bound) = self.participants.get(&handle) else {
            return;
        };
        let stream = Connection {
            handle,
            calls: self.calls.clone(),
            outbox: Arc::clone(&self.outbox),
            supersedes,
        };
        let Some(ticket) = TournamentToken::parse(&bound.attach.ticket) else {
            return;
        };
        let entering =
            (bound.tournament).enter(bound.participant, &ticket, bound.connection, stream);
        entering.await;
    }

    /// Takes a participant over from the stream that kept it.
    pub(super) async fn take_over(&mut self, handle: u32) {
        let bound = self.participants.get_mut(&handle);
        if let Some(holder) = bound.and_then(|bound| bound.held_by.take()) {
            self.take_part(handle, Supersedes::Only(Some(holder))).await;
        }
    }

    /// Executes a call of a tournament.
    pub(super) async fn follow_call(&mut self, handle: u32, call: Call) {
        match call {
            Call::Seat(room) => self.take_seat(handle, room).await,
            Call::HeldBy(holder) => {
                if let Some(bound) = self.participants.get_mut(&handle) {
                    bound.held_by = Some(holder);
                    self.ask_gateway(handle);
                }
            }
            Call::Superseded => self.dismiss(handle, v1::DetachReason::Superseded),
            Call::Over => self.dismiss(handle, v1::DetachReason::TournamentOver),
        }
    }

    /// Attaches a participant to its seat in the room of one of its games.
    async fn take_seat(&mut self, participant: u32, room: RoomId) {
        let Some(bound) = self.participants.get(&participant) else {
            return;
        };
        let Some(token) = TournamentToken::parse(&bound.attach.ticket) else {
            return;
        };
        // The same secret is that of its seat.
        let ticket = RoomToken {
            subject: room,
            secret: token.secret,
        };
        let attach = v1::Attach {
            ticket: ticket.to_text(),
            request_id: 0,
            ..bound.attach.clone()
        };
        // A seat that the client attached with the same ticket stays attached.
        let is_there = (self.seats.values()).any(|seat| {
            seat.secret == ticket.secret && seat.room.id() == room && !seat.is_detached()
        });
        let contested = self.contested.values().map(|seat| &seat.attach);
        let parked = self.parked.iter().flat_map(|it| it.attachments());
        let is_about_to = contested
            .chain(parked)
            .any(|attach| RoomToken::parse(&attach.ticket).is_some_and(|it| it == ticket));
        let is_newest = (bound.tournament).is_newest(bound.participant, bound.connection);
        if is_there || is_about_to || !is_newest {
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
        let next = (self.next_called - self.first_called + 1) % HANDLES_PER_NODE;
        self.next_called = self.first_called + next;
        let supersedes = self.supersedes();
        self.bind(attach, handle, Some(ticket), supersedes).await;
    }

    /// Detaches a participant from this stream. Its seats stay attached.
    fn dismiss(&mut self, handle: u32, reason: v1::DetachReason) {
        if self.participants.remove(&handle).is_some() {
            self.detached(handle, reason);
        }
    }
}
