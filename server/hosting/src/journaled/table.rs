//! The table of units of a kind, in the order of their creation, with look-up by id and join code.
//! Their numbers are made of their times of creation and ids, so all nodes of a cluster list those
//! that are over in the same order.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

use super::unit::{Handle, Journaled, UnitHeader as _};
use chefshat_room::ids::UnitId;

pub(super) struct Table<U: Journaled> {
    /// In the order of their creation.
    by_number: BTreeMap<u64, Arc<Handle<U>>>,
    numbers: HashMap<UnitId, u64>,
    codes: HashMap<String, u64>,
    /// Units that are being created.
    in_creation: HashSet<UnitId>,
}

impl<U: Journaled> Default for Table<U> {
    fn default() -> Self {
        Self {
            by_number: BTreeMap::new(),
            numbers: HashMap::new(),
            codes: HashMap::new(),
            in_creation: HashSet::new(),
        }
    }
}

impl<U: Journaled> Table<U> {
    /// The unit with this id.
    pub(super) fn get(&self, id: UnitId) -> Option<&Arc<Handle<U>>> {
        self.by_number.get(self.numbers.get(&id)?)
    }

    /// The unit with this join code, in its normal form.
    pub(super) fn by_code(&self, code: &str) -> Option<&Arc<Handle<U>>> {
        self.by_number.get(self.codes.get(code)?)
    }

    /// The units created before number `before`, or all; with their numbers, newest first.
    pub(super) fn earlier(
        &self,
        before: Option<u64>,
    ) -> impl Iterator<Item = (u64, &Arc<Handle<U>>)> + '_ {
        let earlier = self.by_number.range(..before.unwrap_or(u64::MAX)).rev();
        earlier.map(|(number, handle)| (*number, handle))
    }

    /// Whether the unit is being created.
    pub(super) fn is_in_creation(&self, id: UnitId) -> bool {
        self.in_creation.contains(&id)
    }

    /// Notes that a unit is being created.
    pub(super) fn reserve(&mut self, id: UnitId) {
        self.in_creation.insert(id);
    }

    /// Notes that a unit is not being created any more.
    pub(super) fn release(&mut self, id: UnitId) {
        self.in_creation.remove(&id);
    }

    /// Adds a unit in place of one with the same id. Units that are over are removed when there are
    /// more than [`Journaled::MOST`].
    pub(super) fn enter(&mut self, handle: Arc<Handle<U>>) {
        let id = handle.id().unit();
        self.remove_id(id);
        while self.by_number.len() >= U::MOST
            && let Some(number) = (self.by_number.iter())
                .find(|(_, handle)| handle.is_over())
                .map(|(number, _)| *number)
        {
            self.remove(number);
        }
        let [first, second] = [id.bytes()[0], id.bytes()[1]].map(u64::from);
        let mut number = (handle.header.created_at_ms() << 16) | (first << 8) | second;
        while self.by_number.contains_key(&number) {
            number += 1;
        }
        self.numbers.insert(id, number);
        // The codes of units that are over are given to new ones, which are found by them.
        if let Some(code) = handle.header.join_code()
            && !(handle.is_over() && self.by_code(code).is_some_and(|other| !other.is_over()))
        {
            self.codes.insert(code.to_owned(), number);
        }
        self.by_number.insert(number, handle);
    }

    /// Removes a unit that is deleted, or that another node may have.
    pub(super) fn remove_id(&mut self, id: UnitId) {
        if let Some(number) = self.numbers.get(&id).copied() {
            self.remove(number);
        }
    }

    fn remove(&mut self, number: u64) {
        if let Some(handle) = self.by_number.remove(&number) {
            self.numbers.remove(&handle.id().unit());
            if let Some(code) = handle.header.join_code()
                && self.codes.get(code) == Some(&number)
            {
                self.codes.remove(code);
            }
        }
    }
}
