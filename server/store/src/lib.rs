//! Storage of games. The trait is asynchronous even in memory: a room publishes a change only after
//! the store has committed it.

pub mod cluster;
mod decode_pool;
mod ephemeral;
mod error;
mod forget;
mod form;
mod memory;
mod postgres;
pub mod samples;
mod sql;
mod sqlite;
pub mod studies;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
#[cfg(test)]
mod tests;
pub mod tournaments;
pub mod units;

use std::borrow::Cow;
use std::sync::Arc;

use async_trait::async_trait;
use chefshat_proto::v1::{self, record_line::Line};
use chefshat_record::pseudonym::{Pseudonym, Redactions};
use prost::Message as _;

pub use decode_pool::MAX_CONCURRENT_RECORDS;
pub use error::StoreError;
pub use memory::{MAX_FINISHED_ENTRIES, MAX_FINISHED_GAMES, MemoryStore};
pub use postgres::{
    DatabaseError, PostgresOptions, PostgresStore, TransferError, Transferred, migrate, transfer,
};
pub use sqlite::{
    DATABASE_FILE, DatabaseCopy, LOCK_FILE, OpenError, SqliteStore, check_copy, copy_database,
};

use chefshat_base::metrics::StoreMetrics;
use chefshat_room::ids::{GameId, Id, SecretHash, StudyId};
use chefshat_room::journal::{Entry, GameHeader, TournamentGame};
use chefshat_wire::convert;
use units::{StoredKind, StoredTraces, StoredUnit, UnitKey, UnitKind, UnitWrite};

/// A finished game in the store.
#[derive(Debug, Clone)]
pub enum StoredGame {
    /// A hosted game: its header, its journal, and the signature of its record, if it has one.
    Hosted(
        Arc<GameHeader>,
        Arc<[Entry]>,
        Option<Arc<v1::RecordSignature>>,
    ),
    /// An imported game: the lines of its record.
    Imported(Arc<[v1::RecordLine]>),
}

impl StoredGame {
    /// All lines of its record.
    pub fn lines(&self) -> Cow<'_, [v1::RecordLine]> {
        match self {
            Self::Hosted(..) => {
                let mut lines = Vec::new();
                self.each_line(|line| lines.push(line.into_owned()));
                Cow::Owned(lines)
            }
            Self::Imported(lines) => Cow::Borrowed(lines),
        }
    }

    /// Passes the same lines on one by one: those of a long game take far more memory than its
    /// journal.
    pub fn each_line<'a>(&'a self, mut take: impl FnMut(Cow<'a, v1::RecordLine>)) {
        match self {
            Self::Hosted(header, journal, signature) => {
                convert::each_record_line(header, journal, |mut line| {
                    if let Some(Line::Footer(footer)) = &mut line.line {
                        footer.signature = signature.as_deref().cloned();
                        footer.participant_removed = header.participant_removed;
                    }
                    take(Cow::Owned(line));
                });
            }
            Self::Imported(lines) => lines.iter().for_each(|line| take(Cow::Borrowed(line))),
        }
    }

    /// Its tournament, if it belongs to one of this server's.
    pub fn tournament(&self) -> Option<TournamentGame> {
        match self {
            Self::Hosted(header, ..) => header.tournament,
            Self::Imported(_) => None,
        }
    }
}

/// A finished game in a list.
#[derive(Debug, Clone)]
pub struct Listed {
    /// Its number.
    pub number: u64,
    /// The hash of its room's owner token, which says who sees it without reading the game. `None`
    /// for one that was imported, which everybody sees, or whose header cannot be read.
    pub owner: Option<SecretHash>,
    /// Its summary, or why that cannot be read.
    pub summary: Result<v1::RecordSummary, UnreadableGame>,
}

/// A finished game whose summary cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the summary of game {game} cannot be read: {problem}")]
pub struct UnreadableGame {
    /// The game.
    pub game: GameId,
    /// The reason.
    pub problem: String,
}

/// The summary of a finished game as it is stored.
fn stored_summary(game: GameId, bytes: &[u8]) -> Result<v1::RecordSummary, UnreadableGame> {
    v1::RecordSummary::decode(bytes).map_err(|error| UnreadableGame {
        game,
        problem: error.to_string(),
    })
}

impl From<UnreadableGame> for StoreError {
    fn from(error: UnreadableGame) -> Self {
        Self::Unreadable(error.to_string())
    }
}

/// A row of the list of finished games, of its number, its id, its summary and the beginning of its
/// header.
fn listed(number: i64, game: &[u8], summary: &[u8], header: Option<&[u8]>) -> Listed {
    let number = u64::try_from(number).unwrap_or_default();
    let game = Id::from_bytes(game.try_into().unwrap_or_default());
    let summary = stored_summary(game, summary).inspect_err(|problem| {
        tracing::error!(number, %problem, "a game is not listed");
    });
    Listed {
        number,
        owner: header.and_then(form::stored_owner),
        summary,
    }
}

/// A part of the list of finished games, and the order of reading. Games are numbered from 1,
/// oldest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The games after this number, oldest first.
    After(u64),
    /// The games before this number, newest first.
    Before(u64),
}

