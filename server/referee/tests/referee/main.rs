//! Tests of the referee against games whose cards are all known.

#![allow(clippy::unwrap_used, reason = "a test fails by it")]

mod noise;
mod table;
mod texts;
