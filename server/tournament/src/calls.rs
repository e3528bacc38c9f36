//! What follows when: which game is called, who is waited for and how long, what comes of a game that ended, when the next round is drawn.
//! What a change does is in `course`; how a round is drawn in `draw`.
//!
//! A game is called when all its participants are present and have a free place, in the order of the schedule. If nothing but absent ones
//! hold it up, it waits for them for the no-show time; that counts as a call, and the game waits again, after the others. On the last
//! call it is played without them. If somebody does not sit down although the last call was heard, the game is called once more without
//! them; others who are absent then are waited for as before. A game that nobody would come to, or that was aborted on its last call, is
//! given up. Which games are looked at is in `floor`.

#[cfg(test)]
mod tests;

use super::Tournament;
use super::change::{Change, Ended, Game, GameResult, GameState, SeatPlayed, SeatResult};
use super::course::{Course, State};
use super::floor::Floor;

/// What is to be done about a game that is due.
enum Readiness {
    /// This participant plays elsewhere.
    Busy(usize),
    /// These have not come or forfeit it, and nothing else holds it up.
    Missing(Vec<usize>),
    /// It can be played; these forfeit it.
    Ready(Vec<usize>),
}

impl Tournament {
    /// Says whether a participant is present: can be seated in games at once. Built-in ones always are. A game's wait
    /// begins anew when all of its participants were there: whoever comes and goes does not spare those who do not come at all.
    pub fn set_present(&mut self, participant: usize, present: bool) {
        let Tournament { course, floor, .. } = self;
        if participant >= course.participants.len() {
            return;
        }
        floor.set_present(course, participant, present);
    }

    /// Whether a participant is present.
    pub fn is_present(&self, participant: usize) -> bool {
        participant < self.course.participants.len()
            && self.floor.is_present(&self.course, participant)
    }

    /// The next change that follows at this time, in milliseconds of any steady clock. Whoever asks folds it and asks again, until there is
    /// none; then again after every other change, and at [`Tournament::wake_at`].
    pub fn next(&mut self, now_ms: u64) -> Option<Change> {
        match self.course.state {
            State::Open => {
                let enough = self.course.settings.start_when_joined?;
                (self.joined() >= enough).then(|| self.beginning())?
            }
            State::Playing => {
                if let Some(change) = self.drawing() {
                    return Some(change);
                }
                if self.course.is_round_over() && self.course.drawn >= self.course.rounds {
                    return Some(Change::Finished);
                }
                self.next_game(now_ms)
            }
            State::Finished | State::Closed => None,
        }
    }

    /// When [`Tournament::next`] is to be asked again although nothing has happened, on the same clock.
    pub fn wake_at(&self) -> Option<u64> {
        self.floor.wake_at(&self.course)
    }

    /// What follows from the end of a game that was called; `None` if it is not being played.
    pub fn ended(&self, game: usize, ended: Ended) -> Option<Change> {
        let course = &self.course;
        let played = course.games.get(game)?;
        if played.state != GameState::Playing {
            return None;
        }
        let is_last_call = played.calls >= course.settings.max_calls;
        let missing = match ended {
            Ended::Played { shifts, seats } if seats.len() == played.seats.len() => {
                let result = result(course, played, shifts, &seats);
                return Some(Change::Counted { game, result });
            }
            Ended::NeverStarted { missing } => missing
                .into_iter()
                .filter(|who| played.seats.contains(who) && !played.forfeited.contains(who))
                .collect(),
            // A result of other seats is none.
            Ended::Played { .. } | Ended::Aborted => Vec::new(),
        };
        // If somebody did not come to the last call, the game is called once more without them.
        Some(if is_last_call && missing.is_empty() {
            Change::Voided { game }
        } else {
            Change::Rescheduled { game, missing }
        })
    }

    /// The change that closes it; `None` if it is over.
    pub fn close(&self) -> Option<Change> {
        (!self.course.state.is_over()).then_some(Change::Closed)
    }

    /// Looks at the games that may have to change, in order, until one of them has to.
    fn next_game(&mut self, now_ms: u64) -> Option<Change> {
        let Tournament { course, floor, .. } = self;
        if !floor.is_open(course, now_ms) {
            return None;
        }
        while let Some(due) = floor.next(course, now_ms) {
            let (_, index) = due;
            let game = &course.games[index];
            match readiness(course, floor, game) {
                Readiness::Busy(by) => floor.hold_up(course, due, by),
                Readiness::Ready(forfeited) => return Some(called(index, game, forfeited)),
                Readiness::Missing(missing) => {
                    if floor.has_waited(course, due, now_ms) {
                        return Some(if game.calls + 1 < course.settings.max_calls {
                            Change::Rescheduled {
                                game: index,
                                missing,
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

fn readiness(course: &Course, floor: &Floor, game: &Game) -> Readiness {
    let mut out = Vec::new();
    let mut waits = false;
    for &participant in &game.seats {
        if course.forfeits(game, participant) {
            out.push(participant);
        } else if !course.has_place(participant) {
            return Readiness::Busy(participant);
        } else if !floor.is_present(course, participant) {
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

/// A game is played without those who forfeit it, if anybody is left.
fn called(index: usize, game: &Game, forfeited: Vec<usize>) -> Change {
    if game.seats.iter().all(|who| forfeited.contains(who)) {
        return Change::Voided { game: index };
    }
    Change::Called {
        game: index,
        forfeited,
    }
}

/// Places those who forfeited behind the others, in the order of their seats, and says what each place is worth.
fn result(course: &Course, game: &Game, shifts: u32, played: &[SeatPlayed]) -> GameResult {
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
                let points = course.settings.points.get(behind);
                points.copied().unwrap_or_default()
            },
            did: SeatPlayed {
                place: behind + 1,
                // What the filler did in its place is nothing of its own.
                ..if forfeited {
                    SeatPlayed::default()
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
