//! Which change follows: when a game is called, how long it waits for absent participants, and what
//! follows from its end. `state` applies changes, `pairing` pairs rounds, `scheduler` selects the
//! games to check.
//!
//! A game is called, in the order of the schedule, when all its participants are present and can
//! play one more game, and a physical table is free if it needs one. If only absent participants
//! block it, it waits for the no-show time. That counts as a call, and the game is queued again
//! behind the others. The last call starts it without the absentees. If a participant misses the
//! last call itself, the game is called once more without it; other absentees are waited for as
//! before. The no-show time of somebody who left its last game to a substitute counts from when it
//! went. A game that all participants forfeit, or that is aborted on its last call, is voided. Those
//! who have left forfeit without being waited for. While the tournament is paused, no game is
//! called, no wait counts, no round is drawn, and the tournament does not end.

#[cfg(test)]
mod tests;

use super::Tournament;
use super::change::{Change, Ended, Game, GameResult, GameState, SeatResult};
use super::scheduler::Scheduler;
use super::state::{State, TournamentState};
use chefshat_engine::SeatStatistics;

/// Whether a due game can be called.
enum Readiness {
    /// This participant cannot play one more game now.
    Busy(usize),
    /// All physical tables are occupied.
    NoTable,
    /// These participants are absent or forfeit; nothing else blocks the game.
    Missing(Vec<usize>),
    /// The game can be called; these participants forfeit it.
    Ready(Vec<usize>),
}

impl Tournament {
    /// Sets whether a participant is present, that is, can take a seat at once. Built-in agents and
    /// participants at a physical table are always present. The wait of a game restarts once all its
    /// participants were present together, so one participant who comes and goes does not prolong it
    /// for the others.
    pub fn set_present(&mut self, participant: usize, present: bool) {
        let Tournament {
            state, scheduler, ..
        } = self;
        if participant >= state.participants.len() {
            return;
        }
        scheduler.set_present(state, participant, present);
    }

    /// Whether a participant is present.
    pub fn is_present(&self, participant: usize) -> bool {
        participant < self.state.participants.len()
            && self.scheduler.is_present(&self.state, participant)
    }

    /// The next change at this time, in milliseconds of any steady clock. Fold it and call again
    /// until the result is `None`; repeat after every other change, and at [`Tournament::wake_at`].
    pub fn next(&mut self, now_ms: u64) -> Option<Change> {
        self.scheduler.see_time(now_ms);
        match self.state.phase {
            State::Open => self.is_draw_due().then(|| self.beginning())?,
            State::Playing => {
                // A void game can be called again until then.
                if !self.state.paused {
                    if let Some(change) = self.pairings() {
                        return Some(change);
                    }
                    if self.state.is_round_over() && self.state.drawn >= self.state.rounds {
                        return Some(Change::Finished);
                    }
                }
                self.next_game(now_ms)
            }
            State::Finished | State::Closed => None,
        }
    }

    /// Whether [`Tournament::next`] begins the tournament or draws a round now, which takes a while.
    pub fn is_draw_due(&self) -> bool {
        match (self.state.phase, self.state.settings.start_when_joined) {
            (State::Open, Some(enough)) => self.joined() >= enough,
            _ => !self.state.paused && self.state.is_draw_due(),
        }
    }

    /// When to call [`Tournament::next`] again if nothing happens before, on the same clock.
    pub fn wake_at(&self) -> Option<u64> {
        self.scheduler.wake_at(&self.state)
    }

