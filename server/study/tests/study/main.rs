//! Tests of the crate: settings, assignment, participants, questionnaires, what participants see.

#![allow(
    clippy::unwrap_used,
    reason = "a test fails by it, in its helpers as well"
)]

mod games;
mod groups;
mod invariants;
mod participants;
mod questionnaires;
mod recruiting;
mod settings;
mod support;
mod views;
