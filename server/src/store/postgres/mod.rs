//! Stores games in a PostgreSQL database that several servers may share. `open` connects, `reader`
//! reads, `journals`, `appends`, `commands`, `ends`, `forget` and `studies` write through `writer`, `cluster`,
//! `claims`, `handover` and `owned` are about nodes and what they own, `transfer` moves an SQLite
//! database here, `form` (beside this folder) encodes; this file joins them into a store.

mod appends;
mod claims;
mod cluster;
mod commands;
mod ends;
mod errors;
mod forget;
mod handover;
mod journals;
mod open;
mod owned;
mod reader;
mod retained;
mod studies;
#[cfg(test)]
pub(super) mod tests;
mod transfer;
mod values;
mod writer;

use std::collections::HashMap;
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use chefshat_cluster::LeaseTimes;
use chefshat_proto::v1;
use chefshat_record::pseudonym::Pseudonym;
use chefshat_study::Change as StudyChange;
use futures::FutureExt as _;
use futures::future::{BoxFuture, pending};
use sqlx::postgres::{PgConnectOptions, PgPoolOptions};
use tokio::sync::Mutex as AsyncMutex;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use tracing::error;

pub use open::{DatabaseError, migrate};
pub use transfer::{TransferError, Transferred, transfer};

use super::codec::Codec;
use super::ephemeral::EphemeralJournal;
use super::form;
use super::studies::{StoredStudy, StoredTraces, StudyHeader};
use super::tournaments::{StoredTournament, TournamentEntry, TournamentHeader};
use super::{
    ForgetError, Forgotten, Journal, Keep, Listed, Part, ResumableGame, Store, StoreError,
    StoredGame,
};
use crate::metrics::StoreMetrics;
use appends::Row;
use chefshat_room::ids::Id;
use chefshat_room::journal::{Entry, GameHeader};
use chefshat_room::policy::Durability;
use commands::Command;
use handover::Handed;
use journals::{DurableJournal, Whole};
use reader::{Reader, StoredRoom};
use studies::StudyWrite;
use values::{FIRST_EPOCH, Owned, integer};
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
    /// How long it is known where a room was after it is over.
    pub retention: Duration,
    /// Whether records are written to files, so that only games whose record has been written may
    /// be deleted.
    pub record_files: bool,
}

impl Default for PostgresOptions {
    fn default() -> Self {
        Self {
            lease: LeaseTimes::DEFAULT,
            retry_for: Duration::from_secs(300),
            retention: Duration::from_secs(600),
            record_files: true,
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
    codec: Codec,
    rows: Queue<Row>,
    commands: Queue<Command>,
    /// The node; 0: none has joined.
    node: AtomicI64,
    /// The epochs at which the tournaments and studies of this node are written.
    epochs: Mutex<HashMap<Id, i64>>,
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
        let address = open::address(url)?;
        open::check(&address).await?;
        let sessions = open::sessions(address);
        let codec = Codec::new();
        let reader = |connections| Reader {
            pool: PgPoolOptions::new()
                .max_connections(connections)
                .acquire_timeout(ACQUIRE_LIMIT)
                .connect_lazy_with(sessions.clone()),
            codec: codec.clone(),
        };
        let [readers, control, beats] = [READERS, CONTROLLERS, BEATERS].map(reader);
        let metrics = StoreMetrics::default();
        let closing = CancellationToken::new();
        let shared = Shared {
            options: sessions.clone(),
            retry_for: options.retry_for,
            metrics: metrics.clone(),
            closing: closing.clone(),
        };
        let mut writing = Vec::new();
        Ok(Self {
            options,
            reader: readers,
            control,
            beats,
            sessions,
            handed: AsyncMutex::default(),
            codec,
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
    fn epoch_of(&self, unit: Id) -> Result<i64, StoreError> {
        let epoch = lock(&self.epochs).get(&unit).copied();
        epoch.ok_or(StoreError::Fenced(unit))
    }

    /// A tournament or study, as this node writes it.
    fn owned(&self, unit: Id) -> Result<Owned, StoreError> {
        Ok(Owned {
            id: unit,
            unit,
            epoch: self.epoch_of(unit)?,
        })
    }

    /// Writes something for a study.
    async fn write_study(&self, write: StudyWrite) -> Result<(), StoreError> {
        let command = Arc::new(Command::Study(write));
        self.commands.commit(command).await.map(drop)
    }

    /// A room to be created: what its journals are written as.
    fn place(&self, header: &GameHeader) -> Result<Owned, StoreError> {
        let unit = header.unit();
        Ok(Owned {
            id: header.room_id,
            unit,
            epoch: match unit == header.room_id {
                true => FIRST_EPOCH,
                false => self.epoch_of(unit)?,
            },
        })
    }

    /// A game with a journal that writes at an epoch.
    fn resumable(&self, room: StoredRoom, epoch: i64) -> ResumableGame {
        let journal = DurableJournal {
            owned: Owned {
                id: room.header.room_id,
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

    async fn create_room(
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
                    Whole { owned, commands },
                ))
            }
        })
    }
}

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

    fn create(
        &self,
        header: Arc<GameHeader>,
        entries: Vec<Entry>,
    ) -> BoxFuture<'_, Result<Box<dyn Journal>, StoreError>> {
        self.create_room(header, entries).boxed()
    }

