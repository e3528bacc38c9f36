//! Stores games in an SQLite database. `open` opens it, `reader` reads, `journals` and `writer`
//! write, `backup` copies, `contents` is for moving; this file joins them into a store.

mod backup;
mod contents;
mod errors;
mod forget;
mod former;
mod journals;
mod open;
mod reader;
mod retained;
mod rewriting;
mod rows;
mod space;
#[cfg(test)]
pub(super) mod tests;
mod units;
mod writer;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::sync::{Arc, Mutex};

use async_trait::async_trait;
use chefshat_proto::v1;
use chefshat_record::pseudonym::Pseudonym;
use futures::future::pending;
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use tracing::{error, warn};

pub use backup::{DatabaseCopy, check_copy, copy_database};
pub(crate) use contents::{Contents, GameRow, JournalRow, ParticipantRow, TracesRow, UnitHeader};
pub use errors::FILE as DATABASE_FILE;
pub use former::LOCK_FILE;
pub(crate) use former::{forget_move, note_move};
pub use open::OpenError;
use open::{FolderLock, IfGone};
pub(crate) use open::{moved, moved_to};

use super::decode_pool::DecodePool;
use super::ephemeral::{EphemeralJournal, Reservations, Scratch};
use super::forget::forget_participant;
use super::form;
use super::units::{StoredTraces, StoredUnit, UnitKey, UnitKind, UnitWrite};
use super::{
    DiskUsage, ForgetError, Forgotten, Journal, Listed, Part, ResumableGame, Store, StoreError,
    StoredGame,
};
use crate::Keep;
use chefshat_base::metrics::StoreMetrics;
use chefshat_base::tasks::{LongTask, named};
use chefshat_room::ids::{GameId, StudyId};
use chefshat_room::journal::{Entry, GameHeader};
use chefshat_room::policy::Durability;
use journals::{DurableJournal, Whole, WriteQueue};
use reader::Reader;
use space::{Disk, Space};
use writer::WriteCommand;

/// Stores games in the database of a data directory.
pub struct SqliteStore {
    data_dir: PathBuf,
    reader: Reader,
    decoding: DecodePool,
    commands: WriteQueue,
    failed: watch::Receiver<Option<StoreError>>,
    numbers: Arc<AtomicI64>,
    /// The ids of what is not in the database yet.
    reserved: Reservations,
    scratch: Scratch,
    writing: Mutex<Option<JoinHandle<()>>>,
    closed: AtomicBool,
    metrics: StoreMetrics,
    space: Arc<Space>,
    _lock: FolderLock,
}

impl SqliteStore {
    /// Opens the database of a data directory, `games.sqlite3`; creates it if it is missing, unless
    /// the directory shows that there was one.
    ///
    /// # Errors
    /// The directory cannot be used; nothing was changed in it.
    pub async fn open(data_dir: &Path) -> Result<Self, OpenError> {
        Self::for_games(data_dir, IfGone::CreateFirst).await
    }

    /// Opens the database of a data directory in which nothing is played from here on: its games may
    /// have moved.
    ///
    /// # Errors
    /// The directory cannot be used; nothing was changed in it.
    pub async fn open_for_deletion(data_dir: &Path) -> Result<Self, OpenError> {
        Self::opened(data_dir, IfGone::CreateFirst).await
    }

    /// Opens the database of a data directory; creates it if it is missing, also if there was one.
    ///
    /// # Errors
    /// The directory cannot be used; nothing was changed in it.
    pub async fn open_or_new(data_dir: &Path) -> Result<Self, OpenError> {
        Self::for_games(data_dir, IfGone::Create).await
    }

    /// Opens the database unless its games have moved: unfinished ones would go on twice.
    async fn for_games(data_dir: &Path, if_gone: IfGone) -> Result<Self, OpenError> {
        let store = Self::opened(data_dir, if_gone).await?;
        // A move holds the lock that the store holds now.
        match moved_to(data_dir)? {
            None => Ok(store),
            Some(address) => {
                store.close().await;
                Err(moved(data_dir, address))
            }
        }
    }

