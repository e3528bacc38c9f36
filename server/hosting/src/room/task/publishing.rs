//! What a room sends: answers to callers, and events to its connections and spectators, once the
//! changes are committed.

use std::sync::Arc;

use chefshat_engine::Seat;
use chefshat_proto::v1;
use chefshat_room::journal::ParticipantKind;
use chefshat_room::{ConnectionId, MAX_EVENTS_KEPT};

use super::{AfterCommit, Room, answer, is_connection};
use crate::room::markers::MarkerLog;
use crate::room::message::{
    AttachRequest, AttachedSeat, NotAttached, Reply, RoomError, SpectateError, SpectateRequest,
};
use crate::room::subscriber::{
    MAX_PENDING_EVENTS, Publication, SeatConnection, Subscriber, is_urgent,
};
use chefshat_wire::convert;
use chefshat_wire::outbox::HandStamp;

impl Room {
    fn spectate(&mut self, request: SpectateRequest) -> Result<(), SpectateError> {
        let policy = &self.core.header().policy;
        if !policy.spectators && !request.is_owner {
            return Err(SpectateError::NotAdmitted);
        }
        if request.snapshot && policy.spectator_delay_decisions > 0 {
            return Err(SpectateError::SnapshotDelayed);
        }
        // The places of those who have left are free.
        self.spectators.retain(|it| !it.is_abandoned());
        let place = (self.spectator_places.try_take(request.charged)).ok_or(SpectateError::Full)?;
        let spectator = Subscriber::spectator(
            &self.core,
            request.outbox,
            Arc::clone(&self.on_space),
            request.from,
            request.snapshot,
            (self.context.metrics.spectator(), place),
        );
        let position = spectator.position();
        self.spectators.push(spectator);
        self.encode_from(position);
        Ok(())
    }

    /// Encodes the public events from a position on, which somebody reads next.
    fn encode_from(&mut self, position: usize) {
        // Events that are gone are not sent.
        if position.max(self.core.log().first()) < self.public.encoded().start {
            self.public.restart_at(self.core.log().first());
            self.public.follow(&self.core);
        }
    }

    /// Sends committed changes to subscribers and results to callers.
    pub(super) fn publish(&mut self) {
        self.core.released(self.now);
        self.forget_events();
        self.public.follow(&self.core);
        let mut after_commit = std::mem::take(&mut self.after_commit);
        for release in after_commit.drain(..) {
            self.release(release);
        }
        self.after_commit = after_commit;
        if let Some(table) = &self.table {
            table.follow(&self.core, self.now);
        }
        if let Some(markers) = &self.markers {
            markers.follow(&self.core);
        }
        self.deliver();
        if self.core.state().is_over() {
            // Those who have received its end are no longer connected.
            self.forget_events();
        }
        self.telemetry.trace_decision(&self.core);
        let metrics = &self.context.metrics;
        self.telemetry.count_published(&self.core, metrics);
    }

    /// Drops old events: the most recent ones are kept for those who come late or come back, and what
    /// connected spectators have not read yet. A seat that is further behind receives a snapshot.
    fn forget_events(&mut self) {
        let length = self.core.log().len();
        let is_left = self.core.state().is_over() && self.is_left();
        if self.core.log().kept() > MAX_EVENTS_KEPT {
            let read_by_spectators = self.spectators.iter().map(Subscriber::position).min();
            let keep_from = (length - MAX_EVENTS_KEPT).min(read_by_spectators.unwrap_or(length));
            self.core.drop_log_before(keep_from);
        }
        // While nobody watches a game that nobody plays, or that is over, none are encoded.
        let is_unwatched = self.core.is_built_in_only() && self.spectators.is_empty();
        self.public.drop_before(match is_left || is_unwatched {
            true => length,
            false => self.core.log().first(),
        });
    }

    /// Whether nobody is connected to whom something remains to be sent.
    fn is_left(&self) -> bool {
        self.spectators.is_empty() && self.connections.iter().flatten().all(Subscriber::has_ended)
    }

