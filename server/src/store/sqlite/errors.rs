//! What SQLite's errors mean for the person who runs the server, and what there is to do.

use std::time::Duration;

/// Name of the database in the data directory.
pub(super) const FILE: &str = "games.sqlite3";
/// How long a database that another program has locked is waited for.
pub(super) const BUSY_LIMIT: Duration = Duration::from_secs(10);

/// SQLite's primary result codes that are told apart.
const BUSY: i32 = 5;
const LOCKED: i32 = 6;
const READ_ONLY: i32 = 8;
const IO_ERROR: i32 = 10;
const CORRUPT: i32 = 11;
const FULL: i32 = 13;
const CANNOT_OPEN: i32 = 14;

/// The primary result code of an error; extended codes carry it in their lowest byte.
fn primary_code(error: &sqlx::Error) -> Option<i32> {
    let code = error.as_database_error()?.code()?;
    code.parse::<i32>().ok().map(|code| code & 0xff)
}

/// Whether an error has this primary result code.
pub(super) fn has_code(error: &sqlx::Error, code: i32) -> bool {
    primary_code(error) == Some(code)
}

/// An error in words, with what to do about it.
pub(super) fn explain(error: &sqlx::Error) -> String {
    let advice = match primary_code(error) {
        Some(FULL) => "the disk is full: free some space",
        Some(BUSY | LOCKED) => {
            let seconds = BUSY_LIMIT.as_secs();
            return format!(
                "another program has had {FILE} locked for more than {seconds} s: end that program, then start the server again ({error})"
            );
        }
        Some(READ_ONLY) => {
            "the file or its folder may not be written: give the server the right to"
        }
        Some(IO_ERROR) => {
            "the disk does not read or write as it should: check the disk and its free space"
        }
        Some(CORRUPT) => "the database is damaged: put back a copy of it",
        Some(CANNOT_OPEN) => {
            "the file cannot be opened: check that its folder is there and may be written"
        }
        _ => return format!("the database failed: {error}"),
    };
    format!("{advice}, then start the server again ({error})")
}
