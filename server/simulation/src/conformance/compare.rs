//! Compares the expectations of a vector with the engine's results. `game` and `deal` decide what
//! is compared.

use serde::Serialize;
use serde_json::Value;
use thiserror::Error;

/// The first place where the engine disagrees with a vector.
#[derive(Clone, Eq, PartialEq, Debug, Error)]
#[error("{place}: expected {expected}, got {got}")]
pub struct Disagreement {
    /// What differs, in the terms of the vector: for instance `steps[41], legal actions`.
    pub place: String,
    /// Index from 0 of the step where it was found; `None` for a deal.
    pub step: Option<usize>,
    /// The vector's value, as JSON or in words.
    pub expected: String,
    /// The engine's result, as JSON or in words.
    pub got: String,
}

/// Compares two values by their JSON. For objects, the error names the first field that differs.
pub(super) fn agree(
    place: &str,
    step: Option<usize>,
    expected: impl Serialize,
    got: impl Serialize,
) -> Result<(), Disagreement> {
    let (expected, got) = (json(expected), json(got));
    if expected == got {
        return Ok(());
    }
    if let (Value::Object(expected), Value::Object(got)) = (&expected, &got) {
        for (field, expected) in expected {
            agree(&format!("{place}.{field}"), step, expected, &got[field])?;
        }
    }
    Err(Disagreement {
        place: place.to_owned(),
        step,
        expected: expected.to_string(),
        got: got.to_string(),
    })
}

fn json(value: impl Serialize) -> Value {
    serde_json::to_value(value).expect("vectors consist of numbers, strings and lists")
}

/// Why a line fails.
#[derive(Clone, Eq, PartialEq, Debug, Error)]
pub enum LineError {
    /// The engine disagrees.
    #[error(transparent)]
    Disagrees(#[from] Disagreement),
    /// The line is not a vector.
    #[error("{0}")]
    Unreadable(String),
}

pub(super) fn unreadable(error: impl std::fmt::Display) -> LineError {
    LineError::Unreadable(error.to_string())
}
