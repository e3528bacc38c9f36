//! Orders of seats: the places of a Shift and the final table of a game.

use std::fmt;

use crate::{BySeat, MAX_SEATS, Seat};

/// All seats of a game, best first: `as_slice()[p]` has place p+1.
#[derive(Copy, Clone)]
pub struct SeatOrder {
    seats: [Seat; MAX_SEATS],
    len: u8,
}

impl SeatOrder {
    pub(crate) const EMPTY: SeatOrder = SeatOrder {
        seats: [Seat::new(0); MAX_SEATS],
        len: 0,
    };

    /// Creates an order, or `None` unless the slice contains each of the seats 0..n once.
    pub fn from_slice(seats: &[Seat]) -> Option<SeatOrder> {
        let mut order = SeatOrder::EMPTY;
        for &seat in seats {
            if seat.index() >= seats.len() || order.as_slice().contains(&seat) {
                return None;
            }
            order.push(seat);
        }
        Some(order)
    }

    /// The seats, best first.
    pub fn as_slice(&self) -> &[Seat] {
        &self.seats[..usize::from(self.len)]
    }

    /// Number of seats.
    pub fn len(&self) -> usize {
        usize::from(self.len)
    }

    /// Whether there are no seats. Never true in an event.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The place of a seat, from 1, or `None` if it is not in the order.
    pub fn place_of(&self, seat: Seat) -> Option<u8> {
        self.as_slice()
            .iter()
            .position(|&other| other == seat)
            .map(|index| index as u8 + 1)
    }

    pub(crate) fn push(&mut self, seat: Seat) {
        self.seats[usize::from(self.len)] = seat;
        self.len += 1;
    }

    /// Reverses the order: the last seat becomes the first.
    pub fn reverse(&mut self) {
        self.seats[..usize::from(self.len)].reverse();
    }

    pub(crate) fn sort_by_key<K: Ord>(&mut self, key: impl FnMut(&Seat) -> K) {
        self.seats[..usize::from(self.len)].sort_by_key(key);
    }
}

impl PartialEq for SeatOrder {
    fn eq(&self, other: &SeatOrder) -> bool {
        self.as_slice() == other.as_slice()
    }
}

impl Eq for SeatOrder {}

impl fmt::Debug for SeatOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.as_slice()).finish()
    }
}

/// The final table of a game: most points first, ties broken by the better place in the last Shift.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub struct Standings {
    /// The seats, best first.
    pub order: SeatOrder,
    /// Points of each seat over the whole game.
    pub points: BySeat<u64>,
}

impl Standings {
    /// The seats, best first.
    pub fn as_slice(&self) -> &[Seat] {
        self.order.as_slice()
    }

    /// The winner of the game.
    pub fn winner(&self) -> Seat {
        self.as_slice()[0]
    }

    /// The rows of the table, best first: place from 1, seat, points.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (u8, Seat, u64)> {
        self.as_slice()
            .iter()
            .enumerate()
            .map(|(index, &seat)| (index as u8 + 1, seat, self.points[seat]))
    }
}
