//! Stores games in memory until the process ends.

use std::collections::{BTreeMap, BTreeSet, btree_map};
use std::sync::{Arc, Mutex, MutexGuard};

use chefshat_proto::v1;
use chefshat_record::pseudonym::{Pseudonym, Redactions};
use chefshat_study::Change as StudyChange;
use futures::FutureExt as _;
use futures::future::{BoxFuture, pending, ready};

use super::ephemeral::{Reservations, Reserved};
use super::forget::forget_stored;
use super::studies::{StoredStudy, StoredTraces, StudyHeader};
use super::tournaments::{StoredTournament, TournamentEntry, TournamentHeader};
use super::{
    ForgetError, Forgotten, Journal, Keep, Listed, Part, ResumableGame, Store, StoreError,
    StoredGame, matches_filter,
};
use crate::clock::since_epoch_ms;
use chefshat_room::ids::Id;
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
    studies: Mutex<BTreeMap<Id, StudyInMemory>>,
    /// The ids of running games.
    reserved: Reservations,
    /// Tournaments that are not over.
    tournaments: Mutex<BTreeSet<Id>>,
    outlives_server: bool,
}

impl MemoryStore {
    /// A store that is treated like one that outlives the server.
    #[cfg(test)]
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
                let unit = header.unit();
                lock_studies(&self.studies).contains_key(&unit)
                    || lock_tournaments(&self.tournaments).contains(&unit)
            }
            StoredGame::Imported(_) => false,
        }
    }
}

#[derive(Debug)]
struct StudyInMemory {
    header: Arc<StudyHeader>,
    changes: Vec<StudyChange>,
    rows: u64,
    traces: Vec<StoredTraces>,
}

#[derive(Debug, Default)]
struct Finished {
    /// By number, oldest first.
    games: BTreeMap<u64, FinishedGame>,
    numbers: BTreeMap<Id, u64>,
    last_number: u64,
    /// Journal entries of all of them.
    entries: usize,
}

#[derive(Debug)]
struct FinishedGame {
    id: Id,
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

    fn remove(&mut self, game: Id) {
        if let Some(number) = self.numbers.remove(&game)
            && let Some(game) = self.games.remove(&number)
        {
            self.entries -= game.entries();
        }
    }

    fn get(&self, game: Id) -> Option<&FinishedGame> {
        let number = self.numbers.get(&game)?;
        self.games.get(number)
    }
}

impl Store for MemoryStore {
    fn outlives_server(&self) -> bool {
        self.outlives_server
    }

