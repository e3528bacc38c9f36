//! Participants of tournaments on a stream of `PlayService`: entered by their tickets, called to the rooms of their games, seated there by the
//! server, dismissed when the tournament is over or another stream has them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use chefshat_proto::v1::{self, seat_update::Update};

use super::reader::{Reader, too_many_seats};
use crate::convert;
use crate::grpc::status::ticket_unknown;
use crate::tournaments::{Call, Connection, Hosted};
use crate::wire::Updates;
use chefshat_room::ids::{Id, Token};

/// First handle of the seats that the server attaches by itself.
pub(super) const FIRST_CALLED: u32 = 1 << 31;

/// Numbers of connections of participants.
static CONNECTIONS: AtomicU64 = AtomicU64::new(1);

/// A participant of a tournament that is attached to a stream.
pub(super) struct BoundParticipant {
    tournament: Arc<Hosted>,
    participant: usize,
    connection: u64,
    /// How it asked to be attached, which holds for its seats too.
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

    /// Does what a tournament has called a participant of this stream to.
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
            ticket: ticket.word(),
            request_id: 0,
            ..bound.attach.clone()
        };
        // A seat that the client attached by itself with the same ticket stays where it is.
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
}
