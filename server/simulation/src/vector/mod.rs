//! Many games of one owner, stepped together: each step takes a decision in every game that waits for the owner, lets built-in agents go on
//! in all of them, and gives the decisions that wait then, in columns. How such games are asked for is in `setup`, how one of them goes in
//! `slot`, what a step gives in `columns`. Pure and without threads: several of these are stepped side by side.

mod columns;
mod setup;
mod slot;

use chefshat_engine::{ActionId, Seat};
use thiserror::Error;

pub use columns::{Batch, Beginnings, Endings, ObservationColumns, Shifts, Totals};
pub use setup::{Decisions, Episode, InvalidActions, Seeds, SetupError, Start, VectorSetup};
pub use slot::PlayedGame;
use slot::Slot;

/// Most seats that an owner plays: games times seats of each.
pub const MAX_SEATS_PLAYED: u32 = 16_384;
/// Decisions and invalid attempts of built-in agents within one step, in all games; those that are left have no row and go on with the
/// next. About a second.
const MAX_WORK_PER_STEP: u64 = 10_000_000;
/// Shifts that end in one game within one step before it is left for the next, but for one that the owner's answer ends.
const MAX_SHIFTS_PER_STEP: u64 = 2;
/// Decisions and invalid attempts that are kept for the records of games that go on: some 64 MB.
pub const MAX_KEPT: u64 = 2_000_000;

/// Why games were not stepped. Nothing has been moved then.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Error)]
pub enum StepError {
    /// Not one action for each row.
    #[error("{given} actions for a batch of {rows} rows: give one for each row, in the same order")]
    Actions {
        /// Actions given.
        given: usize,
        /// Rows of the batch.
        rows: usize,
    },
    /// An action that is not legal, where that is an error.
    #[error(
        "row {row} (game {game}, seat {seat}): action {} is not legal there; take one of the row's mask, or set invalid actions to be asked again",
        action.index()
    )]
    Illegal {
        /// The row, from 0.
        row: usize,
        /// Its game.
        game: u32,
        /// Its seat.
        seat: Seat,
        /// The action.
        action: ActionId,
    },
    /// A game to begin anew that there is not.
    #[error("there is no game {game}: the games are 0 to {last}")]
    NoGame {
        /// What was named.
        game: u32,
        /// The last game.
        last: u32,
    },
    /// Games to begin anew in another order, or twice.
    #[error("game {game} is named twice or out of order: name games ascending, each once")]
    Order {
        /// What was named.
        game: u32,
    },
    /// The games that go on have become too long for their records. They have been moved, and are of no use any more.
    #[error(
        "more than {MAX_KEPT} decisions and invalid attempts are kept of games that go on: play fewer or shorter games at a time, or without records"
    )]
    Kept,
}

/// Games of one owner.
#[derive(Debug)]
pub struct VectorGames {
    setup: VectorSetup,
    slots: Vec<Slot>,
    /// The games of the rows of the last batch.
    open: Vec<u32>,
    totals: Totals,
    step: u64,
}

impl VectorGames {
    /// Begins all games; the first batch comes with them.
    pub fn new(setup: VectorSetup) -> (VectorGames, Batch) {
        let mut games = VectorGames {
            slots: Vec::with_capacity(setup.games() as usize),
            open: Vec::with_capacity(setup.games() as usize),
            setup,
            totals: Totals::default(),
            step: 0,
        };
        let batch = games.begin_all();
        (games, batch)
    }

    /// What the games were asked for with.
    pub fn setup(&self) -> &VectorSetup {
        &self.setup
    }

