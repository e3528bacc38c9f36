//! Vector environments: many games of one client, stepped together. A step takes one action for
//! each open decision of the client, advances all games with built-in agents, and returns the next
//! open decisions as columns. `setup` has the options, `slot` advances one game, `blocks` all of
//! them, `columns` is the output, `situation` reads a row of it, `saved` has complete states of games,
//! `seen` what a seat knows there.
//!
//! A state is everything that determines how a game continues. It can be kept as a value or as
//! bytes, restored here or elsewhere, and forked:
//!
//! ```
//! use chefshat_engine::RuleSetSpec;
//! use chefshat_simulation::vector::{SavedGame, Seeds, VectorGames, VectorSetup};
//!
//! let rules = RuleSetSpec::default().validate()?;
//! let setup = VectorSetup::new(rules, 2, &[None; 4], Seeds::Base(7))?.with_history(64)?;
//! let (mut games, batch) = VectorGames::new(setup);
//! let bytes = games.save(&[1])?[0].to_bytes();
//! let (copies, first) = games.fork(&[1], 100, None)?;
//! assert_eq!((copies.setup().games(), first.rows), (100, 100));
//! let again = games.restore(&[1], vec![SavedGame::from_bytes(&bytes)?])?;
//! assert_eq!(again.masks, batch.masks);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod blocks;
mod columns;
mod error;
mod history;
mod opponent;
mod part;
mod running;
mod sampling;
mod saved;
mod seen;
mod setup;
mod situation;
mod slot;
mod start;
mod terms;
mod waiting;

use std::sync::Arc;

use chefshat_engine::ActionId;
use rayon::ThreadPool;

use blocks::Buffers;
pub use columns::{
    Batch, Beginnings, Endings, ObservationColumns, PlayedGame, Shifts, Totals, kind_number,
};
pub use error::{MAX_RECORDED, STATE_VERSION, StateError, StepError};
pub use history::MAX_HISTORY;
pub use opponent::Opponent;
use part::{OpenRow, Part};
pub use saved::SavedGame;
pub use seen::SeenShift;
pub use setup::{Episode, VectorSetup};
pub use situation::Situation;
use slot::Slot;
pub use start::{Seeds, SetupError, Start, StartPoint};
pub use terms::{Decisions, Difference, InvalidActions};

/// Leaves a decision open, in place of an action: the next batch has it again, unchanged. For a
/// client that decides for some seats first.
pub const LEAVE_OPEN: ActionId = ActionId::new(u16::MAX);

/// The games of one client.
#[derive(Debug)]
pub struct VectorGames {
    setup: VectorSetup,
    slots: Vec<Slot>,
    /// The rows of the last batch.
    open: Vec<OpenRow>,
    pool: Option<Arc<ThreadPool>>,
    /// Those of each block of games.
    buffers: Vec<Buffers>,
    totals: Totals,
    step: u64,
}

impl VectorGames {
    /// Begins all games and returns the first batch.
    pub fn new(setup: VectorSetup) -> (VectorGames, Batch) {
        VectorGames::on(setup, None)
    }

    /// As [`VectorGames::new`], stepped by a pool's threads where several are faster. The results
    /// are the same.
    pub fn on(setup: VectorSetup, pool: Option<Arc<ThreadPool>>) -> (VectorGames, Batch) {
        let mut games = VectorGames {
            slots: Vec::with_capacity(setup.games() as usize),
            open: Vec::new(),
            pool,
            buffers: Vec::new(),
            setup,
            totals: Totals::default(),
            step: 0,
        };
        let batch = games.begin_all();
        (games, batch)
    }

    /// Changes the pool, for a process that was forked and has none of its parent's threads.
    pub fn set_pool(&mut self, pool: Option<Arc<ThreadPool>>) {
        self.pool = pool;
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
        for (number, row) in (first..).zip(&self.open) {
            put(sampling::sample(&row.legal, seed, number));
        }
    }

