//! Tests of the crate, one binary with a module for each subject.

#![allow(
    clippy::unwrap_used,
    reason = "a test fails by it, in its helpers as well"
)]

mod batch;
mod conformance;
mod duplicate;
mod mechanics;
mod power;
mod ratings;
mod same_seat;
mod tournament;
mod trust;
mod vector;