    async fn opened(data_dir: &Path, if_gone: IfGone) -> Result<Self, OpenError> {
        let opened = open::open(data_dir, if_gone).await?;
        let (last, last_row, last_listed): (i64, i64, i64) = sqlx::query_as(
            "SELECT (SELECT coalesce(max(number), 0) FROM games),
                    (SELECT coalesce(max(row), 0) FROM journal),
                    (SELECT coalesce(max(listed), 0) FROM games)",
        )
        .fetch_one(&opened.readers)
        .await
        .map_err(|error| OpenError::of(&data_dir.join(DATABASE_FILE), &error))?;
        let (commands, queue) = mpsc::channel(writer::QUEUE);
        let (has_failed, failed) = watch::channel(None);
        let decoding = DecodePool::new();
        let metrics = StoreMetrics::default();
        let space = Space::new(data_dir);
        let spare = Arc::clone(&space);
        let scratch = Scratch::new(data_dir.to_path_buf(), move || spare.has_some());
        if space.has_some() {
            space::keep_ballast(data_dir);
        } else {
            warn!(
                "the disk is nearly full: durable rooms, tournaments and studies are refused until there is space"
            );
        }
        let writing = tokio::spawn(named(
            LongTask::SqliteWriter,
            writer::run(
                opened.writer,
                last_listed,
                queue,
                has_failed,
                metrics.clone(),
                Arc::clone(&space),
            ),
        ));
        Ok(Self {
            data_dir: data_dir.to_path_buf(),
            reader: Reader {
                pool: opened.readers,
                decoding: decoding.clone(),
            },
            decoding,
            commands: WriteQueue {
                queue: commands,
                next_row: Arc::new(AtomicI64::new(last_row + 1)),
                space: Arc::clone(&space),
            },
            failed,
            numbers: Arc::new(AtomicI64::new(last + 1)),
            reserved: Reservations::default(),
            scratch,
            writing: Mutex::new(Some(writing)),
            closed: AtomicBool::new(false),
            metrics,
            space,
            _lock: opened.lock,
        })
    }
}

#[async_trait]
impl Store for SqliteStore {
    fn outlives_server(&self) -> bool {
        true
    }

    fn has_space(&self) -> bool {
        self.space.has_some()
    }

    async fn wait_for_space(&self) -> bool {
        self.space.wait_for_some().await
    }

    fn stop_waiting(&self) {
        self.space.stop();
    }

    fn metrics(&self) -> Option<&StoreMetrics> {
        Some(&self.metrics)
    }

    fn queue_depth(&self) -> usize {
        self.commands.depth()
    }

    async fn create(
        &self,
        header: Arc<GameHeader>,
        mut entries: Vec<Entry>,
    ) -> Result<Box<dyn Journal>, StoreError> {
        let number = self.numbers.fetch_add(1, Ordering::Relaxed);
        let queue = self.commands.clone();
        let game = header.game_id;
        let taken = StoreError::Taken(game.to_string());
        let reserved = self.reserved.take(game).ok_or_else(|| taken.clone())?;
        if header.policy.durability == Durability::Ephemeral {
            if self.reader.has_game(game).await? {
                return Err(taken);
            }
            let whole = Whole {
                number,
                _running: queue.space.game(),
                queue,
                _reserved: reserved,
            };
            let first = form::entries_to_bytes(&mut entries);
            let journal = EphemeralJournal::new(header, first, self.scratch.clone(), whole);
            return Ok(Box::new(journal));
        }
        let mut journal = DurableJournal {
            number,
            position: 0,
            last_row: None,
            is_of_older_form: false,
            running: Some(queue.space.game()),
            queue,
            readers: self.reader.pool.clone(),
            decoding: self.decoding.clone(),
        };
        journal.begin(&header, &mut entries).await?;
        Ok(Box::new(journal))
    }

    async fn resumable_games(&self, ended_since_ms: u64) -> Result<Vec<ResumableGame>, StoreError> {
        self.reader
            .resumable_games(ended_since_ms, &self.commands)
            .await
    }

    async fn summary(&self, game: GameId) -> Result<Option<v1::RecordSummary>, StoreError> {
        self.reader.summary(game).await
    }

    async fn finished(&self, game: GameId) -> Result<Option<StoredGame>, StoreError> {
        self.reader.finished(game).await
    }

    async fn list(
        &self,
        filter: &v1::RecordFilter,
        part: Part,
        count: usize,
    ) -> Result<Vec<Listed>, StoreError> {
        self.reader.list(filter, part, count).await
    }

