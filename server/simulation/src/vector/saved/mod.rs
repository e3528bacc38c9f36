//! Complete states of games: to continue them later, elsewhere, or several times. A state has
//! everything that determines how its game continues: the cards of all seats, seeds, pending
//! rewards, invalid attempts, statistics, kept decisions, and the positions of the built-in agents'
//! generators. It is for the client that owns the games, and for nobody who plays in them. `bytes`
//! is the portable form.

mod bytes;
mod game;
mod history;
mod reader;

use chefshat_engine::{Game, Seed};

use super::error::StateError;
use super::running::RunningGame;
use super::terms::Terms;

/// A game with everything that determines how it continues, hidden cards included. A clone is a
/// fork.
#[derive(Clone, Debug)]
pub struct SavedGame {
    terms: Terms,
    /// The game's index.
    index: u64,
    /// `None` once the last game of its sequence is over.
    running: Option<RunningGame>,
}

impl SavedGame {
    pub(super) fn new(terms: Terms, index: u64, running: Option<RunningGame>) -> SavedGame {
        SavedGame {
            terms,
            index,
            running,
        }
    }

    /// The game's index.
    pub fn index(&self) -> u64 {
        self.index
    }

    /// The game with the cards of all seats; `None` if it is over.
    pub fn game(&self) -> Option<&Game> {
        self.running.as_ref().map(|running| &running.game)
    }

    /// Number of decisions and attempts kept of the game.
    pub(super) fn kept(&self) -> u64 {
        self.running.as_ref().map_or(0, |running| running.kept)
    }

    /// The game; `None` if it is over.
    pub(super) fn running(&self) -> Option<&RunningGame> {
        self.running.as_ref()
    }

    /// Whether the seats are played by others than in the saved game.
    pub(super) fn is_reseated(&self, here: &Terms) -> bool {
        self.terms.agents != here.agents
    }

    /// Replaces the agents by those of these terms.
    pub(super) fn reseat(&mut self, here: &Terms) {
        if let Some(running) = &mut self.running {
            running.reseat(&self.terms, here);
        }
        self.terms.agents = here.agents;
    }

    /// The game as it is restored.
    pub(super) fn into_running(self) -> Option<RunningGame> {
        self.running
    }

    /// A copy that begins a game: without kept decisions; with a seed also with that seed's later
    /// deals and random choices.
    pub(super) fn begin(&self, seed: Option<Seed>) -> RunningGame {
        let running = self.running.as_ref();
        let mut copy = running
            .expect("the start of a game is a running one")
            .clone();
        if let Some(seed) = seed {
            copy.reseed(&self.terms, seed);
        }
        copy
    }

    /// Checks that the game can continue under these terms.
    pub(super) fn check(&self, here: &Terms) -> Result<(), StateError> {
        match self.terms.difference(here) {
            Some(difference) => Err(difference.into()),
            None => Ok(()),
        }
    }

    /// Whether the kept decisions lead from the start of the game to this state.
    pub(super) fn is_played_from(&self, start: impl FnOnce(Seed) -> Game) -> bool {
        let running = self.running.as_ref();
        running.is_none_or(|running| running.is_played_from(start(running.seed)))
    }

    /// Makes the state the start of games with these terms, which keep no records.
    ///
    /// # Errors
    /// If its game is over or cannot continue.
    pub(super) fn become_start(&mut self, terms: &Terms) -> Result<(), StateError> {
        let running = self.running.as_mut().ok_or(StateError::Over)?;
        running.forget_decisions();
        self.terms.records = false;
        self.check(terms)?;
        if self.is_reseated(terms) {
            self.reseat(terms);
        }
        Ok(())
    }
}
