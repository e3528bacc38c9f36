//! The partitions of the table of journals: added before they are needed, dropped when no game of
//! theirs is left, which gives their space back at once. Each has the same number of games, in the
//! order in which those were created. `journal_N` ends before game number `N *` [`GAMES`].

use std::time::{Duration, Instant};

use sqlx::postgres::PgConnection;
use sqlx::{AssertSqlSafe, Connection as _};
use tracing::info;

use super::errors::is_locked;

/// Numbers of games in a partition, as in the migration that makes the first one.
const GAMES: i64 = 262_144;
/// Partitions after that of the newest game.
const AHEAD: i64 = 2;
/// When the journal of a deleted game is deleted if its partition is still needed, milliseconds. Until
/// then the games around it may have been deleted as well.
const SINGLE_AFTER_MS: i64 = 60_000;
/// Games whose journals are deleted in one statement.
const GAMES_AT_A_TIME: i64 = 200;
/// How long journals are deleted before something else is done.
const TIME: Duration = Duration::from_secs(5);
/// Key of the advisory lock that is held while partitions are added: "journals" in ASCII.
const LOCK: i64 = 0x6a6f_7572_6e61_6c73;

/// Adds the partitions for games up to a number and for those that follow soon. Nobody waits for it.
pub(super) async fn add(connection: &mut PgConnection, game: i64) -> sqlx::Result<()> {
    let needed = game / GAMES + 1 + AHEAD;
    if newest(connection).await? >= needed {
        return Ok(());
    }
    let mut transaction = connection.begin().await?;
    sqlx::query("SELECT pg_advisory_xact_lock($1)")
        .bind(LOCK)
        .execute(&mut *transaction)
        .await?;
    for before in newest(&mut transaction).await?..needed {
        let (number, from, to) = (before + 1, before * GAMES, (before + 1) * GAMES);
        sqlx::raw_sql(AssertSqlSafe(format!(
            "CREATE TABLE journal_{number} (LIKE journal INCLUDING ALL);
             ALTER TABLE journal ATTACH PARTITION journal_{number} FOR VALUES FROM ({from}) TO ({to})"
        )))
        .execute(&mut *transaction)
        .await?;
    }
    transaction.commit().await
}

/// The number of the newest partition.
async fn newest(connection: &mut PgConnection) -> sqlx::Result<i64> {
    sqlx::query_scalar(
        "SELECT max(substr(relname::text, 9)::bigint) FROM pg_inherits JOIN pg_class ON pg_class.oid = inhrelid
         WHERE inhparent = 'journal'::regclass",
    )
    .fetch_one(connection)
    .await
}

/// Adds what is needed, drops what no game is left in, and deletes what is left of single games.
pub(super) async fn tidy(connection: &mut PgConnection) -> sqlx::Result<()> {
    let game: i64 = sqlx::query_scalar("SELECT last_value FROM games_number_seq")
        .fetch_one(&mut *connection)
        .await?;
    add(connection, game).await?;
    for (number, from) in without_games(connection, game).await? {
        match remove(connection, number, from).await {
            // Those who use the table come first, for example a backup.
            Err(error) if is_locked(&error) => break,
            removed => removed?,
        }
    }
    delete_singles(connection).await
}

/// The partitions in which no game is left, with the number of their first game. The newest ones
/// are needed: a transaction that creates a game has drawn its number before it can be seen.
async fn without_games(
    connection: &mut PgConnection,
    newest_game: i64,
) -> sqlx::Result<Vec<(i64, i64)>> {
    sqlx::query_as(
        "SELECT number, first FROM (
             SELECT number, $1 * coalesce(lag(number) OVER (ORDER BY number), 0) AS first FROM (
                 SELECT substr(relname::text, 9)::bigint AS number
                 FROM pg_inherits JOIN pg_class ON pg_class.oid = inhrelid
                 WHERE inhparent = 'journal'::regclass) AS names) AS partitions
         WHERE $1 * (number + 1) <= $2
           AND NOT EXISTS (SELECT FROM games
                           WHERE games.number >= first AND games.number < $1 * partitions.number)
         ORDER BY number",
    )
    .bind(GAMES)
    .bind(newest_game)
    .fetch_all(connection)
    .await
}

/// Drops a partition. Everybody waits for those who use the table, so this waits briefly.
async fn remove(connection: &mut PgConnection, number: i64, from: i64) -> sqlx::Result<()> {
    let to = number * GAMES;
    let mut transaction = connection.begin().await?;
    sqlx::raw_sql(AssertSqlSafe(format!(
        "SET LOCAL lock_timeout = '100ms';
         DROP TABLE IF EXISTS journal_{number};
         DELETE FROM pruned WHERE game >= {from} AND game < {to}"
    )))
    .execute(&mut *transaction)
    .await?;
    transaction.commit().await?;
    info!(
        partition = format!("journal_{number}"),
        "the journals of deleted games were dropped"
    );
    Ok(())
}

/// Deletes the journals of deleted games whose partitions are needed.
async fn delete_singles(connection: &mut PgConnection) -> sqlx::Result<()> {
    let begun = Instant::now();
    while begun.elapsed() < TIME {
        let mut transaction = connection.begin().await?;
        let games: Vec<i64> = sqlx::query_scalar(
            "DELETE FROM pruned WHERE game IN (SELECT game FROM pruned WHERE at_ms < clock_ms() - $1
                                               ORDER BY game LIMIT $2 FOR UPDATE SKIP LOCKED)
             RETURNING game",
        )
        .bind(SINGLE_AFTER_MS)
        .bind(GAMES_AT_A_TIME)
        .fetch_all(&mut *transaction)
        .await?;
        if games.is_empty() {
            break;
        }
        sqlx::query("DELETE FROM journal WHERE game = ANY ($1)")
            .bind(games)
            .execute(&mut *transaction)
            .await?;
        transaction.commit().await?;
    }
    Ok(())
}