    fn create(
        &self,
        header: Arc<GameHeader>,
        entries: Vec<Entry>,
    ) -> BoxFuture<'_, Result<Box<dyn Journal>, StoreError>> {
        let game = header.game_id;
        let reserved = self.reserved.take(game);
        let is_known = lock(&self.finished).get(game).is_some();
        let Some(reserved) = reserved.filter(|_| !is_known) else {
            return ready(Err(StoreError::Taken(game))).boxed();
        };
        let journal = MemoryJournal {
            _reserved: reserved,
            header,
            entries,
            finished: Arc::clone(&self.finished),
        };
        ready(Ok(Box::new(journal) as Box<dyn Journal>)).boxed()
    }

    fn resumable_games(
        &self,
        _ended_since_ms: u64,
    ) -> BoxFuture<'_, Result<Vec<ResumableGame>, StoreError>> {
        ready(Ok(Vec::new())).boxed()
    }

    fn summary(&self, game: Id) -> BoxFuture<'_, Result<Option<v1::RecordSummary>, StoreError>> {
        let finished = lock(&self.finished);
        ready(Ok(finished.get(game).map(|game| game.summary.clone()))).boxed()
    }

    fn finished(&self, game: Id) -> BoxFuture<'_, Result<Option<StoredGame>, StoreError>> {
        let finished = lock(&self.finished);
        ready(Ok(finished.get(game).map(|game| game.stored.clone()))).boxed()
    }

    fn list<'a>(
        &'a self,
        filter: &'a v1::RecordFilter,
        part: Part,
        count: usize,
    ) -> BoxFuture<'a, Result<Vec<Listed>, StoreError>> {
        let finished = lock(&self.finished);
        let games = &finished.games;
        let listed = match part {
            Part::After(number) => listed(games.range(number.saturating_add(1)..), filter, count),
            Part::Before(number) => listed(games.range(..number).rev(), filter, count),
        };
        ready(Ok(listed)).boxed()
    }

    fn import(
        &self,
        game: Id,
        mut summary: v1::RecordSummary,
        lines: Arc<[v1::RecordLine]>,
    ) -> BoxFuture<'_, Result<bool, StoreError>> {
        summary.added = true;
        let Some(_reserved) = self.reserved.take(game) else {
            return ready(Ok(false)).boxed();
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
        ready(Ok(new)).boxed()
    }

    fn finished_games(&self) -> BoxFuture<'_, Result<u64, StoreError>> {
        ready(Ok(lock(&self.finished).games.len() as u64)).boxed()
    }

    fn prunable(
        &self,
        keep: Keep,
        after: u64,
        count: usize,
    ) -> BoxFuture<'_, Result<Vec<(u64, Id)>, StoreError>> {
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
        ready(Ok(found)).boxed()
    }

    fn prune(&self, mut games: Vec<Id>) -> BoxFuture<'_, Result<Vec<Id>, StoreError>> {
        let mut finished = lock(&self.finished);
        games.retain(|game| {
            let is_free = |it: &FinishedGame| !self.is_needed(&it.stored);
            finished.get(*game).is_none_or(is_free)
        });
        for game in &games {
            finished.remove(*game);
        }
        ready(Ok(games)).boxed()
    }

    fn delete(&self, games: Vec<Id>) -> BoxFuture<'_, Result<(), StoreError>> {
        let mut finished = lock(&self.finished);
        for game in games {
            finished.remove(game);
        }
        ready(Ok(())).boxed()
    }

    fn forget<'a>(&'a self, who: &'a Pseudonym) -> BoxFuture<'a, Result<Forgotten, ForgetError>> {
        let mut forgotten = Forgotten::default();
        for game in lock(&self.finished).games.values_mut() {
            let redactions = forget_stored(&mut game.stored, &mut game.summary, who);
            if redactions != Redactions::default() {
                forgotten.add(game.id, false, redactions);
            }
        }
        ready(Ok(forgotten)).boxed()
    }

    fn without_record_file(&self) -> BoxFuture<'_, Result<Vec<Id>, StoreError>> {
        ready(Ok(Vec::new())).boxed()
    }

    fn mark_record_written(&self, _game: Id) -> BoxFuture<'_, Result<(), StoreError>> {
        ready(Ok(())).boxed()
    }

    fn create_tournament(
        &self,
        header: Arc<TournamentHeader>,
        entries: Vec<TournamentEntry>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        if !entries.iter().any(TournamentEntry::is_end) {
            lock_tournaments(&self.tournaments).insert(header.id);
        }
        ready(Ok(())).boxed()
    }

    fn append_tournament(
        &self,
        tournament: Id,
        _row: u64,
        entries: Vec<TournamentEntry>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        if entries.iter().any(TournamentEntry::is_end) {
            lock_tournaments(&self.tournaments).remove(&tournament);
        }
        ready(Ok(())).boxed()
    }

    fn tournaments(
        &self,
        _newest_over: usize,
    ) -> BoxFuture<'_, Result<Vec<StoredTournament>, StoreError>> {
        ready(Ok(Vec::new())).boxed()
    }

    fn hosts_studies(&self) -> bool {
        true
    }

    fn create_study(&self, header: Arc<StudyHeader>) -> BoxFuture<'_, Result<(), StoreError>> {
        let id = header.id;
        let created = match lock_studies(&self.studies).entry(id) {
            btree_map::Entry::Occupied(_) => Err(StoreError::Taken(id)),
            btree_map::Entry::Vacant(place) => {
                place.insert(StudyInMemory {
                    header,
                    changes: Vec::new(),
                    rows: 0,
                    traces: Vec::new(),
                });
                Ok(())
            }
        };
        ready(created).boxed()
    }

    fn append_study(
        &self,
        study: Id,
        row: u64,
        mut changes: Vec<StudyChange>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        if let Some(study) = lock_studies(&self.studies).get_mut(&study) {
            study.changes.append(&mut changes);
            study.rows = row + 1;
        }
        ready(Ok(())).boxed()
    }

    fn rewrite_study(
        &self,
        study: Id,
        changes: Vec<StudyChange>,
        forgotten: Vec<u32>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        if let Some(study) = lock_studies(&self.studies).get_mut(&study) {
            (study.changes, study.rows) = (changes, 1);
            study
                .traces
                .retain(|traces| !forgotten.contains(&traces.number));
        }
        ready(Ok(())).boxed()
    }

    fn delete_study(&self, study: Id) -> BoxFuture<'_, Result<(), StoreError>> {
        lock_studies(&self.studies).remove(&study);
        ready(Ok(())).boxed()
    }

    fn studies(&self) -> BoxFuture<'_, Result<Vec<Id>, StoreError>> {
        let studies = lock_studies(&self.studies);
        ready(Ok(studies.keys().copied().collect())).boxed()
    }

    fn study(&self, study: Id) -> BoxFuture<'_, Result<Option<StoredStudy>, StoreError>> {
        let studies = lock_studies(&self.studies);
        let stored = studies.get(&study).map(|study| StoredStudy {
            header: StudyHeader::clone(&study.header),
            changes: study.changes.clone(),
            rows: study.rows,
        });
        ready(Ok(stored)).boxed()
    }

    fn append_traces(
        &self,
        study: Id,
        traces: StoredTraces,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        if let Some(study) = lock_studies(&self.studies).get_mut(&study) {
            study.traces.push(traces);
        }
        ready(Ok(())).boxed()
    }

    fn traces(&self, study: Id) -> BoxFuture<'_, Result<Vec<StoredTraces>, StoreError>> {
        let studies = lock_studies(&self.studies);
        let traces = studies.get(&study).map(|study| study.traces.clone());
        ready(Ok(traces.unwrap_or_default())).boxed()
    }

    fn failed(&self) -> BoxFuture<'static, StoreError> {
        pending().boxed()
    }

    fn close(&self) -> BoxFuture<'_, ()> {
        ready(()).boxed()
    }
}

