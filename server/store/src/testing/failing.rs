//! A store that fails on request, for tests: simulates a full disk. It also says what was read from
//! it, so that a test sees whether a call reads more of what exists than of what does not.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use async_trait::async_trait;
use chefshat_proto::v1;
use chefshat_record::pseudonym::Pseudonym;
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
    /// Whether appending to journals of games panics.
    pub journals_panic: Arc<AtomicBool>,
    /// Number of parts of the list of games that can still be read.
    pub lists_left: AtomicU64,
    /// Number of deletions of old games that still succeed.
    pub prunes_left: AtomicU64,
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
            journals_panic: Arc::default(),
            lists_left: AtomicU64::new(u64::MAX),
            prunes_left: AtomicU64::new(u64::MAX),
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

/// Takes one of those that are left.
fn take_one(left: &AtomicU64) -> Result<(), StoreError> {
    let taken = left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
        left.checked_sub(1)
    });
    taken.map(drop).map_err(|_| injected_failure())
}

#[async_trait]
impl Store for FailingStore {
    fn outlives_server(&self) -> bool {
        false
    }

    async fn create(
        &self,
        header: Arc<GameHeader>,
        entries: Vec<Entry>,
    ) -> Result<Box<dyn Journal>, StoreError> {
        Ok(Box::new(FailingJournal {
            inner: self.inner.create(header, entries).await?,
            appends_left: Arc::clone(&self.appends_left),
            has_failed: self.has_failed.clone(),
            unreadable: Arc::clone(&self.journals_unreadable),
            panics: Arc::clone(&self.journals_panic),
        }))
    }

    async fn resumable_games(&self, ended_since_ms: u64) -> Result<Vec<ResumableGame>, StoreError> {
        self.inner.resumable_games(ended_since_ms).await
    }

    async fn summary(&self, game: GameId) -> Result<Option<v1::RecordSummary>, StoreError> {
        self.count(Read::Summary);
        self.inner.summary(game).await
    }

    async fn finished(&self, game: GameId) -> Result<Option<StoredGame>, StoreError> {
        if self.games_unreadable.load(Ordering::Relaxed) {
            let unreadable = StoreError::Unreadable("an injected problem".to_owned());
            return Err(unreadable);
        }
        let found = self.inner.finished(game).await?;
        if found.is_some() {
            self.count(Read::Game);
        }
        Ok(found)
    }

    async fn list(
        &self,
        filter: &v1::RecordFilter,
        part: Part,
        count: usize,
    ) -> Result<Vec<Listed>, StoreError> {
        take_one(&self.lists_left)?;
        self.count(Read::List);
        self.inner.list(filter, part, count).await
    }

    async fn import(
        &self,
        game: GameId,
        summary: v1::RecordSummary,
        lines: Arc<[v1::RecordLine]>,
    ) -> Result<bool, StoreError> {
        self.inner.import(game, summary, lines).await
    }

    async fn finished_games(&self) -> Result<u64, StoreError> {
        self.inner.finished_games().await
    }

    async fn prunable(
        &self,
        keep: Keep,
        after: u64,
        count: usize,
    ) -> Result<Vec<(u64, GameId)>, StoreError> {
        self.inner.prunable(keep, after, count).await
    }

    async fn prune(&self, games: Vec<GameId>) -> Result<Vec<GameId>, StoreError> {
        take_one(&self.prunes_left)?;
        self.inner.prune(games).await
    }

    async fn delete(&self, games: Vec<GameId>) -> Result<(), StoreError> {
        self.inner.delete(games).await
    }

    async fn forget(&self, who: &Pseudonym) -> Result<Forgotten, ForgetError> {
        self.inner.forget(who).await
    }

    async fn without_record_file(&self) -> Result<Vec<GameId>, StoreError> {
        self.inner.without_record_file().await
    }

    async fn mark_record_written(&self, game: GameId) -> Result<(), StoreError> {
        self.inner.mark_record_written(game).await
    }

    async fn write_unit(&self, unit: UnitKey, write: UnitWrite) -> Result<(), StoreError> {
        if matches!(
            (unit.kind(), &write),
            (UnitKind::Tournament, UnitWrite::Append(_))
        ) {
            let permit = self.tournament_commits.acquire().await;
            permit.expect("the semaphore is never closed").forget();
        }
        self.inner.write_unit(unit, write).await
    }

    async fn unit(&self, unit: UnitKey) -> Result<Option<StoredUnit>, StoreError> {
        let unreadable = self.unreadable.lock();
        let fails = (unreadable.expect("no code that holds it can panic")).contains(&unit.id());
        match fails {
            true => Err(injected_failure()),
            false => self.inner.unit(unit).await,
        }
    }

    async fn units(&self, kind: UnitKind, newest_over: usize) -> Result<Vec<UnitKey>, StoreError> {
        self.count(Read::Units);
        self.inner.units(kind, newest_over).await
    }

    async fn traces(&self, study: StudyId) -> Result<Vec<StoredTraces>, StoreError> {
        self.inner.traces(study).await
    }

    async fn failed(&self) -> StoreError {
        let mut has_failed = self.has_failed.subscribe();
        (has_failed.wait_for(|failed| *failed).await).expect("the sender is here");
        injected_failure()
    }

    async fn close(&self) {
        self.inner.close().await
    }
}

struct FailingJournal {
    inner: Box<dyn Journal>,
    appends_left: Arc<AtomicU64>,
    has_failed: watch::Sender<bool>,
    unreadable: Arc<AtomicBool>,
    panics: Arc<AtomicBool>,
}

#[async_trait]
impl Journal for FailingJournal {
    async fn append(&mut self, entries: &mut Vec<Entry>) -> Result<(), StoreError> {
        let panics = self.panics.load(Ordering::Relaxed);
        assert!(!panics, "the journal is asked to panic");
        if let Err(failure) = take_one(&self.appends_left) {
            self.has_failed.send_replace(true);
            return Err(failure);
        }
        self.inner.append(entries).await
    }

    async fn entries(&mut self) -> Result<Vec<Entry>, StoreError> {
        match self.unreadable.load(Ordering::Relaxed) {
            true => Err(injected_failure()),
            false => self.inner.entries().await,
        }
    }

    async fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<v1::RecordSignature>,
    ) -> Result<(), StoreError> {
        self.inner.finish(summary, signature).await
    }
}
