//! The rows of one game's journal: finds them, and reads the journal from them.

use sqlx::Row as _;
use sqlx::sqlite::{SqlitePool, SqliteRow};

use super::errors::explain;
use crate::StoreError;
use crate::decode_pool::DecodePool;
use crate::form::{self, Unreadable};
use chefshat_room::journal::Entry;

/// Prefixes a statement with `own (row, game, previous)`: the rows of a journal, found from the last
/// one, which the condition `$last` selects, back to the first. A damaged link leads neither into
/// another game nor around in a circle.
macro_rules! with_own_rows {
    ($last:literal, $statement:literal) => {
        concat!(
            "WITH RECURSIVE own (row, game, previous) AS (
                 SELECT row, game, previous FROM journal WHERE ",
            $last,
            " UNION ALL
                 SELECT journal.row, journal.game, journal.previous
                 FROM own JOIN journal ON journal.row = own.previous
                 WHERE journal.row < own.row AND journal.game = own.game) ",
            $statement
        )
    };
}
pub(super) use with_own_rows;

/// A decoded journal.
#[derive(Default)]
pub(super) struct Read {
    pub(super) entries: Vec<Entry>,
    pub(super) rows: i64,
    pub(super) last_row: Option<i64>,
}

impl Read {
    /// Adds the next row: its number, position and entries.
    pub(super) fn add(&mut self, row: &SqliteRow) -> Result<(), Unreadable> {
        if row.get::<i64, _>(1) != self.rows {
            let gap = format!("a part of its journal is missing at {}", self.rows);
            return Err(Unreadable(gap));
        }
        form::read_entries(row.get(2), &mut self.entries)?;
        self.rows += 1;
        self.last_row = Some(row.get(0));
        Ok(())
    }
}

/// The journal of a game, found from its last row back to its first; the inner result says why it
/// cannot be read.
pub(super) async fn journal(
    pool: &SqlitePool,
    decoding: &DecodePool,
    number: i64,
    last_row: Option<i64>,
) -> Result<Result<Read, Unreadable>, StoreError> {
    let rows = sqlx::query(with_own_rows!(
        "row = $1 AND game = $2",
        "SELECT row, position, entries FROM journal WHERE row IN (SELECT row FROM own) ORDER BY row"
    ))
    .bind(last_row)
    .bind(number)
    .fetch_all(pool)
    .await
    .map_err(|error| StoreError::Failed(explain(&error)))?;
    if rows.is_empty() && last_row.is_some() {
        return Ok(Err(Unreadable("its journal is missing".into())));
    }
    let bytes: usize = rows.iter().map(|row| row.get::<&[u8], _>(2).len()).sum();
    let decoding = decoding.run(bytes / 64, move || {
        let mut read = Read::default();
        rows.iter().try_for_each(|row| read.add(row)).map(|()| read)
    });
    decoding.await
}
