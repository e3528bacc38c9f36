//! The games of participants: which one comes next, with which condition, seed and seat. Rooms
//! belong to the server.

use crate::change::{Change, GameEnded, Outcome, Placed, PlacedGame};
use crate::stage::Task;
use crate::state::{Participant, PlayedGame, Status};
use crate::{Settings, Study};

/// Number of times that a game without a result is played.
pub const MAX_ATTEMPTS: u32 = 3;

/// A game that is to be played now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DueGame {
    /// Index of the condition.
    pub condition: usize,
    /// Whether it is practice.
    pub practice: bool,
    /// Index of its seed in the list of the condition if that has one, else of the study, and the
    /// seed; `None` for practice.
    pub seed: Option<(usize, [u8; 32])>,
    /// The participant's seat.
    pub seat: usize,
    /// Attempt at this game, from 1.
    pub attempt: u32,
}

/// Where a participant is who is to play.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Phase<'p> {
    /// A game is to be played.
    Due {
        /// Attempt at this game, from 1.
        attempt: u32,
    },
    /// It is being played.
    Playing(&'p PlayedGame),
    /// It has ended, and the participant has not continued.
    Over(&'p PlayedGame),
}

impl Phase<'_> {
    /// The phase of a participant whose step is practice or games.
    pub(crate) fn of(participant: &Participant) -> Phase<'_> {
        let Some(game) = participant.current_game().filter(|game| !game.continued) else {
            return Phase::Due { attempt: 1 };
        };
        let attempt = game.placed.attempt;
        match game.ended {
            None => Phase::Playing(game),
            // A test participant may have left it.
            Some((Outcome::Aborted, _)) if attempt < MAX_ATTEMPTS && !participant.test => {
                Phase::Due {
                    attempt: attempt + 1,
                }
            }
            Some(_) => Phase::Over(game),
        }
    }
}

/// How many seats after the first of a group the one with this index sits: as far apart as possible.
fn seats_apart(index: u32, size: u32, players: usize) -> usize {
    index as usize * players / size as usize
}

impl Settings {
    /// The seats of a group, or of a participant who plays alone, in a game of a condition in which the
    /// first of them sits here.
    pub fn seats_of_group(&self, condition: usize, first: usize) -> Vec<usize> {
        let (size, players) = (self.group_size(), self.conditions[condition].players);
        let seats = (0..size).map(|index| (first + seats_apart(index, size, players)) % players);
        seats.collect()
    }
}

impl Participant {
    /// Number of games of its step that it has continued from.
    pub(crate) fn games_done(&self) -> u32 {
        let step = self.step();
        let games = self.games.iter();
        games
            .filter(|game| game.continued && game.placed.step == step)
            .count() as u32
    }
}

impl Study {
    /// The game that a participant is to play now. It gets a room by [`Study::place`].
    pub fn due(&self, number: u32) -> Option<DueGame> {
        let participant = self.participant(number)?;
        if participant.status != Status::Active {
            return None;
        }
        let step = self.step_of(participant)?;
        let practice = match step.task {
            Task::Games { .. } => false,
            Task::Practice { .. } => true,
            _ => return None,
        };
        let Phase::Due { attempt } = Phase::of(participant) else {
            return None;
        };
        // Practice outside a block is the same for everybody, so that it reveals no condition.
        let elsewhere = if practice {
            0
        } else {
            self.sequence_of(participant)?[0]
        };
        let index = step.block.unwrap_or(elsewhere);
        let condition = &self.settings().conditions[index];
        let has_own = !condition.seeds.is_empty();
        let before = participant.games.iter().filter(|game| {
            let counts = game.continued && !game.placed.practice;
            counts && (!has_own || game.placed.condition == index)
        });
        let before = before.count();
        let seeds = if has_own {
            &condition.seeds
        } else {
            &self.settings().seeds
        };
        let (seed, rotated) = match practice {
            true => (None, 0),
            false => {
                let index = before % seeds.len();
                (Some((index, seeds[index])), before % condition.players)
            }
        };
        let seat = condition.participant_seat.unwrap_or(rotated);
        let offset = match practice {
            true => 0,
            false => self.offset_in_group(participant, condition.players),
        };
        Some(DueGame {
            condition: index,
            practice,
            seed,
            seat: (seat + offset) % condition.players,
            attempt,
        })
    }

    /// How many seats after the first of its group a participant sits.
    fn offset_in_group(&self, participant: &Participant, players: usize) -> usize {
        let size = self.settings().group_size();
        seats_apart(participant.slot.unwrap_or(0) % size, size, players)
    }

    /// The seats of all participants of a group, also of those who are missing, in a game that one of
    /// them plays; its own, if it plays alone.
    pub fn seats_of_group(&self, participant: &Participant, game: &PlacedGame) -> Vec<usize> {
        let players = self.settings().conditions[game.condition].players;
        if game.practice || participant.group.is_none() {
            return vec![game.seat];
        }
        let own = self.offset_in_group(participant, players);
        let first = (game.seat + players - own) % players;
        self.settings().seats_of_group(game.condition, first)
    }

    /// The room of the game that a test participant is playing.
    pub fn room_of_test(&self, number: u32) -> Option<[u8; 16]> {
        let participant = self.participant(number).filter(|it| it.test)?;
        match Phase::of(participant) {
            Phase::Playing(game) => Some(game.placed.room),
            Phase::Due { .. } | Phase::Over(_) => None,
        }
    }

    /// The changes by which the due game of a participant, and of all of its group, gets a room; none
    /// if no game is due, or it waits for somebody.
    pub fn place(&self, number: u32, room: [u8; 16], game: [u8; 16]) -> Vec<Change> {
        if self.due(number).is_none() || !self.late_for(number).is_empty() {
            return Vec::new();
        }
        let players = self.players_with(number).into_iter();
        players
            .filter_map(|number| self.placed(number, room, game))
            .collect()
    }

    fn placed(&self, number: u32, room: [u8; 16], game: [u8; 16]) -> Option<Change> {
        let due = self.due(number)?;
        let game = PlacedGame {
            step: self.participant(number)?.step(),
            condition: due.condition,
            practice: due.practice,
            seed_index: due.seed.map(|(index, _)| index),
            seat: due.seat,
            attempt: due.attempt,
            room,
            game,
        };
        Some(Change::Placed(Placed::new(number, &game)))
    }

    /// The change by which a participant's game ends; `None` if it is not its running game.
    pub fn game_ended(
        &self,
        number: u32,
        game: [u8; 16],
        outcome: Outcome,
        now_ms: u64,
    ) -> Option<Change> {
        let last = self.participant(number)?.games.last()?;
        let is_running = last.placed.game == game && last.ended.is_none();
        is_running.then_some(Change::GameEnded(GameEnded {
            number,
            at_ms: now_ms,
            finished: outcome == Outcome::Finished,
        }))
    }
}
