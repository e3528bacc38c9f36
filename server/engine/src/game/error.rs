//! Why an action is not taken, in words that a player understands.

use thiserror::Error;

use super::DecisionKind;
use crate::{Action, ActionId, Face};

/// Why an action was not taken. The game is as it was.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Error)]
pub enum ActionError {
    /// There is nothing left to decide.
    #[error("the game has ended")]
    GameOver,
    /// There is no such action.
    #[error("action {action} does not exist: actions are numbered below {size}")]
    OutOfRange {
        /// The action attempted.
        action: ActionId,
        /// Number of actions.
        size: u16,
    },
    /// The action belongs to another kind of decision.
    #[error("`{attempted}` is no answer to {}", question(*kind))]
    WrongKind {
        /// The action attempted.
        attempted: Action,
        /// The kind of decision that is open.
        kind: DecisionKind,
    },
    /// The rules forbid it now.
    #[error("`{attempted}` is not legal: {reason}")]
    NotLegal {
        /// The action attempted.
        attempted: Action,
        /// Why it is forbidden.
        reason: Refusal,
    },
}

impl ActionError {
    pub(super) fn not_legal(attempted: Action, reason: Refusal) -> ActionError {
        ActionError::NotLegal { attempted, reason }
    }
}

fn question(kind: DecisionKind) -> &'static str {
    match kind {
        DecisionKind::Turn => "a turn: play or pass",
        DecisionKind::Exchange => "the exchange: give a card",
        DecisionKind::SpecialAction => "the offer of a special action: declare or decline",
    }
}

/// Why the rules forbid an action of the right kind.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug, Error)]
pub enum Refusal {
    /// The hand does not hold the cards.
    #[error("the hand does not hold these cards")]
    NotInHand,
    /// The face is not lower than the one on the board.
    #[error("the face must be lower than the {board} on the board")]
    FaceNotLower {
        /// Face on the board, F+1 for a joker alone.
        board: u8,
    },
    /// The play is smaller than the one on the board.
    #[error("at least {board} cards must be played, as many as lie on the board")]
    TooFewCards {
        /// Number of cards on the board.
        board: u8,
    },
    /// A joker alone cannot beat anything.
    #[error("a joker alone can only open a pizza")]
    JokerOnlyOpens,
    /// The Shift opens with the Golden card.
    #[error("the Shift's first turn must play the Golden card, so cards of face {0}")]
    MustPlayGolden(Face),
    /// The Shift opens with the top face.
    #[error("the Shift's first turn must play cards of face {0}")]
    MustPlayTopFace(Face),
    /// The Shift's first turn is a play.
    #[error("passing is not allowed on the Shift's first turn")]
    MayNotPassFirst,
    /// Too many pizzas in a row have ended without a play.
    #[error("passing is not allowed here: the last {0} pizzas ended without a play")]
    MayNotPassIdle(u32),
}
