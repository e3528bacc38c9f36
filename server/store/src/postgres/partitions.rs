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

/// Adds the partitions for games up to a number and for those that follow soon. This waits for no
/// reader or writer of the table, and they do not wait for it.
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

/// Adds the partitions that the next games need.
pub(super) async fn add_next(connection: &mut PgConnection) -> sqlx::Result<()> {
    let game = newest_game(connection).await?;
    add(connection, game).await
}

/// The largest number of a game that was drawn.
async fn newest_game(connection: &mut PgConnection) -> sqlx::Result<i64> {
    sqlx::query_scalar("SELECT last_value FROM games_number_seq")
        .fetch_one(connection)
        .await
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

/// Drops the partitions that no game is left in, and deletes what is left of single games.
pub(super) async fn tidy(connection: &mut PgConnection) -> sqlx::Result<()> {
    for (number, from) in without_games(connection).await? {
        match remove(connection, number, from).await {
            Err(error) if is_locked(&error) => break,
            removed => removed?,
        }
    }
    delete_singles(connection).await
}

/// The partitions in which no game is left, with the number of their first game; none while a long
/// transaction, such as a backup, uses the table: dropping one would wait for it, and everybody else
/// for that. The newest partitions are needed: a transaction that creates a game has drawn its number
/// before it can be seen.
async fn without_games(connection: &mut PgConnection) -> sqlx::Result<Vec<(i64, i64)>> {
    let newest_game = newest_game(connection).await?;
    sqlx::query_as(
        "WITH partitions AS (
             SELECT inhrelid, number, $1 * coalesce(lag(number) OVER (ORDER BY number), 0) AS first FROM (
                 SELECT inhrelid, substr(relname::text, 9)::bigint AS number
                 FROM pg_inherits JOIN pg_class ON pg_class.oid = inhrelid
                 WHERE inhparent = 'journal'::regclass) AS names
         )
         SELECT number, first FROM partitions
         WHERE $1 * (number + 1) <= $2
           AND NOT EXISTS (SELECT FROM games
                           WHERE games.number >= first AND games.number < $1 * partitions.number)
           AND NOT EXISTS (SELECT FROM pg_locks LEFT JOIN pg_stat_activity USING (pid)
                           WHERE relation IN ('journal'::regclass, inhrelid) AND pid <> pg_backend_pid()
                             AND coalesce(xact_start < now() - interval '1 second', true))
         ORDER BY number",
    )
    .bind(GAMES)
    .bind(newest_game)
    .fetch_all(connection)
    .await
}

/// Drops a partition, if still no game is left in it. Everybody waits while this waits for a lock: it
/// does so briefly.
async fn remove(connection: &mut PgConnection, number: i64, from: i64) -> sqlx::Result<()> {
    let to = number * GAMES;
    let mut transaction = connection.begin().await?;
    sqlx::raw_sql(
        "SET LOCAL lock_timeout = '100ms'; LOCK TABLE ONLY journal IN ACCESS EXCLUSIVE MODE",
    )
    .execute(&mut *transaction)
    .await?;
    let is_needed: bool = sqlx::query_scalar(
        "SELECT EXISTS (SELECT FROM games WHERE number >= $1 AND number < $2)
             OR to_regclass('journal_' || $3::bigint) IS NULL",
    )
    .bind(from)
    .bind(to)
    .bind(number)
    .fetch_one(&mut *transaction)
    .await?;
    if is_needed {
        return transaction.rollback().await;
    }
    sqlx::raw_sql(AssertSqlSafe(format!("DROP TABLE journal_{number}")))
        .execute(&mut *transaction)
        .await?;
    transaction.commit().await?;
    info!(
        partition = format!("journal_{number}"),
        "the journals of deleted games were dropped"
    );
    // By itself: nobody should wait for it.
    sqlx::query("DELETE FROM pruned WHERE game >= $1 AND game < $2")
        .bind(from)
        .bind(to)
        .execute(connection)
        .await
        .map(drop)
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
