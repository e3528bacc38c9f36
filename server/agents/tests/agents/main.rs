//! Tests of the crate, one binary with a module for each subject.

#![allow(
    clippy::unwrap_used,
    reason = "a test fails by it, in its helpers as well"
)]

mod built_in;
mod network;
mod network_file;
mod play;
mod recorded;
