//! Explains SQLite's errors to the person who runs the server, with advice.

use std::time::Duration;

use crate::StoreError;

/// The file of the database in a data directory. Beside it lie files whose names begin with it.
pub const FILE: &str = "games.sqlite3";
/// How long to wait for a database that another program has locked.
pub(super) const BUSY_LIMIT: Duration = Duration::from_secs(10);

/// SQLite's primary result codes that have their own advice.
const BUSY: i32 = 5;
const LOCKED: i32 = 6;
const READ_ONLY: i32 = 8;
const IO_ERROR: i32 = 10;
pub(super) const CORRUPT: i32 = 11;
const FULL: i32 = 13;
const CANNOT_OPEN: i32 = 14;
pub(super) const NOT_A_DATABASE: i32 = 26;

/// The primary result code of an error; extended codes carry it in their lowest byte.
fn primary_code(error: &sqlx::Error) -> Option<i32> {
    let code = error.as_database_error()?.code()?;
    code.parse::<i32>().ok().map(|code| code & 0xff)
}

/// Extended result codes of what fails on a full disk besides [`FULL`]: to write, sync, truncate or
/// extend a file, among them the log's index in shared memory.
const NO_SPACE: [i32; 6] = [
    IO_ERROR | (3 << 8),
    IO_ERROR | (4 << 8),
    IO_ERROR | (5 << 8),
    IO_ERROR | (6 << 8),
    IO_ERROR | (19 << 8),
    IO_ERROR | (21 << 8),
];

/// Whether a full disk caused an error. `has_none` says whether there is no space on it.
pub(super) fn is_full(error: &sqlx::Error, has_none: impl FnOnce() -> bool) -> bool {
    let database = error.as_database_error();
    let code = database.and_then(|error| error.code()?.parse().ok());
    code.is_some_and(|code| is_full_code(code, has_none))
}

fn is_full_code(code: i32, has_none: impl FnOnce() -> bool) -> bool {
    code & 0xff == FULL || (NO_SPACE.contains(&code) && has_none())
}

/// Whether an error has this primary result code.
pub(super) fn has_code(error: &sqlx::Error, code: i32) -> bool {
    primary_code(error) == Some(code)
}

/// The error of the store for an error of the database.
pub(super) fn failure(error: sqlx::Error) -> StoreError {
    StoreError::Failed(explain(&error))
}

/// Explains an error, with advice.
pub(super) fn explain(error: &sqlx::Error) -> String {
    let advice = match primary_code(error) {
        Some(FULL) => "the disk is full: free some space",
        Some(BUSY | LOCKED) => {
            let seconds = BUSY_LIMIT.as_secs();
            return format!(
                "another program has kept {FILE} locked for more than {seconds} s: end that program, then start the server again ({error})"
            );
        }
        Some(READ_ONLY) => "the file or its folder is not writable: change its permissions",
        Some(IO_ERROR) => "the disk fails to read or write: check the disk and its free space",
        Some(CORRUPT) => "the database is damaged: restore a backup",
        Some(CANNOT_OPEN) => {
            "the file cannot be opened: check that its folder exists and is writable"
        }
        _ => return format!("the database failed: {error}"),
    };
    format!("{advice}, then start the server again ({error})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failing_disk_is_full_only_if_it_has_no_space() {
        // SQLITE_FULL; IOERR_WRITE, _FSYNC and _SHMSIZE; IOERR_READ and CORRUPT.
        for (code, with_space, without) in [
            (13, true, true),
            (778, false, true),
            (1034, false, true),
            (4874, false, true),
            (266, false, false),
            (11, false, false),
        ] {
            assert_eq!(is_full_code(code, || false), with_space, "{code}");
            assert_eq!(is_full_code(code, || true), without, "{code}");
        }
    }
}
