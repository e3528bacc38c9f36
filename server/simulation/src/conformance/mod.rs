//! Checks the engine against test vectors: files with one JSON object per line, each a deal or a
//! complete game of another engine. This file reads lines; `game` and `deal` check them.

mod compare;
mod deal;
mod game;

use std::io::{BufRead, Read};

use serde_json::Value;
use thiserror::Error;

use compare::unreadable;
pub use compare::{Disagreement, LineError};

/// Maximum length of a line. Far longer than any game of the default rules; bounds memory.
pub const MAX_LINE_BYTES: u64 = 64 << 20;

/// How many vectors agreed.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Default)]
pub struct Agreed {
    /// Deals that agreed card for card.
    pub deals: u64,
    /// Games replayed to the same end.
    pub games: u64,
    /// Decisions of those games.
    pub steps: u64,
}

impl Agreed {
    /// Total number of vectors.
    pub fn vectors(&self) -> u64 {
        self.deals + self.games
    }
}

/// The result for a file: the vectors that agreed up to the first failure or the end.
#[derive(Debug)]
pub struct Report {
    /// Vectors that agreed.
    pub agreed: Agreed,
    /// Why checking stopped before the end of the file, if it did.
    pub failure: Option<Failure>,
}

/// Why checking stopped. Lines are counted from 1.
#[derive(Debug, Error)]
pub enum Failure {
    /// The engine disagrees with the vector.
    #[error("line {line} does not agree: {disagreement}")]
    Disagrees {
        /// The line.
        line: u64,
        /// The place, the expected value and the engine's value.
        disagreement: Disagreement,
    },
    /// The line is not a vector.
    #[error("line {line} is not a vector: {reason}")]
    Unreadable {
        /// The line.
        line: u64,
        /// The reason.
        reason: String,
    },
    /// The file cannot be read.
    #[error("line {line} cannot be read: {source}")]
    Read {
        /// The line.
        line: u64,
        /// The reason.
        source: std::io::Error,
    },
    /// The file has no vectors.
    #[error("the file has no vectors: expected one JSON object per line")]
    Empty,
}

/// Checks all lines up to the first failure. `progress` is called with the size of each line in
/// bytes. Empty lines are skipped.
pub fn check(mut input: impl BufRead, mut progress: impl FnMut(u64)) -> Report {
    let mut agreed = Agreed::default();
    let mut bytes = Vec::new();
    for line in 1u64.. {
        bytes.clear();
        let read = (&mut input)
            .take(MAX_LINE_BYTES + 1)
            .read_until(b'\n', &mut bytes);
        let failure = match read {
            Ok(0) => {
                let failure = (agreed.vectors() == 0).then_some(Failure::Empty);
                return Report { agreed, failure };
            }
            Ok(read) if read as u64 > MAX_LINE_BYTES => Failure::Unreadable {
                line,
                reason: format!("it is longer than {MAX_LINE_BYTES} bytes"),
            },
            Ok(_) if bytes.iter().all(u8::is_ascii_whitespace) => continue,
            Ok(read) => match check_line(&bytes, &mut agreed) {
                Ok(()) => {
                    progress(read as u64);
                    continue;
                }
                Err(LineError::Disagrees(disagreement)) => {
                    Failure::Disagrees { line, disagreement }
                }
                Err(LineError::Unreadable(reason)) => Failure::Unreadable { line, reason },
            },
            Err(source) => Failure::Read { line, source },
        };
        return Report {
            agreed,
            failure: Some(failure),
        };
    }
    unreachable!("a file has fewer than 2^64 lines")
}

/// Checks one line and counts it if it agrees. Its keys tell whether it is a deal or a game.
///
/// # Errors
/// It is not a vector, or the engine disagrees.
pub fn check_line(line: &[u8], agreed: &mut Agreed) -> Result<(), LineError> {
    let value: Value = serde_json::from_slice(line)
        .map_err(|error| LineError::Unreadable(format!("it is not JSON: {error}")))?;
    if value.get("steps").is_some() {
        agreed.steps += game::check(parse(value)?)?;
        agreed.games += 1;
    } else if value.get("hands").is_some() {
        deal::check(&parse(value)?)?;
        agreed.deals += 1;
    } else {
        return Err(LineError::Unreadable(
            "it is neither a game (rules, seed, steps, shifts, scores, winner) nor a deal (rules, seed, shift, hands, leader)"
                .to_owned(),
        ));
    }
    Ok(())
}

fn parse<T: serde::de::DeserializeOwned>(value: Value) -> Result<T, LineError> {
    serde_json::from_value(value).map_err(unreadable)
}
