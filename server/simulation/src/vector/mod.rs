//! Vector environments: many games of one client, stepped together. A step takes one action for
//! each open decision of the client, advances all games with built-in agents, and returns the next
//! open decisions as columns. `setup` has the options, `slot` advances one game, `columns` is the
//! output. There are no threads here; several environments can be stepped in parallel.

mod columns;
mod sampling;
mod setup;
mod slot;

use chefshat_engine::{ActionId, Seat};
use thiserror::Error;

pub use columns::{Batch, Beginnings, Endings, ObservationColumns, PlayedGame, Shifts, Totals};
pub use setup::{
    Decisions, Episode, InvalidActions, MAX_SEATS_PLAYED, Seeds, SetupError, Start, VectorSetup,
};
use slot::Slot;

/// Maximum number of decisions and invalid attempts of built-in agents within one step, over all
/// games: about a second. Games not advanced have no row and continue with the next step.
const MAX_WORK_PER_STEP: u64 = 10_000_000;
/// Maximum number of decisions and invalid attempts kept for records of running games: about 64 MB.
pub const MAX_RECORDED: u64 = 2_000_000;

/// Why a step fails. Except for `RecordsTooLong`, the games are unchanged.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Error)]
pub enum StepError {
    /// The number of actions is not the number of rows.
    #[error("{given} actions for a batch of {rows} rows: give one for each row, in the same order")]
    Actions {
        /// Actions given.
        given: usize,
        /// Rows of the batch.
        rows: usize,
    },
    /// An illegal action, if that is an error.
    #[error(
        "row {row} (game {game}, seat {seat}): action {} is not legal; choose one of the row's mask, or set invalid_actions to ASK_AGAIN",
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
    /// There is no such game to reset.
    #[error("game {game} does not exist: the games are 0 to {last}")]
    NoGame {
        /// The game named.
        game: u32,
        /// The last game.
        last: u32,
    },
    /// Games to reset are repeated or out of order.
    #[error("game {game} is repeated or out of order: list games ascending, each once")]
    Order {
        /// The game named.
        game: u32,
    },
    /// Records of running games exceed the limit. The games have advanced and cannot be used any
    /// more.
    #[error(
        "the records of running games exceed {MAX_RECORDED} decisions and invalid attempts: play fewer or shorter games at a time, or without records"
    )]
    RecordsTooLong,
}

/// The games of one client.
#[derive(Debug)]
pub struct VectorGames {
    setup: VectorSetup,
    slots: Vec<Slot>,
    /// The games of the last batch's rows.
    open: Vec<u32>,
    totals: Totals,
    step: u64,
}

impl VectorGames {
    /// Begins all games and returns the first batch.
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

    /// The options.
    pub fn setup(&self) -> &VectorSetup {
        &self.setup
    }

    /// Number of open decisions.
    pub fn rows(&self) -> usize {
        self.open.len()
    }

    /// Draws a legal action for each open decision, uniformly. Row i takes the draw `first + i` of
    /// the seed's sequence.
    pub fn sample(&self, seed: u64, first: u64, mut put: impl FnMut(ActionId)) {
        for (number, game) in (first..).zip(&self.open) {
            let legal = self.slots[*game as usize].legal();
            put(sampling::sample(
                legal.expect("the game has a row"),
                seed,
                number,
            ));
        }
    }

    /// Takes one action for each row of the last batch, in order, and returns the next batch.
    ///
    /// # Errors
    /// If there is not one action for each row, an action is illegal where that is an error, or
    /// records exceed the limit.
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
            slot.advance(&self.setup, &mut batch, &mut self.totals, &mut budget);
            if slot.write_row(&mut batch) {
                open.push(game);
            }
        }
        drop(answers);
        self.open = open;
        if self.setup.keeps_records()
            && self.slots.iter().map(Slot::kept).sum::<u64>() > MAX_RECORDED
        {
            return Err(StepError::RecordsTooLong);
        }
        Ok(self.finished(batch))
    }

    /// Restarts all games: with new seeds from index 0, without each with its next index.
    pub fn reset(&mut self, seeds: Option<Seeds>) -> Batch {
        let Some(seeds) = seeds else {
            let all: Vec<u32> = (0..self.setup.games()).collect();
            return self.begin_some(&all);
        };
        self.setup = self.setup.clone().with_seeds(seeds);
        self.begin_all()
    }

    /// Restarts some games, in ascending order, each with its next index. The batch contains all
    /// open decisions.
    ///
    /// # Errors
    /// If there is no such game, or the order is not ascending.
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

    /// Restarts some games, in ascending order, with their next indices.
    fn begin_some(&mut self, games: &[u32]) -> Batch {
        let mut batch = self.empty_batch();
        let mut budget = MAX_WORK_PER_STEP;
        self.open.clear();
        let mut restarted = games.iter().copied().peekable();
        for (game, slot) in (0..).zip(&mut self.slots) {
            if restarted.next_if_eq(&game).is_some() {
                slot.begin_next(&self.setup, &mut batch);
                slot.advance(&self.setup, &mut batch, &mut self.totals, &mut budget);
            }
            if slot.write_row(&mut batch) {
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
            slot.advance(&self.setup, &mut batch, &mut self.totals, &mut budget);
            if slot.write_row(&mut batch) {
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
