//! The state of a game at a real table before its first stated Shift.

use chefshat_engine::{BySeat, SeatOrder, Seed};

/// The engine requires a seed, but deals nothing from it.
pub const NO_SEED: Seed = Seed([0; 32]);

/// The state of a game before its first stated Shift.
#[derive(Debug, Clone)]
pub struct StartState {
    /// Number of the first stated Shift.
    pub shift: u32,
    /// The order of the Shift before; `None` for the first.
    pub last_order: Option<SeatOrder>,
    /// Points before it.
    pub scores: BySeat<u32>,
}
