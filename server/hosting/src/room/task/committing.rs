//! How a room commits its changes, ends its game, and fails. Nothing is published before it is
//! committed, nor while another node of the cluster may have the room.

use std::sync::Arc;
use std::time::Duration;

use chefshat_room::State;
use chefshat_room::ids::RoomId;
use tokio::time::Instant;
use tracing::{error, info, warn};

use super::{GameEnd, Room};
use crate::signing::ReadRecord;
use chefshat_store::StoreError;
use chefshat_wire::convert;
use chefshat_wire::outbox::StreamEnd;

/// How long a node tries to read a journal to sign the record, as long as its store tries to commit
/// the end of the game, and the pause before the next attempt.
const SIGNING_LIMIT: Duration = Duration::from_mins(5);
const SIGNING_PAUSE: Duration = Duration::from_secs(1);

impl Room {
    /// Commits new changes if this takes no time.
    pub(super) fn commit_now(&mut self) -> bool {
        let metrics = &self.context.metrics;
        self.telemetry.count_changes(&mut self.core, metrics);
        self.core.pending().is_empty() || self.journal.append_now(self.core.pending())
    }

    /// Commits new changes, then publishes what subscribers may know. Returns `false` when the room
    /// must stop.
    pub(super) async fn commit_and_publish(&mut self) -> bool {
        if !self.commit_now() {
            let room = self.core.header().room_id;
            let appended = self.journal.append(self.core.pending());
            if let Err(error) = unless(self.fence.cancelled(), room, appended).await {
                self.fail(&error);
                return false;
            }
            // The time of the commit does not count as thinking time.
            self.now = self.clock.now();
        }
        let ends = self.core.state().is_over() && self.over_since.is_none();
        let mut end = None;
        if ends {
            end = self.conclude().await;
            if end.is_none() {
                return false;
            }
        }
        if !self.wait_for_lease().await {
            return false;
        }
        self.publish();
        if let Some(end) = end {
            // A shutdown that waits for games to end may close streams at once: everything has been
            // queued.
            (self.context.watcher).game_over(self.core.header().room_id, end);
        }
        true
    }

    /// Waits until the server may publish. Returns `false` if the room must stop instead.
    async fn wait_for_lease(&mut self) -> bool {
        let Some(lease) = self.context.lease.as_ref().filter(|lease| !lease.holds()) else {
            return true;
        };
        tokio::select! {
            () = self.fence.cancelled() => return false,
            () = lease.held() => {}
        }
        self.now = self.clock.now();
        true
    }

    /// Handles the end of the game: finishes the journal and writes the record. Returns `None` when
    /// the room must stop.
    async fn conclude(&mut self) -> Option<GameEnd> {
        self.over_since = Some(self.now);
        let header = Arc::clone(self.core.header());
        // A game without a deal has no record.
        let summary = self.core.game().map(|_| convert::summary(&self.core));
        let has_record = summary.is_some();
        let announced = summary.clone().filter(|_| self.context.webhooks.is_on());
        (self.context.metrics).game_ended(self.core.state() == State::Finished);
        let read = match has_record {
            true => self.read_record().await,
            false => Ok(ReadRecord::default()),
        };
        let finished = match read {
            Ok(ReadRecord { signature, outcome }) => {
                let finished = self.journal.finish(summary.map(Box::new), signature);
                // A node that has a lease learns from its beat that the game is over, maybe before
                // it learns the outcome: it is fenced then, and not lost.
                let lost = async {
                    self.fence.cancelled().await;
                    if let Some(lease) = &self.context.lease {
                        lease.lapsed().await;
                    }
                };
                (unless(lost, header.room_id, finished).await).map(|()| outcome)
            }
            Err(error) => Err(error),
        };
        let outcome = match finished {
            Ok(outcome) => outcome,
            Err(error) => {
                self.over_since = None;
                self.fail(&error);
                return None;
            }
        };
        (self.context.webhooks).game_ended(&header, announced.as_ref());
        info!(
            room = %header.room_id,
            game = %header.game_id,
            finished = self.core.state() == State::Finished,
            decisions = self.core.decisions(),
            "the game has ended"
        );
        if has_record {
            let owner = self.context.owner;
            self.context
                .record_writer
                .write_record(header.game_id, owner);
        }
        Some(match self.core.state() {
            State::Aborted(_) if !has_record => GameEnd::NotDealt,
            State::Aborted(reason) => GameEnd::Aborted(reason),
            _ => GameEnd::Finished(outcome.map(Arc::new)),
        })
    }

    /// Reads the record of the game to sign it. If its journal cannot be read, the record stays
    /// unsigned; a node, whose database may be away, tries again before.
    ///
    /// # Errors
    /// The room was fenced meanwhile.
    async fn read_record(&mut self) -> Result<ReadRecord, StoreError> {
        let background = self.core.is_built_in_only();
        let background = background.then_some((&*self.context.background, self.context.owner));
        let header = self.core.header();
        let (game, unit) = (header.game_id, header.unit());
        let limit = match self.context.lease {
            Some(_) if self.context.signer.key().is_some() => SIGNING_LIMIT,
            _ => Duration::ZERO,
        };
        let began = Instant::now();
        loop {
            let header = Arc::clone(self.core.header());
            let journal = &mut *self.journal;
            let reading = self.context.signer.read(header, journal, background);
            let error = match reading.await {
                Ok(read) => return Ok(read),
                Err(error) => error,
            };
            if began.elapsed() >= limit {
                error!(%game, %error, "the record of a game could not be read; it has no signature");
                return Ok(ReadRecord::default());
            }
            tokio::select! {
                () = self.fence.cancelled() => return Err(StoreError::Fenced(unit)),
                () = tokio::time::sleep(SIGNING_PAUSE) => {}
            }
        }
    }

    /// Handles a failure of the store: nothing uncommitted is published. The streams end, so that
    /// agents reconnect and find the game as the restarted server, or the node that owns it, finds
    /// it.
    fn fail(&mut self, error: &StoreError) {
        let room = self.core.header().room_id;
        self.after_commit.clear();
        match (error, &self.context.lease) {
            (StoreError::Fenced(_) | StoreError::Lost(_), _) => {
                info!(%room, %error, "the room stops here")
            }
            (_, Some(_)) => warn!(%room, %error, "the room stops until its node resumes it"),
            (_, None) => {
                error!(%room, %error, "the store failed; the room stops");
                self.end_streams(StreamEnd::StoreFailed);
            }
        }
    }
}

/// The result of a write, unless the room is lost before.
async fn unless(
    lost: impl Future<Output = ()>,
    room: RoomId,
    written: impl Future<Output = Result<(), StoreError>>,
) -> Result<(), StoreError> {
    tokio::select! {
        biased;
        written = written => written,
        () = lost => Err(StoreError::Fenced(room.unit())),
    }
}
