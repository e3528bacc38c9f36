//! The cells of one row: taken by the name of their column, with the words for those that make no sense.

use std::collections::BTreeMap;
use std::num::{IntErrorKind, ParseIntError};
use std::str::FromStr;

use super::TranscriptError;

/// The longest time a transcript may name, seconds: a hundred days.
const MAX_SECONDS: f64 = 8_640_000.0;

/// The cells of a row by column, those that are not empty.
pub(super) struct Cells<'a> {
    pub(super) line: usize,
    pub(super) cells: BTreeMap<&'a str, &'a str>,
}

impl<'a> Cells<'a> {
    pub(super) fn wrong(&self, problem: impl Into<String>) -> TranscriptError {
        TranscriptError {
            line: self.line,
            problem: problem.into(),
        }
    }

    pub(super) fn need(&self, column: &str) -> Result<&'a str, TranscriptError> {
        self.cells
            .get(column)
            .copied()
            .ok_or_else(|| self.wrong(format!("`{column}` is empty")))
    }

    /// A whole number that is not below zero.
    pub(super) fn number<T>(&self, column: &str) -> Result<T, TranscriptError>
    where
        T: FromStr<Err = ParseIntError>,
    {
        let text = self.need(column)?;
        text.parse()
            .map_err(|error: ParseIntError| match error.kind() {
                IntErrorKind::PosOverflow => {
                    self.wrong(format!("`{column}` is {text}, which is too large"))
                }
                _ => self.wrong(format!("`{column}` is {text:?} and must be a whole number")),
            })
    }

    pub(super) fn float(&self, column: &str) -> Result<Option<f64>, TranscriptError> {
        let Some(text) = self.cells.get(column) else {
            return Ok(None);
        };
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        number
            .map(Some)
            .ok_or_else(|| self.wrong(format!("`{column}` is {text:?} and must be a number")))
    }

    /// A time in seconds, counted in other units.
    pub(super) fn seconds(&self, column: &str, units: f64) -> Result<Option<u64>, TranscriptError> {
        match self.float(column)? {
            None => Ok(None),
            // The bound keeps the product far below what the integer holds.
            Some(seconds) if (0.0..=MAX_SECONDS).contains(&seconds) => {
                Ok(Some((seconds * units).round() as u64))
            }
            Some(seconds) => Err(self.wrong(format!(
                "`{column}` is {seconds} and must be in 0..={MAX_SECONDS}"
            ))),
        }
    }
}
