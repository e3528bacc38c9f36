//! Writes the records of finished games to files, in the background, a few at a time.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tokio::sync::Semaphore;
use tokio_util::task::TaskTracker;
use tracing::{error, info};

use crate::config::MAX_CONCURRENT_RECORDS;
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
    /// Writes games of `store` under `data_dir`; a shutdown waits for `tracker`.
    pub fn new(store: Arc<dyn Store>, data_dir: Option<PathBuf>, tracker: TaskTracker) -> Self {
        Self {
            store,
            data_dir,
            tracker,
            permits: Arc::new(Semaphore::new(MAX_CONCURRENT_RECORDS)),
        }
    }

    /// The data directory, if records are written.
    pub fn data_dir(&self) -> Option<&Path> {
        self.data_dir.as_deref()
    }

    /// Queues the record of a finished game and marks it as written in the store. A record that
    /// fails is tried again at the next start of the server.
    pub fn write_record(&self, game: Id) {
        if let Some(data_dir) = self.data_dir.clone() {
            let writer = self.clone();
            self.tracker.spawn(writer.write(game, data_dir));
        }
    }

    async fn write(self, game: Id, data_dir: PathBuf) {
        // The semaphore is never closed; if it were, the record would merely not wait.
        let _permit = self.permits.acquire().await.ok();
        let stored = match self.store.finished(game).await {
            Ok(Some(stored)) => stored,
            Ok(None) => return,
            Err(error) => {
                error!(%game, %error, "writing a record failed");
                return;
            }
        };
        let written = tokio::task::spawn_blocking(move || {
            let lines = convert::lines_of(&stored);
            let path = chefshat_record::jsonl::path_of(&data_dir, &game.to_string());
            chefshat_record::jsonl::write(&path, &lines).map(|()| path)
        })
        .await;
        match written {
            Ok(Ok(path)) => {
                info!(%game, path = %path.display(), "record written");
                if let Err(error) = self.store.mark_record_written(game).await {
                    error!(%game, %error, "a record was written but not marked as written");
                }
            }
            Ok(Err(error)) => error!(%game, %error, "writing a record failed"),
            Err(error) => error!(%game, %error, "writing a record failed"),
        }
    }
}
