//! Where games are kept. One trait, awaited even where it keeps things in memory: a room tells nobody of a change before the store has
//! taken it.

pub mod journal;
mod memory;

use std::sync::Arc;

use futures::future::BoxFuture;

pub use memory::{FailingStore, MAX_FINISHED_ENTRIES, MAX_FINISHED_GAMES, MemoryStore};

use crate::ids::Id;
use journal::{Entry, GameHeader};

/// Why a store could not do what it was asked.
#[derive(Debug, thiserror::Error)]
#[error("the store failed: {0}")]
pub struct StoreError(pub String);

/// A game as it was kept: its header and its journal.
pub type KeptGame = (Arc<GameHeader>, Arc<[Entry]>);

/// Keeps games.
pub trait Store: Send + Sync + 'static {
    /// Begins a game; its journal is written through what is returned.
    fn create(
        &self,
        header: Arc<GameHeader>,
    ) -> BoxFuture<'_, Result<Box<dyn Journal>, StoreError>>;
    /// A game that is finished, or `None`.
    fn finished(&self, game: Id) -> BoxFuture<'_, Result<Option<KeptGame>, StoreError>>;
}

/// The journal of one game that goes on.
pub trait Journal: Send + 'static {
    /// Adds entries, and leaves `entries` empty. When this has returned `Ok`, they are kept; after an error their fate is unknown.
    fn append<'a>(
        &'a mut self,
        entries: &'a mut Vec<Entry>,
    ) -> BoxFuture<'a, Result<(), StoreError>>;
    /// Says that nothing more will be added.
    fn finish(&mut self) -> BoxFuture<'_, Result<(), StoreError>>;
}
