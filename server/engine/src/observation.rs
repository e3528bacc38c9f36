//! What a seat may know of a game (`docs/rules.md` §8.4) as one value, and the paper's classic
//! vector. `game::view` fills it in. The mask of legal actions is separate
//! ([`crate::Game::legal_actions`]).

use crate::exchange::default_gift;
use crate::{ActionId, ActionSpace, Board, BySeat, Cards, DecisionKind, Mask, Role, Seat};

/// Everything that a seat may know at one moment. For a spectator `hand`, `gave` and `received` are
/// empty.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub struct Observation {
    /// The seat that observes; `None` for a spectator.
    pub seat: Option<Seat>,
    /// The kind of the decision that this seat has open, if any.
    pub kind: Option<DecisionKind>,
    /// Number of faces F of the deck.
    pub faces: u8,
    /// Cards dealt to a hand, H.
    pub hand_size: u8,
    /// Number of the Shift, from 1.
    pub shift: u32,
    /// Number of the pizza in its Shift, from 1; 0 before the Shift's first turn is open.
    pub pizza: u32,
    /// The seat's own hand.
    pub hand: Cards,
    /// The board.
    pub board: Board,
    /// The seat that played the cards on the board; `None` if it is empty.
    pub board_owner: Option<Seat>,
    /// Number of cards in each hand. A card given in the exchange leaves the hand at once.
    pub cards_left: BySeat<u8>,
    /// Whether each seat has passed in this pizza; with [`crate::PassScope::Turn`], since the last
    /// play.
    pub passed: BySeat<bool>,
    /// Place of each seat that has finished the Shift, from 1; 0 for the others.
    pub places: BySeat<u8>,
    /// The role of each seat; none in the first Shift.
    pub roles: BySeat<Option<Role>>,
    /// Points of each seat in the game so far.
    pub points: BySeat<u64>,
    /// Cards played so far in this Shift. Does not say whether the Golden card is one of them.
    pub played: Cards,
    /// Cards that the seat gave in this Shift's exchange so far.
    pub gave: Cards,
    /// Cards that the seat received in this Shift's exchange.
    pub received: Cards,
}

impl Observation {
    /// The default decision ([`crate::Game::default_action`], §8.3), from what the seat sees
    /// and its legal actions. `None` if the seat has no open decision or nothing is legal.
    pub fn default_action(&self, legal: &Mask) -> Option<ActionId> {
        let space = ActionSpace::of(self.faces);
        let default = match self.kind? {
            DecisionKind::Turn => space.pass(),
            DecisionKind::Exchange => default_gift(self.hand, space),
            DecisionKind::SpecialAction => space.decline(),
        };
        Some(default)
            .filter(|action| legal.contains(*action))
            .or(legal.nth(0))
    }

    /// Length of the classic vector: F + H + T, by default the paper's 228.
    pub fn classic_len(&self) -> usize {
        usize::from(self.faces)
            + usize::from(self.hand_size)
            + usize::from(ActionSpace::of(self.faces).turn_actions())
    }

    /// The paper's vector of numbers in 0..=1: the board (F slots: the cards ascending, jokers as
    /// F+1, truncated; F+2 in slot 0 if empty), the hand (H slots: ascending, zeros first), both
    /// divided by F+2, then the mask of a turn's actions as 0 and 1.
    pub fn classic_vector(&self, mask: &Mask) -> Vec<f32> {
        let mut vector = vec![0.0; self.classic_len()];
        self.write_classic_vector(mask, &mut vector);
        vector
    }

    /// Writes the classic vector into a buffer.
    ///
    /// # Panics
    /// If the length of `out` is not [`Observation::classic_len`].
    pub fn write_classic_vector(&self, mask: &Mask, out: &mut [f32]) {
        assert_eq!(
            out.len(),
            self.classic_len(),
            "the buffer has the length of the classic vector"
        );
        let scale = f32::from(self.faces + 2);
        let (board, rest) = out.split_at_mut(usize::from(self.faces));
        let (hand, actions) = rest.split_at_mut(usize::from(self.hand_size));

        board.fill(0.0);
        if self.board.face == 0 {
            board[0] = 1.0;
        }
        let quantity = self.board.size - self.board.jokers;
        for (slot, index) in board.iter_mut().zip(0..self.board.size) {
            let card = if index < quantity {
                self.board.face
            } else {
                self.faces + 1
            };
            *slot = f32::from(card) / scale;
        }

        // A hand never exceeds the cards dealt: the exchange gives as many as it takes.
        let zeros = hand.len().saturating_sub(usize::from(self.hand.len()));
        hand[..zeros].fill(0.0);
        for (slot, card) in hand[zeros..]
            .iter_mut()
            .zip(self.hand.ascending(self.faces))
        {
            *slot = f32::from(card) / scale;
        }

        for (chunk, &word) in actions.chunks_mut(64).zip(mask.words()) {
            for (bit, slot) in chunk.iter_mut().enumerate() {
                *slot = f32::from((word >> bit & 1) as u8);
            }
        }
    }
}
