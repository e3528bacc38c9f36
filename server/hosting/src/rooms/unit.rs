//! The rooms of a unit, which change hands together in a cluster: a room alone, or those of a
//! tournament or study.

use std::collections::{BTreeMap, BTreeSet};
use std::future::Future;

use chefshat_cluster::Load;
use chefshat_proto::v1::RoomState;

use super::Rooms;
use crate::room::Handle;
use chefshat_base::tasks::short;
use chefshat_room::ids::{RoomId, UnitId};

impl Rooms {
    /// Whether the room that is this unit runs here, or is being created.
    pub(crate) fn runs(&self, unit: UnitId) -> bool {
        let table = self.lock();
        table.by_unit(unit).is_some_and(|entry| entry.is_open())
            || table.in_creation.keys().any(|room| room.unit() == unit)
    }

    /// How full this server is.
    pub fn load(&self) -> Load {
        Load {
            rooms: self.open_count() as u64,
            capacity: self.max_rooms as u64,
        }
    }

    /// The rooms that wait or play, by their units; those of units of which nothing is lost with this
    /// server.
    pub(crate) fn durable_units(&self) -> BTreeMap<UnitId, Vec<Handle>> {
        let table = self.lock();
        let mut units = BTreeMap::<UnitId, Vec<Handle>>::new();
        let mut ephemeral = BTreeSet::new();
        for entry in table.by_number.values().filter(|entry| entry.is_open()) {
            let unit = entry.header.unit();
            match entry.durable {
                true => units.entry(unit).or_default().push(entry.handle.clone()),
                false => _ = ephemeral.insert(unit),
            }
        }
        units.retain(|unit, _| !ephemeral.contains(unit));
        units
    }

    /// Stops all rooms of a unit at once, which publish nothing more, unless their games are over.
    pub(crate) fn fence_unit(&self, unit: UnitId) {
        for (handle, _) in self.open_of(unit) {
            handle.fence();
        }
    }

    /// Stops all durable rooms at once: the node ends without having handed them over.
    pub fn fence_all(&self) {
        for (handle, durable) in self.open() {
            if durable {
                handle.fence();
            }
        }
    }

    /// Stops all rooms of a unit, and forgets them when they have ended: another node may have
    /// them. Those whose games are over stay.
    pub async fn stop_unit(&self, unit: UnitId) {
        self.end_unit(unit, |handle, _| async move { handle.fence() })
            .await;
    }

    /// Waits until a room is not one in which an ephemeral game is running.
    pub(crate) async fn until_ephemeral_over(&self, unit: UnitId) {
        let Some(handle) = self.by_unit(unit) else {
            return;
        };
        let described = handle.describe().await.ok();
        if described.is_none_or(|room| room.state() == RoomState::Waiting) {
            return;
        }
        let plays = |entry: &super::Entry| entry.is_open() && !entry.durable;
        self.until(|table| !table.by_unit(unit).is_some_and(plays))
            .await;
    }

    /// Suspends the durable rooms of a unit after their next commit, ends the others, and forgets
    /// them: this node hands the unit over.
    pub(crate) async fn suspend_unit(&self, unit: UnitId) {
        let end = |handle: Handle, durable| async move { handle.end(durable).await };
        self.end_unit(unit, end).await;
    }

    async fn end_unit<F: Future<Output = ()>>(
        &self,
        unit: UnitId,
        end: impl Fn(Handle, bool) -> F,
    ) {
        self.until_created(unit).await;
        let open = self.open_of(unit);
        for (handle, durable) in &open {
            end(handle.clone(), *durable).await;
        }
        for (handle, _) in &open {
            self.until_ended(handle.id()).await;
        }
        let mut table = self.lock();
        let suspended = table.of_unit(unit).filter(|(_, entry)| entry.suspended);
        let suspended: Vec<u64> = suspended.map(|(number, _)| number).collect();
        for number in suspended {
            table.remove(number);
        }
    }

    /// Waits until no room of a unit is being created.
    async fn until_created(&self, unit: UnitId) {
        loop {
            let created = self.created.notified();
            if !self.lock().in_creation.values().any(|of| *of == unit) {
                return;
            }
            created.await;
        }
    }

    /// Closes the rooms of a unit but these.
    pub(crate) fn close_all_but(&self, unit: UnitId, kept: &BTreeSet<RoomId>) {
        for (room, _) in self.open_of(unit) {
            if !kept.contains(&room.id()) {
                let closing = async move { room.close_without_token().await };
                tokio::spawn(short("one message", closing));
            }
        }
    }

    /// The rooms of a unit whose games are not over, and whether they are durable.
    fn open_of(&self, unit: UnitId) -> Vec<(Handle, bool)> {
        let table = self.lock();
        let open = table.of_unit(unit).filter(|(_, entry)| entry.is_open());
        open.map(|(_, entry)| (entry.handle.clone(), entry.durable))
            .collect()
    }
}
