//! Tests of the crate: entry, pairings, calls, results, standings.

#![allow(
    clippy::unwrap_used,
    reason = "a test fails by it, in its helpers as well"
)]

mod by_hand;
mod calls;
mod deals;
mod entry;
mod invariants;
mod knockout;
mod round_robin;
mod standings;
mod support;
mod swiss;
