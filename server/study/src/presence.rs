//! Who has a session open, which is not part of the stored state, and who drops out. Times are
//! milliseconds of a clock that never jumps, because what they end cannot be undone.

use std::collections::{BTreeMap, BTreeSet};

/// The sessions at this moment. After a restart nobody has one.
#[derive(Debug, Clone, Default)]
pub(crate) struct Presence {
    connected: BTreeSet<u32>,
    /// Active participants without a session, with the time since when.
    away: BTreeMap<u32, u64>,
    /// Those who wait for a group, and those for whom a group waits, with the time since when.
    waiting: BTreeMap<u32, u64>,
}

impl Presence {
    pub(crate) fn set(&mut self, number: u32, connected: bool, now_ms: u64) {
        if connected {
            self.connected.insert(number);
            self.away.remove(&number);
        } else if self.connected.remove(&number) {
            self.away.insert(number, now_ms);
        }
    }

    pub(crate) fn is_connected(&self, number: u32) -> bool {
        self.connected.contains(&number)
    }

    /// One of the active participants who has been away for `limit_ms`. One who is away and was not
    /// before, as after a restart, is away from now.
    pub(crate) fn drop_out(
        &mut self,
        active: impl Iterator<Item = u32>,
        limit_ms: u64,
        now_ms: u64,
    ) -> Option<u32> {
        let absent: BTreeSet<u32> = active.filter(|it| !self.connected.contains(it)).collect();
        self.away.retain(|number, _| absent.contains(number));
        for number in absent {
            self.away.entry(number).or_insert(now_ms);
        }
        let mut away = self.away.iter();
        let first = away.find(|(_, since)| now_ms.saturating_sub(**since) >= limit_ms);
        first.map(|(number, _)| *number)
    }

    /// Those who have a session open, by number.
    pub(crate) fn connected(&self) -> impl Iterator<Item = u32> + '_ {
        self.connected.iter().copied()
    }

    /// Notes who waits for a group, and for whom one waits. The time of one who was not noted before, as
    /// after a restart, begins now.
    pub(crate) fn note_waiting(&mut self, waiting: &BTreeSet<u32>, now_ms: u64) {
        self.waiting.retain(|number, _| waiting.contains(number));
        for number in waiting {
            self.waiting.entry(*number).or_insert(now_ms);
        }
    }

    /// Those who have been noted for `limit_ms`.
    pub(crate) fn waited(&self, limit_ms: u64, now_ms: u64) -> BTreeSet<u32> {
        let waiting = self.waiting.iter();
        let long = waiting.filter(|(_, since)| now_ms.saturating_sub(**since) >= limit_ms);
        long.map(|(number, _)| *number).collect()
    }

    /// When the next participant has been noted for `limit_ms`. For those who have been, nothing follows
    /// before somebody comes.
    pub(crate) fn next_waited_ms(&self, limit_ms: u64, now_ms: u64) -> Option<u64> {
        let ends = self
            .waiting
            .values()
            .map(|since| since.saturating_add(limit_ms));
        ends.filter(|end| *end > now_ms).min()
    }

    /// When the next participant drops out.
    pub(crate) fn next_drop_out_ms(&self, limit_ms: u64) -> Option<u64> {
        let since = self.away.values().min();
        since.map(|since| since.saturating_add(limit_ms))
    }
}
