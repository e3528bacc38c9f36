//! Events of a game, and the one place that decides what a viewer may see of them. Events of rooms
//! (a participant took a seat, a connection was lost) live elsewhere.

use crate::{ActionId, BySeat, Cards, Role, Seat, SeatOrder, SpecialAction, Standings};

/// An event of a game. Private content is in optional fields, which [`Event::seen_by`] removes.
/// Secret decisions, such as a declined special action, are not events. Large parts are boxed, so
/// that the many small events stay small.
#[derive(Clone, Eq, PartialEq, Debug)]
pub enum Event {
    /// Cards were dealt.
    ShiftStarted {
        /// Number of the Shift, from 1.
        shift: u32,
        /// Private to each seat: its hand.
        hands: Box<BySeat<Option<Cards>>>,
    },
    /// Roles were assigned, from the second Shift on, or reversed by a Food Fight.
    RolesAssigned {
        /// The role of each seat.
        roles: BySeat<Option<Role>>,
    },
    /// A special action was declared.
    SpecialActionDeclared {
        /// The seat that declared it.
        seat: Seat,
        /// The special action.
        special: SpecialAction,
    },
    /// A seat gave cards to another. Reported when the exchange is complete.
    CardsExchanged {
        /// The seat that gave.
        giver: Seat,
        /// The seat that received.
        receiver: Seat,
        /// Number of cards.
        count: u8,
        /// Private to giver and receiver: the cards.
        cards: Option<Cards>,
    },
    /// A seat played.
    Played {
        /// The seat.
        seat: Seat,
        /// The index of the action.
        action: ActionId,
        /// The face played, F+1 for a joker alone.
        face: u8,
        /// Cards of that face played, 0 for a joker alone.
        quantity: u8,
        /// Jokers played.
        jokers: u8,
        /// Cards left in its hand.
        cards_left: u8,
    },
    /// A seat passed.
    Passed {
        /// The seat.
        seat: Seat,
        /// Cards left in its hand.
        cards_left: u8,
    },
    /// A seat played its last card.
    SeatFinished {
        /// The seat.
        seat: Seat,
        /// Its place in this Shift, from 1.
        place: u8,
    },
    /// A pizza was done and the board was cleared. Another pizza of the same Shift follows.
    PizzaDone {
        /// Number of the pizza in its Shift, from 1.
        pizza: u32,
        /// The seat that played last; `None` if nobody played.
        last_to_play: Option<Seat>,
        /// The seat that leads the next pizza.
        next_leader: Seat,
    },
    /// The Shift ended.
    ShiftEnded(Box<ShiftEnd>),
    /// The game ended.
    GameEnded {
        /// The final table.
        standings: Box<Standings>,
    },
}

/// The end of a Shift.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub struct ShiftEnd {
    /// Number of the Shift, from 1.
    pub shift: u32,
    /// Seats by place.
    pub order: SeatOrder,
    /// Number of seats without cards, which have the places 1..=finished. N-1 unless adjudicated.
    pub finished: u8,
    /// Points of each seat in this Shift.
    pub points: BySeat<u32>,
    /// Points of each seat in the game so far, this Shift included.
    pub scores: BySeat<u64>,
    /// Seat that took the first turn.
    pub starter: Seat,
    /// Pizzas, the one in progress at the end included.
    pub pizzas: u32,
    /// Laps, the one in progress at the end included.
    pub laps: u32,
    /// Turns: plays and passes.
    pub turns: u32,
    /// The special action declared, if any.
    pub special: Option<SpecialAction>,
    /// Whether the Shift reached its limit of turns.
    pub adjudicated: bool,
}

/// Who views a game.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub enum Viewer {
    /// The player of a seat.
    Seat(Seat),
    /// Sees public information alone.
    Spectator,
    /// Sees everything, as the record does.
    Everything,
}

impl Viewer {
    fn is(self, seat: Seat) -> bool {
        self == Viewer::Seat(seat)
    }
}

impl Event {
    /// Redacts the event for a viewer: the same variant, without private fields of others.
    pub fn seen_by(&self, viewer: Viewer) -> Event {
        if viewer == Viewer::Everything {
            return self.clone();
        }
        match self.clone() {
            Event::ShiftStarted { shift, hands } => Event::ShiftStarted {
                shift,
                hands: Box::new(BySeat::from_fn(hands.len(), |seat| {
                    hands[seat].filter(|_| viewer.is(seat))
                })),
            },
            Event::CardsExchanged {
                giver,
                receiver,
                count,
                cards,
            } => Event::CardsExchanged {
                giver,
                receiver,
                count,
                cards: cards.filter(|_| viewer.is(giver) || viewer.is(receiver)),
            },
            // Listed one by one, so that a new event with a private field is not public by mistake.
            public @ (Event::RolesAssigned { .. }
            | Event::SpecialActionDeclared { .. }
            | Event::Played { .. }
            | Event::Passed { .. }
            | Event::SeatFinished { .. }
            | Event::PizzaDone { .. }
            | Event::ShiftEnded(_)
            | Event::GameEnded { .. }) => public,
        }
    }
}
