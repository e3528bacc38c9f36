//! What is legal. This file states the rules of a decision once: it derives a [`PlayRequirement`]
//! from the board and the rule set, and a turn is legal if it meets that and the hand holds its
//! cards. `crate::patterns` lists all legal turns by table look-up; a test compares its masks with
//! [`PlayRequirement::allows`] in random games, and with a second implementation of the rules.

use super::error::{ActionError, Refusal};
use super::{Game, Stage};
use crate::exchange::default_gift;
use crate::patterns::turn_mask;
use crate::{
    Action, ActionId, ActionSpace, Cards, Decision, ExchangePair, Face, GiftRequirement, Mask,
    Opening, PlayRequirement, Requirement, Seat,
};

impl Game {
    /// What the rules require of the open decision; `None` if the game has ended.
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

    #[inline(always)]
    fn play_requirement(&self) -> PlayRequirement {
        let (top, board) = (self.rules.faces(), self.state.board);
        let (opening, empty) = (self.state.is_first_turn(), board.face == 0);
        PlayRequirement {
            // §4.4: the first turn plays the top face, under the default rules the Golden card.
            lowest_face: if opening { top } else { 1 },
            // §4.3: a lower face than the board's, and at least as many cards. A lone joker counts
            // as face F+1.
            highest_face: if empty { top } else { board.face - 1 },
            fewest_cards: board.size.max(1),
            golden_card: opening && self.rules.opening() == Opening::Golden,
            // §4.2, §4.3: a joker alone only starts a pizza.
            lone_joker: empty && !opening,
            may_pass: self.pass_refusal().is_none(),
        }
    }

    /// Why the open turn may not be a pass (§4.4, §5.4); `None` if it may.
    #[inline]
    fn pass_refusal(&self) -> Option<Refusal> {
        let state = &self.state;
        if state.is_first_turn() && !self.rules.opening_pass() {
            Some(Refusal::MayNotPassFirst)
        } else if state.idle >= self.rules.max_idle_pizzas() {
            // The leader must play, which resets the count: no other seat meets this.
            Some(Refusal::MayNotPassIdle(state.idle))
        } else {
            None
        }
    }

    fn gift_requirement(&self, giver: Seat, chef_left: u8) -> GiftRequirement {
        let rank = usize::from(chef_left == 0);
        let pair = ExchangePair::of_rank(&self.ranking, rank).expect("the exchange is open");
        let number = self.gave[giver].len() + 1;
        // The hidden hand of the partner decides how many cards are given. The giver knows the
        // number if no hand can fall short of it, or if it is asked for the last gift there can be.
        let known = number == pair.size || pair.least_gifts(&self.rules) == pair.size;
        GiftRequirement {
            number,
            total: known.then_some(pair.size),
            receiver: pair.forced,
        }
    }

    /// Why an action does not answer the open decision, whatever the hand and the board.
    #[cold]
    pub(super) fn wrong_kind(&self, id: ActionId) -> ActionError {
        let space = self.rules.actions();
        match (self.decision(), space.decode(id)) {
            (None, _) => ActionError::GameOver,
            (Some(_), None) => ActionError::OutOfRange {
                action: id,
                size: space.size(),
            },
            (Some(Decision { kind, .. }), Some(attempted)) => {
                ActionError::WrongKind { attempted, kind }
            }
        }
    }

    /// Checks a turn of a seat. Always inlined: each caller checks one variant of the action, and
    /// the rest is compiled away.
    #[inline(always)]
    pub(super) fn check_turn(&self, seat: Seat, action: Action) -> Result<(), ActionError> {
        if self.hands[seat].holds(action) && self.play_requirement().allows(action) {
            Ok(())
        } else {
            Err(ActionError::not_legal(action, self.refusal(seat, action)))
        }
    }

    /// Checks a gift of a seat: it holds the card.
    pub(super) fn check_gift(&self, giver: Seat, gift: Action) -> Result<(), ActionError> {
        if self.hands[giver].holds(gift) {
            Ok(())
        } else {
            Err(ActionError::not_legal(gift, Refusal::NotInHand))
        }
    }

    /// Why a turn is not legal.
    #[cold]
    fn refusal(&self, seat: Seat, action: Action) -> Refusal {
        if !self.hands[seat].holds(action) {
            return Refusal::NotInHand;
        }
        let (required, board) = (self.play_requirement(), self.state.board);
        match action {
            Action::Pass => self.pass_refusal().expect("a pass is refused for a reason"),
            _ if required.is_opening() => {
                let face = Face::of(self.rules.faces());
                match self.rules.opening() {
                    Opening::Golden => Refusal::MustPlayGolden(face),
                    Opening::AnyTopFace => Refusal::MustPlayTopFace(face),
                }
            }
            Action::Play { face, .. } if face.get() <= required.highest_face => {
                Refusal::TooFewCards { board: board.size }
            }
            Action::Play { .. } => Refusal::FaceNotLower { board: board.face },
            _ => Refusal::JokerOnlyOpens,
        }
    }

    /// The legal actions of the open decision; none if the game has ended.
    #[inline]
    pub fn legal_actions(&self) -> Mask {
        match self.stage {
            Stage::Turn(seat) => self.legal_turns(seat),
            Stage::Exchange { giver, .. } => legal_gifts(self.hands[giver], self.rules.actions()),
            Stage::Special(_) => {
                let space = self.rules.actions();
                Mask::from_actions([space.decline(), space.declare()])
            }
            Stage::Over => Mask::EMPTY,
        }
    }

    #[inline]
    fn legal_turns(&self, seat: Seat) -> Mask {
        turn_mask(
            self.rules.faces(),
            &self.play_requirement(),
            self.hands[seat],
        )
    }

    /// The decision taken for a seat that does not answer (`docs/rules.md` §8.3): pass if that is
    /// legal, else the legal turn with the lowest index; give the highest plain face, else the
    /// Golden card, else a joker; decline. `None` if the game has ended.
    pub fn default_action(&self) -> Option<ActionId> {
        let space = self.rules.actions();
        match self.stage {
            Stage::Turn(_) if self.pass_refusal().is_none() => Some(space.pass()),
            Stage::Turn(seat) => self.legal_turns(seat).nth(0),
            Stage::Exchange { giver, .. } => Some(default_gift(self.hands[giver], space)),
            Stage::Special(_) => Some(space.decline()),
            Stage::Over => None,
        }
    }
}

fn legal_gifts(hand: Cards, space: ActionSpace) -> Mask {
    let mut mask = Mask::EMPTY;
    for face in (1..=space.faces()).map(Face::of) {
        if hand.count(face) > 0 {
            mask.insert(space.give(face).expect("a face of the deck"));
        }
    }
    if hand.jokers() > 0 {
        mask.insert(space.give_joker());
    }
    mask
}
