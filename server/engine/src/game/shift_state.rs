//! The pizzas of one Shift (`docs/rules.md` §4): board, turn order, laps and places. Knows nothing
//! of hands, points or events.

use crate::{Board, BySeat, Seat, SeatOrder};

/// Bit of a seat in a set of seats.
pub(super) const fn bit(seat: Seat) -> u8 {
    1 << seat.index()
}

/// The public state of a Shift.
#[derive(Clone, Eq, PartialEq, Debug)]
pub(super) struct ShiftState {
    pub(super) board: Board,
    /// Plays and passes so far.
    pub(super) turns: u32,
    /// Laps so far (§8.7), from 1 once the first turn is open.
    pub(super) laps: u32,
    /// Number of the current pizza, from 1 once the first turn is open.
    pub(super) pizza: u32,
    /// Consecutive pizzas that ended without a play.
    pub(super) idle: u32,
    /// The seat that takes the Shift's first turn.
    pub(super) starter: Seat,
    /// The seat that takes the pizza's first turn.
    pub(super) leader: Seat,
    /// The last seat to play in this pizza.
    pub(super) last_to_play: Option<Seat>,
    /// Set of seats that hold cards.
    pub(super) holding: u8,
    /// Set of seats that have passed in this pizza, or since the last play if a pass counts for one
    /// turn only.
    pub(super) passed: u8,
    /// Place of each seat that has finished, from 1; 0 for the others.
    pub(super) places: BySeat<u8>,
    /// The seats that have finished, by place.
    pub(super) order: SeatOrder,
    pub(super) players: u8,
}

impl ShiftState {
    /// The state before the first turn.
    pub(super) fn new(players: usize) -> ShiftState {
        ShiftState {
            board: Board::default(),
            turns: 0,
            laps: 0,
            pizza: 0,
            idle: 0,
            starter: Seat::new(0),
            leader: Seat::new(0),
            last_to_play: None,
            holding: (1 << players) - 1,
            passed: 0,
            places: BySeat::filled(players, 0),
            order: SeatOrder::EMPTY,
            players: players as u8,
        }
    }

    /// Opens the Shift's first turn.
    pub(super) fn open(&mut self, starter: Seat) {
        self.starter = starter;
        self.leader = starter;
        self.laps = 1;
        self.pizza = 1;
    }

    /// Whether the Shift's first turn is still to be taken.
    pub(super) fn is_first_turn(&self) -> bool {
        self.turns == 0
    }

    /// Gives a seat the next free place.
    pub(super) fn finish(&mut self, seat: Seat) -> u8 {
        self.order.push(seat);
        self.holding &= !bit(seat);
        let place = self.order.len() as u8;
        self.places[seat] = place;
        place
    }

    /// The seats that may still add to this pizza, other than the last to play.
    pub(super) fn others_in_pizza(&self) -> u8 {
        self.holding & !self.passed & !self.last_to_play.map_or(0, bit)
    }

    /// The distance from a seat to the left to the next seat of a set that is not empty, 1..=N. The
    /// seat itself is a full circle away.
    pub(super) fn distance_left(&self, from: Seat, set: u8) -> u8 {
        let twice = u32::from(set) | u32::from(set) << self.players;
        (twice >> (from.index() + 1)).trailing_zeros() as u8 + 1
    }

    /// The seat at a distance to the left, 0..=N.
    pub(super) fn left_of(&self, from: Seat, distance: u8) -> Seat {
        let index = from.index() + usize::from(distance);
        let players = usize::from(self.players);
        Seat::new(if index >= players {
            index - players
        } else {
            index
        })
    }

    /// Moves the turn to the left by a distance. Counts a lap if it reaches or passes the starter.
    pub(super) fn move_turn(&mut self, from: Seat, distance: u8) -> Seat {
        if self.distance_left(from, bit(self.starter)) <= distance {
            self.laps += 1;
        }
        self.left_of(from, distance)
    }

    /// Clears the board for the next pizza and returns its leader (§4.6).
    pub(super) fn next_pizza(&mut self) -> Seat {
        let leader = match self.last_to_play {
            Some(seat) if self.holding & bit(seat) != 0 => seat,
            Some(seat) => self.left_of(seat, self.distance_left(seat, self.holding)),
            None => {
                self.idle += 1;
                self.left_of(self.leader, self.distance_left(self.leader, self.holding))
            }
        };
        self.board = Board::default();
        self.passed = 0;
        self.last_to_play = None;
        self.leader = leader;
        self.pizza += 1;
        leader
    }
}
