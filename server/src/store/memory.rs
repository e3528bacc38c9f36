//! Games in memory, for as long as the process lives; and a store that fails when told to, for tests.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

use futures::FutureExt as _;
use futures::future::{BoxFuture, ready};

use super::journal::{Entry, GameHeader};
use super::{Journal, KeptGame, Store, StoreError};
use crate::ids::Id;

/// Finished games that are kept; older ones are forgotten.
pub const MAX_FINISHED_GAMES: usize = 1_000;
/// Changes of finished games that are kept in all; the oldest games are forgotten for it.
pub const MAX_FINISHED_ENTRIES: usize = 10_000_000;

/// Keeps running games, and finished ones up to [`MAX_FINISHED_GAMES`] and [`MAX_FINISHED_ENTRIES`], in memory.
#[derive(Debug, Default)]
pub struct MemoryStore {
    finished: Arc<Mutex<Finished>>,
}

#[derive(Debug, Default)]
struct Finished {
    games: BTreeMap<Id, KeptGame>,
    /// Oldest first.
    order: VecDeque<Id>,
    /// Changes of all of them.
    entries: usize,
}

impl Finished {
    fn keep(&mut self, header: Arc<GameHeader>, entries: Arc<[Entry]>) {
        self.entries += entries.len();
        self.order.push_back(header.game_id);
        self.games.insert(header.game_id, (header, entries));
        while self.order.len() > 1
            && (self.order.len() > MAX_FINISHED_GAMES || self.entries > MAX_FINISHED_ENTRIES)
            && let Some(oldest) = self.order.pop_front()
            && let Some((_, entries)) = self.games.remove(&oldest)
        {
            self.entries -= entries.len();
        }
    }
}

impl Store for MemoryStore {
    fn create(
        &self,
        header: Arc<GameHeader>,
    ) -> BoxFuture<'_, Result<Box<dyn Journal>, StoreError>> {
        let journal = MemoryJournal {
            header,
            entries: Vec::new(),
            finished: Arc::clone(&self.finished),
        };
        ready(Ok(Box::new(journal) as Box<dyn Journal>)).boxed()
    }

    fn finished(&self, game: Id) -> BoxFuture<'_, Result<Option<KeptGame>, StoreError>> {
        ready(Ok(lock(&self.finished).games.get(&game).cloned())).boxed()
    }
}

struct MemoryJournal {
    header: Arc<GameHeader>,
    entries: Vec<Entry>,
    finished: Arc<Mutex<Finished>>,
}

impl Journal for MemoryJournal {
    fn append<'a>(
        &'a mut self,
        entries: &'a mut Vec<Entry>,
    ) -> BoxFuture<'a, Result<(), StoreError>> {
        self.entries.append(entries);
        ready(Ok(())).boxed()
    }

    fn finish(&mut self) -> BoxFuture<'_, Result<(), StoreError>> {
        let entries = std::mem::take(&mut self.entries).into();
        lock(&self.finished).keep(Arc::clone(&self.header), entries);
        ready(Ok(())).boxed()
    }
}

fn lock(finished: &Mutex<Finished>) -> MutexGuard<'_, Finished> {
    finished
        .lock()
        .expect("nothing that holds this lock can panic")
}

/// A memory store whose appends fail from a certain one on: what a full disk would do.
#[derive(Debug)]
pub struct FailingStore {
    inner: MemoryStore,
    appends_left: Arc<AtomicU64>,
}

impl FailingStore {
    /// A store that takes `appends` appends and fails at every later one.
    pub fn after(appends: u64) -> Self {
        Self {
            inner: MemoryStore::default(),
            appends_left: Arc::new(AtomicU64::new(appends)),
        }
    }
}

impl Store for FailingStore {
    fn create(
        &self,
        header: Arc<GameHeader>,
    ) -> BoxFuture<'_, Result<Box<dyn Journal>, StoreError>> {
        let appends_left = Arc::clone(&self.appends_left);
        self.inner
            .create(header)
            .map(|inner| {
                let inner = inner?;
                Ok(Box::new(FailingJournal {
                    inner,
                    appends_left,
                }) as Box<dyn Journal>)
            })
            .boxed()
    }

    fn finished(&self, game: Id) -> BoxFuture<'_, Result<Option<KeptGame>, StoreError>> {
        self.inner.finished(game)
    }
}

struct FailingJournal {
    inner: Box<dyn Journal>,
    appends_left: Arc<AtomicU64>,
}

impl Journal for FailingJournal {
    fn append<'a>(
        &'a mut self,
        entries: &'a mut Vec<Entry>,
    ) -> BoxFuture<'a, Result<(), StoreError>> {
        let allowed = self
            .appends_left
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
                left.checked_sub(1)
            })
            .is_ok();
        if allowed {
            self.inner.append(entries)
        } else {
            ready(Err(StoreError("told to fail".into()))).boxed()
        }
    }

    fn finish(&mut self) -> BoxFuture<'_, Result<(), StoreError>> {
        self.inner.finish()
    }
}
