//! Stores games in memory until the process ends.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard};

use async_trait::async_trait;
use chefshat_proto::v1;
use chefshat_record::pseudonym::{Pseudonym, Redactions};
use futures::future::pending;

use super::ephemeral::{Reservations, Reserved};
use super::forget::forget_stored;
use super::units::{StoredTraces, StoredUnit, UnitKey, UnitKind, UnitWrite};
use super::{
    ForgetError, Forgotten, Journal, Keep, Listed, Part, ResumableGame, Store, StoreError,
    StoredGame, matches_filter,
};
use chefshat_base::clock::since_epoch_ms;
use chefshat_room::ids::{GameId, StudyId};
use chefshat_room::journal::{Entry, GameHeader};

/// Most finished games in memory; older ones are dropped.
pub const MAX_FINISHED_GAMES: usize = 1_000;
/// Most journal entries of finished games in memory; the oldest games are dropped.
pub const MAX_FINISHED_ENTRIES: usize = 10_000_000;

/// Stores running games in memory, and finished ones up to [`MAX_FINISHED_GAMES`] and
/// [`MAX_FINISHED_ENTRIES`].
#[derive(Debug, Default)]
pub struct MemoryStore {
    finished: Arc<Mutex<Finished>>,
    /// Those that are not over: what a study needs to be resumed, and of a tournament, which its
    /// server has in memory, that it is there.
    units: Mutex<BTreeMap<UnitKey, UnitInMemory>>,
    /// The ids of running games.
    reserved: Reservations,
    outlives_server: bool,
}

impl MemoryStore {
    /// A store that is treated like one that outlives the server.
    #[cfg(any(test, feature = "testing"))]
    pub fn outliving_server() -> Self {
        Self {
            outlives_server: true,
            ..Self::default()
        }
    }

    /// Whether a tournament that is not over, or a study, needs the record of a game.
    fn is_needed(&self, game: &StoredGame) -> bool {
        match game {
            StoredGame::Hosted(header, ..) => {
                let unit = UnitKey::of_game(header);
                unit.is_some_and(|unit| lock(&self.units).contains_key(&unit))
            }
            StoredGame::Imported(_) => false,
        }
    }
}

#[derive(Debug)]
struct UnitInMemory {
    /// `None`: it is a tournament.
    stored: Option<StoredUnit>,
    traces: Vec<StoredTraces>,
}

/// Writes something for a unit. One that is over is dropped.
fn write_in(
    units: &mut BTreeMap<UnitKey, UnitInMemory>,
    unit: UnitKey,
    write: UnitWrite,
) -> Result<(), StoreError> {
    let known = units.get_mut(&unit);
    match (write, known) {
        (UnitWrite::Create { .. }, Some(_)) => {
            return Err(StoreError::Taken(unit.id().to_string()));
        }
        (UnitWrite::Create { header, first, .. }, None) => {
            if !first.as_ref().is_some_and(|row| row.over) {
                let rows = first.into_iter().map(|row| row.entries).collect();
                let is_study = unit.kind() == UnitKind::Study;
                let stored = is_study.then(|| StoredUnit::new(header, rows));
                let traces = Vec::new();
                units.insert(unit, UnitInMemory { stored, traces });
            }
        }
        (UnitWrite::Append(row), Some(known)) => match row.over {
            true => drop(units.remove(&unit)),
            false => {
                if let Some(stored) = &mut known.stored {
                    stored.rows.push(row.entries);
                }
            }
        },
        (UnitWrite::Rewrite { entries, forgotten }, Some(known)) => {
            if let Some(stored) = &mut known.stored {
                stored.rows = vec![entries];
            }
            (known.traces).retain(|traces| !forgotten.contains(&traces.number));
        }
        (UnitWrite::Traces(traces), Some(known)) => known.traces.push(traces),
        (UnitWrite::Delete, _) => drop(units.remove(&unit)),
        (_, None) => {}
    }
    Ok(())
}

#[derive(Debug, Default)]
struct Finished {
    /// By number, oldest first.
    games: BTreeMap<u64, FinishedGame>,
    numbers: BTreeMap<GameId, u64>,
    last_number: u64,
    /// Journal entries of all of them.
    entries: usize,
}

#[derive(Debug)]
struct FinishedGame {
    id: GameId,
    /// When it ended; of an imported game, when it was imported.
    ended_at_ms: u64,
    summary: v1::RecordSummary,
    stored: StoredGame,
}

