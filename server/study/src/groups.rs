//! Participants who play together: who belongs to a group, whom it waits for, and what becomes of those
//! who are left over.

use std::collections::{BTreeMap, BTreeSet};

use crate::Study;
use crate::change::{Change, Ended, Grouped, PlacedGame};
use crate::settings::{Groups, LeftOverPolicy};
use crate::stage::{Arrival, Task};
use crate::state::{Participant, Status};
use crate::view::ShownArrival;

/// With whom participants can be a group: test participants among themselves, and those of a plan.
type Among = (bool, Option<u32>);

impl Participant {
    fn among(&self) -> Among {
        (self.test, self.planned)
    }

    /// Whether this is its running game.
    fn plays(&self, game: &PlacedGame) -> bool {
        let last = self.games.last().filter(|game| game.ended.is_none());
        last.is_some_and(|last| last.placed.game == game.game)
    }
}

impl Study {
    /// Those in the middle of the study who play the running game of a participant, by number.
    pub fn players_of(&self, number: u32) -> Vec<u32> {
        let participant = self.participant(number);
        let Some(game) = participant.and_then(|it| it.games.last()) else {
            return Vec::new();
        };
        let mut players = self.with_group(number);
        players.retain(|number| {
            let player = self.participant(*number);
            player.is_some_and(|it| it.status == Status::Active && it.plays(&game.placed))
        });
        players
    }

    /// Whether others play on in the running game of a participant.
    pub fn plays_with_others(&self, number: u32) -> bool {
        self.players_of(number).iter().any(|other| *other != number)
    }

    /// How many participants began a game of one of them.
    pub fn began_with(&self, number: u32, game: [u8; 16]) -> usize {
        let players = self.with_group(number).into_iter();
        let played = |number: &u32| {
            let games = self.participant(*number).map(|it| &it.games);
            games.is_some_and(|games| games.iter().any(|it| it.placed.game == game))
        };
        players.filter(played).count()
    }

    /// A participant and all of its group, by number.
    fn with_group(&self, number: u32) -> Vec<u32> {
        let group = self.participant(number).and_then(|it| it.group);
        let members = group.and_then(|group| self.state.groups.get(&group));
        members.map_or_else(|| vec![number], |them| them.iter().copied().collect())
    }

    /// The participants of a group who are in the middle of the study, by number.
    fn members(&self, group: u32) -> Vec<u32> {
        let members = self.state.groups.get(&group).into_iter().flatten().copied();
        let is_active = |number: &u32| {
            let participant = self.participant(*number);
            participant.is_some_and(|it| it.status == Status::Active)
        };
        members.filter(is_active).collect()
    }

    /// The participants who play the due game of a participant: it alone, or all of its group who have
    /// not left, by number.
    pub(crate) fn players_with(&self, number: u32) -> Vec<u32> {
        let participant = self.participant(number);
        let step = participant.and_then(|it| self.step_of(it));
        let is_practice = step.is_some_and(|step| matches!(step.task, Task::Practice { .. }));
        match participant.and_then(|it| it.group) {
            Some(group) if !is_practice => self.members(group),
            _ => vec![number],
        }
    }

    /// Those for whom the due game of a participant waits.
    pub(crate) fn late_for(&self, number: u32) -> Vec<u32> {
        let mut players = self.players_with(number);
        players.retain(|other| *other != number && !self.is_ready(*other));
        players
    }

    /// Whether a participant could begin its due game at once.
    fn is_ready(&self, number: u32) -> bool {
        self.is_connected(number) && self.waits_to_play(number)
    }

    /// Whether a game that its group plays is due for a participant.
    fn waits_to_play(&self, number: u32) -> bool {
        self.due(number).is_some_and(|due| !due.practice)
    }

    /// The other participants who see something else when something happens to one: those of its
    /// group, and all who wait for one with it.
    pub fn affected_with(&self, number: u32) -> Vec<u32> {
        let participant = self.participant(number);
        let Some(participant) = participant.filter(|_| self.settings().groups.is_some()) else {
            return Vec::new();
        };
        let members = participant.group.map(|group| self.members(group));
        let waiting = self.waiting_with(participant);
        let mut affected: Vec<u32> = members.into_iter().flatten().chain(waiting).collect();
        affected.retain(|other| *other != number);
        affected
    }

    /// Those who wait for a group and are here, by with whom they can be one, in the order of their
    /// arrival.
    fn arrived(&self) -> BTreeMap<Among, Vec<u32>> {
        let mut arrived: BTreeMap<Among, Vec<(u64, u32)>> = BTreeMap::new();
        for number in self.presence.connected() {
            let participant = self.participant(number);
            if let Some(waiting) = participant.filter(|it| self.waits_for_group(it)) {
                let since = waiting.reached_at_ms.last().copied().unwrap_or(0);
                arrived
                    .entry(waiting.among())
                    .or_default()
                    .push((since, number));
            }
        }
        let in_order = arrived.into_iter().map(|(among, mut waiting)| {
            waiting.sort_unstable();
            let waiting = waiting.into_iter().map(|(_, number)| number).collect();
            (among, waiting)
        });
        in_order.collect()
    }

