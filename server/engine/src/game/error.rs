//! Why an action is refused, in words for players.

use thiserror::Error;

use crate::DecisionKind;
use crate::{Action, ActionId, Face};

/// Why an action was refused. The game is unchanged.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Error)]
pub enum ActionError {
    /// The game has ended.
    #[error("the game has ended")]
    GameOver,
    /// There is no such action.
    #[error("action {action} does not exist: actions are numbered below {size}")]
    OutOfRange {
        /// The attempted action.
        action: ActionId,
        /// Number of actions.
        size: u16,
    },
    /// The action belongs to another kind of decision.
    #[error("`{attempted}` does not fit the open decision: {}", choices(*kind))]
    WrongKind {
        /// The attempted action.
        attempted: Action,
        /// The kind of the open decision.
        kind: DecisionKind,
    },
    /// The rules forbid the action now.
    #[error("`{attempted}` is not legal: {reason}")]
    NotLegal {
        /// The attempted action.
        attempted: Action,
        /// The reason.
        reason: Refusal,
    },
}

impl ActionError {
    pub(super) fn not_legal(attempted: Action, reason: Refusal) -> ActionError {
        ActionError::NotLegal { attempted, reason }
    }
}

fn choices(kind: DecisionKind) -> &'static str {
    match kind {
        DecisionKind::Turn => "play or pass",
        DecisionKind::Exchange => "give a card",
        DecisionKind::SpecialAction => "declare or decline the special action",
    }
}

fn last_pizzas(count: u32) -> String {
    match count {
        1 => "the last pizza".to_owned(),
        count => format!("the last {count} pizzas"),
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
    #[error("at least {board} cards must be played, the number on the board")]
    TooFewCards {
        /// Number of cards on the board.
        board: u8,
    },
    /// A joker alone beats nothing.
    #[error("a joker alone can only open a pizza")]
    JokerOnlyOpens,
    /// The Shift's first turn must play the Golden card.
    #[error("the Shift's first turn must play cards of face {0}, the Golden card among them")]
    MustPlayGolden(Face),
    /// The Shift's first turn must play the top face.
    #[error("the Shift's first turn must play cards of face {0}")]
    MustPlayTopFace(Face),
    /// The Shift's first turn must be a play.
    #[error("passing is not allowed on the Shift's first turn")]
    MayNotPassFirst,
    /// Too many consecutive pizzas ended without a play.
    #[error("passing is not allowed here: {} ended without a play", last_pizzas(*.0))]
    MayNotPassIdle(u32),
}