struct MemoryJournal {
    _reserved: Reserved,
    header: Arc<GameHeader>,
    entries: Vec<Entry>,
    finished: Arc<Mutex<Finished>>,
}

impl Journal for MemoryJournal {
    fn append_now(&mut self, entries: &mut Vec<Entry>) -> bool {
        self.entries.append(entries);
        true
    }

    fn append<'a>(
        &'a mut self,
        entries: &'a mut Vec<Entry>,
    ) -> BoxFuture<'a, Result<(), StoreError>> {
        self.append_now(entries);
        ready(Ok(())).boxed()
    }

    fn entries(&mut self) -> BoxFuture<'_, Result<Vec<Entry>, StoreError>> {
        ready(Ok(self.entries.clone())).boxed()
    }

    fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<v1::RecordSignature>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
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
        ready(Ok(())).boxed()
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
        .map(|(number, game)| (*number, Ok(game.summary.clone())))
        .collect()
}

fn lock(finished: &Mutex<Finished>) -> MutexGuard<'_, Finished> {
    finished
        .lock()
        .expect("no code that holds this lock can panic")
}

fn lock_studies(
    studies: &Mutex<BTreeMap<Id, StudyInMemory>>,
) -> MutexGuard<'_, BTreeMap<Id, StudyInMemory>> {
    studies
        .lock()
        .expect("no code that holds this lock can panic")
}

fn lock_tournaments(tournaments: &Mutex<BTreeSet<Id>>) -> MutexGuard<'_, BTreeSet<Id>> {
    tournaments
        .lock()
        .expect("no code that holds this lock can panic")
}
