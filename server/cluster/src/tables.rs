//! The database of a cluster as a value: which nodes beat when, which node owns which unit at which epoch, and the journals. Each
//! method is one transaction. It is the reference that stores are tested against, and what the model checker runs.

use std::collections::{BTreeMap, BTreeSet};

use crate::{Epoch, LeaseTimes, NodeId};

/// A row of a journal.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Row<E> {
    /// The epoch of its writer.
    pub epoch: Epoch,
    /// What was written.
    pub entries: E,
}

/// What became of a write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Written {
    /// It is committed.
    Committed,
    /// Nothing was written: the epoch is not the present one, the position is taken, or the item is over.
    Refused,
}

/// What became of a creation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Created {
    /// It is committed.
    Created,
    /// The id is taken. Nothing was written.
    Taken,
    /// The creator does not own the unit, or is no node of the cluster. Nothing was written.
    Refused,
}

/// A room or tournament.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct Item<K, E> {
    unit: K,
    /// The owner of the unit. While items of a unit are not over, they have the same owner and epoch.
    node: Option<NodeId>,
    epoch: Epoch,
    over: bool,
    journal: Vec<Row<E>>,
}

/// The tables: items with ids of type `K`, and journals whose rows contain `E`.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Tables<K, E> {
    times: LeaseTimes,
    /// When each node last beat.
    nodes: BTreeMap<NodeId, u64>,
    items: BTreeMap<K, Item<K, E>>,
    last_node: u64,
}

impl<K: Ord + Copy, E> Tables<K, E> {
    /// No nodes, nothing owned.
    pub fn new(times: LeaseTimes) -> Self {
        Self {
            times,
            nodes: BTreeMap::new(),
            items: BTreeMap::new(),
            last_node: 0,
        }
    }

    /// Adds a node, whose lease begins now.
    pub fn join(&mut self, now_ms: u64) -> NodeId {
        self.last_node += 1;
        let node = NodeId(self.last_node);
        self.join_as(node, now_ms);
        node
    }

    /// The same with a number that was drawn elsewhere, which no node has had.
    pub fn join_as(&mut self, node: NodeId, now_ms: u64) {
        self.nodes.insert(node, now_ms);
    }

    /// Removes a node that owns nothing. Does nothing if it still owns something.
    pub fn leave(&mut self, node: NodeId) {
        if self.owned_by(node).is_empty() {
            self.nodes.remove(&node);
        }
    }

    /// Removes the nodes that own nothing and whose lease has expired.
    pub fn remove_expired(&mut self, now_ms: u64) {
        let owners: BTreeSet<NodeId> = self.open().filter_map(|(_, item)| item.node).collect();
        let times = self.times;
        (self.nodes).retain(|node, beat| owners.contains(node) || !times.expired(*beat, now_ms));
    }

    /// Renews a lease, also one that has expired while nobody claimed anything. Returns whether the node is known.
    pub fn beat(&mut self, node: NodeId, now_ms: u64) -> bool {
        match self.nodes.get_mut(&node) {
            Some(beat) => {
                *beat = now_ms;
                true
            }
            None => false,
        }
    }

    /// When a node last beat, if it is known.
    pub fn last_beat(&self, node: NodeId) -> Option<u64> {
        self.nodes.get(&node).copied()
    }

    /// The units that a node owns and that are not over, with their epochs, in order.
    pub fn owned_by(&self, node: NodeId) -> Vec<(K, Epoch)> {
        let owned = self.open().filter(|(_, item)| item.node == Some(node));
        units(owned).collect()
    }

    /// At most `count` units that are not over and that nobody owns, or whose owner's lease has expired, with their epochs, in order.
    pub fn orphans(&self, now_ms: u64, count: usize) -> Vec<(K, Epoch)> {
        let orphans = (self.open()).filter(|(_, item)| self.is_orphan(item, now_ms));
        units(orphans).take(count).collect()
    }

    fn open(&self) -> impl Iterator<Item = (K, &Item<K, E>)> {
        let items = self.items.iter().filter(|(_, item)| !item.over);
        items.map(|(id, item)| (*id, item))
    }

    fn is_orphan(&self, item: &Item<K, E>, now_ms: u64) -> bool {
        let beat = item.node.and_then(|node| self.nodes.get(&node));
        beat.is_none_or(|&beat| self.times.expired(beat, now_ms))
    }

    /// Creates a unit with the first entries of its own journal, owned by a node.
    pub fn create(&mut self, unit: K, node: NodeId, entries: E) -> Created {
        match (
            self.nodes.contains_key(&node),
            self.items.contains_key(&unit),
        ) {
            (false, _) => Created::Refused,
            (true, true) => Created::Taken,
            (true, false) => self.insert(unit, unit, Some(node), Epoch::FIRST, entries),
        }
    }

