//! What happens in a game, and the one place that decides what a viewer may see of it. Events of
//! rooms (somebody sat down, a connection was lost) do not live here.

use crate::{ActionId, BySeat, Cards, Role, Seat, SeatOrder, SpecialAction, Standings};

/// One thing that happened in a game. What only some viewers may see stands in fields that can be
/// left out ([`Event::seen_by`]); what must not even be known to have happened, such as a declined
/// special action, is no event. Large parts are boxed, so that the many small events stay small.
#[derive(Clone, Eq, PartialEq, Debug)]
pub enum Event {
    /// Cards were dealt.
    ShiftStarted {
        /// Number of the Shift, from 1.
        shift: u32,
        /// Private: each hand for its own seat.
        hands: Box<BySeat<Option<Cards>>>,
    },
    /// Roles were given, from the second Shift on, or reversed by a Food Fight.
    RolesAssigned {
        /// The role of each seat.
        roles: BySeat<Option<Role>>,
    },
    /// A special action was declared.
    SpecialActionDeclared {
        /// By whom.
        seat: Seat,
        /// Which.
        special: SpecialAction,
    },
    /// Cards went from one seat to another. Told when the whole exchange is complete.
    CardsExchanged {
        /// Who gave.
        giver: Seat,
        /// Who received.
        receiver: Seat,
        /// How many cards.
        count: u8,
        /// Private: which cards, for giver and receiver.
        cards: Option<Cards>,
    },
    /// A seat played.
    Played {
        /// The seat.
        seat: Seat,
        /// The action it took.
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
    /// A seat got rid of its last card.
    SeatFinished {
        /// The seat.
        seat: Seat,
        /// Its place in this Shift, from 1.
        place: u8,
    },
    /// A pizza was done, the board cleared, and another pizza of the same Shift follows.
    PizzaDone {
        /// Number of the pizza in its Shift, from 1.
        pizza: u32,
        /// Who played last; `None` if nobody played.
        last_to_play: Option<Seat>,
        /// Who leads the next pizza.
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

/// How a Shift ended.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub struct ShiftEnd {
    /// Number of the Shift, from 1.
    pub shift: u32,
    /// Seats by place.
    pub order: SeatOrder,
    /// How many seats got rid of their cards: those with the places 1..=finished. One less than
    /// there are seats, unless adjudicated.
    pub finished: u8,
    /// Points of this Shift.
    pub points: BySeat<u32>,
    /// Points of the game so far.
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

/// Who looks at a game.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub enum Viewer {
    /// The player on a seat.
    Seat(Seat),
    /// Somebody who sees what everybody may see.
    Spectator,
    /// Somebody who sees all hands, for instance the record.
    Everything,
}

impl Viewer {
    fn is(self, seat: Seat) -> bool {
        self == Viewer::Seat(seat)
    }
}

impl Event {
    /// The event as a viewer may see it: the same variant, private fields left out where they are
    /// not the viewer's.
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
            // Named one by one, so that a new event with a private field is not shown to everybody
            // by oversight.
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
