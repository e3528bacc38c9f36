//! What the rules require of the open decision, as a value that can be shown to everyone who may
//! know that the decision is open: it follows from public facts and from no card in a hand. A
//! client that has it needs no rules of its own. How a game fills it in is in `game::legal`.

use crate::{Action, Seat, SpecialAction};

/// What the rules require of a decision.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub enum Requirement {
    /// A turn: what a play must be, and whether passing is allowed.
    Play(PlayRequirement),
    /// A gift of the exchange.
    Gift(GiftRequirement),
    /// The special action that may be declared or declined.
    SpecialAction(SpecialAction),
}

/// What a turn must be. A play is legal if it meets this and the hand holds its cards.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub struct PlayRequirement {
    /// The lowest face allowed: F on the Shift's first turn, 1 on all others.
    pub lowest_face: u8,
    /// The highest face allowed, 0..=F; 0 if no play beats the board.
    pub highest_face: u8,
    /// The fewest cards allowed, jokers included, at least 1.
    pub fewest_cards: u8,
    /// The play includes the Golden card. It is the first card of its face to be played on this
    /// turn, so every play of the required face includes it.
    pub golden_card: bool,
    /// Whether one joker may be played alone.
    pub lone_joker: bool,
    /// Whether passing is allowed.
    pub may_pass: bool,
}

impl PlayRequirement {
    /// Whether an action meets the requirement, whatever the hand holds. Only plays and passes do.
    pub fn allows(&self, action: Action) -> bool {
        match action {
            Action::Play {
                face,
                quantity,
                jokers,
            } => {
                (self.lowest_face..=self.highest_face).contains(&face.get())
                    && quantity + jokers >= self.fewest_cards
            }
            Action::LoneJoker => self.lone_joker,
            Action::Pass => self.may_pass,
            Action::Give(_) | Action::GiveJoker | Action::Decline | Action::Declare => false,
        }
    }
}

/// Which card of the exchange is due.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub struct GiftRequirement {
    /// Which of the seat's gifts this is, from 1.
    pub number: u8,
    /// How many cards the seat gives in all, 1 or 2; `None` while it may not know: its partner may
    /// hold too few ingredient cards, and it gives as many as it receives.
    pub total: Option<u8>,
    /// Who receives the card.
    pub receiver: Seat,
}