    fn release(&mut self, release: AfterCommit) {
        match release {
            AfterCommit::Join(reply, joined) => answer(reply, joined.map_err(RoomError::Refused)),
            AfterCommit::Attach(request, seat, connection, reply) => {
                self.release_attach(*request, seat, connection, reply);
            }
            AfterCommit::Result(seat, connection, result) => {
                if let Some(subscriber) = self.current(seat, connection) {
                    subscriber.send_result(result);
                    self.always_visit[seat.index()] = true;
                }
            }
            AfterCommit::Refuse(seat, connection, refused) => {
                if let Some(subscriber) = self.current(seat, connection) {
                    subscriber.refuse(refused);
                    self.always_visit[seat.index()] = true;
                }
            }
            AfterCommit::Acted(reply, acted) => answer(reply, acted.map_err(RoomError::Refused)),
            AfterCommit::Hint(reply, hint) => answer(reply, Ok(hint)),
            AfterCommit::Closed(reply) => answer(reply, Ok(convert::describe(&self.core))),
            AfterCommit::Left(reply, left) => {
                let left = left.map(|()| convert::describe(&self.core));
                answer(reply, left.map_err(RoomError::Refused));
            }
            AfterCommit::Describe(reply) => {
                let watching = (self.spectators.iter())
                    .filter(|it| !it.is_abandoned())
                    .count();
                let room = v1::Room {
                    spectators: convert::number(watching),
                    ..convert::describe_at(&self.core, self.now)
                };
                answer(reply, room);
            }
            AfterCommit::Spectate(request, reply) => {
                let watching = self.spectate(*request);
                answer(reply, watching.map_err(RoomError::Refused));
            }
            AfterCommit::Reported(reply, outcome) => {
                let state = (self.table.as_ref()).map(|table| table.state(&self.core, self.now));
                let state = state.map_or_else(v1::TableState::default, Arc::unwrap_or_clone);
                let response = convert::report_response(&outcome, state);
                answer(reply, Ok(Box::new(response)));
            }
            AfterCommit::Marked(reply, number) => {
                let marker = &self.core.markers()[number - 1];
                let marker = convert::marker_to_proto(number - 1, marker);
                answer(reply, Ok(marker));
            }
            AfterCommit::FollowMarkers(position, reply) => {
                let core = &self.core;
                let log = (self.markers).get_or_insert_with(|| Box::new(MarkerLog::new(core)));
                log.follow(core);
                let following = log
                    .subscribe(position)
                    .ok_or(RoomError::Refused(SpectateError::Full));
                answer(reply, following);
            }
            AfterCommit::WatchTable(reply) => {
                let watching = (self.table.as_ref())
                    .and_then(|table| table.watch(&self.core, self.now))
                    .ok_or(RoomError::Refused(SpectateError::Full));
                answer(reply, watching);
            }
        }
    }

    fn release_attach(
        &mut self,
        request: AttachRequest,
        seat: Seat,
        connection: ConnectionId,
        reply: Reply<AttachedSeat, NotAttached>,
    ) {
        // Its participant may have left or been removed in the same batch.
        if self.core.seat_of_ticket(&request.secret) != Some(seat) {
            return answer(reply, Err(RoomError::SecretUnknown));
        }
        let participant = self.core.standing(seat).participant;
        let kind = participant.map_or(ParticipantKind::Agent, |participant| participant.kind);
        let stamp = HandStamp::new(self.clock.clone());
        let connected = SeatConnection::new(
            (seat, connection, request.charged),
            request.handle,
            request.options,
            Arc::clone(&stamp),
            request.by_gateway,
            request.detached,
            self.context.metrics.seat(kind),
        );
        let mut subscriber =
            Subscriber::seat(connected, request.outbox, Arc::clone(&self.on_space));
        subscriber.confirm_attached(&self.core, request.request_id, request.assigned_ticket);
        self.encode_from(subscriber.position());
        let news = Publication::new(&self.core, &self.public, self.now);
        subscriber.deliver(&news, true);
        if let Some(mut older) = self.connections[seat.index()].replace(subscriber) {
            older.detach(v1::DetachReason::Superseded);
        }
        self.always_visit[seat.index()] = true;
        let attached = AttachedSeat {
            seat,
            connection,
            stamp,
        };
        answer(reply, Ok(attached));
    }

    /// The number of the newest connection of a seat, attached or about to be.
    pub(super) fn holder(&self, seat: Seat) -> Option<u64> {
        let mut attaching = self
            .after_commit
            .iter()
            .rev()
            .filter_map(|release| match release {
                AfterCommit::Attach(_, of, connection, _) if *of == seat => Some(connection.0),
                _ => None,
            });
        let attached = || {
            let subscriber = self.connections[seat.index()].as_ref()?;
            Some(subscriber.connection()?.id.0)
        };
        attaching.next().or_else(attached)
    }

    fn current(&mut self, seat: Seat, connection: ConnectionId) -> Option<&mut Subscriber> {
        self.connections[seat.index()]
            .as_mut()
            .filter(|subscriber| is_connection(subscriber, connection))
    }

    /// Sends updates that are due. Visits only connections for which some may be: with many rooms,
    /// each visit costs several cache misses.
    fn deliver(&mut self) {
        let events = self.core.log().since(self.delivered);
        let length = self.core.log().len();
        let news = Publication::new(&self.core, &self.public, self.now);
        let awaited = self.core.awaited().map(|open| open.decision.seat);
        let all = length >= self.backlog_due_at || self.core.state().is_over();
        for seat in self.core.all_seats() {
            let urgent = events.clone().any(|entry| is_urgent(&entry.event, seat));
            let substituted = self.core.is_substituted_unseen(seat);
            let always_visit = &mut self.always_visit[seat.index()];
            if (all || urgent || substituted || *always_visit || awaited == Some(seat))
                && let Some(subscriber) = &mut self.connections[seat.index()]
            {
                subscriber.deliver(&news, urgent);
                *always_visit = subscriber.must_always_be_visited();
            }
        }
        if all {
            let connected = self.connections.iter().flatten();
            let due_at = connected.map(Subscriber::backlog_due_at).min();
            self.backlog_due_at = due_at.unwrap_or(length + MAX_PENDING_EVENTS);
        }
        self.delivered = length;
        self.spectators
            .retain_mut(|spectator| spectator.deliver(&news, false));
    }
}
