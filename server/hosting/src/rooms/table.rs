//! The table of rooms, in the order of their creation, with look-up by id and join code.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::convert::Infallible;
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, MutexGuard};

use tokio::sync::Notify;

use crate::room::{GameEnd, Handle};
use chefshat_admission::limits::{Permit, Refused};
use chefshat_base::lock::Lock;
use chefshat_room::ids::{GameId, RoomId, UnitId};
use chefshat_room::journal::GameHeader;
use chefshat_store::StoreError;

/// Why no room, tournament or study was created. `P`: why its settings are refused.
#[derive(Debug, thiserror::Error)]
pub enum CreateError<P: std::error::Error = Infallible> {
    /// A setting is invalid.
    #[error(transparent)]
    Settings(P),
    /// The limit of rooms is reached.
    #[error("the server already has {0} rooms; close one or try later")]
    TooMany(usize),
    /// Its creator, or the server, has too many.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// The request id was used for something else.
    #[error("this request id was used to create something else; draw a new one")]
    RequestIdUsed,
    /// The server is shutting down.
    #[error("the server is shutting down and accepts nothing new")]
    ShuttingDown,
    /// No other node reaches this one.
    #[error(
        "no other node reaches this one, which accepts nothing new; try again, and if it fails again, tell the operator"
    )]
    NotReached,
    /// The disk has no space for more games.
    #[error("the server's disk is nearly full; the rest is reserved for running games")]
    DiskNearlyFull,
    /// The store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

#[derive(Default)]
pub(super) struct Table {
    pub(super) next_number: u64,
    /// In the order of their creation.
    pub(super) by_number: BTreeMap<u64, Entry>,
    pub(super) numbers: HashMap<UnitId, u64>,
    /// The rooms of each unit.
    by_unit: HashMap<UnitId, BTreeSet<u64>>,
    /// The rooms that are not open.
    ended: BTreeSet<u64>,
    pub(super) codes: HashMap<String, u64>,
    /// The rooms of games, by the ids of the games.
    games: HashMap<GameId, u64>,
    /// Rooms that are being created, for which space is reserved, with their units.
    pub(super) in_creation: HashMap<RoomId, UnitId>,
    /// What the tasks of units wait on, for their own games.
    pub(super) waiting: HashMap<UnitId, Arc<Notify>>,
    pub(super) shutting_down: bool,
    /// Removed rooms, until the table is unlocked: the last handle of a room may end it, and a room
    /// that ends looks into the table.
    removed: Vec<Entry>,
}

/// The table while it is locked. What was removed meanwhile is dropped once it is unlocked.
pub(super) struct LockedTable<'a>(Option<MutexGuard<'a, Table>>);

impl<'a> LockedTable<'a> {
    pub(super) fn new(table: &'a Lock<Table>) -> Self {
        Self(Some(table.lock()))
    }
}

impl Deref for LockedTable<'_> {
    type Target = Table;

    fn deref(&self) -> &Table {
        self.0.as_ref().expect("locked until it is dropped")
    }
}

impl DerefMut for LockedTable<'_> {
    fn deref_mut(&mut self) -> &mut Table {
        self.0.as_mut().expect("locked until it is dropped")
    }
}

impl Drop for LockedTable<'_> {
    fn drop(&mut self) {
        let removed = std::mem::take(&mut self.removed);
        drop(self.0.take());
        drop(removed);
    }
}

pub(super) struct Entry {
    pub(super) handle: Handle,
    pub(super) header: Arc<GameHeader>,
    /// Whether the game survives a restart of the server.
    pub(super) durable: bool,
    /// The game has ended.
    pub(super) over: bool,
    /// How it has ended, if it did so since the server was started.
    pub(super) end: Option<GameEnd>,
    /// The room has ended but its game resumes when the server is restarted, or the room has failed.
    /// It stays in the table, so that clients are asked to try again: the room is not unknown.
    pub(super) suspended: bool,
    /// Whether lists show it.
    pub(super) listed: bool,
    /// Its place among its creator's rooms, until its game is over.
    pub(super) place: Option<Permit>,
}