impl Part {
    /// All, oldest first.
    pub const FROM_OLDEST: Self = Self::After(0);
    /// All, newest first.
    pub const FROM_NEWEST: Self = Self::Before(u64::MAX);
}

/// A game whose room is restored when the server starts.
pub struct ResumableGame {
    /// Its header; the caller adds the recorded players of its seats.
    pub header: GameHeader,
    /// Its journal so far.
    pub entries: Vec<Entry>,
    /// The journal for further entries.
    pub journal: Box<dyn Journal>,
    /// Whether its end has been committed, with everything that follows from it.
    pub concluded: bool,
}

/// Which finished games stay. All conditions that are set must allow the deletion of a game.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Keep {
    /// Those that ended or were imported at this time or later, milliseconds since the Unix epoch.
    pub ended_since_ms: Option<u64>,
    /// The newest ones in the order of their ends or imports, this many.
    pub newest: Option<u64>,
}

/// The disk of a store.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct DiskUsage {
    /// Bytes that the store takes.
    pub bytes: u64,
    /// Bytes that are free.
    pub free_bytes: u64,
}

/// What was removed from a store.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Forgotten {
    /// Games that contained the name.
    pub games: Vec<GameId>,
    /// Those of them whose record was written to a file, which must be written again. Until they
    /// are marked as written, the next start of the server does.
    pub filed: Vec<GameId>,
    /// Number of tournaments that contained the name.
    pub tournaments: u64,
    /// The changes in the games.
    pub redactions: Redactions,
}

/// Why a participant cannot be removed. Nothing was changed, unless the store failed.
#[derive(Debug, thiserror::Error)]
pub enum ForgetError {
    /// A game with the name is not over.
    #[error(
        "{0:?} takes part in a game that is not over; nothing was changed: let the game end or close its room on the running server, and try again"
    )]
    GameRunning(String),
    /// A tournament with the name is not over.
    #[error(
        "{0:?} takes part in a tournament that is not over; nothing was changed: let it end or close it on the running server, and try again"
    )]
    TournamentRunning(String),
    /// Stored data cannot be read.
    #[error("{what} cannot be read: {problem}; nothing was changed")]
    Unreadable {
        /// The data.
        what: String,
        /// The reason.
        problem: String,
    },
    /// The store failed.
    #[error("{0}")]
    Store(#[from] StoreError),
}

