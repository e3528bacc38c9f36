//! Selects the due games to check. Holds what is not part of the stored state: who is present,
//! which games wait for absent participants, and which games need a check. Up to a hundred thousand
//! games may be due; a game is checked again only after something changed for one of its
//! participants. `calls` decides what a check results in.

use std::collections::{BTreeMap, BTreeSet};

use super::change::{Change, Game, GameState};
use super::state::TournamentState;

/// Queue position and number of a due game. Outdated once the game is called or queued again.
pub(super) type DueGame = (u64, usize);

/// Longest time that a game waits for participants because they had to wait themselves,
/// milliseconds.
const MAX_PATIENCE_MS: u64 = 600_000;

/// The schedule at this moment. After a restart nobody is present.
#[derive(Debug, Clone, Default)]
pub(super) struct Scheduler {
    /// By participant: whether it is present.
    present: Vec<bool>,
    /// Number of games of the state seen so far.
    known: usize,
    /// Games to check. A due game that is neither here nor waiting is blocked.
    to_check: BTreeSet<DueGame>,
    /// By participant at its limit of games: the games it blocks. When it can play again, the first
    /// of them is checked; if that one is not called, the next.
    blocked: Vec<BTreeSet<DueGame>>,
    /// Games that wait for a physical table. When one is free, the first of them is checked; if it is
    /// not called, the next.
    without_table: BTreeSet<DueGame>,
    /// Games blocked by absent participants only, with the time since when, in milliseconds; later by
    /// what they wait longer than the no-show time.
    waits: BTreeMap<usize, u64>,
    /// The same games by time, except those whose time was up at the last check.
    by_time: BTreeSet<(u64, usize)>,
    /// The same games by participant.
    waits_by_participant: Vec<BTreeSet<usize>>,
    /// Whether the maximum number of games is being played, or the tournament is paused. No wait
    /// counts meanwhile.
    full: bool,
    /// When that last ended, in milliseconds; every wait restarts then.
    open_since: u64,
    /// By participant that was present when its last game ended: when that was, in milliseconds;
    /// `None` until the next time is seen.
    free_since: BTreeMap<usize, Option<u64>>,
    /// By participant that was present and is not any more.
    gone: BTreeMap<usize, Gone>,
    /// Number of checks so far.
    #[cfg(test)]
    pub(super) checks: u64,
}

/// A participant that has gone.
#[derive(Debug, Clone, Copy, Default)]
struct Gone {
    /// Since when, in milliseconds; `None` until the next time is seen.
    since: Option<u64>,
    /// Whether a game has ended meanwhile in which a substitute played for it.
    left_a_game: bool,
}

impl Scheduler {
    pub(super) fn is_present(&self, state: &TournamentState, participant: usize) -> bool {
        let entrant = &state.participants[participant];
        entrant.built_in.is_some()
            || entrant.at_table
            || self.present.get(participant) == Some(&true)
    }

    /// Sets whether a participant is present. An arrival may complete waiting games; a game whose
    /// participants are all present restarts its wait.
    pub(super) fn set_present(
        &mut self,
        state: &TournamentState,
        participant: usize,
        present: bool,
    ) {
        self.seat(state);
        let was_present = std::mem::replace(&mut self.present[participant], present);
        if !present {
            if was_present {
                self.gone.insert(participant, Gone::default());
            }
            return;
        }
        self.gone.remove(&participant);
        for index in self.waits_by_participant[participant].clone() {
            let game = &state.games[index];
            self.to_check.insert((game.turn, index));
            if game.seats.iter().all(|&who| self.is_present(state, who)) {
                self.end_wait(state, index);
            }
        }
    }

