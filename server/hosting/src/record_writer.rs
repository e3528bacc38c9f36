//! Writes the records of finished games to files, in the background, those of each caller in turns.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tokio::sync::{Mutex, OwnedRwLockWriteGuard, RwLock};
use tokio_util::task::TaskTracker;
use tracing::{error, info};

use chefshat_admission::limits::{Background, Key};
use chefshat_base::tasks::short;
use chefshat_record::atomic_file;
use chefshat_room::ids::GameId;
use chefshat_store::{Store, StoredGame};

/// Lines of a record after which the disk may have become nearly full.
const LINES_PER_CHECK: usize = 256;

/// Writes records to the folder of records of a data directory.
#[derive(Clone)]
pub struct RecordWriter {
    store: Arc<dyn Store>,
    /// `None`: records are not written.
    data_dir: Option<PathBuf>,
    tracker: TaskTracker,
    background: Arc<Background>,
    /// Locked for reading while a record is written.
    writing: Arc<RwLock<()>>,
    /// Locked by the record that waits for space.
    first: Arc<Mutex<()>>,
}

impl RecordWriter {
    /// Writes games of `store` under `data_dir`; a shutdown waits for `tracker`.
    pub fn new(
        store: Arc<dyn Store>,
        data_dir: Option<PathBuf>,
        tracker: TaskTracker,
        background: Arc<Background>,
    ) -> Self {
        Self {
            store,
            data_dir,
            tracker,
            background,
            writing: Arc::default(),
            first: Arc::default(),
        }
    }

    /// The data directory, if records are written.
    pub fn data_dir(&self) -> Option<&Path> {
        self.data_dir.as_deref()
    }

    /// Waits until no record is being written, and lets none begin while the value lives.
    pub async fn pause(&self) -> OwnedRwLockWriteGuard<()> {
        Arc::clone(&self.writing).write_owned().await
    }

    /// Queues the record of a finished game, charged to its creator, and marks it as written in the
    /// store. The file waits while the disk is nearly full. A record that fails, or still waits
    /// when the server stops, is tried again at its next start.
    pub fn write_record(&self, game: GameId, charged: Key) {
        if let Some(data_dir) = self.data_dir.clone() {
            let writer = self.clone();
            self.tracker
                .spawn(short("one record", writer.write(game, charged, data_dir)));
        }
    }

    async fn write(self, game: GameId, charged: Key, data_dir: PathBuf) {
        // Before it is read: a long record takes much memory. The database has it already, so its
        // file takes nothing of what is kept for running games.
        let (_slice, _writing) = loop {
            let slice = self.background.slice(charged).await;
            if self.store.has_space() {
                if let Ok(writing) = self.writing.try_read() {
                    break (slice, writing);
                }
                // A pause may take minutes, in which others compute.
                drop(slice);
                drop(self.writing.read().await);
                continue;
            }
            drop(slice);
            // The first one waits for space, and the others for it.
            let _first = self.first.lock().await;
            if !self.store.has_space() {
                info!("records are written to files as soon as the disk has space for them");
            }
            if !self.store.wait_for_space().await {
                return;
            }
        };
        let stored = match self.store.finished(game).await {
            Ok(Some(stored)) => stored,
            Ok(None) => return,
            Err(error) => {
                error!(%game, %error, "writing a record failed");
                return;
            }
        };
        if let StoredGame::Hosted(header, ..) = &stored
            && header.study.is_some()
        {
            // Its record is in the database alone, from which a participant's data can be deleted.
            if let Err(error) = self.store.mark_record_written(game).await {
                error!(%game, %error, "a game of a study was not marked as needing no record file");
            }
            return;
        }
        let store = Arc::clone(&self.store);
        let writing = self.background.run(move || {
            let path = chefshat_record::jsonl::path_of(&data_dir, &game.to_string());
            let written = chefshat_record::jsonl::write_private(&path, |write| {
                let (mut count, mut written) = (0_usize, Ok(()));
                stored.each_line(|line| {
                    if count.is_multiple_of(LINES_PER_CHECK) && !store.has_space() {
                        written = Err(io::ErrorKind::StorageFull.into());
                    }
                    count += 1;
                    if written.is_ok() {
                        write(&line);
                    }
                });
                written
            });
            written.map(|()| path)
        });
        match writing.await {
            Some(Ok(path)) => {
                // It may have been deleted meanwhile, and its files before this one was there.
                if self.store.outlives_server()
                    && let Ok(None) = self.store.summary(game).await
                {
                    let removing = tokio::task::spawn_blocking(move || atomic_file::remove(&path));
                    if !matches!(removing.await, Ok(Ok(()))) {
                        error!(%game, "the record file of a deleted game was not removed");
                    }
                    return;
                }
                info!(%game, path = %path.display(), "record written");
                if let Err(error) = self.store.mark_record_written(game).await {
                    error!(%game, %error, "a record was written but not marked as written");
                }
            }
            Some(Err(error)) => error!(%game, %error, "writing a record failed"),
            None => error!(%game, "writing a record failed"),
        }
    }
}

#[cfg(test)]
mod tests {
    use futures::FutureExt as _;

    use super::*;
    use chefshat_admission::limits::Shares;
    use chefshat_store::MemoryStore;

    /// Deleting a participant pauses the records, and reads every file of them.
    #[tokio::test]
    async fn records_that_are_paused_leave_long_computations_to_others() {
        let background = Arc::new(Background::new(Shares::ALL, 1).expect("threads"));
        let writer = RecordWriter::new(
            Arc::new(MemoryStore::default()),
            Some(PathBuf::new()),
            TaskTracker::new(),
            Arc::clone(&background),
        );
        let paused = writer.pause().await;
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        for _ in 0..cores {
            writer.write_record(GameId::random(), Key::Local);
        }
        for _ in 0..100 {
            tokio::task::yield_now().await;
        }
        assert!(background.slice(Key::Resumed).now_or_never().is_some());
        drop(paused);
        writer.tracker.close();
        writer.tracker.wait().await;
    }
}
