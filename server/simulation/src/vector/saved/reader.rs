//! Reads numbers from bytes that may be anything: every read is checked, and no length is trusted.

use chefshat_engine::{BySeat, Seat};

use crate::vector::columns::NO_SEAT;
use crate::vector::error::StateError;
use crate::vector::opponent::Opponent;

/// Bytes not yet read.
pub(super) struct Reader<'a>(pub(super) &'a [u8]);

const CUT: StateError = StateError::Malformed("they are incomplete");

impl<'a> Reader<'a> {
    pub(super) fn take(&mut self, length: usize) -> Result<&'a [u8], StateError> {
        let (taken, rest) = self.0.split_at_checked(length).ok_or(CUT)?;
        self.0 = rest;
        Ok(taken)
    }

    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], StateError> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(CUT)?;
        self.0 = rest;
        Ok(*taken)
    }

    pub(super) fn u8(&mut self) -> Result<u8, StateError> {
        Ok(u8::from_le_bytes(self.array()?))
    }

    pub(super) fn u16(&mut self) -> Result<u16, StateError> {
        Ok(u16::from_le_bytes(self.array()?))
    }

    pub(super) fn u32(&mut self) -> Result<u32, StateError> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(super) fn u64(&mut self) -> Result<u64, StateError> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    pub(super) fn u128(&mut self) -> Result<u128, StateError> {
        Ok(u128::from_le_bytes(self.array()?))
    }

    pub(super) fn f32(&mut self) -> Result<f32, StateError> {
        let value = f32::from_le_bytes(self.array()?);
        finite(value.is_finite()).map(|()| value)
    }

    pub(super) fn f64(&mut self) -> Result<f64, StateError> {
        let value = f64::from_le_bytes(self.array()?);
        finite(value.is_finite()).map(|()| value)
    }

    pub(super) fn flag(&mut self) -> Result<bool, StateError> {
        match self.u8()? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(StateError::Malformed("a flag is neither 0 nor 1")),
        }
    }

    /// A number of items that follow, of at least `size` bytes each.
    pub(super) fn count(&mut self, size: usize) -> Result<usize, StateError> {
        let count = self.u32()? as usize;
        if count.saturating_mul(size) > self.0.len() {
            return Err(CUT);
        }
        Ok(count)
    }

    /// A text of at most 255 bytes.
    pub(super) fn text(&mut self) -> Result<&'a str, StateError> {
        let length = self.u8()?;
        let bytes = self.take(length.into())?;
        std::str::from_utf8(bytes).map_err(|_| StateError::Malformed("a name is not text"))
    }

    /// An agent; `None` if empty.
    pub(super) fn agent(&mut self) -> Result<Option<Opponent>, StateError> {
        let name = self.text()?;
        if name.is_empty() {
            return Ok(None);
        }
        let unknown = StateError::Malformed("an agent of this name is not built in");
        Opponent::from_text(name).map(Some).ok_or(unknown)
    }

    pub(super) fn seat(&mut self, players: usize) -> Result<Seat, StateError> {
        let index = usize::from(self.u8()?);
        if index >= players {
            return Err(StateError::Malformed("a seat does not exist"));
        }
        Ok(Seat::new(index))
    }

    /// A seat, or [`NO_SEAT`].
    pub(super) fn seat_or_none(&mut self, players: usize) -> Result<Option<Seat>, StateError> {
        if self.0.first() == Some(&NO_SEAT) {
            self.u8()?;
            return Ok(None);
        }
        self.seat(players).map(Some)
    }

    pub(super) fn by_seat<T: Copy + Default>(
        &mut self,
        players: usize,
        mut value: impl FnMut(&mut Self) -> Result<T, StateError>,
    ) -> Result<BySeat<T>, StateError> {
        let mut values = BySeat::filled(players, T::default());
        for seat in values.seats() {
            values[seat] = value(self)?;
        }
        Ok(values)
    }

    /// A value if a flag says that it follows.
    pub(super) fn optional<T>(
        &mut self,
        value: impl FnOnce(&mut Self) -> Result<T, StateError>,
    ) -> Result<Option<T>, StateError> {
        let follows = self.flag()?;
        follows.then(|| value(self)).transpose()
    }
}

fn finite(is_finite: bool) -> Result<(), StateError> {
    match is_finite {
        true => Ok(()),
        false => Err(StateError::Malformed("a number is not finite")),
    }
}