impl Entry {
    pub(super) fn is_open(&self) -> bool {
        !self.over && !self.suspended
    }
}

impl Table {
    pub(super) fn get(&self, id: RoomId) -> Option<&Entry> {
        self.by_unit(id.unit())
    }

    /// The room that is this unit, if it is one.
    pub(super) fn by_unit(&self, unit: UnitId) -> Option<&Entry> {
        self.by_number.get(self.numbers.get(&unit)?)
    }

    pub(super) fn number_of(&self, id: RoomId) -> Option<u64> {
        self.numbers.get(&id.unit()).copied()
    }

    /// The rooms of a unit, with their numbers.
    pub(super) fn of_unit(&self, unit: UnitId) -> impl Iterator<Item = (u64, &Entry)> {
        let numbers = self.by_unit.get(&unit).into_iter().flatten();
        numbers.map(|number| (*number, &self.by_number[number]))
    }

    /// Number of rooms that wait or play.
    pub(super) fn open_count(&self) -> usize {
        self.by_number.len() - self.ended.len()
    }

    /// Reserves space for a room that will be created.
    pub(super) fn reserve(
        &mut self,
        id: RoomId,
        unit: UnitId,
        max_rooms: usize,
    ) -> Result<(), CreateError> {
        if self.open_count() + self.in_creation.len() >= max_rooms {
            return Err(CreateError::TooMany(max_rooms));
        }
        self.in_creation.insert(id, unit);
        Ok(())
    }

    pub(super) fn enter(&mut self, entry: Entry) {
        let number = self.next_number;
        self.next_number += 1;
        self.numbers.insert(entry.handle.id().unit(), number);
        let code = entry.header.join_code.clone();
        let taken_by = self.codes.get(&code).and_then(|it| self.by_number.get(it));
        // The codes of rooms that are over are given to new ones, which are found by them.
        if !(entry.over && taken_by.is_some_and(|other| !other.over)) {
            self.codes.insert(code, number);
        }
        self.games.insert(entry.header.game_id, number);
        (self.by_unit.entry(entry.header.unit()).or_default()).insert(number);
        if !entry.is_open() {
            self.ended.insert(number);
        }
        self.by_number.insert(number, entry);
    }

    /// Changes a room so that it is not open any more. Returns what its unit's task waits on.
    pub(super) fn end(
        &mut self,
        number: u64,
        change: impl FnOnce(&mut Entry),
    ) -> Option<Arc<Notify>> {
        let entry = self.by_number.get_mut(&number)?;
        change(entry);
        self.ended.insert(number);
        self.waiting.get(&entry.header.unit()).cloned()
    }

    /// The room of a game that is not over.
    pub(super) fn of_game(&self, game: GameId) -> Option<&Entry> {
        let entry = self.by_number.get(self.games.get(&game)?)?;
        (!entry.over).then_some(entry)
    }

    /// Removes ended rooms if their space is needed.
    pub(super) fn make_space(&mut self, max_rooms: usize) {
        while self.by_number.len() >= max_rooms
            && let Some(number) = self.ended.first().copied()
        {
            self.remove(number);
        }
    }

    pub(super) fn remove_over(&mut self) {
        let over: Vec<u64> = (self.by_number.iter())
            .filter(|(_, entry)| entry.over)
            .map(|(number, _)| *number)
            .collect();
        for number in over {
            self.remove(number);
        }
    }

    pub(super) fn remove(&mut self, number: u64) {
        if let Some(entry) = self.by_number.remove(&number) {
            self.numbers.remove(&entry.handle.id().unit());
            self.ended.remove(&number);
            let unit = entry.header.unit();
            if let Some(rooms) = self.by_unit.get_mut(&unit) {
                rooms.remove(&number);
                if rooms.is_empty() {
                    self.by_unit.remove(&unit);
                }
            }
            if self.games.get(&entry.header.game_id) == Some(&number) {
                self.games.remove(&entry.header.game_id);
            }
            if self.codes.get(&entry.header.join_code) == Some(&number) {
                self.codes.remove(&entry.header.join_code);
            }
            self.removed.push(entry);
        }
    }
}
