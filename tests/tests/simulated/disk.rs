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

#[tonic::async_trait]
impl Store for DiskStore {
    fn outlives_server(&self) -> bool {
        true
    }

    async fn create(
        &self,
        header: Arc<GameHeader>,
        entries: Vec<Entry>,
    ) -> Result<Box<dyn Journal>, StoreError> {
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

    async fn resumable_games(
        &self,
        _ended_since_ms: u64,
    ) -> Result<Vec<ResumableGame>, StoreError> {
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
        Ok(resumable.collect())
    }

    async fn finished_games(&self) -> Result<u64, StoreError> {
        Ok(self.disk.finished().len() as u64)
    }

    async fn summary(&self, game: GameId) -> Result<Option<v1::RecordSummary>, StoreError> {
        let games = self.disk.games();
        Ok(games.get(&game).and_then(|game| game.summary.clone()))
    }

    async fn finished(&self, game: GameId) -> Result<Option<StoredGame>, StoreError> {
        let games = self.disk.games();
        let game = games.get(&game).filter(|game| game.finished);
        Ok(game.map(|game| {
            StoredGame::Hosted(Arc::clone(&game.header), game.entries.clone().into(), None)
        }))
    }

    async fn list(
        &self,
        filter: &v1::RecordFilter,
        part: Part,
        count: usize,
    ) -> Result<Vec<Listed>, StoreError> {
        self.rest.list(filter, part, count).await
    }

    async fn import(
        &self,
        game: GameId,
        summary: v1::RecordSummary,
        lines: Arc<[v1::RecordLine]>,
    ) -> Result<bool, StoreError> {
        self.rest.import(game, summary, lines).await
    }

    async fn without_record_file(&self) -> Result<Vec<GameId>, StoreError> {
        self.rest.without_record_file().await
    }

    async fn mark_record_written(&self, game: GameId) -> Result<(), StoreError> {
        self.rest.mark_record_written(game).await
    }

    async fn write_unit(&self, unit: UnitKey, write: UnitWrite) -> Result<(), StoreError> {
        self.rest.write_unit(unit, write).await
    }

    async fn unit(&self, unit: UnitKey) -> Result<Option<StoredUnit>, StoreError> {
        self.rest.unit(unit).await
    }

    async fn units(&self, kind: UnitKind, newest_over: usize) -> Result<Vec<UnitKey>, StoreError> {
        self.rest.units(kind, newest_over).await
    }

    async fn traces(&self, study: StudyId) -> Result<Vec<StoredTraces>, StoreError> {
        self.rest.traces(study).await
    }

    async fn failed(&self) -> StoreError {
        self.rest.failed().await
    }

    async fn close(&self) {
        self.rest.close().await
    }
}

struct DiskJournal {
    disk: Arc<Disk>,
    game: GameId,
}

#[tonic::async_trait]
impl Journal for DiskJournal {
    async fn append(&mut self, entries: &mut Vec<Entry>) -> Result<(), StoreError> {
        let new = std::mem::take(entries);
        let append = |games: &mut BTreeMap<GameId, OnDisk>| {
            let game = games.get_mut(&self.game).expect("created before");
            game.entries.extend(new);
        };
        self.disk.commit(append).await;
        Ok(())
    }

    async fn entries(&mut self) -> Result<Vec<Entry>, StoreError> {
        Ok(self.disk.games()[&self.game].entries.clone())
    }

    async fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        _signature: Option<v1::RecordSignature>,
    ) -> Result<(), StoreError> {
        let (id, aborted) = (self.game, summary.is_none());
        let finish = move |games: &mut BTreeMap<GameId, OnDisk>| {
            let game = games.get_mut(&id).expect("created before");
            let closed =
                (game.entries.iter()).any(|entry| matches!(entry.change, Change::Aborted(_)));
            assert!(!aborted || closed, "a game without a record was aborted");
            game.finished = true;
            game.summary = summary.map(|summary| *summary);
        };

        self.disk.commit(finish).await;
        Ok(())
    }
}
