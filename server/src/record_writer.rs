//! Writing the records of finished games to files, in the background, a few at a time.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tokio::sync::Semaphore;
use tokio_util::task::TaskTracker;
use tracing::{error, info};

use crate::config::MAX_RECORDS_IN_HAND;
use crate::convert;
use crate::store::Store;
use chefshat_room::ids::Id;

/// Writes records to the folder of records of a data directory.
#[derive(Clone)]
pub struct RecordWriter {
    store: Arc<dyn Store>,
    /// `None`: records are not written.
    data_dir: Option<PathBuf>,
    tracker: TaskTracker,
    permits: Arc<Semaphore>,
}

impl RecordWriter {
    /// Writes what `store` holds under `data_dir`; a shutdown waits for `tracker`.
    pub fn new(store: Arc<dyn Store>, data_dir: Option<PathBuf>, tracker: TaskTracker) -> Self {
        Self {
            store,
            data_dir,
            tracker,
            permits: Arc::new(Semaphore::new(MAX_RECORDS_IN_HAND)),
        }
    }

    /// The data directory, if records are written.
    pub fn data_dir(&self) -> Option<&Path> {
        self.data_dir.as_deref()
    }

    /// Writes the record of a finished game when its turn comes, and has the store note it. What fails is tried again when the server next
    /// starts.
    pub fn write_record(&self, game: Id) {
        if let Some(data_dir) = self.data_dir.clone() {
            let writer = self.clone();
            self.tracker.spawn(writer.write(game, data_dir));
        }
    }

    async fn write(self, game: Id, data_dir: PathBuf) {
        // Nobody closes it; if somebody did, the record would merely not wait.
        let _permit = self.permits.acquire().await.ok();
        let kept = match self.store.finished(game).await {
            Ok(Some(kept)) => kept,
            Ok(None) => return,
            Err(error) => {
                error!(%game, %error, "the record is not written");
                return;
            }
        };
        let written = tokio::task::spawn_blocking(move || {
            let lines = convert::lines_of(&kept);
            let path = chefshat_record::jsonl::path_of(&data_dir, &game.to_string());
            chefshat_record::jsonl::write(&path, &lines).map(|()| path)
        })
        .await;
        match written {
            Ok(Ok(path)) => {
                info!(%game, path = %path.display(), "the record is written");
                if let Err(error) = self.store.note_filed(game).await {
                    error!(%game, %error, "that the record is written was not noted");
                }
            }
            Ok(Err(error)) => error!(%game, %error, "the record is not written"),
            Err(error) => error!(%game, %error, "the record is not written"),
        }
    }
}
