//! Tests of records, a module for each subject.

#![allow(
    clippy::unwrap_used,
    reason = "a test fails by it, in its helpers as well"
)]

mod branches;
mod damage;
mod files;
mod forgeries;
mod fuzz;
mod import;
mod outcome;
mod verify;
