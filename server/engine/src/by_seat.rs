//! One value for each seat of a game.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::ops::{Index, IndexMut};

use crate::{MAX_SEATS, Seat};

/// One value for each seat of a game. Has a fixed size, is copied and never allocates. Comparing,
/// hashing and formatting use only the seats that the game has.
#[derive(Copy, Clone)]
pub struct BySeat<T> {
    values: [T; MAX_SEATS],
    len: u8,
}

impl<T: Copy + Default> BySeat<T> {
    /// `players` values, each computed from its seat.
    ///
    /// # Panics
    /// If `players` is above [`MAX_SEATS`].
    pub fn from_fn(players: usize, mut value: impl FnMut(Seat) -> T) -> BySeat<T> {
        assert!(players <= MAX_SEATS, "a game has at most MAX_SEATS seats");
        let mut values = [T::default(); MAX_SEATS];
        for (index, slot) in values.iter_mut().enumerate().take(players) {
            *slot = value(Seat::new(index));
        }
        BySeat {
            values,
            len: players as u8,
        }
    }

    /// The same value for each of `players` seats.
    ///
    /// # Panics
    /// If `players` is above [`MAX_SEATS`].
    pub fn filled(players: usize, value: T) -> BySeat<T> {
        assert!(players <= MAX_SEATS, "a game has at most MAX_SEATS seats");
        BySeat {
            values: [value; MAX_SEATS],
            len: players as u8,
        }
    }

    /// The values of a slice, index = seat, or `None` if there are more than [`MAX_SEATS`].
    pub fn from_slice(values: &[T]) -> Option<BySeat<T>> {
        (values.len() <= MAX_SEATS)
            .then(|| BySeat::from_fn(values.len(), |seat| values[seat.index()]))
    }

    /// The same seats with other values.
    pub fn map<U: Copy + Default>(&self, mut value: impl FnMut(T) -> U) -> BySeat<U> {
        BySeat::from_fn(self.len(), |seat| value(self[seat]))
    }
}

impl<T> BySeat<T> {
    /// Number of seats.
    pub fn len(&self) -> usize {
        usize::from(self.len)
    }

    /// Whether there are no seats. Never true in a game.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The values, index = seat.
    pub fn as_slice(&self) -> &[T] {
        &self.values[..self.len()]
    }

    /// The seats and their values, in the order of the seats.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = (Seat, &T)> + ExactSizeIterator {
        self.as_slice()
            .iter()
            .enumerate()
            .map(|(index, value)| (Seat::new(index), value))
    }

    /// The values in the order of the seats.
    pub fn values(&self) -> std::slice::Iter<'_, T> {
        self.as_slice().iter()
    }

    /// The seats, ascending.
    pub fn seats(&self) -> impl DoubleEndedIterator<Item = Seat> + ExactSizeIterator + use<T> {
        (0..self.len()).map(Seat::new)
    }

    /// The value of a seat, or `None` if the game has no such seat.
    pub fn get(&self, seat: Seat) -> Option<&T> {
        self.as_slice().get(seat.index())
    }
}

impl<T> Index<Seat> for BySeat<T> {
    type Output = T;

    fn index(&self, seat: Seat) -> &T {
        &self.values[seat.index()]
    }
}

impl<T> IndexMut<Seat> for BySeat<T> {
    fn index_mut(&mut self, seat: Seat) -> &mut T {
        &mut self.values[seat.index()]
    }
}

impl<T: PartialEq> PartialEq for BySeat<T> {
    fn eq(&self, other: &BySeat<T>) -> bool {
        self.as_slice() == other.as_slice()
    }
}

impl<T: Eq> Eq for BySeat<T> {}

impl<T: Hash> Hash for BySeat<T> {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.as_slice().hash(state);
    }
}

impl<T: fmt::Debug> fmt::Debug for BySeat<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.as_slice()).finish()
    }
}
