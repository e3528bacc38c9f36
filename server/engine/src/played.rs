//! Decisions of recorded games, as values that agents, records and rooms share.

use crate::{ActionId, Mask, Observation, Seed};

/// A decision and the invalid attempts before it.
#[derive(Clone, Eq, PartialEq, Debug)]
pub struct PlayedDecision {
    /// The action.
    pub action: ActionId,
    /// Invalid attempts before it.
    pub attempts: Vec<ActionId>,
    /// Whether it is the default decision, taken after too many invalid attempts.
    pub by_default: bool,
}

/// One decision of a recorded player.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedDecision {
    /// What the seat knew.
    pub observation: Observation,
    /// The legal actions.
    pub legal: Mask,
    /// The action taken.
    pub action: ActionId,
    /// Whether the player decided. Otherwise the clock, too many invalid attempts or a substitute
    /// did: a replay repeats such a decision, but does not imitate it elsewhere.
    pub own: bool,
}

/// Consecutive decisions of a recorded game that a branch takes over.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TakenOver {
    /// The seed of every Shift that starts with or between these decisions.
    pub seed: Seed,
    /// The decisions.
    pub actions: Vec<ActionId>,
}
