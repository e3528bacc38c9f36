//! Stores games in a PostgreSQL database that several servers may share. `open` connects, `reader`
//! reads, `journals`, `appends`, `commands`, `ends`, `forget` and `units` write through `writer`, `cluster`,
//! `claims` and `handover` are about nodes and what they own, `partitions` divides the table
//! of journals, `transfer` moves an SQLite database here, `form` (beside this folder) encodes; this
//! file joins them into a store.

mod appends;
mod claims;
mod cluster;
mod commands;
mod ends;
mod errors;
mod forget;
mod forgetting;
mod handover;
mod journals;
mod open;
mod partitions;
mod reader;
mod retained;
#[cfg(test)]
pub(super) mod tests;
mod transfer;
mod units;
mod values;
mod writer;

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use async_trait::async_trait;
use chefshat_cluster::LeaseTimes;
use chefshat_proto::v1;
use chefshat_record::pseudonym::Pseudonym;
use futures::future::pending;
use sqlx::postgres::{PgConnectOptions, PgPoolOptions};
use tokio::sync::Mutex as AsyncMutex;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use tracing::error;

pub use open::{DatabaseError, migrate};
pub use transfer::{TransferError, Transferred, transfer};

use super::decode_pool::DecodePool;
use super::ephemeral::{EphemeralJournal, Scratch};
use super::forget::forget_participant;
use super::form;
use super::units::{StoredTraces, StoredUnit, UnitKey, UnitKind, UnitWrite};
use super::{
    ForgetError, Forgotten, Journal, Keep, Listed, Part, ResumableGame, Store, StoreError,
    StoredGame,
};
use appends::Row;
use chefshat_base::metrics::StoreMetrics;
use chefshat_room::ids::{GameId, StudyId, UnitId, random_bytes};
use chefshat_room::journal::{Entry, GameHeader};
use chefshat_room::policy::Durability;
use commands::Command;
use handover::Handed;
use journals::{DurableJournal, Whole};
use open::IfEmpty;
use reader::{Reader, StoredRoom};
use values::{FIRST_EPOCH, Owned};
use writer::{Queue, Shared};

/// Writers of rows of running games: while one commits, the other takes what arrives.
const APPENDERS: usize = 2;
/// Writers of everything else.
const COMMANDERS: usize = 2;
/// Connections for reading.
const READERS: u32 = 6;
/// Connections for ownership, which must not wait for readers.
const CONTROLLERS: u32 = 2;
/// Connections for beats, which wait for nothing else. One is enough, unless it hangs.
const BEATERS: u32 = 2;
/// How long a read waits for a connection.
const ACQUIRE_LIMIT: Duration = Duration::from_secs(5);

/// How a node uses the database.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PostgresOptions {
    /// The times of leases; the same for all nodes.
    pub lease: LeaseTimes,
    /// How long work is tried again while the database does not answer.
    pub retry_for: Duration,
    /// How long a write waits for what somebody else has locked in the database, before it makes
    /// way for others.
    pub lock_limit: Duration,
    /// How long it is known where a room was after it is over.
    pub retention: Duration,
    /// Whether records are written to files, so that only games whose record has been written may
    /// be deleted.
    pub record_files: bool,
    /// Where long games that are stored when they end are until then, if this folder can be
    /// written; else in that for temporary files.
    pub scratch: PathBuf,
}

impl Default for PostgresOptions {
    fn default() -> Self {
        Self {
            lease: LeaseTimes::DEFAULT,
            retry_for: Duration::from_secs(300),
            lock_limit: Duration::from_secs(1),
            retention: Duration::from_secs(600),
            record_files: true,
            scratch: std::env::temp_dir(),
        }
    }
}

/// Stores games in a PostgreSQL database. What it creates belongs to the node as which it has
/// joined ([`ClusterStore::join`](super::cluster::ClusterStore::join)).
pub struct PostgresStore {
    options: PostgresOptions,
    reader: Reader,
    /// Over its own connections.
    control: Reader,
    /// Over its own connections.
    beats: Reader,
    sessions: PgConnectOptions,
    /// Listens from when it is first asked.
    handed: AsyncMutex<Option<Handed>>,
    decoding: DecodePool,
    rows: Queue<Row>,
    commands: Queue<Command>,
    /// The node; 0: none has joined.
    node: AtomicI64,
    /// The epochs at which the tournaments and studies of this node are written.
    epochs: Mutex<HashMap<UnitId, i64>>,
    scratch: Scratch,
    closing: CancellationToken,
    writing: Mutex<Vec<JoinHandle<()>>>,
    metrics: StoreMetrics,
}

impl PostgresStore {
    /// Connects to a database, and creates the tables if it is empty.
    ///
    /// # Errors
    /// The database cannot be used; nothing was changed in it.
    pub async fn open(url: &str, options: PostgresOptions) -> Result<Self, DatabaseError> {
        Self::open_if(url, options, IfEmpty::Create).await
    }

