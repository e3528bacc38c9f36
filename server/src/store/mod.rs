//! Where games are kept. One trait, awaited even where it keeps things in memory: a room tells nobody of a change before the store has
//! taken it.

mod failing;
mod memory;
mod sqlite;
#[cfg(test)]
mod tests;
pub mod tournaments;

use std::sync::Arc;

use chefshat_proto::v1;
use futures::future::BoxFuture;

pub use failing::FailingStore;
pub use memory::{MAX_FINISHED_ENTRIES, MAX_FINISHED_GAMES, MemoryStore};
pub use sqlite::{ForgetError, Forgetting, Forgotten, OpenError, SqliteStore};

use chefshat_room::ids::Id;
use chefshat_room::journal::{Entry, GameHeader, TournamentGame};
use tournaments::{StoredTournament, TournamentEntry, TournamentHeader};

/// Why a store could not do what it was asked, and what to do about it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// The store failed; a commit that was under way may or may not have been made.
    #[error("{0}")]
    Failed(String),
    /// There is a game or a tournament with this id. Nothing was changed, and the store has not failed.
    #[error("the id {0} is taken")]
    Taken(Id),
}

/// A finished game as it was kept.
#[derive(Debug, Clone)]
pub enum StoredGame {
    /// A game that was hosted: its header and its journal.
    Hosted(Arc<GameHeader>, Arc<[Entry]>),
    /// A game that was imported: the lines of its record.
    Imported(Arc<[v1::RecordLine]>),
}

impl StoredGame {
    /// The tournament it belongs to, if it is one of this server's.
    pub fn tournament(&self) -> Option<TournamentGame> {
        match self {
            Self::Hosted(header, _) => header.tournament,
            Self::Imported(_) => None,
        }
    }
}

/// A part of the list of finished games, which are numbered from 1, older ones before newer ones; and the way in which it is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Those after the one of this number, oldest first.
    After(u64),
    /// Those before the one of this number, newest first.
    Before(u64),
}

impl Part {
    /// All, oldest first.
    pub const FROM_OLDEST: Self = Self::After(0);
    /// All, newest first.
    pub const FROM_NEWEST: Self = Self::Before(u64::MAX);
}

/// A game whose room is to be there again after the server ended.
pub struct ResumableGame {
    /// Its header; the recorded players of its seats are left for the caller to fill in.
    pub header: GameHeader,
    /// Everything that was kept of it.
    pub entries: Vec<Entry>,
    /// What its next changes go to.
    pub journal: Box<dyn Journal>,
    /// Whether its end has been kept, with everything that follows from it.
    pub concluded: bool,
}

/// Keeps games.
pub trait Store: Send + Sync + 'static {
    /// Whether unfinished games are still there when the server has ended, however it ended.
    fn outlives_server(&self) -> bool;
    /// Whether there is space for more games than those that go on, for which some is kept free.
    fn has_space(&self) -> bool {
        true
    }
    /// Begins a game with its first entries, kept together or not at all; its journal goes on through what is returned.
    fn create(
        &self,
        header: Arc<GameHeader>,
        entries: Vec<Entry>,
    ) -> BoxFuture<'_, Result<Box<dyn Journal>, StoreError>>;
    /// The games that were going on when the server ended, and those that had ended since a time (milliseconds since the Unix epoch), of
    /// which somebody may not have heard; oldest first. One that cannot be read is left as it is, and logged.
    fn resumable_games(
        &self,
        ended_since_ms: u64,
    ) -> BoxFuture<'_, Result<Vec<ResumableGame>, StoreError>>;
    /// A finished game, or `None`.
    fn finished(&self, game: Id) -> BoxFuture<'_, Result<Option<StoredGame>, StoreError>>;
    /// At most `count` finished games that a filter lets through, of a part of the list and in its order, with their numbers.
    fn list<'a>(
        &'a self,
        filter: &'a v1::RecordFilter,
        part: Part,
        count: usize,
    ) -> BoxFuture<'a, Result<Vec<(u64, v1::RecordSummary)>, StoreError>>;
    /// Keeps the record of a game that was played elsewhere. `false` if there is a game of this id.
    fn import(
        &self,
        game: Id,
        summary: v1::RecordSummary,
        lines: Arc<[v1::RecordLine]>,
    ) -> BoxFuture<'_, Result<bool, StoreError>>;
    /// Finished games whose record has not been written to a file.
    fn unfiled(&self) -> BoxFuture<'_, Result<Vec<Id>, StoreError>>;
    /// Notes that the record of a game has been written to a file.
    fn note_filed(&self, game: Id) -> BoxFuture<'_, Result<(), StoreError>>;
    /// Begins a tournament with the first part, row 0, of what moved it, kept together or not at all.
    fn create_tournament(
        &self,
        header: Arc<TournamentHeader>,
        entries: Vec<TournamentEntry>,
    ) -> BoxFuture<'_, Result<(), StoreError>>;
    /// Adds to a tournament the `row`-th part, from 1, of what moved it.
    fn append_tournament(
        &self,
        tournament: Id,
        row: u64,
        entries: Vec<TournamentEntry>,
    ) -> BoxFuture<'_, Result<(), StoreError>>;
    /// The tournaments that are not over and, of those that are, at most the `newest_over` that were made last; oldest first. One that
    /// cannot be read is left as it is, and logged.
    fn tournaments(
        &self,
        newest_over: usize,
    ) -> BoxFuture<'_, Result<Vec<StoredTournament>, StoreError>>;
    /// Returns when the store can keep nothing any more; until then it waits.
    fn failed(&self) -> BoxFuture<'static, StoreError>;
    /// Ends in good order; nothing is asked of it afterwards.
    fn close(&self) -> BoxFuture<'_, ()>;
}

impl std::fmt::Debug for dyn Store {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("Store")
    }
}

/// The journal of one game that goes on.
pub trait Journal: Send + 'static {
    /// Adds entries, and leaves `entries` empty. When this has returned `Ok`, they are kept; after an error their fate is unknown.
    fn append<'a>(
        &'a mut self,
        entries: &'a mut Vec<Entry>,
    ) -> BoxFuture<'a, Result<(), StoreError>>;
    /// Says that the game is over and nothing more will be added; without a summary there is nothing to make a record of.
    fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
    ) -> BoxFuture<'_, Result<(), StoreError>>;
}

/// Who had a seat: a built-in agent is itself, whatever it was called.
fn identity(seat: &v1::Participant) -> &String {
    match seat.built_in_agent.is_empty() {
        true => &seat.name,
        false => &seat.built_in_agent,
    }
}

/// Whether a filter lets a record through.
fn lets_through(filter: &v1::RecordFilter, summary: &v1::RecordSummary) -> bool {
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