    /// The change that follows from the end of a called game; `None` if the game is not being
    /// played.
    pub fn ended(&self, game: usize, ended: Ended) -> Option<Change> {
        let state = &self.state;
        let played = state.games.get(game)?;
        if played.state != GameState::Playing {
            return None;
        }
        let is_last_call = played.calls >= state.settings.max_calls;
        let never_started = matches!(ended, Ended::NeverStarted { .. });
        let mut was_left = false;
        let missing: Vec<usize> = match ended {
            Ended::Played { shifts, seats } if seats.len() == played.seats.len() => {
                let result = result(state, played, shifts, &seats);
                return Some(Change::Counted { game, result });
            }
            // It could not start without those who left; nobody else has missed it.
            Ended::NeverStarted { .. } if !played.left.is_empty() => {
                was_left = true;
                let left = played.left.iter().copied();
                left.filter(|&who| state.withdrawn[who]).collect()
            }
            Ended::NeverStarted { missing } => missing
                .into_iter()
                .filter(|who| played.is_played_by(*who))
                .collect(),
            // Seats that do not match are not a result.
            Ended::Played { .. } | Ended::Aborted => Vec::new(),
        };
        // Participants missed the last call: call again without them.
        Some(if is_last_call && missing.is_empty() && !was_left {
            Change::Voided { game }
        } else {
            Change::Rescheduled {
                game,
                missing,
                never_started,
            }
        })
    }

    /// The change that closes the tournament; `None` if it is over.
    pub fn close(&self) -> Option<Change> {
        (!self.state.phase.is_over()).then_some(Change::Closed)
    }

    /// Checks due games in order until one of them changes.
    fn next_game(&mut self, now_ms: u64) -> Option<Change> {
        let Tournament {
            state, scheduler, ..
        } = self;
        if !scheduler.is_open(state, now_ms) {
            return None;
        }
        while let Some(due) = scheduler.next(state, now_ms) {
            let (_, index) = due;
            let game = &state.games[index];
            match readiness(state, scheduler, game) {
                Readiness::Busy(by) => scheduler.block(state, due, by),
                Readiness::NoTable => scheduler.wait_for_table(state, due),
                Readiness::Ready(forfeited) => return Some(called(index, game, forfeited)),
                Readiness::Missing(missing) => {
                    if scheduler.has_waited(state, due, now_ms) {
                        return Some(if game.calls + 1 < state.settings.max_calls {
                            Change::Rescheduled {
                                game: index,
                                missing,
                                never_started: false,
                            }
                        } else {
                            called(index, game, missing)
                        });
                    }
                }
            }
        }
        None
    }
}

fn readiness(state: &TournamentState, scheduler: &Scheduler, game: &Game) -> Readiness {
    if game.physical && !state.has_free_table() {
        return Readiness::NoTable;
    }
    let mut out = Vec::new();
    let mut waits = false;
    for &participant in &game.seats {
        if state.forfeits(game, participant) {
            out.push(participant);
        } else if !state.has_capacity(participant) {
            return Readiness::Busy(participant);
        } else if !scheduler.is_present(state, participant) {
            out.push(participant);
            waits = true;
        }
    }
    if waits {
        Readiness::Missing(out)
    } else {
        Readiness::Ready(out)
    }
}

/// Calls a game without the participants who forfeit it; voids it if nobody remains.
fn called(index: usize, game: &Game, forfeited: Vec<usize>) -> Change {
    if game.seats.iter().all(|who| forfeited.contains(who)) {
        return Change::Voided { game: index };
    }
    Change::Called {
        game: index,
        forfeited,
    }
}

/// Places participants who forfeited behind the others, by seat, and scores each place.
fn result(
    state: &TournamentState,
    game: &Game,
    shifts: u32,
    played: &[SeatStatistics],
) -> GameResult {
    let has_forfeited = |seat: usize| game.forfeited.contains(&game.seats[seat]);
    let mut order: Vec<usize> = (0..played.len()).collect();
    order.sort_by_key(|&seat| match has_forfeited(seat) {
        false => (false, played[seat].place, seat),
        true => (true, 0, seat),
    });
    let seats = game.seats.iter().enumerate().map(|(seat, &participant)| {
        let behind = order.iter().position(|&other| other == seat);
        let behind = behind.expect("every seat is in the order");
        let forfeited = has_forfeited(seat);
        SeatResult {
            participant,
            forfeited,
            score: if forfeited {
                0
            } else {
                let points = state.settings.points.get(behind);
                points.copied().unwrap_or_default()
            },
            statistics: SeatStatistics {
                place: behind + 1,
                // What the filler did on this seat is not attributed to the participant.
                ..if forfeited {
                    SeatStatistics::default()
                } else {
                    played[seat]
                }
            },
        }
    });
    GameResult {
        shifts,
        seats: seats.collect(),
    }
}
