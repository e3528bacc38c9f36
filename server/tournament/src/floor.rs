//! What a tournament knows of this moment alone: who is present, which games that are due are worth a look, which wait for absent ones. A
//! hundred thousand games may be due at a time; one is looked at again only when something has changed for one of its participants. What
//! is made of a look is decided in `calls`.

use std::collections::{BTreeMap, BTreeSet};

use super::change::{Change, Game, GameState};
use super::course::Course;

/// A game that is due, by its turn. A game that was called or given a new turn since is no longer due by this one.
pub(super) type DueGame = (u64, usize);

/// This moment. After a restart nobody is present until they come back.
#[derive(Debug, Clone, Default)]
pub(super) struct Floor {
    /// Who is present, by participant.
    present: Vec<bool>,
    /// Games of the course that have been taken in.
    known: usize,
    /// What is to be looked at. If a due game is neither here nor waiting, somebody without a free place holds it up.
    fresh: BTreeSet<DueGame>,
    /// Games that a participant without a free place held up, by participant. When it has a free place, the first of them is looked at; if
    /// that is not called, the next.
    held_up: Vec<BTreeSet<DueGame>>,
    /// Games that nothing but absent ones hold up, and since when, in milliseconds.
    waits: BTreeMap<usize, u64>,
    /// The same games by time, but for those whose time was up when it was last looked at.
    by_time: BTreeSet<(u64, usize)>,
    /// The same games by the participants whom they need.
    waits_of: Vec<BTreeSet<usize>>,
    /// Whether as many games were being played as may be. Meanwhile nobody is waited for.
    full: bool,
    /// When that was last over, in milliseconds: every wait began anew.
    open_since: u64,
    /// Games that have been looked at.
    #[cfg(test)]
    pub(super) looks: u64,
}

impl Floor {
    pub(super) fn is_present(&self, course: &Course, participant: usize) -> bool {
        course.participants[participant].built_in.is_some()
            || self.present.get(participant) == Some(&true)
    }

    /// Somebody came or went. Who comes may complete games that wait; one whose participants were all there waits anew.
    pub(super) fn set_present(&mut self, course: &Course, participant: usize, present: bool) {
        self.seat(course);
        self.present[participant] = present;
        if !present {
            return;
        }
        for index in self.waits_of[participant].clone() {
            let game = &course.games[index];
            self.fresh.insert((game.turn, index));
            if game.seats.iter().all(|&who| self.is_present(course, who)) {
                self.end_wait(course, index);
            }
        }
    }

    /// Takes in what a change that the course has folded means for games that are due.
    pub(super) fn fold(&mut self, course: &Course, change: &Change) {
        match change {
            Change::Joined(_) | Change::Begun { .. } => {}
            Change::Drawn { .. } => {
                self.seat(course);
                let drawn = self.known..course.games.len();
                (self.fresh).extend(drawn.map(|index| (course.games[index].turn, index)));
                self.known = course.games.len();
            }
            Change::Called { game, .. }
            | Change::Rescheduled { game, .. }
            | Change::Counted { game, .. }
            | Change::Voided { game } => self.moved(course, *game),
            Change::Finished | Change::Closed => {
                *self = Floor {
                    present: std::mem::take(&mut self.present),
                    ..Floor::default()
                };
                self.known = course.games.len();
                self.seat(course);
            }
        }
    }

    /// A game was called, is due again or is over: some of its participants may have free places, others none any more.
    fn moved(&mut self, course: &Course, index: usize) {
        let Some(game) = course.games.get(index) else {
            return;
        };
        self.end_wait(course, index);
        match game.state {
            GameState::Due => drop(self.fresh.insert((game.turn, index))),
            _ => drop(self.fresh.remove(&(game.turn, index))),
        }
        for &who in &game.seats {
            if course.has_place(who) {
                continue;
            }
            for waiting in std::mem::take(&mut self.waits_of[who]) {
                self.end_wait(course, waiting);
                self.held_up[who].insert((course.games[waiting].turn, waiting));
            }
        }
        self.release(course, game);
    }

    /// The next thing to look at is the first game that each of these participants held up, if it has a free place.
    fn release(&mut self, course: &Course, game: &Game) {
        for &who in game.seats.iter().filter(|who| course.has_place(**who)) {
            self.fresh.extend(self.held_up[who].pop_first());
        }
    }

    /// Whether games can be called: fewer are being played than may be.
    pub(super) fn is_open(&mut self, course: &Course, now_ms: u64) -> bool {
        let was_full = self.full;
        self.full = course.playing.len() >= course.settings.max_parallel;
        if was_full && !self.full {
            self.open_since = now_ms;
        }
        !self.full
    }

    /// The next game to look at, in the order of turns; the same one until it is called, rescheduled, held up or made to wait.
    pub(super) fn next(&mut self, course: &Course, now_ms: u64) -> Option<DueGame> {
        while let Some(&(since, index)) = self.by_time.first()
            && now_ms.saturating_sub(since) >= course.settings.no_show_ms
        {
            self.by_time.pop_first();
            self.fresh.insert((course.games[index].turn, index));
        }
        loop {
            let next = *self.fresh.first()?;
            if course.due.contains(&next) {
                #[cfg(test)]
                {
                    self.looks += 1;
                }
                return Some(next);
            }
            self.put_by(course, next);
        }
    }

    /// A game was looked at and is not to be called.
    fn put_by(&mut self, course: &Course, looked_at: DueGame) {
        self.fresh.remove(&looked_at);
        self.release(course, &course.games[looked_at.1]);
    }

    /// Somebody without a free place holds the game up.
    pub(super) fn hold_up(&mut self, course: &Course, looked_at: DueGame, by: usize) {
        self.end_wait(course, looked_at.1);
        self.held_up[by].insert(looked_at);
        self.put_by(course, looked_at);
    }

    /// Lets a game wait for those who are absent, unless it has waited for as long as it may: then it says so.
    pub(super) fn has_waited(&mut self, course: &Course, looked_at: DueGame, now_ms: u64) -> bool {
        let (_, index) = looked_at;
        let before = self.waits.get(&index).copied();
        let since = before.map_or(now_ms, |since| since.max(self.open_since));
        if now_ms.saturating_sub(since) >= course.settings.no_show_ms {
            self.waits.insert(index, since);
            return true;
        }
        if let Some(before) = before {
            self.by_time.remove(&(before, index));
        }
        self.waits.insert(index, since);
        self.by_time.insert((since, index));
        let game = &course.games[index];
        for &who in &game.seats {
            if !course.forfeits(game, who) {
                self.waits_of[who].insert(index);
            }
        }
        self.put_by(course, looked_at);
        false
    }

    /// Nobody is waited for in this game any more.
    fn end_wait(&mut self, course: &Course, index: usize) {
        if let Some(since) = self.waits.remove(&index) {
            self.by_time.remove(&(since, index));
            for &who in &course.games[index].seats {
                self.waits_of[who].remove(&index);
            }
        }
    }

    /// When the first wait is over, in milliseconds.
    pub(super) fn wake_at(&self, course: &Course) -> Option<u64> {
        let &(since, _) = self.by_time.first().filter(|_| !self.full)?;
        let since = since.max(self.open_since);
        Some(since.saturating_add(course.settings.no_show_ms))
    }

    /// Makes a place for every participant.
    fn seat(&mut self, course: &Course) {
        let participants = course.participants.len();
        self.present.resize(participants, false);
        self.held_up.resize(participants, BTreeSet::new());
        self.waits_of.resize(participants, BTreeSet::new());
    }
}