    /// Those who wait for a group with a participant and are here.
    fn waiting_with(&self, participant: &Participant) -> Vec<u32> {
        let here = self.presence.connected();
        let waits = |number: &u32| {
            let other = self.participant(*number);
            other.is_some_and(|it| it.among() == participant.among() && self.waits_for_group(it))
        };
        here.filter(waits).collect()
    }

    fn waits_for_group(&self, participant: &Participant) -> bool {
        let is_active = participant.status == Status::Active && participant.group.is_none();
        let step = is_active.then(|| self.step_of(participant)).flatten();
        step.is_some_and(|step| matches!(step.task, Task::Arrival(_)))
    }

    /// What a participant who waits for its group sees.
    pub(crate) fn shown_arrival(
        &self,
        participant: &Participant,
        arrival: &Arrival,
    ) -> ShownArrival {
        let here = self.waiting_with(participant).len() as u32;
        let groups = self.settings().groups;
        let size = self.settings().group_size();
        ShownArrival {
            text: arrival.text.clone(),
            size,
            here: here.clamp(1, size),
            wait_ms: groups.map_or(0, |groups| groups.wait_ms),
        }
    }

    /// The changes by which these participants become a group; none if no slots are free.
    pub(crate) fn grouped(&self, numbers: &[u32], now_ms: u64) -> Vec<Change> {
        let first = numbers.first().and_then(|number| self.participant(*number));
        let Some(slot) = first.and_then(|first| self.free_slot(first.test)) else {
            return Vec::new();
        };
        let last = self.state.groups.last_key_value();
        let group = last.map_or(0, |(group, _)| *group) + 1;
        let grouped = (slot..).zip(numbers).filter_map(|(slot, number)| {
            let participant = self.participant(*number)?;
            Some(Change::Grouped(Grouped {
                number: *number,
                group,
                slot,
                passed_over: self.passed_over_next(participant, None),
                at_ms: now_ms,
            }))
        });
        grouped.collect()
    }

    /// The changes by which those drop out for whom the game of a test participant waits.
    pub fn without_late(&self, number: u32, now_ms: u64) -> Vec<Change> {
        let is_test = self.participant(number).is_some_and(|it| it.test);
        let late = (is_test && self.waits_to_play(number)).then(|| self.late_for(number));
        dropped_out(late.unwrap_or_default(), now_ms)
    }

    /// The changes of groups that follow by themselves at this time, if any: a group is formed, those
    /// who have waited for one are left over, or those for whom others waited drop out.
    pub(crate) fn next_of_groups(&mut self, now_ms: u64, elapsed_ms: u64) -> Vec<Change> {
        let Some(groups) = self.settings().groups else {
            return Vec::new();
        };
        let arrived = self.arrived();
        let late = self.late();
        let noted = arrived.values().flatten().chain(late.keys());
        let noted: BTreeSet<u32> = noted.copied().collect();
        self.presence.note_waiting(&noted, elapsed_ms);
        let waited = self.presence.waited(groups.wait_ms, elapsed_ms);
        for ((test, _), waiting) in &arrived {
            let changes = match self.free_slot(*test) {
                // No wait helps.
                None => left_over(waiting, now_ms),
                Some(_) => self.next_of_arrived(waiting, &waited, groups, now_ms),
            };
            if !changes.is_empty() {
                return changes;
            }
        }
        let late = late.into_iter();
        let late =
            late.filter(|(number, somebody_is_here)| *somebody_is_here && waited.contains(number));
        dropped_out(late.map(|(number, _)| number).collect(), now_ms)
    }

    /// Those for whom others of their group wait before a game, with whether one of these is here.
    fn late(&self) -> BTreeMap<u32, bool> {
        let here = self.presence.connected();
        let groups = here.filter_map(|number| self.participant(number)?.group);
        let mut late = BTreeMap::new();
        for group in groups.collect::<BTreeSet<u32>>() {
            let members = self.members(group);
            let waiting = members.iter().filter(|number| self.waits_to_play(**number));
            let waiting: Vec<u32> = waiting.copied().collect();
            for number in members {
                let mut others = waiting.iter().filter(|other| **other != number).peekable();
                if others.peek().is_some() && !self.is_ready(number) {
                    late.insert(number, others.any(|other| self.is_connected(*other)));
                }
            }
        }
        late
    }

    /// What follows for those who wait for a group with each other, if slots are free.
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
        match groups.left_over {
            _ if of_group.len() == size => self.grouped(of_group, now_ms),
            LeftOverPolicy::Agents if is_late => self.grouped(of_group, now_ms),
            LeftOverPolicy::Agents => Vec::new(),
            LeftOverPolicy::Dismiss => {
                let out = of_group.iter().filter(|number| waited.contains(number));
                left_over(&out.copied().collect::<Vec<_>>(), now_ms)
            }
        }
    }
}

fn left_over(numbers: &[u32], at_ms: u64) -> Vec<Change> {
    let ended = numbers.iter().map(|&number| Ended { number, at_ms });
    ended.map(Change::LeftOver).collect()
}

fn dropped_out(numbers: Vec<u32>, at_ms: u64) -> Vec<Change> {
    let ended = numbers.into_iter().map(|number| Ended { number, at_ms });
    ended.map(Change::DroppedOut).collect()
}
