//! Games in memory, for as long as the process lives; and a store that fails when told to, for tests.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use futures::FutureExt as _;
use futures::future::{BoxFuture, ready};

use super::journal::{Entry, GameHeader};
use super::{KeptGame, Store, StoreError};
use crate::ids::Id;

/// Finished games that are kept; older ones are forgotten.
pub const MAX_FINISHED_GAMES: usize = 1_000;

/// Keeps running games and the last [`MAX_FINISHED_GAMES`] finished ones in memory.
#[derive(Debug, Default)]
pub struct MemoryStore {
    games: Mutex<Games>,
}

#[derive(Debug, Default)]
struct Games {
    kept: BTreeMap<Id, KeptGame>,
    finished: VecDeque<Id>,
}

impl MemoryStore {
    fn with<T: Send + 'static>(
        &self,
        action: impl FnOnce(&mut Games) -> Result<T, StoreError>,
    ) -> BoxFuture<'_, Result<T, StoreError>> {
        let mut games = self
            .games
            .lock()
            .expect("nothing that holds this lock can panic");
        ready(action(&mut games)).boxed()
    }
}

impl Store for MemoryStore {
    fn create(&self, header: Arc<GameHeader>) -> BoxFuture<'_, Result<(), StoreError>> {
        self.with(|games| {
            games.kept.insert(header.game_id, (header, Vec::new()));
            Ok(())
        })
    }

    fn append(&self, game: Id, mut entries: Vec<Entry>) -> BoxFuture<'_, Result<(), StoreError>> {
        self.with(|games| {
            let (_, journal) = games
                .kept
                .get_mut(&game)
                .ok_or_else(|| StoreError(format!("game {game} was never created")))?;
            journal.append(&mut entries);
            Ok(())
        })
    }

    fn finish(&self, game: Id) -> BoxFuture<'_, Result<(), StoreError>> {
        self.with(|games| {
            games.finished.push_back(game);
            if games.finished.len() > MAX_FINISHED_GAMES
                && let Some(oldest) = games.finished.pop_front()
            {
                games.kept.remove(&oldest);
            }
            Ok(())
        })
    }

    fn finished(&self, game: Id) -> BoxFuture<'_, Result<Option<KeptGame>, StoreError>> {
        self.with(|games| {
            Ok(if games.finished.contains(&game) {
                games.kept.get(&game).cloned()
            } else {
                None
            })
        })
    }
}

/// A memory store whose appends fail from a certain one on: what a full disk would do.
#[derive(Debug)]
pub struct FailingStore {
    inner: MemoryStore,
    appends_left: AtomicU64,
}

impl FailingStore {
    /// A store that takes `appends` appends and fails at every later one.
    pub fn after(appends: u64) -> Self {
        Self {
            inner: MemoryStore::default(),
            appends_left: AtomicU64::new(appends),
        }
    }
}

impl Store for FailingStore {
    fn create(&self, header: Arc<GameHeader>) -> BoxFuture<'_, Result<(), StoreError>> {
        self.inner.create(header)
    }

    fn append(&self, game: Id, entries: Vec<Entry>) -> BoxFuture<'_, Result<(), StoreError>> {
        let allowed = self
            .appends_left
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
                left.checked_sub(1)
            })
            .is_ok();
        if allowed {
            self.inner.append(game, entries)
        } else {
            ready(Err(StoreError("told to fail".into()))).boxed()
        }
    }

    fn finish(&self, game: Id) -> BoxFuture<'_, Result<(), StoreError>> {
        self.inner.finish(game)
    }

    fn finished(&self, game: Id) -> BoxFuture<'_, Result<Option<KeptGame>, StoreError>> {
        self.inner.finished(game)
    }
}
