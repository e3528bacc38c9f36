//! Why steps and states are refused, in words for users.

use chefshat_engine::{ActionId, Seat};
use thiserror::Error;

use super::terms::Difference;

/// Version of the bytes of a state.
pub const STATE_VERSION: u16 = 1;
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
        "row {row} (game {game}, seat {seat}): action {} is not legal; choose one of the row's mask, or let such decisions be asked again (invalid_actions ASK_AGAIN; in Python invalid=\"ask_again\")",
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
    /// There is no such game.
    #[error("game {game} does not exist: the games are 0 to {last}")]
    NoGame {
        /// The game named.
        game: u32,
        /// The last game.
        last: u32,
    },
    /// Games are repeated or out of order.
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

/// Why states are refused. No game has changed.
#[derive(Clone, Eq, PartialEq, Debug, Error)]
pub enum StateError {
    /// The games do not exist or are out of order.
    #[error("{0}")]
    Games(#[from] StepError),
    /// There is not one state for each game.
    #[error("{states} states for {games} games: give one for each")]
    Count {
        /// Games named.
        games: usize,
        /// States given.
        states: usize,
    },
    /// The bytes are not a state.
    #[error("these bytes are not a state of a game: {0}")]
    Malformed(&'static str),
    /// The state is from another version of the format.
    #[error("the state has format version {0}; this program reads version {STATE_VERSION}")]
    Version(u16),
    /// The state is from games of another setup.
    #[error(transparent)]
    Differs(#[from] Difference),
    /// No game can have this state.
    #[error("{0}")]
    Impossible(#[from] chefshat_engine::StateError),
    /// The decisions kept for the record do not lead to the state.
    #[error("the decisions kept for the record do not lead to this state")]
    Record,
    /// The game of the state is over.
    #[error("the game of the state is over: fork games that are running")]
    Over,
    /// The game of the state waits for no decision of the client.
    #[error("the game waits for no decision: save it when it has a row in the batch")]
    NoDecision,
    /// The history does not reach back to the start of the Shift.
    #[error(
        "the state does not have all actions of the Shift: give the games a history that is wide enough, for instance of 512 actions; games that begin within a Shift have it from the next Shift on"
    )]
    HistoryTooShort,
}
