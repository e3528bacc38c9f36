//! Reads the journal of one game from its rows.

use sqlx::Row as _;
use sqlx::sqlite::{SqlitePool, SqliteRow};

use super::codec::Codec;
use super::errors::explain;
use super::form::{self, Unreadable};
use crate::store::StoreError;
use chefshat_room::journal::Entry;

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
    codec: &Codec,
    number: i64,
    last_row: Option<i64>,
) -> Result<Result<Read, Unreadable>, StoreError> {
    let rows = sqlx::query(
        "WITH RECURSIVE own (row, position, entries, previous) AS (
             SELECT row, position, entries, previous FROM journal WHERE row = $1 AND game = $2
             UNION ALL
             SELECT journal.row, journal.position, journal.entries, journal.previous
             FROM own JOIN journal ON journal.row = own.previous
             WHERE journal.row < own.row AND journal.game = $2)
         SELECT row, position, entries FROM own ORDER BY row",
    )
    .bind(last_row)
    .bind(number)
    .fetch_all(pool)
    .await
    .map_err(|error| StoreError::Failed(explain(&error)))?;
    if rows.is_empty() && last_row.is_some() {
        return Ok(Err(Unreadable("its journal is missing".into())));
    }
    let bytes: usize = rows.iter().map(|row| row.get::<&[u8], _>(2).len()).sum();
    let decoding = codec.run(bytes / 64, move || {
        let mut read = Read::default();
        rows.iter().try_for_each(|row| read.add(row)).map(|()| read)
    });
    decoding.await
}
