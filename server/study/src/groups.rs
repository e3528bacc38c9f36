//! Participants who play together: who belongs to a group, whom it waits for, and what becomes of those
//! who are left over.

use std::collections::{BTreeMap, BTreeSet};

use crate::Study;
use crate::change::Change;
use crate::settings::{Groups, LeftOver};
use crate::stage::{Arrival, Task};
use crate::state::{Participant, Status};
use crate::view::ShownArrival;

/// With whom participants can be a group: test participants among themselves, and those of a plan.
type Among = (bool, Option<u32>);

impl Study {
    /// The participants who play the next game of a participant: it alone, or all of its group who
    /// have not left, by number.
    pub fn players_with(&self, number: u32) -> Vec<u32> {
        let participant = self.participant(number);
        let step = participant.and_then(|it| self.step_of(it));
        let is_practice = step.is_some_and(|step| matches!(step.task, Task::Practice { .. }));
        match participant.and_then(|it| it.group) {
            Some(group) if !is_practice => self.members(group),
            _ => vec![number],
        }
    }

    /// The participants of a group who are in the middle of the study, by number.
    fn members(&self, group: u32) -> Vec<u32> {
        let stays = |it: &Participant| it.group == Some(group) && it.status == Status::Active;
        let participants = self.participants().iter();
        let members = participants.filter(|(_, it)| stays(it));
        members.map(|(number, _)| *number).collect()
    }

    /// Whether a participant could begin its due game at once.
    pub(crate) fn is_ready(&self, number: u32) -> bool {
        self.is_connected(number) && self.due(number).is_some()
    }

    /// Those for whom the due game of a participant waits.
    pub(crate) fn late_for(&self, number: u32) -> Vec<u32> {
        let mut players = self.players_with(number);
        players.retain(|other| *other != number && !self.is_ready(*other));
        players
    }

    /// The other participants who see something else when something happens to one: those of its
    /// group, and all who wait for one.
    pub fn affected_with(&self, number: u32) -> Vec<u32> {
        if self.settings().groups.is_none() {
            return Vec::new();
        }
        let group = self.participant(number).and_then(|it| it.group);
        let members = group.map(|group| self.members(group));
        let arrived = self.arrived().into_values().flatten();
        let mut affected: Vec<u32> = members.into_iter().flatten().chain(arrived).collect();
        affected.retain(|other| *other != number);
        affected
    }

    /// Whether others play on in the running game of a participant.
    pub fn plays_with_others(&self, number: u32) -> bool {
        let game = |it: &Participant| it.games.last().filter(|game| game.ended.is_none()).cloned();
        let Some(own) = self.participant(number).and_then(game) else {
            return false;
        };
        let mut participants = self.participants().iter();
        participants.any(|(other, it)| {
            *other != number
                && it.status == Status::Active
                && game(it).is_some_and(|game| game.placed.game == own.placed.game)
        })
    }

    /// Those who wait for a group and are here, by with whom they can be one, in the order of their
    /// arrival.
    fn arrived(&self) -> BTreeMap<Among, Vec<u32>> {
        let mut arrived: BTreeMap<Among, Vec<(u64, u32)>> = BTreeMap::new();
        for (number, participant) in self.participants() {
            if self.is_connected(*number) && self.waits_for_group(participant) {
                let since = participant.reached_at_ms.last().copied().unwrap_or(0);
                let among = (participant.test, participant.planned);
                arrived.entry(among).or_default().push((since, *number));
            }
        }
        let in_order = arrived.into_iter().map(|(among, mut waiting)| {
            waiting.sort_unstable();
            let waiting = waiting.into_iter().map(|(_, number)| number).collect();
            (among, waiting)
        });
        in_order.collect()
    }

    fn waits_for_group(&self, participant: &Participant) -> bool {
        let is_active = participant.status == Status::Active && participant.group.is_none();
        let step = is_active.then(|| self.step_of(participant)).flatten();
        step.is_some_and(|step| matches!(step.task, Task::Arrival(_)))
    }

    /// What a participant who waits for its group sees.
    pub(crate) fn shown_arrival(&self, number: u32, arrival: &Arrival) -> ShownArrival {
        let arrived = self.arrived().into_values();
        let own = arrived
            .into_iter()
            .find(|waiting| waiting.contains(&number))
            .map_or(1, |waiting| waiting.len());
        let groups = self.settings().groups;
        let size = self.settings().group_size();
        ShownArrival {
            text: arrival.text.clone(),
            size,
            here: (own as u32).min(size),
            wait_ms: groups.map_or(0, |groups| groups.wait_ms),
        }
    }

    /// The changes by which these participants become a group; none if no slots are free.
    pub(crate) fn grouped(&self, numbers: &[u32], now_ms: u64) -> Vec<Change> {
        let first = numbers.first().and_then(|number| self.participant(*number));
        let Some(slot) = first.and_then(|first| self.free_slot(first.test)) else {
            return Vec::new();
        };
        let groups = self.participants().values().filter_map(|it| it.group);
        let group = groups.max().unwrap_or(0) + 1;
        let grouped = (slot..).zip(numbers).filter_map(|(slot, number)| {
            let participant = self.participant(*number)?;
            Some(Change::Grouped {
                number: *number,
                group,
                slot,
                passed_over: self.passed_over_next(participant, None),
                at_ms: now_ms,
            })
        });
        grouped.collect()
    }

    /// The changes of groups that follow by themselves at this time, if any: a group is formed, those
    /// who have waited for one are left over, or those for whom others waited drop out.
    pub(crate) fn next_of_groups(&mut self, now_ms: u64) -> Vec<Change> {
        let Some(groups) = self.settings().groups else {
            return Vec::new();
        };
        let arrived = self.arrived();
        let late: BTreeMap<u32, Vec<u32>> = (self.participants().keys())
            .filter(|number| self.is_ready(**number))
            .map(|number| (*number, self.late_for(*number)))
            .filter(|(_, late)| !late.is_empty())
            .collect();
        let waiting: BTreeSet<u32> = (arrived.values().flatten())
            .chain(late.keys())
            .copied()
            .collect();
        self.presence.note_waiting(&waiting, now_ms);
        let waited = self.presence.waited(groups.wait_ms, now_ms);
        for waiting in arrived.values() {
            let changes = self.next_of_arrived(waiting, &waited, groups, now_ms);
            if !changes.is_empty() {
                return changes;
            }
        }
        let late = late.into_iter().find(|(number, _)| waited.contains(number));
        let late = late.map_or_else(Vec::new, |(_, late)| late);
        let dropped_out = late.into_iter().map(|number| Change::DroppedOut {
            number,
            at_ms: now_ms,
        });
        dropped_out.collect()
    }

    /// What follows for those who wait for a group with each other.
    fn next_of_arrived(
        &self,
        waiting: &[u32],
        waited: &BTreeSet<u32>,
        groups: Groups,
        now_ms: u64,
    ) -> Vec<Change> {
        let size = groups.size as usize;
        let of_group = &waiting[..waiting.len().min(size)];
        let is_late = of_group.iter().any(|number| waited.contains(number));
        let is_whole = of_group.len() == size;
        if is_whole || (is_late && groups.left_over == LeftOver::Agents) {
            let grouped = self.grouped(of_group, now_ms);
            if !grouped.is_empty() {
                return grouped;
            }
        }
        // Where all slots are taken, no wait helps.
        let left_over = of_group
            .iter()
            .filter(|number| is_whole || waited.contains(number));
        let left_over = left_over.map(|number| Change::LeftOver {
            number: *number,
            at_ms: now_ms,
        });
        left_over.collect()
    }
}