    /// Those of this node.
    fn resumable_games(
        &self,
        ended_since_ms: u64,
    ) -> BoxFuture<'_, Result<Vec<ResumableGame>, StoreError>> {
        self.own_games(ended_since_ms).boxed()
    }

    fn summary(&self, game: Id) -> BoxFuture<'_, Result<Option<v1::RecordSummary>, StoreError>> {
        self.reader.summary(game).boxed()
    }

    fn finished(&self, game: Id) -> BoxFuture<'_, Result<Option<StoredGame>, StoreError>> {
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
        game_id: Id,
        mut summary: v1::RecordSummary,
        lines: Arc<[v1::RecordLine]>,
    ) -> BoxFuture<'_, Result<bool, StoreError>> {
        summary.added = true;
        async move {
            let count = lines.len();
            let encoding = self.codec.run(count, move || form::lines_to_bytes(&lines));
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
        .boxed()
    }

    fn finished_games(&self) -> BoxFuture<'_, Result<u64, StoreError>> {
        self.reader.finished_games().boxed()
    }

    fn prunable(
        &self,
        keep: Keep,
        after: u64,
        count: usize,
    ) -> BoxFuture<'_, Result<Vec<(u64, Id)>, StoreError>> {
        let part = (after, count);
        (self.reader)
            .prunable(keep, part, self.options.record_files)
            .boxed()
    }

    fn prune(&self, games: Vec<Id>) -> BoxFuture<'_, Result<Vec<Id>, StoreError>> {
        async move {
            let prune = Command::Prune {
                games: games.clone(),
            };
            self.commands.commit(Arc::new(prune)).await?;
            self.reader.missing(games).await
        }
        .boxed()
    }

    fn delete(&self, games: Vec<Id>) -> BoxFuture<'_, Result<(), StoreError>> {
        async move {
            let delete = Command::Delete { games };
            self.commands.commit(Arc::new(delete)).await.map(drop)
        }
        .boxed()
    }

    fn forget<'a>(&'a self, who: &'a Pseudonym) -> BoxFuture<'a, Result<Forgotten, ForgetError>> {
        async move {
            let rewrite = self.reader.forgetting(who).await?;
            let forgotten = rewrite.forgotten.clone();
            let rewrite = Command::Rewrite(rewrite);
            self.commands.commit(Arc::new(rewrite)).await?;
            Ok(forgotten)
        }
        .boxed()
    }

    fn without_record_file(&self) -> BoxFuture<'_, Result<Vec<Id>, StoreError>> {
        self.reader.without_record_file().boxed()
    }

    fn mark_record_written(&self, game_id: Id) -> BoxFuture<'_, Result<(), StoreError>> {
        async move {
            let written = Command::RecordWritten { game_id };
            self.commands.commit(Arc::new(written)).await.map(drop)
        }
        .boxed()
    }

    fn create_tournament(
        &self,
        header: Arc<TournamentHeader>,
        entries: Vec<TournamentEntry>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        async move {
            let create = Command::Tournament {
                id: header.id,
                node: self.node()?,
                join_code: header.join_code.clone(),
                header: form::tournament_to_bytes(&header),
                entries: form::tournament_entries_to_bytes(&entries),
                over: entries.iter().any(TournamentEntry::is_end),
            };
            self.commands.commit(Arc::new(create)).await?;
            lock(&self.epochs).insert(header.id, FIRST_EPOCH);
            Ok(())
        }
        .boxed()
    }

    fn append_tournament(
        &self,
        tournament: Id,
        row: u64,
        entries: Vec<TournamentEntry>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        async move {
            let append = Command::TournamentEntries {
                owned: self.owned(tournament)?,
                position: integer(row),
                entries: form::tournament_entries_to_bytes(&entries),
                over: entries.iter().any(TournamentEntry::is_end),
            };
            self.commands.commit(Arc::new(append)).await.map(drop)
        }
        .boxed()
    }

    /// Those of this node that are not over, and the newest ones of the cluster that are.
    fn tournaments(
        &self,
        newest_over: usize,
    ) -> BoxFuture<'_, Result<Vec<StoredTournament>, StoreError>> {
        self.own_tournaments(newest_over).boxed()
    }

    fn hosts_studies(&self) -> bool {
        true
    }

    fn create_study(&self, header: Arc<StudyHeader>) -> BoxFuture<'_, Result<(), StoreError>> {
        async move {
            let create = StudyWrite::Create {
                id: header.id,
                node: self.node()?,
                header: form::study_to_bytes(&header),
            };
            self.write_study(create).await?;
            lock(&self.epochs).insert(header.id, FIRST_EPOCH);
            Ok(())
        }
        .boxed()
    }

    fn append_study(
        &self,
        study: Id,
        row: u64,
        changes: Vec<StudyChange>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        async move {
            let append = StudyWrite::Append {
                owned: self.owned(study)?,
                position: integer(row),
                changes: form::study_changes_to_bytes(&changes),
            };
            self.write_study(append).await
        }
        .boxed()
    }

    fn rewrite_study(
        &self,
        study: Id,
        changes: Vec<StudyChange>,
        forgotten: Vec<u32>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        async move {
            let rewrite = StudyWrite::Rewrite {
                owned: self.owned(study)?,
                changes: form::study_changes_to_bytes(&changes),
                forgotten,
            };
            self.write_study(rewrite).await
        }
        .boxed()
    }

    fn delete_study(&self, study: Id) -> BoxFuture<'_, Result<(), StoreError>> {
        async move {
            let owned = self.owned(study)?;
            self.write_study(StudyWrite::Delete { owned }).await?;
            lock(&self.epochs).remove(&study);
            Ok(())
        }
        .boxed()
    }

    fn study(&self, study: Id) -> BoxFuture<'_, Result<Option<StoredStudy>, StoreError>> {
        self.reader.study(study).boxed()
    }

    /// Those of all nodes.
    fn studies(&self) -> BoxFuture<'_, Result<Vec<Id>, StoreError>> {
        self.reader.studies().boxed()
    }

    fn append_traces(
        &self,
        study: Id,
        traces: StoredTraces,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        async move {
            let add = StudyWrite::Traces {
                owned: self.owned(study)?,
                id: Id::random(),
                participant: traces.number,
                game: traces.game,
                traces: form::traces_to_bytes(traces.traces),
            };
            self.write_study(add).await
        }
        .boxed()
    }

    fn traces(&self, study: Id) -> BoxFuture<'_, Result<Vec<StoredTraces>, StoreError>> {
        self.reader.traces(study).boxed()
    }

    /// Never: a database that does not answer may do so later.
    fn failed(&self) -> BoxFuture<'static, StoreError> {
        pending().boxed()
    }

    fn close(&self) -> BoxFuture<'_, ()> {
        async move {
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
        .boxed()
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex
        .lock()
        .expect("no code that holds this lock can panic")
}