    async fn import(
        &self,
        game: GameId,
        mut summary: v1::RecordSummary,
        lines: Arc<[v1::RecordLine]>,
    ) -> Result<bool, StoreError> {
        summary.added = true;
        let Some(_reserved) = self.reserved.take(game) else {
            return Ok(false);
        };
        let number = self.numbers.fetch_add(1, Ordering::Relaxed);
        let count = lines.len();
        let encoding = self
            .decoding
            .run(count, move || form::lines_to_bytes(&lines));
        let record = encoding.await?;
        let import = WriteCommand::Import {
            number,
            game_id: game,
            record,
            summary: Box::new(summary),
        };
        match self.commands.send(import).await {
            Ok(()) => Ok(true),
            Err(StoreError::Taken(_)) => Ok(false),
            Err(error) => Err(error),
        }
    }

    fn disk(&self) -> Option<DiskUsage> {
        let disk = Disk::of(&self.data_dir).ok()?;
        let files = ["", "-wal"].map(|ending| format!("{DATABASE_FILE}{ending}"));
        let sizes = files.map(|file| self.data_dir.join(file).metadata().map_or(0, |it| it.len()));
        Some(DiskUsage {
            bytes: sizes.iter().sum(),
            free_bytes: disk.free_bytes,
        })
    }

    async fn finished_games(&self) -> Result<u64, StoreError> {
        self.reader.finished_games().await
    }

    async fn prunable(
        &self,
        keep: Keep,
        after: u64,
        count: usize,
    ) -> Result<Vec<(u64, GameId)>, StoreError> {
        // What waits for space must not keep what frees some.
        let unwritten = !self.space.has_some();
        self.reader.prunable(keep, after, count, unwritten).await
    }

    async fn prune(&self, games: Vec<GameId>) -> Result<Vec<GameId>, StoreError> {
        let prune = WriteCommand::Prune {
            games: games.clone(),
        };
        self.commands.send(prune).await?;
        let mut gone = Vec::new();
        for game in games {
            if !self.reader.has_game(game).await? {
                gone.push(game);
            }
        }
        Ok(gone)
    }

    async fn delete(&self, games: Vec<GameId>) -> Result<(), StoreError> {
        self.commands.send(WriteCommand::Delete { games }).await
    }

    async fn forget(&self, who: &Pseudonym) -> Result<Forgotten, ForgetError> {
        forget_participant(self, who).await
    }

    async fn without_record_file(&self) -> Result<Vec<GameId>, StoreError> {
        self.reader.without_record_file().await
    }

    async fn mark_record_written(&self, game_id: GameId) -> Result<(), StoreError> {
        self.commands
            .send(WriteCommand::RecordWritten { game_id })
            .await
    }

    async fn write_unit(&self, unit: UnitKey, write: UnitWrite) -> Result<(), StoreError> {
        self.commands.send(WriteCommand::Unit(unit, write)).await
    }

    async fn unit(&self, unit: UnitKey) -> Result<Option<StoredUnit>, StoreError> {
        self.reader.unit(unit).await
    }

    async fn units(&self, kind: UnitKind, newest_over: usize) -> Result<Vec<UnitKey>, StoreError> {
        self.reader.units(kind, newest_over).await
    }

    async fn traces(&self, study: StudyId) -> Result<Vec<StoredTraces>, StoreError> {
        self.reader.traces(study).await
    }

    async fn failed(&self) -> StoreError {
        let failure = match self.failed.clone().wait_for(Option::is_some).await {
            Ok(failure) => failure.clone(),
            Err(_) if self.closed.load(Ordering::Acquire) => None,
            Err(_) => Some(StoreError::Failed(
                "the writer of the database has ended unexpectedly".into(),
            )),
        };
        match failure {
            Some(failure) => failure,
            None => pending().await,
        }
    }

    async fn close(&self) {
        self.closed.store(true, Ordering::Release);
        self.reader.pool.close().await;
        // A failed writer is reported elsewhere; here it is only awaited.
        let _ = self.commands.send(WriteCommand::Close).await;
        let writing = self
            .writing
            .lock()
            .expect("no code that holds this lock can panic")
            .take();
        if let Some(writing) = writing
            && let Err(error) = writing.await
        {
            error!(%error, "the writer of the database did not close cleanly");
        }
    }
}
