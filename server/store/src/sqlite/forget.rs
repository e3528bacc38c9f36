//! Removing a participant from the database: reads what contains the name, and sends what changes to
//! the writer. `store::forget` decides what changes.

use std::path::Path;

use async_trait::async_trait;
use sqlx::sqlite::{SqlitePool, SqliteRow};
use sqlx::{Connection as _, Row as _};

use super::SqliteStore;
use super::errors::{FILE, failure};
use super::open::{self, IfGone, OpenError};
use super::rows::with_own_rows;
use super::writer::WriteCommand;
use crate::StoreError;
use crate::decode_pool::DecodePool;
use crate::forget::{GameRows, Rewritable, Rewrite, TournamentRow};
use crate::units::TOURNAMENT_ROWS;
use chefshat_room::ids::Id;

impl SqliteStore {
    /// Rewrites the database of a data directory so that nothing of what was deleted remains in its
    /// file. This needs as much free disk space as the database has.
    ///
    /// # Errors
    /// The directory cannot be used, a server uses it, or the database failed.
    pub async fn purge(data_dir: &Path) -> Result<(), OpenError> {
        let mut opened = open::open(data_dir, IfGone::CreateFirst).await?;
        opened.readers.close().await;
        let failed = |error| OpenError::of(&data_dir.join(FILE), &error);
        for tidying in [
            open::SHRINKABLE,
            "VACUUM",
            "PRAGMA wal_checkpoint(TRUNCATE)",
        ] {
            let tidied = sqlx::query(tidying).execute(&mut opened.writer).await;
            tidied.map_err(failed)?;
        }
        opened.writer.close().await.map_err(failed)
    }
}

#[async_trait]
impl Rewritable for SqliteStore {
    async fn games_with(&self, name: &str) -> Result<Vec<i64>, StoreError> {
        sqlx::query_scalar(
            "SELECT number FROM games
             WHERE number IN (SELECT game FROM participants WHERE name = $1
                              UNION SELECT game FROM journal WHERE instr(entries, CAST($1 AS BLOB)) > 0
                              UNION SELECT game FROM added_records WHERE instr(record, CAST($1 AS BLOB)) > 0
                              UNION SELECT number FROM games
                                    WHERE state = 0 AND instr(header, CAST($1 AS BLOB)) > 0)
             ORDER BY number",
        )
        .bind(name)
        .fetch_all(&self.reader.pool)
        .await
        .map_err(failure)
    }

    async fn tournaments_with(&self, name: &str) -> Result<Vec<i64>, StoreError> {
        sqlx::query_scalar(
            "SELECT DISTINCT tournament FROM tournament_entries
             WHERE instr(entries, CAST($1 AS BLOB)) > 0",
        )
        .bind(name)
        .fetch_all(&self.reader.pool)
        .await
        .map_err(failure)
    }

    async fn game_rows(&self, number: i64) -> Result<Option<GameRows>, StoreError> {
        let row = sqlx::query(
            "SELECT game_id, state, filed, header, summary, record, last_row, signature, form
             FROM games LEFT JOIN added_records ON game = number WHERE number = $1",
        )
        .bind(number)
        .fetch_optional(&self.reader.pool)
        .await
        .map_err(failure)?;
        let Some(row) = row else { return Ok(None) };
        let id: Vec<u8> = row.get(0);
        let id = id.try_into().map(Id::from_bytes).map_err(|_| {
            StoreError::Failed(format!("game number {number} has an id that is damaged"))
        })?;
        Ok(Some(GameRows {
            number,
            id,
            form: row.get(8),
            is_running: row.get::<i64, _>(1) == 0,
            is_filed: row.get(2),
            header: row.get(3),
            summary: row.get(4),
            record: row.get(5),
            signature: row.get(7),
            journal: journal_of(&self.reader.pool, number, row.get(6)).await?,
        }))
    }

    async fn tournament_rows(&self, number: i64) -> Result<Vec<TournamentRow>, StoreError> {
        sqlx::query_as(TOURNAMENT_ROWS)
            .bind(number)
            .fetch_all(&self.reader.pool)
            .await
            .map_err(failure)
    }

    async fn write(&self, rewrite: Rewrite) -> Result<(), StoreError> {
        let rewrite = WriteCommand::Rewrite(Box::new(rewrite));
        self.commands.send(rewrite).await
    }

    fn decoding(&self) -> &DecodePool {
        &self.decoding
    }
}

/// The rows of a game's journal, in order.
async fn journal_of(
    pool: &SqlitePool,
    game: i64,
    last_row: Option<i64>,
) -> Result<Vec<(i64, Vec<u8>)>, StoreError> {
    let rows: Vec<SqliteRow> = sqlx::query(match last_row {
        Some(_) => with_own_rows!(
            "row = $1 AND game = $2",
            "SELECT row, entries FROM journal WHERE row IN (SELECT row FROM own) ORDER BY row"
        ),
        // The game is not over: the position of its last row is unknown.
        None => "SELECT row, entries FROM journal WHERE $1 IS NULL AND game = $2 ORDER BY row",
    })
    .bind(last_row)
    .bind(game)
    .fetch_all(pool)
    .await
    .map_err(failure)?;
    Ok(rows.iter().map(|row| (row.get(0), row.get(1))).collect())
}