    /// Updates the schedule for a change that the state has folded.
    pub(super) fn fold(&mut self, state: &TournamentState, change: &Change) {
        match change {
            Change::Begun { .. } | Change::Paused | Change::Resumed => {}
            Change::Joined(_) => self.seat(state),
            Change::Withdrawn { participant, .. } | Change::Replaced { participant, .. } => {
                self.on_new_standing(state, *participant);
            }
            Change::Drawn { .. } => {
                self.seat(state);
                let drawn = self.known..state.games.len();
                (self.to_check).extend(drawn.map(|index| (state.games[index].turn, index)));
                self.known = state.games.len();
            }
            Change::Rescheduled { game, missing, .. } => {
                self.free_since.retain(|who, _| !missing.contains(who));
                self.on_game_change(state, *game);
            }
            Change::Counted { game, result } => {
                self.note_free(state, *game);
                for seat in result
                    .seats
                    .iter()
                    .filter(|seat| seat.statistics.substituted)
                {
                    if let Some(gone) = self.gone.get_mut(&seat.participant) {
                        gone.left_a_game = true;
                    }
                }
                self.on_game_change(state, *game);
            }
            Change::Called { game, .. } => {
                if let Some(game) = state.games.get(*game) {
                    self.free_since.retain(|who, _| !game.seats.contains(who));
                }
                self.on_game_change(state, *game);
            }
            Change::Voided { game }
            | Change::Postponed { game, .. }
            | Change::Recalled { game } => self.on_game_change(state, *game),
            Change::Finished | Change::Closed => {
                *self = Scheduler {
                    present: std::mem::take(&mut self.present),
                    ..Scheduler::default()
                };
                self.known = state.games.len();
                self.seat(state);
            }
        }
    }

    /// Handles a participant who has left, or whose place somebody else has taken: all its games may
    /// be ready.
    fn on_new_standing(&mut self, state: &TournamentState, participant: usize) {
        self.seat(state);
        self.free_since.remove(&participant);
        self.gone.remove(&participant);
        let Some(present) = self.present.get_mut(participant) else {
            return;
        };
        *present = false;
        for &(turn, index) in &state.due {
            if state.games[index].seats.contains(&participant) {
                self.end_wait(state, index);
                self.to_check.insert((turn, index));
            }
        }
        // Some of them may need no table any more.
        self.to_check.append(&mut self.without_table);
    }

    /// Notes who was present when a game ended.
    fn note_free(&mut self, state: &TournamentState, index: usize) {
        let Some(game) = state.games.get(index) else {
            return;
        };
        for &who in &game.seats {
            self.free_since.remove(&who);
            if game.is_played_by(who) && self.is_present(state, who) {
                self.free_since.insert(who, None);
            }
        }
    }

    /// Learns what time it is.
    pub(super) fn see_time(&mut self, now_ms: u64) {
        for since in self.free_since.values_mut() {
            since.get_or_insert(now_ms);
        }
        for gone in self.gone.values_mut() {
            gone.since.get_or_insert(now_ms);
        }
    }

    /// From when on the no-show time of a game counts that now has to wait for absent participants.
    /// Those who had to wait for it themselves are waited for as long as they did. Those who left a
    /// game to a substitute have been waited for since they went.
    pub(super) fn awaits_from(&self, state: &TournamentState, game: &Game, now_ms: u64) -> u64 {
        let from = |who: &usize| match self.gone.get(who) {
            Some(gone) if gone.left_a_game => gone.since.unwrap_or(now_ms),
            _ => {
                let free = self.free_since.get(who).copied().flatten();
                let waited = now_ms - free.unwrap_or(now_ms).min(now_ms);
                let patience = waited.min(MAX_PATIENCE_MS);
                now_ms + patience.saturating_sub(state.settings.no_show_ms)
            }
        };
        let seats = game.seats.iter();
        let awaited =
            seats.filter(|&&who| !state.forfeits(game, who) && !self.is_present(state, who));
        awaited.map(from).max().unwrap_or(now_ms)
    }

    /// Handles a game that was called, queued again or ended: its participants may have gained or
    /// lost capacity, and a physical table may have become free or occupied.
    fn on_game_change(&mut self, state: &TournamentState, index: usize) {
        let Some(game) = state.games.get(index) else {
            return;
        };
        self.end_wait(state, index);
        match game.state {
            GameState::Due => drop(self.to_check.insert((game.turn, index))),
            _ => drop(self.to_check.remove(&(game.turn, index))),
        }
        for &who in &game.seats {
            if state.has_capacity(who) {
                continue;
            }
            for waiting in std::mem::take(&mut self.waits_by_participant[who]) {
                self.end_wait(state, waiting);
                self.blocked[who].insert((state.games[waiting].turn, waiting));
            }
        }
        if game.physical && !state.has_free_table() {
            let games = &state.games;
            let waiting = self.waits.keys().copied();
            let physical: Vec<usize> = waiting.filter(|index| games[*index].physical).collect();
            for index in physical {
                self.end_wait(state, index);
                self.without_table.insert((games[index].turn, index));
            }
        }
        self.release(state, game);
    }