    /// Connects to a database that has its tables.
    ///
    /// # Errors
    /// The database is empty or cannot be used; nothing was changed in it.
    pub async fn open_existing(url: &str, options: PostgresOptions) -> Result<Self, DatabaseError> {
        Self::open_if(url, options, IfEmpty::Refuse).await
    }

    async fn open_if(
        url: &str,
        options: PostgresOptions,
        if_empty: IfEmpty,
    ) -> Result<Self, DatabaseError> {
        let address = open::address(url)?;
        open::check(&address, if_empty).await?;
        let sessions = open::sessions(address);
        let decoding = DecodePool::new();
        let reader = |connections| Reader {
            pool: PgPoolOptions::new()
                .max_connections(connections)
                .acquire_timeout(ACQUIRE_LIMIT)
                .connect_lazy_with(sessions.clone()),
            decoding: decoding.clone(),
        };
        let [readers, control, beats] = [READERS, CONTROLLERS, BEATERS].map(reader);
        let metrics = StoreMetrics::default();
        let closing = CancellationToken::new();
        let shared = Shared {
            options: open::with_lock_limit(open::writers(sessions.clone()), options.lock_limit),
            retry_for: options.retry_for,
            metrics: metrics.clone(),
            closing: closing.clone(),
        };
        let mut writing = Vec::new();
        Ok(Self {
            scratch: Scratch::new(options.scratch.clone(), || true),
            options,
            reader: readers,
            control,
            beats,
            sessions,
            handed: AsyncMutex::default(),
            decoding,
            rows: writer::start(&shared, APPENDERS, &mut writing),
            commands: writer::start(&shared, COMMANDERS, &mut writing),
            node: AtomicI64::new(0),
            epochs: Mutex::default(),
            closing,
            writing: Mutex::new(writing),
            metrics,
        })
    }

    /// The number of this node.
    fn node(&self) -> Result<i64, StoreError> {
        match self.node.load(Ordering::Acquire) {
            0 => Err(StoreError::Failed(
                "this server has not joined the cluster of its database yet".into(),
            )),
            node => Ok(node),
        }
    }

    /// The epoch at which this node writes a tournament or study.
    fn epoch_of(&self, unit: UnitId) -> Result<i64, StoreError> {
        let epoch = lock(&self.epochs).get(&unit).copied();
        epoch.ok_or(StoreError::Fenced(unit))
    }

    /// What is written for a tournament or study, and by whom.
    fn change(&self, unit: UnitKey, write: UnitWrite) -> Result<units::Change, StoreError> {
        let owned = || {
            let (unit, epoch) = (unit.id(), self.epoch_of(unit.id())?);
            let id = unit;
            Ok::<_, StoreError>(Owned { id, unit, epoch })
        };
        Ok(match write {
            UnitWrite::Create {
                join_code,
                header,
                first,
            } => units::Change::Create {
                unit,
                node: self.node()?,
                join_code,
                header,
                first,
            },
            UnitWrite::Append(row) => units::Change::Append(unit.kind(), owned()?, row),
            UnitWrite::Rewrite { entries, forgotten } => {
                units::Change::Rewrite(unit.kind(), owned()?, entries, forgotten)
            }
            UnitWrite::Traces(traces) => units::Change::Traces(owned()?, random_bytes(), traces),
            UnitWrite::Delete => units::Change::Delete(unit.kind(), owned()?),
        })
    }

    /// A room to be created: what its journals are written as.
    fn place(&self, header: &GameHeader) -> Result<Owned, StoreError> {
        let unit = header.unit();
        Ok(Owned {
            id: header.room_id.unit(),
            unit,
            epoch: match unit == header.room_id.unit() {
                true => FIRST_EPOCH,
                false => self.epoch_of(unit)?,
            },
        })
    }

    /// A game with a journal that writes at an epoch.
    fn resumable(&self, room: StoredRoom, epoch: i64) -> ResumableGame {
        let journal = DurableJournal {
            owned: Owned {
                id: room.header.room_id.unit(),
                unit: room.header.unit(),
                epoch,
            },
            number: room.number,
            position: room.rows,
            unanswered: None,
            rows: self.rows.clone(),
            commands: self.commands.clone(),
            reader: self.reader.clone(),
        };
        ResumableGame {
            header: room.header,
            entries: room.entries,
            journal: Box::new(journal),
            concluded: room.over,
        }
    }
}

#[async_trait]
impl Store for PostgresStore {
    fn outlives_server(&self) -> bool {
        true
    }

    fn metrics(&self) -> Option<&StoreMetrics> {
        Some(&self.metrics)
    }

    fn queue_depth(&self) -> usize {
        self.rows.depth() + self.commands.depth()
    }

