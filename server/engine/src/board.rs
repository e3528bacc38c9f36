//! What lies on the board (`docs/rules.md` §4).

/// The play on the board.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Default)]
pub struct Board {
    /// The face, F+1 for a joker alone, 0 if the board is empty.
    pub face: u8,
    /// Number of cards, jokers included.
    pub size: u8,
    /// Number of jokers among them.
    pub jokers: u8,
}
