//! The disk of the simulated server: it survives crashes, and commits take simulated time. What was
//! being committed during a crash may or may not be there afterwards.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use chefshat_proto::v1;
use chefshat_room::ids::{GameId, StudyId};
use chefshat_room::journal::{Change, Entry, GameHeader};
use chefshat_server::store::units::{StoredTraces, StoredUnit, UnitKey, UnitKind, UnitWrite};
use chefshat_server::store::{
    Journal, Listed, MemoryStore, Part, ResumableGame, Store, StoreError, StoredGame,
};
use futures::FutureExt as _;
use futures::future::BoxFuture;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Longest time of a commit.
const SLOWEST_COMMIT: Duration = Duration::from_millis(20);

/// What is on the disk.
pub(crate) struct Disk {
    games: Mutex<BTreeMap<GameId, OnDisk>>,
    chance: Mutex<ChaCha8Rng>,
}

#[derive(Clone)]
struct OnDisk {
    header: Arc<GameHeader>,
    entries: Vec<Entry>,
    finished: bool,
    summary: Option<v1::RecordSummary>,
}

impl Disk {
    /// An empty disk; `seed` decides how long commits take.
    pub(crate) fn new(seed: u64) -> Arc<Self> {
        Arc::new(Self {
            games: Mutex::default(),
            chance: Mutex::new(ChaCha8Rng::seed_from_u64(seed)),
        })
    }

    fn games(&self) -> MutexGuard<'_, BTreeMap<GameId, OnDisk>> {
        self.games.lock().expect("no panic")
    }

    /// Commits a change: half of the time passes before it is on the disk, half of it after.
    async fn commit(&self, change: impl FnOnce(&mut BTreeMap<GameId, OnDisk>)) {
        let half = {
            let mut chance = self.chance.lock().expect("no panic");
            SLOWEST_COMMIT.mul_f64(chance.random_range(0.0..0.5))
        };
        tokio::time::sleep(half).await;
        change(&mut self.games());
        tokio::time::sleep(half).await;
    }

    /// The finished games.
    pub(crate) fn finished(&self) -> Vec<(Arc<GameHeader>, Vec<Entry>)> {
        let games = self.games();
        let finished = games.values().filter(|game| game.finished);
        finished
            .map(|game| (Arc::clone(&game.header), game.entries.clone()))
            .collect()
    }
}

/// A store on a disk. Lists, imports, tournaments and studies are not simulated.
pub(crate) struct DiskStore {
    disk: Arc<Disk>,
    rest: MemoryStore,
}

impl DiskStore {
    /// Opens the store of a disk.
    pub(crate) fn open(disk: &Arc<Disk>) -> Self {
        Self {
            disk: Arc::clone(disk),
            rest: MemoryStore::default(),
        }
    }

    fn journal(&self, game: GameId) -> Box<dyn Journal> {
        Box::new(DiskJournal {
            disk: Arc::clone(&self.disk),
            game,
        })
    }
}

impl Store for DiskStore {
    fn outlives_server(&self) -> bool {
        true
    }

