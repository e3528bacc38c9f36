//! The tests of offline play, one binary. Each module below is a subject.

#![allow(
    clippy::unwrap_used,
    reason = "a test fails by it, in its helpers as well"
)]

mod agents;
mod batch;
mod conformance;
mod duplicate;
mod mechanics;
mod network;
mod network_file;
mod play;
mod ratings;
mod recorded;
mod same_seat;
mod tournament;
mod trust;
mod vector;