    /// Takes one action for each row of the last batch, in order, and returns the next batch.
    /// [`LEAVE_OPEN`] takes none.
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
        let (setup, open) = (&self.setup, std::mem::take(&mut self.open));
        let every_game = open.len() == self.slots.len();
        let (pool, buffers, step) = (self.pool.as_ref(), &mut self.buffers, self.step);
        let part = blocks::run(&mut self.slots, setup, pool, buffers, step, |slot, part| {
            let game = slot.number();
            let row = match every_game {
                true => Some(game as usize),
                false => open.binary_search_by_key(&game, |row| row.game).ok(),
            };
            if let Some(row) = row
                && actions[row] != LEAVE_OPEN
            {
                slot.answer(actions[row], setup, part);
            }
            true
        });
        let batch = self.finished(part);
        if self.setup.keeps_records()
            && self.slots.iter().map(Slot::kept).sum::<u64>() > MAX_RECORDED
        {
            return Err(StepError::RecordsTooLong);
        }
        Ok(batch)
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
        self.check_games(games)?;
        Ok(self.begin_some(games))
    }

    /// The complete states of these games, in the order given.
    ///
    /// # Errors
    /// If there is no such game.
    pub fn save(&self, games: &[u32]) -> Result<Vec<SavedGame>, StepError> {
        let last = self.setup.games() - 1;
        let saved = games.iter().map(|&game| {
            let slot = self.slots.get(game as usize);
            let slot = slot.ok_or(StepError::NoGame { game, last })?;
            Ok(slot.save(&self.setup))
        });
        saved.collect()
    }

    /// Replaces these games, in ascending order, by saved ones. Each continues exactly as the saved
    /// game would, with its index, until its end; other agents than those saved continue from here,
    /// and play to the client's next decision. The game that follows has the index that is higher by
    /// the number of games here, and the seed that it has here. The batch contains all open decisions;
    /// a restored game has not begun anew, so it is not among the beginnings.
    ///
    /// # Errors
    /// If the games do not exist or are not ascending, or a state cannot be continued here. Then
    /// nothing has changed.
    pub fn restore(&mut self, games: &[u32], states: Vec<SavedGame>) -> Result<Batch, StateError> {
        self.check_games(games)?;
        if games.len() != states.len() {
            return Err(StateError::Count {
                games: games.len(),
                states: states.len(),
            });
        }
        states
            .iter()
            .try_for_each(|state| self.setup.check(state))?;
        let replaced = |game: u32| games.binary_search(&game).is_ok();
        let slots = (0..).zip(&self.slots).filter(|(game, _)| !replaced(*game));
        let kept: u64 = slots.map(|(_, slot)| slot.kept()).sum();
        if kept + states.iter().map(SavedGame::kept).sum::<u64>() > MAX_RECORDED {
            return Err(StepError::RecordsTooLong.into());
        }
        let terms = self.setup.terms();
        let mut taken_over = Vec::new();
        for (&game, mut state) in games.iter().zip(states) {
            if state.is_reseated(&terms) {
                state.reseat(&terms);
                taken_over.push(game);
            }
            self.slots[game as usize].restore(state);
        }
        Ok(self.advance_some(&taken_over, |_, _, _| {}))
    }

    /// `times` copies of each of these games as games of their own, with the first batch: game i is
    /// a copy of the one at i modulo the number of `games`. [`VectorSetup::forked`] explains
    /// `seeds`. These games are unchanged.
    ///
    /// # Errors
    /// If a game does not exist or is over, or there are no copies.
    pub fn fork(
        &self,
        games: &[u32],
        times: u32,
        seeds: Option<Seeds>,
    ) -> Result<(VectorGames, Batch), SetupError> {
        let setup = self.setup.forked(self.save(games)?, times, seeds)?;
        Ok(VectorGames::new(setup))
    }

    fn check_games(&self, games: &[u32]) -> Result<(), StepError> {
        let last = self.setup.games() - 1;
        if let Some(&game) = games.iter().find(|game| **game > last) {
            return Err(StepError::NoGame { game, last });
        }
        if let Some(pair) = games.windows(2).find(|pair| pair[0] >= pair[1]) {
            return Err(StepError::Order { game: pair[1] });
        }
        Ok(())
    }

    /// Restarts some games, in ascending order, with their next indices.
    fn begin_some(&mut self, games: &[u32]) -> Batch {
        self.advance_some(games, Slot::begin_next)
    }

    /// Advances some games, in ascending order, after `first`.
    fn advance_some(
        &mut self,
        games: &[u32],
        first: impl Fn(&mut Slot, &VectorSetup, &mut Part) + Sync,
    ) -> Batch {
        let setup = &self.setup;
        let (pool, buffers, step) = (self.pool.as_ref(), &mut self.buffers, self.step);
        let part = blocks::run(&mut self.slots, setup, pool, buffers, step, |slot, part| {
            let advances = games.binary_search(&slot.number()).is_ok();
            if advances {
                first(slot, setup, part);
            }
            advances
        });
        self.finished(part)
    }

    fn begin_all(&mut self) -> Batch {
        let setup = &self.setup;
        self.slots.clear();
        self.slots.extend((0..setup.games()).map(Slot::new));
        let (pool, buffers, step) = (self.pool.as_ref(), &mut self.buffers, self.step);
        let part = blocks::run(&mut self.slots, setup, pool, buffers, step, |slot, part| {
            slot.begin(setup, part);
            true
        });
        self.finished(part)
    }

    fn check(&self, actions: &[ActionId]) -> Result<(), StepError> {
        let answers = self.open.iter().zip(actions).enumerate();
        for (row, (open, &action)) in answers {
            if action != LEAVE_OPEN && !open.legal.contains(action) {
                return Err(StepError::Illegal {
                    row,
                    game: open.game,
                    seat: open.seat,
                    action,
                });
            }
        }
        Ok(())
    }

    fn finished(&mut self, part: Part) -> Batch {
        let mut batch = part.batch;
        self.step += 1;
        self.open = part.open;
        self.totals.add(&part.totals);
        batch.step = self.step;
        batch.done = self.open.is_empty() && self.slots.iter().all(Slot::is_over);
        batch.totals = self.totals;
        batch
    }
}
