//! Taking over a unit, in one transaction.

use std::time::Duration;

use sqlx::Row as _;
use sqlx::postgres::PgConnection;
use tracing::error;

use super::journals::encode;
use crate::clock::since_epoch_ms;
use crate::store::cluster::Epoch;
use crate::store::form;
use chefshat_room::ids::Id;
use chefshat_room::journal::{Change, Entry};

/// What became of a claim.
pub(super) enum Claim {
    /// It has the new epoch.
    Won(Epoch),
    /// It is no orphan, or not at this epoch.
    Lost,
    /// The last owner wrote something at the same time.
    Busy,
}

/// Claims a unit for a node, if it still has the epoch that was seen.
pub(super) async fn claim(
    connection: &mut PgConnection,
    node: i64,
    expire_after: i64,
    unit: Id,
    seen: i64,
) -> sqlx::Result<Claim> {
    let unit = unit.0.as_slice();
    // Whoever has locked the rows claims the unit, or ends one of them.
    let rows: Vec<(Option<i64>, bool)> = sqlx::query_as(
        "SELECT node, durable FROM owned
         WHERE unit = $1 AND epoch = $2 AND NOT over AND EXISTS (SELECT FROM nodes WHERE node = $3)
         ORDER BY id FOR UPDATE",
    )
    .bind(unit)
    .bind(seen)
    .bind(node)
    .fetch_all(&mut *connection)
    .await?;
    if !rows.iter().any(|(_, durable)| *durable) {
        return Ok(Claim::Lost);
    }
    // All of them have the same owner.
    let (owner, _) = rows[0];
    if let Some(owner) = owner {
        // A beat waits for the lock, so its answer comes before or after the whole claim.
        let alive: Option<bool> = sqlx::query_scalar(
            "SELECT beat_ms + $2 > clock_ms() FROM nodes WHERE node = $1 FOR SHARE",
        )
        .bind(owner)
        .bind(expire_after)
        .fetch_optional(&mut *connection)
        .await?;
        if alive == Some(true) {
            return Ok(Claim::Lost);
        }
    }
    sqlx::query("DELETE FROM owned WHERE unit = $1 AND NOT durable AND NOT over")
        .bind(unit)
        .execute(&mut *connection)
        .await?;
    let epoch = seen + 1;
    // The rooms that are over can be shown by the new owner.
    sqlx::query(
        "UPDATE owned SET node = $2, epoch = CASE WHEN over THEN epoch ELSE $3 END WHERE unit = $1",
    )
    .bind(unit)
    .bind(node)
    .bind(epoch)
    .execute(&mut *connection)
    .await?;
    match restart(connection, unit, epoch).await? {
        true => Ok(Claim::Won(Epoch(epoch.cast_unsigned()))),
        false => Ok(Claim::Busy),
    }
}

/// Adds "the server was restarted" to the journals of a unit's rooms that are not over. Returns
/// `false` if the last owner has just written at the same position.
async fn restart(connection: &mut PgConnection, unit: &[u8], epoch: i64) -> sqlx::Result<bool> {
    let games = sqlx::query(
        "SELECT number, created_at_ms, position, entries
         FROM owned JOIN games USING (game_id)
              LEFT JOIN LATERAL (SELECT position, entries FROM journal WHERE game = number
                                 ORDER BY position DESC LIMIT 1) last ON true
         WHERE unit = $1 AND NOT over",
    )
    .bind(unit)
    .fetch_all(&mut *connection)
    .await?;
    let (mut numbers, mut positions, mut rows) = (Vec::new(), Vec::new(), Vec::new());
    for game in &games {
        let number: i64 = game.get(0);
        let mut last = Vec::new();
        let entries: Option<&[u8]> = game.get(3);
        if let Err(problem) = form::read_entries(entries.unwrap_or_default(), &mut last) {
            error!(number, %problem, "a game cannot be read; it is left unchanged");
            continue;
        }
        let created_at_ms = u64::try_from(game.get::<i64, _>(1)).unwrap_or_default();
        let age = Duration::from_millis(since_epoch_ms().saturating_sub(created_at_ms));
        let last = last.last().map_or(Duration::ZERO, |entry| entry.at);
        let entry = Entry {
            // A clock that was set back does not make the room younger than its journal.
            at: age.max(last),
            change: Change::ServerRestarted,
        };
        numbers.push(number);
        positions.push(game.get::<Option<i64>, _>(2).map_or(0, |last| last + 1));
        rows.push(encode(&mut vec![entry]));
    }
    let written = sqlx::query(
        "INSERT INTO journal (game, position, epoch, entries)
         SELECT game, position, $3, entries FROM unnest($1, $2, $4) AS new (game, position, entries)
         ON CONFLICT DO NOTHING",
    )
    .bind(&numbers)
    .bind(&positions)
    .bind(epoch)
    .bind(&rows)
    .execute(connection)
    .await?;
    Ok(written.rows_affected() == numbers.len() as u64)
}
