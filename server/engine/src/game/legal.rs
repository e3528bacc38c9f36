//! What is legal: as a mask of all legal actions, as the reason why a single one is not, and the
//! default decision. Mask and reason are written apart, for speed; a property test holds them
//! together.

use super::start::{CHEF_GIFTS, SOUS_CHEF_GIFTS};
use super::{Game, Refusal, Stage};
use crate::patterns::{PATTERNS, turn_mask};
use crate::{
    Action, ActionId, Cards, Face, GiftRequirement, Mask, Opening, PlayRequirement, Requirement,
    Seat,
};

impl Game {
    /// The legal actions of the open decision; none if the game has ended.
    #[inline]
    pub fn legal_actions(&self) -> Mask {
        match self.stage {
            Stage::Turn(seat) => self.legal_turns(seat),
            Stage::Exchange { giver, .. } => self.legal_gifts(giver),
            Stage::Special(_) => {
                let space = self.rules.actions();
                Mask::from_actions([space.decline(), space.declare()])
            }
            Stage::Over => Mask::EMPTY,
        }
    }

    /// The decision that is taken for a seat that takes none: pass if that is legal, else the
    /// lowest legal turn; give the highest plain face, else the Golden card, else a joker; decline.
    /// `None` if the game has ended.
    pub fn default_action(&self) -> Option<ActionId> {
        let space = self.rules.actions();
        match self.stage {
            Stage::Turn(seat) if self.check_pass().is_err() => self.legal_turns(seat).nth(0),
            Stage::Turn(_) => Some(space.pass()),
            Stage::Exchange { giver, .. } => Some(default_gift(self.hands[giver], space)),
            Stage::Special(_) => Some(space.decline()),
            Stage::Over => None,
        }
    }

    /// What the rules require of the open decision; `None` if the game has ended. It tells no card
    /// of any hand, so everyone who may know of the decision may see it.
    pub fn requirement(&self) -> Option<Requirement> {
        match self.stage {
            Stage::Turn(_) => Some(Requirement::Play(self.play_requirement())),
            Stage::Exchange {
                giver, chef_left, ..
            } => Some(Requirement::Gift(self.gift_requirement(giver, chef_left))),
            Stage::Special(seat) => Some(Requirement::SpecialAction(self.special_of(seat))),
            Stage::Over => None,
        }
    }

    fn play_requirement(&self) -> PlayRequirement {
        let (top, board) = (self.rules.faces(), self.table.board);
        let (opens, empty) = (self.table.is_first_turn(), board.face == 0);
        PlayRequirement {
            lowest_face: if opens { top } else { 1 },
            highest_face: if empty { top } else { board.face - 1 },
            fewest_cards: board.size.max(1),
            golden_card: opens && self.rules.opening() == Opening::Golden,
            lone_joker: empty && !opens,
            may_pass: self.check_pass().is_ok(),
        }
    }

    fn gift_requirement(&self, giver: Seat, chef_left: u8) -> GiftRequirement {
        let (rank, most) = if chef_left > 0 {
            (0, CHEF_GIFTS)
        } else {
            (1, SOUS_CHEF_GIFTS)
        };
        let number = self.gave[giver].len() + 1;
        // The partner's hand decides how many cards are given. It can fall short only if all jokers
        // of the deck leave too little room in it; that a last gift is due tells that it does not.
        let certain = number == most || self.rules.hand_size() >= most + self.rules.jokers();
        GiftRequirement {
            number,
            total: certain.then_some(most),
            receiver: self.ranked_from_last(rank),
        }
    }