    /// Checks the first game blocked by each of these participants that can play again, and the
    /// first that waits for a table if one is free: also after a game that no longer needs its own,
    /// because its participant at the table has left the tournament.
    fn release(&mut self, state: &TournamentState, game: &Game) {
        for &who in game.seats.iter().filter(|who| state.has_capacity(**who)) {
            self.to_check.extend(self.blocked[who].pop_first());
        }
        if state.has_free_table() {
            self.to_check.extend(self.without_table.pop_first());
        }
    }

    /// Whether games can be called: fewer than the maximum are being played, and the tournament is not
    /// paused.
    pub(super) fn is_open(&mut self, state: &TournamentState, now_ms: u64) -> bool {
        let was_full = self.full;
        self.full = state.paused || state.playing.len() >= state.settings.max_parallel;
        if was_full && !self.full {
            self.open_since = now_ms;
        }
        !self.full
    }

    /// The next game to check, in queue order. Stays the same until it is called, rescheduled,
    /// blocked or waiting.
    pub(super) fn next(&mut self, state: &TournamentState, now_ms: u64) -> Option<DueGame> {
        while let Some(&(since, index)) = self.by_time.first()
            && now_ms.saturating_sub(since) >= state.settings.no_show_ms
        {
            self.by_time.pop_first();
            self.to_check.insert((state.games[index].turn, index));
        }
        loop {
            let next = *self.to_check.first()?;
            if state.due.contains(&next) {
                #[cfg(test)]
                {
                    self.checks += 1;
                }
                return Some(next);
            }
            self.set_aside(state, next);
        }
    }

    /// Removes a checked game that is not called.
    fn set_aside(&mut self, state: &TournamentState, checked: DueGame) {
        self.to_check.remove(&checked);
        self.release(state, &state.games[checked.1]);
    }

    /// Records that a participant at its limit of games blocks the game.
    pub(super) fn block(&mut self, state: &TournamentState, checked: DueGame, by: usize) {
        self.end_wait(state, checked.1);
        self.blocked[by].insert(checked);
        self.set_aside(state, checked);
    }

    /// Records that a game waits for a physical table.
    pub(super) fn wait_for_table(&mut self, state: &TournamentState, checked: DueGame) {
        self.end_wait(state, checked.1);
        self.without_table.insert(checked);
        self.set_aside(state, checked);
    }

    /// Makes a game wait for absent participants. Returns `true` if its wait is over instead.
    pub(super) fn has_waited(
        &mut self,
        state: &TournamentState,
        checked: DueGame,
        now_ms: u64,
    ) -> bool {
        let (_, index) = checked;
        let game = &state.games[index];
        let before = self.waits.get(&index).copied();
        let since = before.unwrap_or_else(|| self.awaits_from(state, game, now_ms));
        let since = since.max(self.open_since);
        if now_ms.saturating_sub(since) >= state.settings.no_show_ms {
            self.waits.insert(index, since);
            return true;
        }
        if let Some(before) = before {
            self.by_time.remove(&(before, index));
        }
        self.waits.insert(index, since);
        self.by_time.insert((since, index));
        for &who in &game.seats {
            if !state.forfeits(game, who) {
                self.waits_by_participant[who].insert(index);
            }
        }
        self.set_aside(state, checked);
        false
    }

    /// Ends the wait of a game.
    fn end_wait(&mut self, state: &TournamentState, index: usize) {
        if let Some(since) = self.waits.remove(&index) {
            self.by_time.remove(&(since, index));
            for &who in &state.games[index].seats {
                self.waits_by_participant[who].remove(&index);
            }
        }
    }

    /// When the first wait ends, in milliseconds.
    pub(super) fn wake_at(&self, state: &TournamentState) -> Option<u64> {
        let &(since, _) = self.by_time.first().filter(|_| !self.full)?;
        let since = since.max(self.open_since);
        Some(since.saturating_add(state.settings.no_show_ms))
    }

    /// Extends the lists to all participants.
    fn seat(&mut self, state: &TournamentState) {
        let participants = state.participants.len();
        self.present.resize(participants, false);
        self.blocked.resize(participants, BTreeSet::new());
        self.waits_by_participant
            .resize(participants, BTreeSet::new());
    }
}
