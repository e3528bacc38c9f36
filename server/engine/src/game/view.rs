//! Fills in observations. Only what is written here reaches an agent's observation.

use super::shift_state::bit;
use super::{Game, Stage};
use crate::{BySeat, Cards, Observation, Viewer};

impl Game {
    /// What a viewer may know now. Spectators get no hand, and neither does [`Viewer::Everything`].
    ///
    /// # Panics
    /// If the game has no such seat.
    #[inline]
    pub fn observe(&self, viewer: Viewer) -> Observation {
        let seat = match viewer {
            Viewer::Seat(seat) => Some(seat),
            Viewer::Spectator | Viewer::Everything => None,
        };
        let own = |cards: &BySeat<Cards>| {
            seat.map_or(Cards::EMPTY, |seat| cards.as_slice()[seat.index()])
        };
        let state = &self.state;
        Observation {
            seat,
            kind: self
                .decision()
                .filter(|decision| Some(decision.seat) == seat)
                .map(|decision| decision.kind),
            faces: self.rules.faces(),
            hand_size: self.rules.hand_size(),
            shift: self.shift,
            pizza: state.pizza,
            hand: own(&self.hands),
            board: state.board,
            board_owner: state.last_to_play,
            cards_left: self.cards_left,
            passed: BySeat::from_fn(self.rules.players(), |seat| state.passed & bit(seat) != 0),
            places: state.places,
            roles: self.roles,
            points: self.scores,
            played: self.played,
            gave: own(&self.gave),
            received: own(&self.received),
        }
    }

    /// Whether the open decision is a turn.
    pub(super) fn is_turn(&self) -> bool {
        matches!(self.stage, Stage::Turn(_))
    }
}