    /// Takes a decision for each row of the last batch, in its order, and gives the next batch.
    ///
    /// # Errors
    /// If there is not one action for each row, or one is illegal where that is an error.
    pub fn step(&mut self, actions: &[ActionId]) -> Result<Batch, StepError> {
        if actions.len() != self.open.len() {
            return Err(StepError::Actions {
                given: actions.len(),
                rows: self.open.len(),
            });
        }
        if self.setup.invalid_actions() == InvalidActions::Error {
            self.check(actions)?;
        }
        let mut batch = self.empty_batch();
        let mut budget = MAX_WORK_PER_STEP;
        let mut answers = self.open.drain(..).zip(actions).peekable();
        let mut open = Vec::with_capacity(self.slots.len());
        for (game, slot) in (0..).zip(&mut self.slots) {
            if let Some((_, action)) = answers.next_if(|(answered, _)| *answered == game) {
                slot.answer(*action, &self.setup, &mut batch, &mut self.totals);
            }
            slot.go_on(&self.setup, &mut batch, &mut self.totals, &mut budget);
            if slot.put_row(&mut batch) {
                open.push(game);
            }
        }
        drop(answers);
        self.open = open;
        if self.setup.keeps_records() && self.slots.iter().map(Slot::kept).sum::<u64>() > MAX_KEPT {
            return Err(StepError::Kept);
        }
        Ok(self.finished(batch))
    }

    /// Gives up all games and begins them anew: with other seeds from the first, without each with its next index.
    pub fn reset(&mut self, seeds: Option<Seeds>) -> Batch {
        let Some(seeds) = seeds else {
            let all: Vec<u32> = (0..self.setup.games()).collect();
            return self.begin_some(&all);
        };
        self.setup = self.setup.clone().with_seeds(seeds);
        self.begin_all()
    }

    /// Gives up some games, named ascending, and begins them anew, each with its next index. The batch lists all that wait.
    ///
    /// # Errors
    /// If there is no such game, or the order is another.
    pub fn reset_some(&mut self, games: &[u32]) -> Result<Batch, StepError> {
        let last = self.setup.games() - 1;
        if let Some(&game) = games.iter().find(|game| **game > last) {
            return Err(StepError::NoGame { game, last });
        }
        if let Some(pair) = games.windows(2).find(|pair| pair[0] >= pair[1]) {
            return Err(StepError::Order { game: pair[1] });
        }
        Ok(self.begin_some(games))
    }

    /// Begins some games, ascending, with their next indices.
    fn begin_some(&mut self, games: &[u32]) -> Batch {
        let mut batch = self.empty_batch();
        let mut budget = MAX_WORK_PER_STEP;
        self.open.clear();
        let mut anew = games.iter().copied().peekable();
        for (game, slot) in (0..).zip(&mut self.slots) {
            if anew.next_if_eq(&game).is_some() {
                slot.begin_next(&self.setup, &mut batch);
                slot.go_on(&self.setup, &mut batch, &mut self.totals, &mut budget);
            }
            if slot.put_row(&mut batch) {
                self.open.push(game);
            }
        }
        self.finished(batch)
    }

    fn begin_all(&mut self) -> Batch {
        let mut batch = self.empty_batch();
        let mut budget = MAX_WORK_PER_STEP;
        self.slots.clear();
        self.open.clear();
        for game in 0..self.setup.games() {
            let mut slot = Slot::new(game, &self.setup, &mut batch);
            slot.go_on(&self.setup, &mut batch, &mut self.totals, &mut budget);
            if slot.put_row(&mut batch) {
                self.open.push(game);
            }
            self.slots.push(slot);
        }
        self.finished(batch)
    }

    fn check(&self, actions: &[ActionId]) -> Result<(), StepError> {
        let answers = self.open.iter().zip(actions).enumerate();
        for (row, (&game, &action)) in answers {
            let slot = &self.slots[game as usize];
            if let Some(seat) = slot.refuses(action) {
                return Err(StepError::Illegal {
                    row,
                    game,
                    seat,
                    action,
                });
            }
        }
        Ok(())
    }

    fn empty_batch(&self) -> Batch {
        Batch::new(&self.setup)
    }

    fn finished(&mut self, mut batch: Batch) -> Batch {
        self.step += 1;
        batch.step = self.step;
        batch.done = self.open.is_empty() && self.slots.iter().all(Slot::is_over);
        batch.totals = self.totals;
        batch
    }
}