/// Stores games. No call does anything before its future is polled.
#[async_trait]
pub trait Store: Send + Sync + 'static {
    /// Whether unfinished games survive the end of the server, a crash included.
    fn outlives_server(&self) -> bool;
    /// Whether there is space for new games besides the reserve for running ones.
    fn has_space(&self) -> bool {
        true
    }
    /// Waits until `has_space` is true; `false` if the server stops first.
    async fn wait_for_space(&self) -> bool {
        true
    }
    /// The server stops: what waits for space on the disk fails.
    fn stop_waiting(&self) {}
    /// The metrics of its writer, if it has one.
    fn metrics(&self) -> Option<&StoreMetrics> {
        None
    }
    /// Number of commands that wait for its writer.
    fn queue_depth(&self) -> usize {
        0
    }
    /// Creates a game with its first entries, in one commit. Returns its journal.
    async fn create(
        &self,
        header: Arc<GameHeader>,
        entries: Vec<Entry>,
    ) -> Result<Box<dyn Journal>, StoreError>;
    /// The unfinished games, and those that have ended since a time (milliseconds since the Unix
    /// epoch), whose clients may have missed the end; oldest first. A game that cannot be read is
    /// logged and left unchanged.
    async fn resumable_games(&self, ended_since_ms: u64) -> Result<Vec<ResumableGame>, StoreError>;
    /// The summary of a finished game, or `None`. Reads little, whatever the length of the game: it
    /// is read before anything else, to find out who may read the rest.
    async fn summary(&self, game: GameId) -> Result<Option<v1::RecordSummary>, StoreError>;
    /// A finished game, or `None`.
    async fn finished(&self, game: GameId) -> Result<Option<StoredGame>, StoreError>;
    /// At most `count` finished games of a part of the list that match a filter, in its order, with
    /// their numbers. One whose summary cannot be read is named in its place.
    async fn list(
        &self,
        filter: &v1::RecordFilter,
        part: Part,
        count: usize,
    ) -> Result<Vec<Listed>, StoreError>;
    /// Stores the record of a game played elsewhere. Returns `false` if the id is taken.
    async fn import(
        &self,
        game: GameId,
        summary: v1::RecordSummary,
        lines: Arc<[v1::RecordLine]>,
    ) -> Result<bool, StoreError>;
    /// Its disk; `None` if it has none, or if the system does not say.
    fn disk(&self) -> Option<DiskUsage> {
        None
    }
    /// Number of finished games.
    async fn finished_games(&self) -> Result<u64, StoreError>;
    /// At most `count` finished games that need not be kept, by a number that orders them, after a
    /// number. Never the newest game, one whose record is still to be written (unless it waits for
    /// space), one of a study, one of a tournament that is not over or cannot be read, or one that
    /// does not say of which it is.
    /// A store that keeps everything returns none.
    async fn prunable(
        &self,
        _keep: Keep,
        _after: u64,
        _count: usize,
    ) -> Result<Vec<(u64, GameId)>, StoreError> {
        Ok(Vec::new())
    }
    /// Deletes those of these games that a tournament or study does not need, as `prunable` says, and
    /// gives their space back, now or soon. Returns those that it no longer has: only their files may be
    /// deleted.
    async fn prune(&self, _games: Vec<GameId>) -> Result<Vec<GameId>, StoreError> {
        Ok(Vec::new())
    }
    /// Deletes finished games, whatever needs them, and gives their space back.
    async fn delete(&self, _games: Vec<GameId>) -> Result<(), StoreError> {
        Ok(())
    }
    /// Replaces the name of a participant in all games and tournaments by a pseudonym, and deletes
    /// its expressions and annotations. Changed records lose their signature and count as not
    /// written to files. What contains the name and is not over refuses it. If the store fails
    /// meanwhile, some games and tournaments have changed, each of them completely: doing it again
    /// completes it. A store that cannot forget fails.
    async fn forget(&self, _who: &Pseudonym) -> Result<Forgotten, ForgetError> {
        let failure = StoreError::Failed("this store cannot remove participants".to_owned());
        Err(failure.into())
    }
    /// Finished games whose record is not yet written to a file.
    async fn without_record_file(&self) -> Result<Vec<GameId>, StoreError>;
    /// Marks the record of a game as written to a file.
    async fn mark_record_written(&self, game: GameId) -> Result<(), StoreError>;
    /// Writes something for a tournament or study, in one commit. What is added to one that was
    /// deleted has no effect.
    async fn write_unit(&self, unit: UnitKey, write: UnitWrite) -> Result<(), StoreError>;
    /// A tournament or study, or `None`.
    async fn unit(&self, unit: UnitKey) -> Result<Option<StoredUnit>, StoreError>;
    /// The tournaments or studies that are not over, and of the `newest_over` newest ones
    /// that are; oldest first.
    async fn units(&self, kind: UnitKind, newest_over: usize) -> Result<Vec<UnitKey>, StoreError>;
    /// The interface traces of a study, in the order in which they were added. One that cannot be
    /// read is logged and left out.
    async fn traces(&self, study: StudyId) -> Result<Vec<StoredTraces>, StoreError>;
    /// Waits until the store fails for good.
    async fn failed(&self) -> StoreError;
    /// Closes the store; it must not be used afterwards.
    async fn close(&self);
}

impl std::fmt::Debug for dyn Store {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("Store")
    }
}

/// The ids of the tournaments or studies that [`Store::units`] returns.
///
/// # Errors
/// The store failed.
pub async fn units_of<K: StoredKind>(
    store: &(impl Store + ?Sized),
    newest_over: usize,
) -> Result<Vec<Id<K>>, StoreError> {
    let units = store.units(K::KIND, newest_over).await?;
    Ok(units.into_iter().filter_map(K::id_of).collect())
}

/// The journal of a running game. As with [`Store`], only polled futures do anything.
#[async_trait]
pub trait Journal: Send + 'static {
    /// Commits entries and leaves `entries` empty, if this takes no time. Otherwise returns `false`
    /// and changes nothing.
    fn append_now(&mut self, _entries: &mut Vec<Entry>) -> bool {
        false
    }
    /// Commits entries and leaves `entries` empty. After an error it is unknown whether they were
    /// committed.
    async fn append(&mut self, entries: &mut Vec<Entry>) -> Result<(), StoreError>;
    /// Reads back all committed entries.
    async fn entries(&mut self) -> Result<Vec<Entry>, StoreError>;
    /// Marks the game as over; nothing can be added afterwards. Without a summary it has no record.
    async fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<v1::RecordSignature>,
    ) -> Result<(), StoreError>;
}

/// The identity of a seat's participant: that of a built-in agent is its agent, not its display
/// name.
fn identity(seat: &v1::Participant) -> &String {
    match seat.built_in_agent.is_empty() {
        true => &seat.name,
        false => &seat.built_in_agent,
    }
}

/// Whether a record matches a filter.
fn matches_filter(filter: &v1::RecordFilter, summary: &v1::RecordSummary) -> bool {
    let unset = 0;
    (filter.state == unset || filter.state == summary.state)
        && (filter.origin == unset || filter.origin == summary.origin)
        && !(filter.hosted_here && summary.added)
        && (filter.room_name.is_empty() || filter.room_name == summary.room_name)
        && summary.created_at_ms >= filter.created_from_ms
        && (filter.created_before_ms == 0 || summary.created_at_ms < filter.created_before_ms)
        && (filter.kind == unset || summary.seats.iter().any(|seat| seat.kind == filter.kind))
        && (filter.participant.is_empty()
            || (summary.seats.iter()).any(|seat| *identity(seat) == filter.participant))
}
