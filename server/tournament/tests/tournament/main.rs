//! Tournaments: getting in, who plays whom, who is waited for, what counts. ratings.

#![allow(
    clippy::unwrap_used,
    reason = "a test fails by it, in its helpers as well"
)]

mod calls;
mod course;
mod deals;
mod entry;
mod knockout;
mod round_robin;
mod standings;
mod support;
mod swiss;