impl FinishedGame {
    fn entries(&self) -> usize {
        match &self.stored {
            StoredGame::Hosted(_, entries, _) => entries.len(),
            StoredGame::Imported(lines) => lines.len(),
        }
    }
}

impl Finished {
    fn insert(&mut self, game: FinishedGame) {
        self.last_number += 1;
        self.entries += game.entries();
        self.numbers.insert(game.id, self.last_number);
        self.games.insert(self.last_number, game);
        while self.games.len() > 1
            && (self.games.len() > MAX_FINISHED_GAMES || self.entries > MAX_FINISHED_ENTRIES)
            && let Some((_, oldest)) = self.games.pop_first()
        {
            self.numbers.remove(&oldest.id);
            self.entries -= oldest.entries();
        }
    }

    fn remove(&mut self, game: GameId) {
        if let Some(number) = self.numbers.remove(&game)
            && let Some(game) = self.games.remove(&number)
        {
            self.entries -= game.entries();
        }
    }

    fn get(&self, game: GameId) -> Option<&FinishedGame> {
        let number = self.numbers.get(&game)?;
        self.games.get(number)
    }
}

#[async_trait]
impl Store for MemoryStore {
    fn outlives_server(&self) -> bool {
        self.outlives_server
    }

    async fn create(
        &self,
        header: Arc<GameHeader>,
        entries: Vec<Entry>,
    ) -> Result<Box<dyn Journal>, StoreError> {
        let game = header.game_id;
        let reserved = self.reserved.take(game);
        let is_known = lock(&self.finished).get(game).is_some();
        let Some(reserved) = reserved.filter(|_| !is_known) else {
            return Err(StoreError::Taken(game.to_string()));
        };
        let journal = MemoryJournal {
            _reserved: reserved,
            header,
            entries,
            finished: Arc::clone(&self.finished),
        };
        Ok(Box::new(journal))
    }

    async fn resumable_games(
        &self,
        _ended_since_ms: u64,
    ) -> Result<Vec<ResumableGame>, StoreError> {
        Ok(Vec::new())
    }

    async fn summary(&self, game: GameId) -> Result<Option<v1::RecordSummary>, StoreError> {
        let finished = lock(&self.finished);
        Ok(finished.get(game).map(|game| game.summary.clone()))
    }

    async fn finished(&self, game: GameId) -> Result<Option<StoredGame>, StoreError> {
        let finished = lock(&self.finished);
        Ok(finished.get(game).map(|game| game.stored.clone()))
    }

    async fn list(
        &self,
        filter: &v1::RecordFilter,
        part: Part,
        count: usize,
    ) -> Result<Vec<Listed>, StoreError> {
        let finished = lock(&self.finished);
        let games = &finished.games;
        Ok(match part {
            Part::After(number) => listed(games.range(number.saturating_add(1)..), filter, count),
            Part::Before(number) => listed(games.range(..number).rev(), filter, count),
        })
    }

    async fn import(
        &self,
        game: GameId,
        mut summary: v1::RecordSummary,
        lines: Arc<[v1::RecordLine]>,
    ) -> Result<bool, StoreError> {
        summary.added = true;
        let Some(_reserved) = self.reserved.take(game) else {
            return Ok(false);
        };
        let mut finished = lock(&self.finished);
        let new = finished.get(game).is_none();
        if new {
            finished.insert(FinishedGame {
                id: game,
                ended_at_ms: since_epoch_ms(),
                summary,
                stored: StoredGame::Imported(lines),
            });
        }
        Ok(new)
    }

    async fn finished_games(&self) -> Result<u64, StoreError> {
        Ok(lock(&self.finished).games.len() as u64)
    }

    async fn prunable(
        &self,
        keep: Keep,
        after: u64,
        count: usize,
    ) -> Result<Vec<(u64, GameId)>, StoreError> {
        let finished = lock(&self.finished);
        let newest = usize::try_from(keep.newest.unwrap_or(1)).unwrap_or(usize::MAX);
        let old = finished.games.len().saturating_sub(newest.max(1));
        let found = (finished.games.iter().take(old))
            .filter(|(number, _)| **number > after)
            .filter(|(_, game)| {
                keep.ended_since_ms
                    .is_none_or(|since| game.ended_at_ms < since)
            })
            .filter(|(_, game)| !self.is_needed(&game.stored))
            .take(count)
            .map(|(number, game)| (*number, game.id))
            .collect();
        Ok(found)
    }

