//! Where games are kept. One trait, awaited even where it keeps things in memory: a room tells nobody of a change before the store has
//! taken it.

pub mod journal;
mod memory;

use std::sync::Arc;

use futures::future::BoxFuture;

pub use memory::{FailingStore, MAX_FINISHED_GAMES, MemoryStore};

use crate::ids::Id;
use journal::{Entry, GameHeader};

/// Why a store could not do what it was asked.
#[derive(Debug, thiserror::Error)]
#[error("the store failed: {0}")]
pub struct StoreError(pub String);

/// A game as it was kept: its header and its journal.
pub type KeptGame = (Arc<GameHeader>, Vec<Entry>);

/// Keeps games.
pub trait Store: Send + Sync + 'static {
    /// Begins a game.
    fn create(&self, header: Arc<GameHeader>) -> BoxFuture<'_, Result<(), StoreError>>;
    /// Adds to a game's journal. When this has returned `Ok`, the entries are kept; after an error their fate is unknown.
    fn append(&self, game: Id, entries: Vec<Entry>) -> BoxFuture<'_, Result<(), StoreError>>;
    /// Says that nothing more will be added to a game.
    fn finish(&self, game: Id) -> BoxFuture<'_, Result<(), StoreError>>;
    /// A game that is finished, or `None`.
    fn finished(&self, game: Id) -> BoxFuture<'_, Result<Option<KeptGame>, StoreError>>;
}
