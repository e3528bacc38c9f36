//! What a room tells once its changes are kept: answers to those who asked, news to seats and spectators, the record of a game that has
//! ended.

use std::sync::Arc;

use chefshat_engine::Seat;
use chefshat_proto::v1;
use tokio::sync::oneshot;
use tonic::Status;
use tracing::{error, info};

use super::Task;
use crate::convert;
use crate::grpc::status;
use crate::outbox::HandStamp;
use crate::room::delivery::{Attachment, is_urgent};
use crate::room::handle::{Acted, AttachRequest, Joined, SpectateError, SpectateRequest};
use crate::room::spectators::{MAX_SPECTATORS, Spectator};
use crate::store::StoreError;
use chefshat_room::{ConnectionId, JoinError, LeaveError, State};

/// What is told once the changes are kept.
pub(super) enum Release {
    Join(
        oneshot::Sender<Result<Joined, JoinError>>,
        Result<Joined, JoinError>,
    ),
    Attach(
        Box<AttachRequest>,
        Seat,
        ConnectionId,
        oneshot::Sender<Option<(Seat, ConnectionId)>>,
    ),
    Result(Seat, ConnectionId, v1::AnswerResult),
    Refuse(Seat, ConnectionId, v1::Refused),
    Acted(oneshot::Sender<Option<Acted>>, Acted),
    Closed(oneshot::Sender<Option<v1::Room>>),
    Left(
        oneshot::Sender<Option<Result<v1::Room, LeaveError>>>,
        Result<(), LeaveError>,
    ),
    Describe(oneshot::Sender<v1::Room>),
    Spectate(
        Box<SpectateRequest>,
        oneshot::Sender<Result<(), SpectateError>>,
    ),
}

impl Task {
    fn spectate(&mut self, request: SpectateRequest) -> Result<(), SpectateError> {
        let policy = &self.core.header().policy;
        if !policy.spectators {
            return Err(SpectateError::NotAdmitted);
        }
        if request.snapshot && policy.spectator_delay_decisions > 0 {
            return Err(SpectateError::SnapshotDelayed);
        }
        if self.spectators.len() >= MAX_SPECTATORS {
            return Err(SpectateError::Full);
        }
        let spectator = Spectator::new(&self.core, request.outbox, request.from, request.snapshot);
        self.spectators.push(spectator);
        Ok(())
    }

    /// Hands new changes to the store, awaits it, then tells everybody what they may know. `false` when the room must stop.
    pub(super) async fn keep_and_tell(&mut self) -> bool {
        if !self.core.unkept().is_empty() {
            if let Err(error) = self.journal.append(self.core.unkept()).await {
                self.fail(&error);
                return false;
            }
            // What the store took is nobody's thinking time.
            self.now = self.clock.now();
        }
        self.core.released(self.now);
        let ends = self.core.state().is_over() && self.over_since.is_none();
        if ends && !self.conclude().await {
            return false;
        }
        self.public.follow(&self.core);
        let mut releases = std::mem::take(&mut self.releases);
        for release in releases.drain(..) {
            self.release(release);
        }
        self.releases = releases;
        self.deliver();
        if ends {
            // Whoever waits for games to end may close streams at once: everything has been put into them.
            self.context.watcher.game_over(self.core.header().room_id);
        }
        true
    }

    fn release(&mut self, release: Release) {
        match release {
            Release::Join(reply, joined) => answer(reply, joined),
            Release::Attach(request, seat, connection, reply) => {
                self.release_attach(*request, seat, connection, reply);
            }
            Release::Result(seat, connection, result) => {
                if let Some(attachment) = self.current(seat, connection) {
                    attachment.tell_result(result);
                }
            }
            Release::Refuse(seat, connection, refused) => {
                if let Some(attachment) = self.current(seat, connection) {
                    attachment.refuse(refused);
                }
            }
            Release::Acted(reply, acted) => answer(reply, Some(acted)),
            Release::Closed(reply) => answer(reply, Some(convert::describe(&self.core))),
            Release::Left(reply, left) => {
                answer(reply, Some(left.map(|()| convert::describe(&self.core))));
            }
            Release::Describe(reply) => answer(reply, convert::describe(&self.core)),
            Release::Spectate(request, reply) => answer(reply, self.spectate(*request)),
        }
    }

    fn release_attach(
        &mut self,
        request: AttachRequest,
        seat: Seat,
        connection: ConnectionId,
        reply: oneshot::Sender<Option<(Seat, ConnectionId)>>,
    ) {
        let mut attachment = Attachment::new(
            connection,
            request.outbox,
            request.handle,
            request.wishes,
            HandStamp::new(self.clock),
            request.ended,
            Arc::clone(&self.on_space),
        );
        attachment.greet(&self.core, seat, request.request_id, request.told_ticket);
        let older = self.attachments[seat.index()].replace(attachment);
        if let Some(mut older) = older {
            older.detach(v1::DetachReason::Superseded);
        }
        let now = self.now;
        if let Some(attachment) = &mut self.attachments[seat.index()] {
            attachment.deliver(&self.core, &self.public, seat, now, true);
        }
        answer(reply, Some((seat, connection)));
    }

    fn current(&mut self, seat: Seat, connection: ConnectionId) -> Option<&mut Attachment> {
        self.attachments[seat.index()]
            .as_mut()
            .filter(|attachment| attachment.connection() == connection)
    }

    fn deliver(&mut self) {
        let now = self.now;
        let news = self.core.log().since(self.delivered);
        for seat in self.core.all_seats() {
            if let Some(attachment) = &mut self.attachments[seat.index()] {
                let urgent = news.iter().any(|entry| is_urgent(&entry.happening, seat));
                attachment.deliver(&self.core, &self.public, seat, now, urgent);
            }
        }
        self.delivered = self.core.log().len();
        let (core, on_space) = (&self.core, &self.on_space);
        self.spectators
            .retain_mut(|spectator| spectator.deliver(core, on_space));
    }

    /// The game has ended: the store is told, the record is written.
    async fn conclude(&mut self) -> bool {
        self.over_since = Some(self.now);
        let header = Arc::clone(self.core.header());
        // Of a room in which nothing was ever dealt there is no record.
        let summary = self.core.game().map(|_| convert::summary(&self.core));
        let has_record = summary.is_some();
        if let Err(error) = self.journal.finish(summary.map(Box::new)).await {
            self.fail(&error);
            return false;
        }
        info!(
            room = %header.room_id,
            game = %header.game_id,
            finished = self.core.state() == State::Finished,
            decisions = self.core.decisions(),
            "the game has ended"
        );
        if has_record {
            self.context.filing.file(header.game_id);
        }
        true
    }

    /// The store has failed: nobody is told of what may not be kept. The streams end, so that agents connect again and find the game where
    /// the server, once it is back, finds it.
    fn fail(&mut self, error: &StoreError) {
        error!(room = %self.core.header().room_id, %error, "the room stops");
        self.releases.clear();
        self.end_streams(&status::store_failed());
    }

    /// Ends the streams of everybody in the room, who may connect again when the server is back.
    pub(super) fn end_streams(&mut self, status: &Status) {
        for attachment in self.attachments.iter_mut().flatten() {
            attachment.end(status.clone());
        }
        for spectator in self.spectators.drain(..) {
            spectator.end(status.clone());
        }
    }
}

/// Answers a caller. One that is no longer there does not want to know.
pub(super) fn answer<T>(reply: oneshot::Sender<T>, answer: T) {
    let _ = reply.send(answer);
}