    fn create(
        &self,
        header: Arc<GameHeader>,
        entries: Vec<Entry>,
    ) -> BoxFuture<'_, Result<Box<dyn Journal>, StoreError>> {
        async move {
            let game = header.game_id;
            let on_disk = OnDisk {
                header,
                entries,
                finished: false,
                summary: None,
            };
            self.disk
                .commit(|games| drop(games.insert(game, on_disk)))
                .await;
            Ok(self.journal(game))
        }
        .boxed()
    }

    fn resumable_games(
        &self,
        _ended_since_ms: u64,
    ) -> BoxFuture<'_, Result<Vec<ResumableGame>, StoreError>> {
        let games = self.disk.games();
        let resumable = games.values().map(|game| ResumableGame {
            header: GameHeader {
                // Later than any time of day: a room's age then follows from its journal alone,
                // not from how long the simulation took.
                created_at_ms: u64::MAX,
                ..GameHeader::clone(&game.header)
            },
            entries: game.entries.clone(),
            journal: self.journal(game.header.game_id),
            concluded: game.finished,
        });
        let resumable = resumable.collect();
        async move { Ok(resumable) }.boxed()
    }

    fn finished_games(&self) -> BoxFuture<'_, Result<u64, StoreError>> {
        let finished = self.disk.finished().len() as u64;
        async move { Ok(finished) }.boxed()
    }

    fn summary(
        &self,
        game: GameId,
    ) -> BoxFuture<'_, Result<Option<v1::RecordSummary>, StoreError>> {
        let summary = (self.disk.games().get(&game)).and_then(|game| game.summary.clone());
        async move { Ok(summary) }.boxed()
    }

    fn finished(&self, game: GameId) -> BoxFuture<'_, Result<Option<StoredGame>, StoreError>> {
        let games = self.disk.games();
        let stored = (games.get(&game).filter(|game| game.finished)).map(|game| {
            StoredGame::Hosted(Arc::clone(&game.header), game.entries.clone().into(), None)
        });
        async move { Ok(stored) }.boxed()
    }

    fn list<'a>(
        &'a self,
        filter: &'a v1::RecordFilter,
        part: Part,
        count: usize,
    ) -> BoxFuture<'a, Result<Vec<Listed>, StoreError>> {
        self.rest.list(filter, part, count)
    }

    fn import(
        &self,
        game: GameId,
        summary: v1::RecordSummary,
        lines: Arc<[v1::RecordLine]>,
    ) -> BoxFuture<'_, Result<bool, StoreError>> {
        self.rest.import(game, summary, lines)
    }

    fn without_record_file(&self) -> BoxFuture<'_, Result<Vec<GameId>, StoreError>> {
        self.rest.without_record_file()
    }

    fn mark_record_written(&self, game: GameId) -> BoxFuture<'_, Result<(), StoreError>> {
        self.rest.mark_record_written(game)
    }

    fn write_unit(&self, unit: UnitKey, write: UnitWrite) -> BoxFuture<'_, Result<(), StoreError>> {
        self.rest.write_unit(unit, write)
    }

    fn unit(&self, unit: UnitKey) -> BoxFuture<'_, Result<Option<StoredUnit>, StoreError>> {
        self.rest.unit(unit)
    }

    fn units(
        &self,
        kind: UnitKind,
        newest_over: usize,
    ) -> BoxFuture<'_, Result<Vec<UnitKey>, StoreError>> {
        self.rest.units(kind, newest_over)
    }

    fn traces(&self, study: StudyId) -> BoxFuture<'_, Result<Vec<StoredTraces>, StoreError>> {
        self.rest.traces(study)
    }

    fn failed(&self) -> BoxFuture<'static, StoreError> {
        self.rest.failed()
    }

    fn close(&self) -> BoxFuture<'_, ()> {
        self.rest.close()
    }
}

struct DiskJournal {
    disk: Arc<Disk>,
    game: GameId,
}

impl Journal for DiskJournal {
    fn append<'a>(
        &'a mut self,
        entries: &'a mut Vec<Entry>,
    ) -> BoxFuture<'a, Result<(), StoreError>> {
        async move {
            let new = std::mem::take(entries);
            let append = |games: &mut BTreeMap<GameId, OnDisk>| {
                let game = games.get_mut(&self.game).expect("created before");
                game.entries.extend(new);
            };
            self.disk.commit(append).await;
            Ok(())
        }
        .boxed()
    }

    fn entries(&mut self) -> BoxFuture<'_, Result<Vec<Entry>, StoreError>> {
        let entries = self.disk.games()[&self.game].entries.clone();
        async move { Ok(entries) }.boxed()
    }

    fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        _signature: Option<v1::RecordSignature>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        let (id, aborted) = (self.game, summary.is_none());
        let finish = move |games: &mut BTreeMap<GameId, OnDisk>| {
            let game = games.get_mut(&id).expect("created before");
            let closed =
                (game.entries.iter()).any(|entry| matches!(entry.change, Change::Aborted(_)));
            assert!(!aborted || closed, "a game without a record was aborted");
            game.finished = true;
            game.summary = summary.map(|summary| *summary);
        };
        async move {
            self.disk.commit(finish).await;
            Ok(())
        }
        .boxed()
    }
}
