//! A decision that a game waits for, and what the rules require of it. `game::legal` derives the
//! requirement from the state of the game.

use crate::{Action, Seat, SpecialAction};

/// The kind of a decision.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub enum DecisionKind {
    /// Play or pass.
    Turn,
    /// Give one card in the exchange.
    Exchange,
    /// Declare the special action or decline.
    SpecialAction,
}

/// A decision that a game waits for.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub struct Decision {
    /// The seat that decides.
    pub seat: Seat,
    /// Its kind.
    pub kind: DecisionKind,
}

/// What the rules require of the open decision. It follows from public facts alone, so it reveals
/// no hidden card, and a client that has it needs no rules of its own.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub enum Requirement {
    /// A turn: what a play must be, and whether passing is legal.
    Play(PlayRequirement),
    /// A gift in the exchange.
    Gift(GiftRequirement),
    /// The special action that may be declared or declined.
    SpecialAction(SpecialAction),
}

/// What a turn must be (`docs/rules.md` §4.2 to §4.5). A play is legal if it meets this and the
/// hand holds its cards.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub struct PlayRequirement {
    /// The lowest face allowed: F on the Shift's first turn, 1 on all others.
    pub lowest_face: u8,
    /// The highest face allowed, 0..=F; 0 if no play beats the board.
    pub highest_face: u8,
    /// The fewest cards allowed, jokers included, at least 1.
    pub fewest_cards: u8,
    /// The play includes the Golden card. On the turn that requires it, the Golden card is played
    /// before all others of its face, so every play of that face includes it.
    pub golden_card: bool,
    /// Whether one joker may be played alone.
    pub lone_joker: bool,
    /// Whether passing is legal.
    pub may_pass: bool,
}

impl PlayRequirement {
    /// Whether the rules allow an action at this turn to a hand that holds its cards. Only plays
    /// and passes are turns.
    #[inline]
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

    /// Whether this is the Shift's first turn.
    pub fn is_opening(&self) -> bool {
        self.lowest_face > 1
    }
}

/// Which gift of the exchange is due (`docs/rules.md` §3.4). Any card of the hand may be given.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub struct GiftRequirement {
    /// Which of the seat's gifts this is, from 1.
    pub number: u8,
    /// How many cards the seat gives in all, 1 or 2. `None` while the seat may not know: with very
    /// small hands its partner may hold too few ingredient cards, and both give the same number.
    pub total: Option<u8>,
    /// The seat that receives the card.
    pub receiver: Seat,
}
