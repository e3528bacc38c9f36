//! Decisions of games that were played before, as values that agents, records and rooms share.

use crate::{ActionId, Mask, Observation, Seed};

/// A decision that was taken, after the attempts that were refused.
#[derive(Clone, Eq, PartialEq, Debug)]
pub struct PlayedDecision {
    /// The action.
    pub action: ActionId,
    /// Invalid attempts before it.
    pub attempts: Vec<ActionId>,
    /// Whether it is the default, taken because there were too many of them.
    pub by_default: bool,
}

/// One decision of a recorded player.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedDecision {
    /// What its seat knew.
    pub observation: Observation,
    /// What was legal.
    pub legal: Mask,
    /// What was decided.
    pub action: ActionId,
    /// Whether the player decided it. Otherwise it was decided for the player (by the clock, after invalid attempts, by a substitute):
    /// that is repeated where it was decided, and is no model elsewhere.
    pub own: bool,
}

/// Decisions of a recorded game that followed each other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TakenOver {
    /// Deals every Shift that begins with or between these decisions.
    pub seed: Seed,
    /// The decisions.
    pub actions: Vec<ActionId>,
}
