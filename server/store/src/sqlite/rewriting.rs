//! Writes what removing a participant changes, in a transaction of the writer, and empties the log
//! that still has what was overwritten.

use sqlx::sqlite::SqliteConnection;
use sqlx::{AssertSqlSafe, Executor as _};
use tracing::warn;

use super::errors::BUSY_LIMIT;
use crate::forget::Rewrite;

/// Writes what changes. The records of the games count as not written to files.
pub(super) async fn rewrite(
    connection: &mut SqliteConnection,
    rewrite: &Rewrite,
) -> sqlx::Result<()> {
    for game in &rewrite.games {
        for (row, entries) in &game.journal {
            sqlx::query("UPDATE journal SET entries = $2 WHERE row = $1")
                .bind(*row)
                .bind(entries.as_slice())
                .execute(&mut *connection)
                .await?;
        }
        if let Some(record) = &game.record {
            sqlx::query("UPDATE added_records SET record = $2 WHERE game = $1")
                .bind(game.number)
                .bind(record.as_slice())
                .execute(&mut *connection)
                .await?;
        }
        if let Some(header) = &game.header {
            sqlx::query("UPDATE games SET header = $2 WHERE number = $1")
                .bind(game.number)
                .bind(header.as_slice())
                .execute(&mut *connection)
                .await?;
        }
        if let Some((summary, room_name)) = &game.summary {
            sqlx::query(
                "UPDATE games SET summary = $2, room_name = $3, filed = 0, signature = $4
                 WHERE number = $1",
            )
            .bind(game.number)
            .bind(summary.as_slice())
            .bind(room_name.as_str())
            .bind(game.signature.as_deref())
            .execute(&mut *connection)
            .await?;
        }
        for seat in &game.seats {
            sqlx::query("UPDATE participants SET name = $3 WHERE game = $1 AND seat = $2")
                .bind(game.number)
                .bind(*seat)
                .bind(rewrite.who.pseudonym.as_str())
                .execute(&mut *connection)
                .await?;
        }
    }
    for tournament in &rewrite.tournaments {
        for (position, entries) in &tournament.rows {
            sqlx::query(
                "UPDATE tournament_entries SET entries = $3 WHERE tournament = $1 AND position = $2",
            )
            .bind(tournament.number)
            .bind(*position)
            .bind(entries.as_slice())
            .execute(&mut *connection)
            .await?;
        }
    }
    Ok(())
}

/// Empties the write-ahead log, which still has what was overwritten, unless a reader needs it:
/// then the log is emptied later.
pub(super) async fn empty_log(connection: &mut SqliteConnection) {
    checkpoint(connection, "TRUNCATE").await;
}

/// Empties the write-ahead log, as [`empty_log`] does, but keeps its space on the disk.
pub(super) async fn empty_log_in_place(connection: &mut SqliteConnection) {
    checkpoint(connection, "RESTART").await;
}

async fn checkpoint(connection: &mut SqliteConnection, how: &str) {
    let limit = format!("PRAGMA busy_timeout = {}", BUSY_LIMIT.as_millis());
    for text in [
        "PRAGMA busy_timeout = 0".to_owned(),
        format!("PRAGMA wal_checkpoint({how})"),
        limit,
    ] {
        if let Err(cause) = connection.execute(AssertSqlSafe(text)).await {
            warn!(%cause, "the log of the database was not emptied");
        }
    }
}
