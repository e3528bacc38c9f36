//! What a room tells once its changes are kept: answers to those who asked, news to seats and spectators, the record of a game that has
//! ended.

use std::path::PathBuf;
use std::sync::Arc;

use chefshat_engine::Seat;
use chefshat_proto::v1;
use tokio::sync::oneshot;
use tracing::{error, info};

use super::Task;
use crate::convert;
use crate::ids::Id;
use crate::outbox::HandStamp;
use crate::room::core::{ConnectionId, JoinError, State};
use crate::room::delivery::{Attachment, is_urgent};
use crate::room::handle::{Acted, AttachRequest, Joined, SpectateError, SpectateRequest};
use crate::room::spectators::{MAX_SPECTATORS, Spectator};
use crate::store::Store;

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
        if !self.core.unkept().is_empty()
            && let Err(error) = self.journal.append(self.core.unkept()).await
        {
            self.fail(&error.to_string());
            return false;
        }
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
            HandStamp::new(self.epoch),
            request.ended,
            Arc::clone(&self.on_space),
        );
        attachment.greet(&self.core, seat, request.request_id);
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
        if let Err(error) = self.journal.finish().await {
            self.fail(&error.to_string());
            return false;
        }
        info!(
            room = %header.room_id,
            game = %header.game_id,
            finished = self.core.state() == State::Finished,
            decisions = self.core.decisions(),
            "the game has ended"
        );
        // A room in which nothing was ever dealt leaves no record.
        if let (Some(data_dir), true) = (&self.context.data_dir, self.core.game().is_some()) {
            let write = write_record(
                Arc::clone(&self.context.store),
                header.game_id,
                data_dir.clone(),
            );
            self.context.tracker.spawn(write);
        }
        true
    }

    /// The store has failed: nobody is told of what may not be kept; everybody is told that the room has stopped.
    fn fail(&mut self, error: &str) {
        error!(room = %self.core.header().room_id, error, "the room stops because its store failed");
        self.releases.clear();
        for attachment in self.attachments.iter_mut().flatten() {
            attachment.detach(v1::DetachReason::RoomFailed);
        }
        for spectator in self.spectators.drain(..) {
            spectator.fail();
        }
    }
}

async fn write_record(store: Arc<dyn Store>, game: Id, data_dir: PathBuf) {
    let kept = match store.finished(game).await {
        Ok(Some(kept)) => kept,
        Ok(None) => return,
        Err(error) => {
            error!(%game, %error, "the record is not written");
            return;
        }
    };
    let written = tokio::task::spawn_blocking(move || {
        let (header, journal) = kept;
        let lines = convert::record_lines(&header, &journal);
        let path = chefshat_records::jsonl::path_of(&data_dir, &game.to_string());
        chefshat_records::jsonl::write(&path, &lines).map(|()| path)
    })
    .await;
    match written {
        Ok(Ok(path)) => info!(%game, path = %path.display(), "the record is written"),
        Ok(Err(error)) => error!(%game, %error, "the record is not written"),
        Err(error) => error!(%game, %error, "the record is not written"),
    }
}

/// Answers a caller. One that is no longer there does not want to know.
pub(super) fn answer<T>(reply: oneshot::Sender<T>, answer: T) {
    let _ = reply.send(answer);
}
