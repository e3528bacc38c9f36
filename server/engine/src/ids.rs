//! Newtypes for the numbers of the game: seats, faces and indices of actions.
//! [`crate::ActionSpace`] says what an index means.

use std::fmt;

use crate::{MAX_FACES, MAX_SEATS};

/// A position at the table, numbered from 0. The seat to the left of seat s is s+1 modulo N.
#[derive(Copy, Clone, Eq, PartialEq, Ord, PartialOrd, Hash, Debug, Default)]
pub struct Seat(u8);

impl Seat {
    /// The seat with this number.
    ///
    /// # Panics
    /// If `index` is not below [`MAX_SEATS`]. Check untrusted numbers against the number of players
    /// first.
    pub const fn new(index: usize) -> Seat {
        assert!(index < MAX_SEATS, "a seat's number is below MAX_SEATS");
        Seat(index as u8)
    }

    /// The seat's number, from 0.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

impl fmt::Display for Seat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// The face of a card, 1..=[`MAX_FACES`]. A lower face is rarer: face f is in the deck f times.
#[derive(Copy, Clone, Eq, PartialEq, Ord, PartialOrd, Hash, Debug)]
pub struct Face(u8);

impl Face {
    /// The face with this number, or `None` if it is not in 1..=[`MAX_FACES`].
    pub const fn new(number: u8) -> Option<Face> {
        if number >= 1 && number <= MAX_FACES {
            Some(Face(number))
        } else {
            None
        }
    }

    /// The face's number, 1..=[`MAX_FACES`].
    pub const fn get(self) -> u8 {
        self.0
    }

    /// A face whose number is known to be in range.
    pub(crate) const fn of(number: u8) -> Face {
        debug_assert!(number >= 1 && number <= MAX_FACES);
        Face(number)
    }
}

impl fmt::Display for Face {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// The index of an action in an [`crate::ActionSpace`], unchecked: it may be out of range.
#[derive(Copy, Clone, Eq, PartialEq, Ord, PartialOrd, Hash, Debug)]
pub struct ActionId(u16);

impl ActionId {
    /// Wraps an index.
    pub const fn new(index: u16) -> ActionId {
        ActionId(index)
    }

    /// The index.
    pub const fn index(self) -> u16 {
        self.0
    }
}

impl fmt::Display for ActionId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}
