//! Taking units over, in one transaction.

use std::time::Duration;

use chefshat_engine::RULES_VERSION;
use sqlx::Row as _;
use sqlx::postgres::PgConnection;
use tracing::error;

use crate::cluster::Epoch;
use crate::form::{self, FORM};
use crate::sql::integer;
use chefshat_base::clock::since_epoch_ms;
use chefshat_room::ids::UnitId;
use chefshat_room::journal::{Change, Entry};

/// What became of claims.
pub(super) enum Claims {
    /// The new epoch of each unit; `None` if it is not claimed.
    Made(Vec<Option<Epoch>>),
    /// Nothing: the last owner of one of them wrote something at the same time.
    Busy,
}

/// Claims units for a node, if they still have the epochs that were seen. What somebody else is
/// just claiming or ending is not claimed.
pub(super) async fn claim(
    connection: &mut PgConnection,
    node: i64,
    expire_after: i64,
    orphans: &[(UnitId, Epoch)],
) -> sqlx::Result<Claims> {
    let seen: Vec<i64> = orphans.iter().map(|(_, seen)| integer(seen.0)).collect();
    let units: Vec<&[u8]> = orphans
        .iter()
        .map(|(unit, _)| unit.bytes().as_slice())
        .collect();
    let locked: Vec<(Vec<u8>, Option<i64>, bool)> = sqlx::query_as(
        "WITH locked AS (
             SELECT unit, node, durable, form, rules_version FROM owned
             WHERE (unit, epoch) IN (SELECT * FROM unnest($1::bytea[], $2::bigint[]))
               AND NOT over AND EXISTS (SELECT FROM nodes WHERE node = $3)
             ORDER BY id FOR UPDATE SKIP LOCKED
         )
         SELECT unit, min(node),
                bool_or(durable) AND bool_and(form <= $4 AND coalesce(rules_version, $5) = $5)
                AND count(*) = (SELECT count(*) FROM owned WHERE owned.unit = locked.unit AND NOT over)
         FROM locked GROUP BY unit",
    )
    .bind(units)
    .bind(seen)
    .bind(node)
    .bind(FORM)
    .bind(i64::from(RULES_VERSION))
    .fetch_all(&mut *connection)
    .await?;
    // All rows of a unit have the same owner. A beat waits for the lock, so its answer comes before
    // or after all claims.
    let owners: Vec<i64> = locked.iter().filter_map(|(_, owner, _)| *owner).collect();
    let owners: Vec<(i64, bool)> = match owners.is_empty() {
        true => Vec::new(),
        false => {
            sqlx::query_as(
                "SELECT node, beat_ms + $2 > clock_ms() FROM nodes
                 WHERE node = ANY ($1) ORDER BY node FOR SHARE",
            )
            .bind(owners)
            .bind(expire_after)
            .fetch_all(&mut *connection)
            .await?
        }
    };
    let is_alive = |owner: &i64| owners.contains(&(*owner, true));
    let claimed: Vec<Vec<u8>> = (locked.into_iter())
        .filter(|(_, owner, claimable)| *claimable && !owner.as_ref().is_some_and(is_alive))
        .map(|(unit, ..)| unit)
        .collect();
    if !claimed.is_empty() {
        take(connection, node, &claimed).await?;
        if !restart(connection, &claimed).await? {
            return Ok(Claims::Busy);
        }
    }
    let epoch = |(unit, seen): &(UnitId, Epoch)| {
        let is_claimed = claimed.iter().any(|claimed| *claimed == unit.bytes());
        is_claimed.then(|| seen.next())
    };
    Ok(Claims::Made(orphans.iter().map(epoch).collect()))
}

/// Makes units a node's and raises their epochs. Their ephemeral rooms have died with the last one.
async fn take(connection: &mut PgConnection, node: i64, units: &[Vec<u8>]) -> sqlx::Result<()> {
    sqlx::query(
        // The rooms that are over can be shown by the new owner. What it writes, versions that do
        // not know its form cannot read.
        "WITH died AS (
             DELETE FROM owned WHERE unit = ANY ($1) AND NOT durable AND NOT over
         ), form AS (
             UPDATE games SET form = $3 FROM owned
             WHERE unit = ANY ($1) AND NOT over AND games.game_id = owned.game_id AND games.form < $3
         ), tournament AS (
             UPDATE tournaments SET form = $3 FROM owned
             WHERE unit = ANY ($1) AND NOT owned.over AND tournament_id = id AND tournaments.form < $3
         ), study AS (
             UPDATE studies SET form = $3 FROM owned
             WHERE unit = ANY ($1) AND NOT over AND study_id = id AND studies.form < $3
         )
         UPDATE owned SET node = $2,
                          epoch = CASE WHEN over THEN epoch ELSE epoch + 1 END,
                          form = CASE WHEN over THEN form ELSE greatest(form, $3) END
         WHERE unit = ANY ($1) AND (durable OR over)",
    )
    .bind(units)
    .bind(node)
    .bind(FORM)
    .execute(connection)
    .await
    .map(drop)
}

/// Adds "the server was restarted" to the journals of the rooms of units that are not over. Returns
/// `false` if a last owner has just written at the same position.
async fn restart(connection: &mut PgConnection, units: &[Vec<u8>]) -> sqlx::Result<bool> {
    let games = sqlx::query(
        "SELECT number, created_at_ms, owned.epoch, position, entries
         FROM owned JOIN games USING (game_id)
              LEFT JOIN LATERAL (SELECT position, entries FROM journal WHERE game = number
                                 ORDER BY position DESC LIMIT 1) last ON true
         WHERE unit = ANY ($1) AND NOT over",
    )
    .bind(units)
    .fetch_all(&mut *connection)
    .await?;
    let (mut numbers, mut epochs) = (Vec::new(), Vec::<i64>::new());
    let (mut positions, mut rows) = (Vec::new(), Vec::new());
    for game in &games {
        let number: i64 = game.get(0);
        let mut last = Vec::new();
        let entries: Option<&[u8]> = game.get(4);
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
        epochs.push(game.get(2));
        positions.push(game.get::<Option<i64>, _>(3).map_or(0, |last| last + 1));
        rows.push(form::entries_to_bytes(&mut vec![entry]));
    }
    let written = sqlx::query(
        "INSERT INTO journal (game, position, epoch, entries)
         SELECT * FROM unnest($1::bigint[], $2::bigint[], $3::bigint[], $4::bytea[])
         ON CONFLICT DO NOTHING",
    )
    .bind(&numbers)
    .bind(&positions)
    .bind(&epochs)
    .bind(&rows)
    .execute(connection)
    .await?;
    Ok(written.rows_affected() == numbers.len() as u64)
}
