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

use chefshat_proto::v1;
use chefshat_record::pseudonym::Pseudonym;
use futures::FutureExt as _;
use futures::future::BoxFuture;
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use tracing::{error, warn};

pub use backup::{DatabaseCopy, check_copy, copy_database};
pub(crate) use contents::{
    Contents, GameRow, JournalRow, ParticipantRow, StudyRow, TournamentRow, TracesRow,
};
pub use errors::FILE as DATABASE_FILE;
pub use former::LOCK_FILE;
pub(crate) use former::{forget_move, note_move};
pub use open::OpenError;
use open::{FolderLock, IfGone};
pub(crate) use open::{moved, moved_to};

use super::decode_pool::DecodePool;
use super::ephemeral::{EphemeralJournal, Reservations, Scratch};
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
use errors::explain;
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
    closed: Arc<AtomicBool>,
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
        .map_err(|error| OpenError::Other(data_dir.join(DATABASE_FILE), explain(&error)))?;
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
            closed: Arc::new(AtomicBool::new(false)),
            metrics,
            space,
            _lock: opened.lock,
        })
    }
}

impl Store for SqliteStore {
    fn outlives_server(&self) -> bool {
        true
    }

    fn has_space(&self) -> bool {
        self.space.has_some()
    }

    fn wait_for_space(&self) -> BoxFuture<'_, bool> {
        self.space.wait_for_some().boxed()
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

    fn create(
        &self,
        header: Arc<GameHeader>,
        mut entries: Vec<Entry>,
    ) -> BoxFuture<'_, Result<Box<dyn Journal>, StoreError>> {
        let number = self.numbers.fetch_add(1, Ordering::Relaxed);
        let (commands, readers) = (self.commands.clone(), self.reader.pool.clone());
        let decoding = self.decoding.clone();
        async move {
            let game = header.game_id;
            let taken = StoreError::Taken(game.to_string());
            let reserved = self.reserved.take(game).ok_or_else(|| taken.clone())?;
            if header.policy.durability == Durability::Ephemeral {
                if self.reader.has_game(game).await? {
                    return Err(taken);
                }
                let running = commands.space.game();
                let whole = Whole {
                    number,
                    queue: commands,
                    _running: running,
                    _reserved: reserved,
                };
                let first = form::entries_to_bytes(&mut entries);
                let journal = EphemeralJournal::new(header, first, self.scratch.clone(), whole);
                return Ok(Box::new(journal) as Box<dyn Journal>);
            }
            let mut journal = DurableJournal {
                number,
                position: 0,
                last_row: None,
                running: Some(commands.space.game()),
                queue: commands,
                readers,
                decoding,
            };
            journal.begin(&header, &mut entries).await?;
            Ok(Box::new(journal) as Box<dyn Journal>)
        }
        .boxed()
    }

    fn resumable_games(
        &self,
        ended_since_ms: u64,
    ) -> BoxFuture<'_, Result<Vec<ResumableGame>, StoreError>> {
        self.reader
            .resumable_games(ended_since_ms, &self.commands)
            .boxed()
    }

    fn summary(
        &self,
        game: GameId,
    ) -> BoxFuture<'_, Result<Option<v1::RecordSummary>, StoreError>> {
        self.reader.summary(game).boxed()
    }

    fn finished(&self, game: GameId) -> BoxFuture<'_, Result<Option<StoredGame>, StoreError>> {
        self.reader.finished(game).boxed()
    }

    fn list<'a>(
        &'a self,
        filter: &'a v1::RecordFilter,
        part: Part,
        count: usize,
    ) -> BoxFuture<'a, Result<Vec<Listed>, StoreError>> {
        self.reader.list(filter, part, count).boxed()
    }

    fn import(
        &self,
        game: GameId,
        mut summary: v1::RecordSummary,
        lines: Arc<[v1::RecordLine]>,
    ) -> BoxFuture<'_, Result<bool, StoreError>> {
        summary.added = true;
        async move {
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
        .boxed()
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

    fn finished_games(&self) -> BoxFuture<'_, Result<u64, StoreError>> {
        self.reader.finished_games().boxed()
    }

    fn prunable(
        &self,
        keep: Keep,
        after: u64,
        count: usize,
    ) -> BoxFuture<'_, Result<Vec<(u64, GameId)>, StoreError>> {
        // What waits for space must not keep what frees some.
        let unwritten = !self.space.has_some();
        (self.reader)
            .prunable(keep, after, count, unwritten)
            .boxed()
    }

    fn prune(&self, games: Vec<GameId>) -> BoxFuture<'_, Result<Vec<GameId>, StoreError>> {
        async move {
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
        .boxed()
    }

    fn delete(&self, games: Vec<GameId>) -> BoxFuture<'_, Result<(), StoreError>> {
        self.commands.send(WriteCommand::Delete { games }).boxed()
    }

    fn forget<'a>(&'a self, who: &'a Pseudonym) -> BoxFuture<'a, Result<Forgotten, ForgetError>> {
        async move {
            let rewrite = self.reader.forgetting(who).await?;
            let forgotten = rewrite.forgotten.clone();
            self.commands
                .send(WriteCommand::Rewrite(Box::new(rewrite)))
                .await?;
            Ok(forgotten)
        }
        .boxed()
    }

    fn without_record_file(&self) -> BoxFuture<'_, Result<Vec<GameId>, StoreError>> {
        self.reader.without_record_file().boxed()
    }

    fn mark_record_written(&self, game_id: GameId) -> BoxFuture<'_, Result<(), StoreError>> {
        self.commands
            .send(WriteCommand::RecordWritten { game_id })
            .boxed()
    }

    fn write_unit(&self, unit: UnitKey, write: UnitWrite) -> BoxFuture<'_, Result<(), StoreError>> {
        self.commands.send(WriteCommand::Unit(unit, write)).boxed()
    }

    fn unit(&self, unit: UnitKey) -> BoxFuture<'_, Result<Option<StoredUnit>, StoreError>> {
        self.reader.unit(unit).boxed()
    }

    fn units(
        &self,
        kind: UnitKind,
        newest_over: usize,
    ) -> BoxFuture<'_, Result<Vec<UnitKey>, StoreError>> {
        self.reader.units(kind, newest_over).boxed()
    }

    fn traces(&self, study: StudyId) -> BoxFuture<'_, Result<Vec<StoredTraces>, StoreError>> {
        self.reader.traces(study).boxed()
    }

    fn failed(&self) -> BoxFuture<'static, StoreError> {
        let mut failed = self.failed.clone();
        let closed = Arc::clone(&self.closed);
        async move {
            let failure = match failed.wait_for(Option::is_some).await {
                Ok(failure) => failure.clone(),
                Err(_) if closed.load(Ordering::Acquire) => None,
                Err(_) => Some(StoreError::Failed(
                    "the writer of the database has ended unexpectedly".into(),
                )),
            };
            match failure {
                Some(failure) => failure,
                None => futures::future::pending().await,
            }
        }
        .boxed()
    }

    fn close(&self) -> BoxFuture<'_, ()> {
        async move {
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
        .boxed()
    }
}
