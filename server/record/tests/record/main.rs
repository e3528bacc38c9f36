//! Tests of records, a module for each subject.

#![allow(
    clippy::unwrap_used,
    reason = "a test fails by it, in its helpers as well"
)]

use std::path::{Path, PathBuf};

use chefshat_proto::v1;
use chefshat_record::jsonl;

mod branches;
mod damage;
mod files;
mod forgeries;
mod fuzz;
mod import;
mod outcome;
mod unordered;
mod verify;

/// The path of a recorded game of the fixtures.
fn fixture_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/fixtures/records")
        .join(name)
}

/// A recorded game of the fixtures.
fn fixture(name: &str) -> Vec<v1::RecordLine> {
    jsonl::read(&fixture_path(name)).unwrap()
}
