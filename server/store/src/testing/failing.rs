//! A store that fails on request, for tests: simulates a full disk. It also says what was read from
//! it, so that a test sees whether a call reads more of what exists than of what does not.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use chefshat_proto::v1;
use chefshat_record::pseudonym::Pseudonym;
use futures::FutureExt as _;
use futures::future::{BoxFuture, ready};
use tokio::sync::{Semaphore, watch};

use crate::units::{StoredTraces, StoredUnit, UnitKey, UnitKind, UnitWrite};
use crate::{
    ForgetError, Forgotten, Journal, Keep, Listed, MemoryStore, Part, ResumableGame, Store,
    StoreError, StoredGame,
};
use chefshat_room::ids::{GameId, StudyId, UnitId};
use chefshat_room::journal::{Entry, GameHeader};

/// A memory store whose appends fail after a number of them.
#[derive(Debug)]
pub struct FailingStore {
    inner: MemoryStore,
    appends_left: Arc<AtomicU64>,
    has_failed: watch::Sender<bool>,
    reads: Mutex<Vec<Read>>,
    /// Permits for commits of tournaments; each commit uses one.
    pub tournament_commits: Arc<Semaphore>,
    /// Tournaments and studies that cannot be read.
    pub unreadable: Mutex<BTreeSet<UnitId>>,
    /// Whether finished games cannot be read, but for their summaries.
    pub games_unreadable: AtomicBool,
    /// Whether journals of games cannot be read.
    pub journals_unreadable: Arc<AtomicBool>,
}

impl FailingStore {
    /// Creates a store that takes `appends` appends and fails at every later one.
    pub fn after(appends: u64) -> Self {
        Self {
            inner: MemoryStore::default(),
            appends_left: Arc::new(AtomicU64::new(appends)),
            has_failed: watch::Sender::new(false),
            reads: Mutex::default(),
            tournament_commits: Arc::new(Semaphore::new(Semaphore::MAX_PERMITS)),
            unreadable: Mutex::default(),
            games_unreadable: AtomicBool::new(false),
            journals_unreadable: Arc::default(),
        }
    }
}

/// What was read from a store.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Read {
    /// The summary of a game, which is small.
    Summary,
    /// A game with its journal, which was found.
    Game,
    /// A part of the list of games.
    List,
    /// The ids of tournaments or studies.
    Units,
}

impl FailingStore {
    /// What was read since the last call of this.
    pub fn take_reads(&self) -> Vec<Read> {
        let mut reads = self.reads.lock().expect("no code that holds it can panic");
        std::mem::take(&mut *reads)
    }

    fn count(&self, read: Read) {
        let mut reads = self.reads.lock().expect("no code that holds it can panic");
        reads.push(read);
    }
}

fn injected_failure() -> StoreError {
    StoreError::Failed("injected failure".into())
}

impl Store for FailingStore {
    fn outlives_server(&self) -> bool {
        false
    }

