//! The complete state of a game as a plain value, for those who keep games. `restore` leads to it
//! and back. Bytes are left to others.

use thiserror::Error;

use super::shift_state::{ShiftState, bit};
use crate::{Board, BySeat, Cards, RuleSet, Seat, SeatOrder, Seed, SpecialAction};

/// Where a game stands within a Shift.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub enum Stage {
    /// This seat was dealt two jokers and may declare a special action.
    Special(Seat),
    /// A seat gives a card.
    Exchange {
        /// The seat that gives.
        giver: Seat,
        /// Gifts that the Chef still gives, including this one.
        chef_left: u8,
        /// Gifts that the Sous-Chef still gives, including this one.
        sous_chef_left: u8,
    },
    /// This seat plays or passes.
    Turn(Seat),
    /// The game has ended.
    Over,
}

/// The complete state of a game, hidden cards and seed included. What follows from these values
/// (roles, the number of cards in each hand) is not repeated.
#[derive(Clone, Eq, PartialEq, Debug)]
pub struct GameState {
    /// The rule set.
    pub rules: RuleSet,
    /// The seed of the deals to come.
    pub seed: Seed,
    /// Number of the Shift, from 1.
    pub shift: u32,
    /// Where the game stands within the Shift.
    pub stage: Stage,
    /// The board.
    pub board: Board,
    /// Plays and passes in this Shift.
    pub turns: u32,
    /// Laps of this Shift; 0 before its first turn is open.
    pub laps: u32,
    /// Number of the pizza in this Shift; 0 before its first turn is open.
    pub pizza: u32,
    /// Consecutive pizzas that ended without a play.
    pub idle: u32,
    /// The seat that takes the Shift's first turn; seat 0 before that turn is open.
    pub starter: Seat,
    /// The seat that takes the pizza's first turn; seat 0 before the Shift's first turn is open.
    pub leader: Seat,
    /// The last seat to play in this pizza.
    pub last_to_play: Option<Seat>,
    /// Whether each seat has passed, as in [`crate::Observation::passed`].
    pub passed: BySeat<bool>,
    /// Place of each seat that has finished the Shift, from 1; 0 for the others.
    pub places: BySeat<u8>,
    /// The hands. A card given in the exchange is in no hand until the exchange is complete.
    pub hands: BySeat<Cards>,
    /// Cards played in this Shift, without the Golden card's flag.
    pub played: Cards,
    /// Cards that each seat gave in this Shift's exchange.
    pub gave: BySeat<Cards>,
    /// Cards that each seat received in this Shift's exchange.
    pub received: BySeat<Cards>,
    /// Points of each seat so far.
    pub scores: BySeat<u64>,
    /// The seats from Chef to Dishwasher; `None` in the first Shift. A Food Fight reverses it.
    pub ranking: Option<SeatOrder>,
    /// The special action declared in this Shift.
    pub special: Option<SpecialAction>,
    /// The seat drawn at the deal for [`Opening::AnyTopFace`].
    pub drawn: Option<Seat>,
    /// The order of the last Shift that this game has ended itself; `None` if it has ended none.
    pub last_order: Option<SeatOrder>,
}

/// Why a state is refused: no game can have it.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Error)]
#[error("no game can have this state: {0}")]
pub struct StateError(pub(crate) &'static str);

pub(super) fn ensure(holds: bool, otherwise: &'static str) -> Result<(), StateError> {
    if holds {
        Ok(())
    } else {
        Err(StateError(otherwise))
    }
}

impl GameState {
    /// Checks that there is one value for each seat, and that all seats exist.
    pub(super) fn check_seats(&self) -> Result<(), StateError> {
        let players = self.rules.players();
        let order = |order: Option<SeatOrder>| order.map_or(players, |order| order.len());
        let counts = [
            self.passed.len(),
            self.places.len(),
            self.hands.len(),
            self.gave.len(),
            self.received.len(),
            self.scores.len(),
            order(self.ranking),
            order(self.last_order),
        ];
        let each = counts.iter().all(|count| *count == players);
        ensure(each, "there is one value for each seat")?;
        let open = match self.stage {
            Stage::Special(seat) | Stage::Turn(seat) => Some(seat),
            Stage::Exchange { giver, .. } => Some(giver),
            Stage::Over => None,
        };
        let seats = [open, self.last_to_play, self.drawn];
        let named = seats.into_iter().flatten();
        let mut named = named.chain([self.starter, self.leader]);
        let exist = named.all(|seat| seat.index() < players);
        ensure(exist, "a seat does not exist")
    }

    /// The state of the Shift, with places in order.
    pub(super) fn shift_state(&self) -> Result<ShiftState, StateError> {
        let players = self.rules.players();
        let mut order = SeatOrder::EMPTY;
        for place in 1..=players as u8 {
            let found = self.places.iter().find(|(_, taken)| **taken == place);
            found.into_iter().for_each(|(seat, _)| order.push(seat));
        }
        let set = |seats: BySeat<bool>| {
            let members = seats.iter().filter(|(_, is_in)| **is_in);
            members.fold(0, |set, (seat, _)| set | bit(seat))
        };
        let state = ShiftState {
            board: self.board,
            turns: self.turns,
            laps: self.laps,
            pizza: self.pizza,
            idle: self.idle,
            starter: self.starter,
            leader: self.leader,
            last_to_play: self.last_to_play,
            holding: set(self.hands.map(|hand| !hand.is_empty())),
            passed: set(self.passed),
            places: self.places,
            order,
            players: players as u8,
        };
        let taken = self.places.values().filter(|place| **place > 0).count();
        let ordered = order.as_slice().iter().zip(1u8..);
        let gapless = taken == order.len()
            && ordered
                .into_iter()
                .all(|(&seat, place)| self.places[seat] == place);
        ensure(gapless, "places are taken from the first on, each once")?;
        Ok(state)
    }
}
