//! The tests of simulation, one binary. Each module below is a subject.

#![allow(
    clippy::unwrap_used,
    reason = "a test fails by it, in its helpers as well"
)]

mod batch;
mod conformance;
mod duplicate;
mod mechanics;
#[path = "../../../agents/tests/agents/network_file.rs"]
mod network_file;
mod ratings;
mod same_seat;
#[path = "../../../tournament/tests/tournament/support.rs"]
#[allow(dead_code, reason = "shared with the tests of tournaments")]
mod support;
mod tournament;
mod trust;
mod vector;