    /// Creates an item of a unit (a room of a tournament) with its first entries, if the unit still has this epoch and is not over.
    pub fn create_in(&mut self, unit: K, epoch: Epoch, id: K, entries: E) -> Created {
        let owner = self.items.get(&unit);
        match owner.filter(|owner| owner.epoch == epoch && !owner.over) {
            None => Created::Refused,
            Some(_) if self.items.contains_key(&id) => Created::Taken,
            Some(owner) => self.insert(id, unit, owner.node, epoch, entries),
        }
    }

    fn insert(
        &mut self,
        id: K,
        unit: K,
        node: Option<NodeId>,
        epoch: Epoch,
        entries: E,
    ) -> Created {
        let item = Item {
            unit,
            node,
            epoch,
            over: false,
            journal: vec![Row { epoch, entries }],
        };
        self.items.insert(id, item);
        Created::Created
    }

    /// Takes an orphan over, if it still has the epoch that was seen: raises the epoch of its items that are not over, and appends
    /// what `restarted` returns for each to its journal ("the server was restarted"). Returns the new epoch.
    pub fn claim(
        &mut self,
        unit: K,
        seen: Epoch,
        node: NodeId,
        now_ms: u64,
        restarted: impl Fn(K) -> Option<E>,
    ) -> Option<Epoch> {
        let first = self.open().find(|(_, item)| item.unit == unit);
        let (_, first) = first?;
        let is_orphan = self.is_orphan(first, now_ms) && first.epoch == seen;
        if !is_orphan || !self.nodes.contains_key(&node) {
            return None;
        }
        let epoch = seen.next();
        for (id, item) in self.open_of(unit) {
            item.node = Some(node);
            item.epoch = epoch;
            let row = restarted(id).map(|entries| Row { epoch, entries });
            item.journal.extend(row);
        }
        Some(epoch)
    }

    /// Gives a unit up, so that others may claim it at once.
    pub fn release(&mut self, unit: K, epoch: Epoch) {
        for (_, item) in self.open_of(unit) {
            if item.epoch == epoch {
                item.node = None;
            }
        }
    }

    fn open_of(&mut self, unit: K) -> impl Iterator<Item = (K, &mut Item<K, E>)> {
        let items = self.items.iter_mut();
        items
            .filter(move |(_, item)| item.unit == unit && !item.over)
            .map(|(id, item)| (*id, item))
    }

    /// Writes a row at a position, from 0, if the writer has the present epoch and the position is the next one. Doing so again
    /// changes nothing, at any time: a writer that had no answer learns that its row stands.
    pub fn append(&mut self, id: K, epoch: Epoch, position: u64, entries: E) -> Written
    where
        E: PartialEq,
    {
        let Some(item) = self.items.get_mut(&id) else {
            return Written::Refused;
        };
        let row = Row { epoch, entries };
        let rows = item.journal.len() as u64;
        if !item.over && item.epoch == epoch && rows == position {
            item.journal.push(row);
            return Written::Committed;
        }
        let position = usize::try_from(position).ok();
        let stands = position.and_then(|position| item.journal.get(position));
        match stands == Some(&row) {
            true => Written::Committed,
            false => Written::Refused,
        }
    }

    /// Ends an item whose journal has this many rows: nobody owns it any more, and its journal stays as it is. Doing so again
    /// changes nothing. The rows are compared because an append of the same owner, from before it lost and regained its lease,
    /// may still arrive.
    pub fn finish(&mut self, id: K, epoch: Epoch, rows: u64) -> Written {
        match self.items.get_mut(&id) {
            Some(item) if item.epoch == epoch && item.journal.len() as u64 == rows => {
                item.over = true;
                Written::Committed
            }
            _ => Written::Refused,
        }
    }

    /// The items of a unit that are not over, in order.
    pub fn open_items(&self, unit: K) -> Vec<K> {
        let items = self.open().filter(|(_, item)| item.unit == unit);
        items.map(|(id, _)| id).collect()
    }

    /// The rows of a journal, from position 0.
    pub fn journal(&self, id: K) -> &[Row<E>] {
        self.items.get(&id).map_or(&[], |item| &item.journal)
    }

    /// The present epoch of an item.
    pub fn epoch(&self, id: K) -> Option<Epoch> {
        self.items.get(&id).map(|item| item.epoch)
    }

    /// The owner of an item that is not over.
    pub fn owner(&self, id: K) -> Option<NodeId> {
        let item = self.items.get(&id).filter(|item| !item.over)?;
        item.node
    }
}

/// The units of items, each once, in order.
fn units<'a, K: Ord + Copy + 'a, E: 'a>(
    items: impl Iterator<Item = (K, &'a Item<K, E>)>,
) -> impl Iterator<Item = (K, Epoch)> {
    let units: BTreeMap<K, Epoch> = items.map(|(_, item)| (item.unit, item.epoch)).collect();
    units.into_iter()
}
