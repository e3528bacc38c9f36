//! How games begin: seeds, hands, saved games. Why options are invalid stands here as well.

use std::sync::Arc;

use chefshat_agents::game_seed;
use chefshat_engine::{ActionError, ActionId, Game, Script, ScriptError, Seat, Seed};
use thiserror::Error;

use super::error::{StateError, StepError};
use super::history::MAX_HISTORY;
use super::saved::SavedGame;

/// The seeds of the games.
#[derive(Clone, Eq, PartialEq, Debug)]
pub enum Seeds {
    /// Game i has seed i of this base seed ([`game_seed`]).
    Base(u64),
    /// Game i has seed i modulo the length of the list, which is not empty.
    List(Arc<[Seed]>),
}

impl Seeds {
    pub(super) fn of(&self, index: u64) -> Seed {
        match self {
            Seeds::Base(base) => game_seed(*base, index),
            Seeds::List(seeds) => seeds[(index % seeds.len() as u64) as usize],
        }
    }
}

/// A scripted Shift, and actions that were taken in it.
#[derive(Clone, Eq, PartialEq, Debug)]
pub struct StartPoint {
    /// The start of the Shift.
    pub script: Script,
    /// The actions of all seats from there, in order. They do not end the Shift.
    pub actions: Vec<ActionId>,
}

/// The start of each game.
#[derive(Clone, Debug, Default)]
pub enum Start {
    /// A deal from the seed.
    #[default]
    Deal,
    /// A scripted Shift.
    Script(Box<Script>),
    /// A copy of a running game.
    Point {
        /// The game.
        game: Box<Game>,
        /// Whether later Shifts are dealt from this game's seed instead of each game's own.
        same_deals: bool,
    },
    /// Scripted Shifts with the actions that follow: the game with index i begins at the one at i
    /// modulo their number.
    Listed(Arc<[StartPoint]>),
    /// Copies of saved games: the game with index i is a copy of the saved game at i modulo their
    /// number.
    Saved {
        /// The games.
        games: Arc<[SavedGame]>,
        /// Whether a copy continues as the saved game would: with its seed, and its agents'
        /// generators where they were. A game that follows a copy of the same saved game then has
        /// the same deals again: limit the total number of games, or collect the statistics of one
        /// game each. Otherwise later Shifts are dealt and agents choose by each game's own seed.
        same_deals: bool,
    },
}

/// Why options are invalid.
#[derive(Clone, Eq, PartialEq, Debug, Error)]
pub enum SetupError {
    /// The number of entries is not the number of seats.
    #[error("{given} seats are filled, but the game has {players}")]
    Seats {
        /// Entries given.
        given: usize,
        /// Seats of the rule set.
        players: usize,
    },
    /// The client has no seat.
    #[error("the client plays no seat: give it at least one")]
    NoClient,
    /// A network is to play a seat of the client.
    #[error("the client plays seat {0}: a network plays only other seats")]
    ClientsSeat(Seat),
    /// A network was trained for other games. Players, faces, cards of a hand.
    #[error(
        "it is for {} players, {} faces and hands of {}, and these games have {} players, {} faces and hands of {}: use one that was trained under such rules",
        .trained[0], .trained[1], .trained[2], .here[0], .here[1], .here[2]
    )]
    UnfitNetwork {
        /// Those of the network.
        trained: [u8; 3],
        /// Those of the games.
        here: [u8; 3],
    },
    /// The number of games is 0.
    #[error("play at least 1 game")]
    NoGames,
    /// The total number of games is below the number of parallel games.
    #[error("{total} games in total are fewer than the {games} parallel games")]
    Total {
        /// Total number of games.
        total: u64,
        /// Parallel games.
        games: u32,
    },
    /// The list of seeds is empty.
    #[error("the list of seeds is empty: give at least one")]
    NoSeeds,
    /// The script is invalid.
    #[error("{0}")]
    Script(#[from] ScriptError),
    /// The history column is too wide.
    #[error("a history of {0} actions: choose at most {MAX_HISTORY}")]
    History(u16),
    /// The list of starts is empty.
    #[error("the list of starts is empty: give at least one")]
    NoStarts,
    /// A script of the list is invalid.
    #[error("start {entry}: {error}")]
    ListedScript {
        /// The start at fault, from 0.
        entry: usize,
        /// Why.
        error: ScriptError,
    },
    /// An action of the list is not legal.
    #[error("start {entry}, action {place} of its list: {error}")]
    ListedAction {
        /// The start at fault, from 0.
        entry: usize,
        /// The action at fault, from 0.
        place: usize,
        /// Why.
        error: ActionError,
    },
    /// An action of the list ends the Shift.
    #[error(
        "start {entry}, action {place} of its list ends the Shift: leave it and later ones out"
    )]
    ListedEnd {
        /// The start at fault, from 0.
        entry: usize,
        /// The action at fault, from 0.
        place: usize,
    },
    /// The list of saved games is empty.
    #[error("the list of saved games is empty: give at least one")]
    NoSaved,
    /// Copies of saved games cannot be recorded.
    #[error("copies of saved games cannot be recorded: leave records off")]
    SavedRecords,
    /// A game to be copied does not exist.
    #[error(transparent)]
    Copied(#[from] StepError),
    /// A saved game cannot be continued with these options.
    #[error("saved game {entry}: {error}")]
    Saved {
        /// The game at fault, from 0.
        entry: usize,
        /// Why.
        error: StateError,
    },
}
