//! The table of tournaments, in the order of their creation, with look-up by id and join code. Their
//! numbers are made of their times of creation and ids, so all nodes of a cluster list those that are
//! over in the same order.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

use super::handle::TournamentHandle;
use crate::config::MAX_TOURNAMENTS;
use chefshat_room::ids::Id;

#[derive(Debug, Default)]
pub(super) struct Table {
    /// In the order of their creation.
    by_number: BTreeMap<u64, Arc<TournamentHandle>>,
    numbers: HashMap<Id, u64>,
    codes: HashMap<String, u64>,
    /// Tournaments that are being created, for which space is reserved.
    in_creation: HashSet<Id>,
}

impl Table {
    /// The tournament with this id.
    pub(super) fn get(&self, id: Id) -> Option<&Arc<TournamentHandle>> {
        self.by_number.get(self.numbers.get(&id)?)
    }

    /// The tournament with this join code, in capitals, without spaces and dashes.
    pub(super) fn by_code(&self, code: &str) -> Option<&Arc<TournamentHandle>> {
        self.by_number.get(self.codes.get(code)?)
    }

    /// The tournaments created before number `before`, or all; with their numbers, newest first.
    pub(super) fn earlier(
        &self,
        before: Option<u64>,
    ) -> impl Iterator<Item = (u64, &Arc<TournamentHandle>)> + '_ {
        let earlier = self.by_number.range(..before.unwrap_or(u64::MAX)).rev();
        earlier.map(|(number, handle)| (*number, handle))
    }

    /// Whether the tournament is being created.
    pub(super) fn is_in_creation(&self, id: Id) -> bool {
        self.in_creation.contains(&id)
    }

    /// Reserves space for a tournament that will be created; `false` if the table is full.
    pub(super) fn reserve(&mut self, id: Id) -> bool {
        let open = self.by_number.values().filter(|handle| !handle.is_over());
        let has_space = open.count() + self.in_creation.len() < MAX_TOURNAMENTS;
        if has_space {
            self.in_creation.insert(id);
        }
        has_space
    }

    /// Releases the space reserved for a tournament.
    pub(super) fn release(&mut self, id: Id) {
        self.in_creation.remove(&id);
    }

    /// Adds a tournament. Tournaments that are over are removed when the space is needed.
    pub(super) fn enter(&mut self, handle: Arc<TournamentHandle>) {
        while self.by_number.len() >= MAX_TOURNAMENTS
            && let Some(number) = (self.by_number.iter())
                .find(|(_, handle)| handle.is_over())
                .map(|(number, _)| *number)
        {
            self.remove(number);
        }
        let id = handle.id();
        let [first, second] = [id.0[0], id.0[1]].map(u64::from);
        let mut number = (handle.header.created_at_ms << 16) | (first << 8) | second;
        while self.by_number.contains_key(&number) {
            number += 1;
        }
        self.numbers.insert(id, number);
        self.codes.insert(handle.join_code().to_owned(), number);
        self.by_number.insert(number, handle);
    }

    /// Removes a tournament that another node may have.
    pub(super) fn remove_id(&mut self, id: Id) {
        if let Some(number) = self.numbers.get(&id).copied() {
            self.remove(number);
        }
    }

    fn remove(&mut self, number: u64) {
        if let Some(handle) = self.by_number.remove(&number) {
            self.numbers.remove(&handle.id());
            self.codes.remove(handle.join_code());
        }
    }
}