    async fn create(
        &self,
        header: Arc<GameHeader>,
        mut entries: Vec<Entry>,
    ) -> Result<Box<dyn Journal>, StoreError> {
        let (owned, node) = (self.place(&header)?, self.node()?);
        let durable = header.policy.durability != Durability::Ephemeral;
        let encoded = (!entries.is_empty()).then(|| form::entries_to_bytes(&mut entries));
        let rows = i64::from(encoded.is_some());
        let (first, encoded) = match durable {
            true => (encoded, None),
            false => (None, encoded),
        };
        let create = Command::Create {
            owned,
            node,
            join_code: header.join_code.clone(),
            game_id: header.game_id,
            rules_version: header.rules_version,
            created_at_ms: header.created_at_ms,
            durable: durable.then(|| (form::header_to_bytes(&header), first)),
        };
        let number = self.commands.commit(Arc::new(create)).await?;
        Ok(match durable {
            true => Box::new(DurableJournal {
                owned,
                number,
                position: rows,
                unanswered: None,
                rows: self.rows.clone(),
                commands: self.commands.clone(),
                reader: self.reader.clone(),
            }),
            false => {
                let commands = self.commands.clone();
                let first = encoded.unwrap_or_default();
                Box::new(EphemeralJournal::new(
                    header,
                    first,
                    self.scratch.clone(),
                    Whole { owned, commands },
                ))
            }
        })
    }

    /// None: a node resumes units ([`ClusterStore::load`](super::cluster::ClusterStore::load)).
    async fn resumable_games(&self, _: u64) -> Result<Vec<ResumableGame>, StoreError> {
        Ok(Vec::new())
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
        game_id: GameId,
        mut summary: v1::RecordSummary,
        lines: Arc<[v1::RecordLine]>,
    ) -> Result<bool, StoreError> {
        summary.added = true;
        let count = lines.len();
        let encoding = self
            .decoding
            .run(count, move || form::lines_to_bytes(&lines));
        let import = Command::Import {
            game_id,
            record: encoding.await?,
            summary: Box::new(summary),
        };
        match self.commands.commit(Arc::new(import)).await {
            Ok(_) => Ok(true),
            Err(StoreError::Taken(_)) => Ok(false),
            Err(error) => Err(error),
        }
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
        let part = (after, count);
        (self.reader)
            .prunable(keep, part, !self.options.record_files)
            .await
    }

    async fn prune(&self, games: Vec<GameId>) -> Result<Vec<GameId>, StoreError> {
        let prune = Command::Prune {
            games: games.clone(),
        };
        self.commands.commit(Arc::new(prune)).await?;
        self.reader.missing(games).await
    }

    async fn delete(&self, games: Vec<GameId>) -> Result<(), StoreError> {
        let delete = Command::Delete { games };
        self.commands.commit(Arc::new(delete)).await.map(drop)
    }

    async fn forget(&self, who: &Pseudonym) -> Result<Forgotten, ForgetError> {
        let forgotten = forget_participant(self, who).await?;
        // After the games: one that retention deletes meanwhile is found here.
        self.control.forget_pruned(&who.of.name).await?;
        Ok(forgotten)
    }

    async fn without_record_file(&self) -> Result<Vec<GameId>, StoreError> {
        self.reader.without_record_file().await
    }

    async fn mark_record_written(&self, game_id: GameId) -> Result<(), StoreError> {
        let written = Command::RecordWritten { game_id };
        self.commands.commit(Arc::new(written)).await.map(drop)
    }

    async fn write_unit(&self, unit: UnitKey, write: UnitWrite) -> Result<(), StoreError> {
        let is_new = matches!(write, UnitWrite::Create { .. });
        let is_deletion = matches!(write, UnitWrite::Delete);
        let change = self.change(unit, write)?;
        self.commands
            .commit(Arc::new(Command::Unit(change)))
            .await?;
        if is_new {
            lock(&self.epochs).insert(unit.id(), FIRST_EPOCH);
        }
        if is_deletion {
            lock(&self.epochs).remove(&unit.id());
        }
        Ok(())
    }

    async fn unit(&self, unit: UnitKey) -> Result<Option<StoredUnit>, StoreError> {
        self.reader.unit(unit).await
    }

    /// The studies of all nodes, and the tournaments of this node that are not over with the newest
    /// ones of the cluster that are.
    async fn units(&self, kind: UnitKind, newest_over: usize) -> Result<Vec<UnitKey>, StoreError> {
        match kind {
            UnitKind::Study => self.reader.studies().await,
            UnitKind::Tournament => self.reader.tournaments(self.node()?, newest_over).await,
        }
    }

    async fn traces(&self, study: StudyId) -> Result<Vec<StoredTraces>, StoreError> {
        self.reader.traces(study).await
    }

    /// Never: a database that does not answer may do so later.
    async fn failed(&self) -> StoreError {
        pending().await
    }

    async fn close(&self) {
        self.closing.cancel();
        let writing = std::mem::take(&mut *lock(&self.writing));
        for writer in writing {
            if let Err(error) = writer.await {
                error!(%error, "a writer of the database did not close cleanly");
            }
        }
        self.reader.pool.close().await;
        self.control.pool.close().await;
        self.beats.pool.close().await;
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex
        .lock()
        .expect("no code that holds this lock can panic")
}