    fn create(
        &self,
        header: Arc<GameHeader>,
        entries: Vec<Entry>,
    ) -> BoxFuture<'_, Result<Box<dyn Journal>, StoreError>> {
        let appends_left = Arc::clone(&self.appends_left);
        let has_failed = self.has_failed.clone();
        let unreadable = Arc::clone(&self.journals_unreadable);
        let inner = self.inner.create(header, entries);
        async move {
            let journal: Box<dyn Journal> = Box::new(FailingJournal {
                inner: inner.await?,
                appends_left,
                has_failed,
                unreadable,
            });
            Ok(journal)
        }
        .boxed()
    }

    fn resumable_games(
        &self,
        ended_since_ms: u64,
    ) -> BoxFuture<'_, Result<Vec<ResumableGame>, StoreError>> {
        self.inner.resumable_games(ended_since_ms)
    }

    fn summary(
        &self,
        game: GameId,
    ) -> BoxFuture<'_, Result<Option<v1::RecordSummary>, StoreError>> {
        self.count(Read::Summary);
        self.inner.summary(game)
    }

    fn finished(&self, game: GameId) -> BoxFuture<'_, Result<Option<StoredGame>, StoreError>> {
        if self.games_unreadable.load(Ordering::Relaxed) {
            let unreadable = StoreError::Unreadable("an injected problem".to_owned());
            return ready(Err(unreadable)).boxed();
        }
        let finished = self.inner.finished(game);
        let counted = |found: &Result<Option<_>, _>| {
            if let Ok(Some(_)) = found {
                self.count(Read::Game);
            }
        };
        finished.inspect(counted).boxed()
    }

    fn list<'a>(
        &'a self,
        filter: &'a v1::RecordFilter,
        part: Part,
        count: usize,
    ) -> BoxFuture<'a, Result<Vec<Listed>, StoreError>> {
        self.count(Read::List);
        self.inner.list(filter, part, count)
    }

    fn import(
        &self,
        game: GameId,
        summary: v1::RecordSummary,
        lines: Arc<[v1::RecordLine]>,
    ) -> BoxFuture<'_, Result<bool, StoreError>> {
        self.inner.import(game, summary, lines)
    }

    fn finished_games(&self) -> BoxFuture<'_, Result<u64, StoreError>> {
        self.inner.finished_games()
    }

    fn prunable(
        &self,
        keep: Keep,
        after: u64,
        count: usize,
    ) -> BoxFuture<'_, Result<Vec<(u64, GameId)>, StoreError>> {
        self.inner.prunable(keep, after, count)
    }

    fn prune(&self, games: Vec<GameId>) -> BoxFuture<'_, Result<Vec<GameId>, StoreError>> {
        self.inner.prune(games)
    }

    fn delete(&self, games: Vec<GameId>) -> BoxFuture<'_, Result<(), StoreError>> {
        self.inner.delete(games)
    }

    fn forget<'a>(&'a self, who: &'a Pseudonym) -> BoxFuture<'a, Result<Forgotten, ForgetError>> {
        self.inner.forget(who)
    }

    fn without_record_file(&self) -> BoxFuture<'_, Result<Vec<GameId>, StoreError>> {
        self.inner.without_record_file()
    }

    fn mark_record_written(&self, game: GameId) -> BoxFuture<'_, Result<(), StoreError>> {
        self.inner.mark_record_written(game)
    }

    fn write_unit(&self, unit: UnitKey, write: UnitWrite) -> BoxFuture<'_, Result<(), StoreError>> {
        async move {
            if matches!(
                (unit.kind(), &write),
                (UnitKind::Tournament, UnitWrite::Append(_))
            ) {
                let permit = self.tournament_commits.acquire().await;
                permit.expect("the semaphore is never closed").forget();
            }
            self.inner.write_unit(unit, write).await
        }
        .boxed()
    }

    fn unit(&self, unit: UnitKey) -> BoxFuture<'_, Result<Option<StoredUnit>, StoreError>> {
        let unreadable = self.unreadable.lock();
        match (unreadable.expect("no code that holds it can panic")).contains(&unit.id()) {
            true => ready(Err(injected_failure())).boxed(),
            false => self.inner.unit(unit),
        }
    }

    fn units(
        &self,
        kind: UnitKind,
        newest_over: usize,
    ) -> BoxFuture<'_, Result<Vec<UnitKey>, StoreError>> {
        self.count(Read::Units);
        self.inner.units(kind, newest_over)
    }

    fn traces(&self, study: StudyId) -> BoxFuture<'_, Result<Vec<StoredTraces>, StoreError>> {
        self.inner.traces(study)
    }

    fn failed(&self) -> BoxFuture<'static, StoreError> {
        let mut has_failed = self.has_failed.subscribe();
        async move {
            // The sender lives as long as the store, whose failure this waits for.
            let _ = has_failed.wait_for(|failed| *failed).await;
            injected_failure()
        }
        .boxed()
    }

    fn close(&self) -> BoxFuture<'_, ()> {
        self.inner.close()
    }
}

struct FailingJournal {
    inner: Box<dyn Journal>,
    appends_left: Arc<AtomicU64>,
    has_failed: watch::Sender<bool>,
    unreadable: Arc<AtomicBool>,
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
            return self.inner.append(entries);
        }
        self.has_failed.send_replace(true);
        ready(Err(injected_failure())).boxed()
    }

    fn entries(&mut self) -> BoxFuture<'_, Result<Vec<Entry>, StoreError>> {
        match self.unreadable.load(Ordering::Relaxed) {
            true => ready(Err(injected_failure())).boxed(),
            false => self.inner.entries(),
        }
    }

    fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<v1::RecordSignature>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        self.inner.finish(summary, signature)
    }
}