    fn legal_turns(&self, seat: Seat) -> Mask {
        let (hand, table, faces) = (self.hands[seat], &self.table, self.rules.faces());
        let (jokers, size) = (hand.jokers(), table.board.size);
        // A face on the board, F+1 included, leaves the faces below it; an empty board all.
        let below = if table.board.face == 0 {
            faces + 1
        } else {
            table.board.face
        };
        let mut allowed = (1u64 << (4 * (below - 1))) - 1;
        if table.is_first_turn() {
            allowed = 0xF << (4 * (faces - 1));
        }
        let playable = hand.among_faces(allowed);
        let possible = playable.has_face_with_at_least(size.saturating_sub(jokers).max(1));
        let patterns = &PATTERNS[usize::from(jokers)][usize::from(size)];
        let lone_joker = size == 0 && jokers > 0 && !table.is_first_turn();
        turn_mask(
            faces,
            patterns,
            if possible { playable } else { Cards::EMPTY },
            lone_joker,
            self.check_pass().is_ok(),
        )
    }

    fn legal_gifts(&self, giver: Seat) -> Mask {
        let (hand, space) = (self.hands[giver], self.rules.actions());
        let mut mask = Mask::EMPTY;
        for face in (1..=self.rules.faces())
            .filter_map(Face::new)
            .filter(|&face| hand.count(face) > 0)
        {
            mask.insert(space.give(face).expect("a face of the deck"));
        }
        if hand.jokers() > 0 {
            mask.insert(space.give_joker());
        }
        mask
    }

    #[inline]
    pub(super) fn check_play(
        &self,
        seat: Seat,
        face: Face,
        quantity: u8,
        jokers: u8,
    ) -> Result<(), Refusal> {
        let (hand, table) = (self.hands[seat], &self.table);
        if hand.count(face) < quantity || hand.jokers() < jokers {
            return Err(Refusal::NotInHand);
        }
        if table.board.face != 0 {
            if face.get() >= table.board.face {
                return Err(Refusal::FaceNotLower {
                    board: table.board.face,
                });
            }
            if quantity + jokers < table.board.size {
                return Err(Refusal::TooFewCards {
                    board: table.board.size,
                });
            }
        }
        if table.is_first_turn() && face.get() != self.rules.faces() {
            Err(self.opening_refusal())
        } else {
            Ok(())
        }
    }

    pub(super) fn check_lone_joker(&self, seat: Seat) -> Result<(), Refusal> {
        if self.hands[seat].jokers() == 0 {
            Err(Refusal::NotInHand)
        } else if self.table.board.face != 0 {
            Err(Refusal::JokerOnlyOpens)
        } else if self.table.is_first_turn() {
            Err(self.opening_refusal())
        } else {
            Ok(())
        }
    }

    #[inline]
    pub(super) fn check_pass(&self) -> Result<(), Refusal> {
        let table = &self.table;
        if table.is_first_turn() && !self.rules.opening_pass() {
            Err(Refusal::MayNotPassFirst)
        } else if table.idle >= self.rules.max_idle_pizzas() {
            // The leader of a pizza after so many idle ones plays, which begins the count anew:
            // nobody else meets it.
            Err(Refusal::MayNotPassIdle(table.idle))
        } else {
            Ok(())
        }
    }

    pub(super) fn check_gift(&self, giver: Seat, gift: Action) -> Result<(), Refusal> {
        let hand = self.hands[giver];
        let held = match gift {
            Action::Give(face) => hand.count(face),
            _ => hand.jokers(),
        };
        if held > 0 {
            Ok(())
        } else {
            Err(Refusal::NotInHand)
        }
    }

    fn opening_refusal(&self) -> Refusal {
        let face = Face::of(self.rules.faces());
        match self.rules.opening() {
            Opening::Golden => Refusal::MustPlayGolden(face),
            Opening::AnyTopFace => Refusal::MustPlayTopFace(face),
        }
    }
}

/// Gives the highest plain face, else the Golden card, else a joker.
pub(crate) fn default_gift(hand: Cards, space: crate::ActionSpace) -> ActionId {
    let mut plain = hand;
    if hand.has_golden() {
        plain.remove_counts(space.faces(), 1, 0);
    }
    match plain.highest().or(hand.highest()) {
        Some(face) => space.give(face).expect("a face of the deck"),
        None => space.give_joker(),
    }
}
