//! The list of the rooms: in the order in which they were made, found by their ids and join codes. What a room is, and when it leaves the list,
//! is decided elsewhere.

use std::collections::{BTreeMap, HashMap, HashSet};

use crate::room::Handle;
use crate::store::StoreError;
use chefshat_room::ids::{Id, SecretHash};

/// Why no room was created.
#[derive(Debug, thiserror::Error)]
pub enum CreateError {
    /// The limit of rooms is reached.
    #[error("the server holds {0} rooms already; close one or try later")]
    TooMany(usize),
    /// The request id was used for a room with other content.
    #[error("this request id was used to create another room; draw a new one")]
    RequestIdUsed,
    /// The server takes no new rooms.
    #[error("the server is shutting down and takes no new rooms")]
    ShuttingDown,
    /// There is no space for more games.
    #[error("the server's disk is nearly full; the rest is reserved for running games")]
    DiskNearlyFull,
    /// The store refused.
    #[error(transparent)]
    Store(#[from] StoreError),
}

#[derive(Default)]
pub(super) struct Table {
    pub(super) next_number: u64,
    /// In the order in which they were made.
    pub(super) by_number: BTreeMap<u64, Entry>,
    pub(super) numbers: HashMap<Id, u64>,
    pub(super) codes: HashMap<String, u64>,
    /// Rooms that are being created, for which space is reserved.
    pub(super) in_creation: HashSet<Id>,
    pub(super) shutting_down: bool,
}

pub(super) struct Entry {
    pub(super) handle: Handle,
    pub(super) game_id: Id,
    /// The owner's token, hashed.
    pub(super) owner: SecretHash,
    pub(super) join_code: String,
    /// Whether the game goes on when the server is back.
    pub(super) durable: bool,
    /// The game has ended.
    pub(super) over: bool,
    /// The room has ended and its game has not, which goes on when the server is back. It stays in the table, so that whoever comes is
    /// told to come again, not that there is no such room.
    pub(super) put_down: bool,
}

impl Entry {
    pub(super) fn is_open(&self) -> bool {
        !self.over && !self.put_down
    }
}

impl Table {
    pub(super) fn get(&self, id: Id) -> Option<&Entry> {
        self.by_number.get(self.numbers.get(&id)?)
    }

    /// Reserves space for a room that is about to be created.
    pub(super) fn reserve(&mut self, id: Id, max_rooms: usize) -> Result<(), CreateError> {
        if self.shutting_down {
            return Err(CreateError::ShuttingDown);
        }
        let full = self.by_number.len() + self.in_creation.len() >= max_rooms;
        if full {
            let open = self.by_number.values().filter(|it| it.is_open()).count();
            if open + self.in_creation.len() >= max_rooms {
                return Err(CreateError::TooMany(max_rooms));
            }
        }
        self.in_creation.insert(id);
        Ok(())
    }

    pub(super) fn enter(&mut self, entry: Entry) {
        let number = self.next_number;
        self.next_number += 1;
        self.numbers.insert(entry.handle.id(), number);
        self.codes.insert(entry.join_code.clone(), number);
        self.by_number.insert(number, entry);
    }

    /// Ended rooms are shown only as long as there is space for them.
    pub(super) fn make_space(&mut self, max_rooms: usize) {
        while self.by_number.len() >= max_rooms
            && let Some(number) = self
                .by_number
                .iter()
                .find(|(_, entry)| !entry.is_open())
                .map(|(number, _)| *number)
        {
            self.remove(number);
        }
    }

    pub(super) fn any_open(&self, which: impl Fn(Id) -> bool) -> bool {
        self.by_number
            .values()
            .any(|entry| entry.is_open() && which(entry.handle.id()))
    }

    /// Whether there is an open room of this durability.
    pub(super) fn any_open_of(&self, durable: bool) -> bool {
        self.by_number
            .values()
            .any(|entry| entry.is_open() && entry.durable == durable)
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
            self.numbers.remove(&entry.handle.id());
            self.codes.remove(&entry.join_code);
        }
    }
}
