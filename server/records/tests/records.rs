//! The tests of records, one binary. A module for each subject.

#![allow(
    clippy::unwrap_used,
    reason = "a test fails by it, in its helpers as well"
)]

mod records {
    mod branches;
    mod damage;
    mod dataset;
    mod files;
    mod made;
    mod outcome;
    mod picture;
    mod table;
    mod verify;
}
