//! Recorded games as services need them: found by their id, read a few at a time, off the threads that serve others. A turn is held by the
//! work itself, not by who asked for it: a call that is given up does not make room for another before its work has ended.

use std::sync::Arc;

use chefshat_proto::v1;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tonic::{Code, Status};

use super::status::{self, status};
use crate::config::MAX_RECORDS_IN_HAND;
use crate::convert::lines_of;
use crate::rooms::Rooms;
use crate::store::StoreError;
use chefshat_room::ids::Id;

/// Why a record is withheld for a while.
pub(super) const SERIES_OPEN: &str = "SERIES_OPEN";

/// The recorded games of a server.
#[derive(Debug, Clone)]
pub struct Recorded {
    rooms: Arc<Rooms>,
    /// Records are large while they are put together: only so many at a time.
    permits: Arc<Semaphore>,
}

impl Recorded {
    /// The recorded games of these rooms' store.
    pub fn new(rooms: Arc<Rooms>) -> Self {
        Self {
            rooms,
            permits: Arc::new(Semaphore::new(MAX_RECORDS_IN_HAND)),
        }
    }

    /// The rooms.
    pub(super) fn rooms(&self) -> &Arc<Rooms> {
        &self.rooms
    }

    /// What `work` makes of the record of a game that has ended.
    pub(super) async fn of_game<T: Send + 'static>(
        &self,
        game_id: &str,
        work: impl FnOnce(Vec<v1::RecordLine>) -> T + Send + 'static,
    ) -> Result<T, Status> {
        let unknown = || {
            status(
                Code::NotFound,
                "GAME_UNKNOWN",
                format!(
                    "the server holds no game {game_id:?}; list its records to see which it holds"
                ),
                [("field", "game_id")],
            )
        };
        let game = Id::parse(game_id).ok_or_else(unknown)?;
        if self.rooms.is_running(game) {
            return Err(status(
                Code::FailedPrecondition,
                "GAME_RUNNING",
                "this game has not ended; its record can be had when it has",
                [("field", "game_id")],
            ));
        }
        let permit = permit(&self.permits).await;
        let kept = (self.rooms.store().finished(game).await)
            .map_err(not_read)?
            .ok_or_else(unknown)?;
        if (kept.tournament()).is_some_and(|game| self.rooms.is_withheld(game)) {
            return Err(status(
                Code::FailedPrecondition,
                SERIES_OPEN,
                "other games with the same deals are being played; its record can be had when they have ended",
                [("field", "game_id")],
            ));
        }
        in_background(permit, move || work(lines_of(&kept).into_owned())).await
    }

    /// What `work` makes of something that is as large as a record.
    pub(super) async fn in_turn<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Status> {
        in_background(permit(&self.permits).await, work).await
    }
}

/// Waits for a turn; what is returned holds it.
pub(super) async fn permit(permits: &Arc<Semaphore>) -> Option<OwnedSemaphorePermit> {
    // Nobody closes it; if somebody did, the request would merely not wait.
    Arc::clone(permits).acquire_owned().await.ok()
}

/// What a client is told when the store cannot be read.
pub(super) fn not_read(error: StoreError) -> Status {
    tracing::error!(%error, "a record was not read");
    status::internal()
}

/// Does work that takes milliseconds on a thread that serves nobody. The turn ends with the work.
async fn in_background<T: Send + 'static>(
    permit: Option<OwnedSemaphorePermit>,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Status> {
    let working = tokio::task::spawn_blocking(move || {
        let _permit = permit;
        work()
    });
    working.await.map_err(|error| {
        tracing::error!(%error, "work on a record was not done");
        status::internal()
    })
}