    async fn prune(&self, mut games: Vec<GameId>) -> Result<Vec<GameId>, StoreError> {
        let mut finished = lock(&self.finished);
        games.retain(|game| {
            let is_free = |it: &FinishedGame| !self.is_needed(&it.stored);
            finished.get(*game).is_none_or(is_free)
        });
        for game in &games {
            finished.remove(*game);
        }
        Ok(games)
    }

    async fn delete(&self, games: Vec<GameId>) -> Result<(), StoreError> {
        let mut finished = lock(&self.finished);
        for game in games {
            finished.remove(game);
        }
        Ok(())
    }

    async fn forget(&self, who: &Pseudonym) -> Result<Forgotten, ForgetError> {
        let mut forgotten = Forgotten::default();
        for game in lock(&self.finished).games.values_mut() {
            let redactions = forget_stored(&mut game.stored, &mut game.summary, who);
            if redactions != Redactions::default() {
                forgotten.add(game.id, false, redactions);
            }
        }
        Ok(forgotten)
    }

    async fn without_record_file(&self) -> Result<Vec<GameId>, StoreError> {
        Ok(Vec::new())
    }

    async fn mark_record_written(&self, _game: GameId) -> Result<(), StoreError> {
        Ok(())
    }

    async fn write_unit(&self, unit: UnitKey, write: UnitWrite) -> Result<(), StoreError> {
        write_in(&mut lock(&self.units), unit, write)
    }

    async fn unit(&self, unit: UnitKey) -> Result<Option<StoredUnit>, StoreError> {
        let units = lock(&self.units);
        let stored = units.get(&unit).and_then(|it| it.stored.clone());
        Ok(stored)
    }

    /// Studies alone.
    async fn units(&self, kind: UnitKind, _newest_over: usize) -> Result<Vec<UnitKey>, StoreError> {
        let units = lock(&self.units);
        let stored = units.iter().filter(|(_, it)| it.stored.is_some());
        let ids = stored.filter(|(unit, _)| unit.kind() == kind);
        Ok(ids.map(|(unit, _)| *unit).collect())
    }

    async fn traces(&self, study: StudyId) -> Result<Vec<StoredTraces>, StoreError> {
        let units = lock(&self.units);
        let study = units.get(&UnitKey::Study(study));
        Ok(study.map_or_else(Vec::new, |it| it.traces.clone()))
    }

    async fn failed(&self) -> StoreError {
        pending().await
    }

    async fn close(&self) {}
}

struct MemoryJournal {
    _reserved: Reserved,
    header: Arc<GameHeader>,
    entries: Vec<Entry>,
    finished: Arc<Mutex<Finished>>,
}

#[async_trait]
impl Journal for MemoryJournal {
    fn append_now(&mut self, entries: &mut Vec<Entry>) -> bool {
        self.entries.append(entries);
        true
    }

    async fn append(&mut self, entries: &mut Vec<Entry>) -> Result<(), StoreError> {
        self.append_now(entries);
        Ok(())
    }

    async fn entries(&mut self) -> Result<Vec<Entry>, StoreError> {
        Ok(self.entries.clone())
    }

    async fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<v1::RecordSignature>,
    ) -> Result<(), StoreError> {
        let entries = std::mem::take(&mut self.entries).into();
        if let Some(summary) = summary {
            lock(&self.finished).insert(FinishedGame {
                id: self.header.game_id,
                ended_at_ms: summary.ended_at_ms,
                summary: *summary,
                stored: StoredGame::Hosted(
                    Arc::clone(&self.header),
                    entries,
                    signature.map(Arc::new),
                ),
            });
        }
        Ok(())
    }
}

/// The first `count` of these games that match a filter.
fn listed<'a>(
    games: impl Iterator<Item = (&'a u64, &'a FinishedGame)>,
    filter: &v1::RecordFilter,
    count: usize,
) -> Vec<Listed> {
    games
        .filter(|(_, game)| matches_filter(filter, &game.summary))
        .take(count)
        .map(|(number, game)| Listed {
            number: *number,
            owner: match &game.stored {
                StoredGame::Hosted(header, ..) => Some(header.owner),
                StoredGame::Imported(_) => None,
            },
            summary: Ok(game.summary.clone()),
        })
        .collect()
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    (mutex.lock()).expect("no code that holds this lock can panic")
}
