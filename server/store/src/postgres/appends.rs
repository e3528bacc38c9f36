//! Appends to the journals of running games: one statement for all that wait. The position in the
//! journal is the fence: a takeover writes an entry at the next position, and only one of two rows
//! can stand there. A row follows the one before it: a database that went back in time, for example
//! to a backup, has lost rows that were acknowledged, and their room stops and goes on from what is
//! stored.

use std::collections::HashSet;
use std::sync::Arc;

use sqlx::SqlSafeStr as _;
use sqlx::postgres::PgConnection;
use tracing::error;

use super::values::Owned;
use super::writer::{Answers, Work, confirming};
use crate::StoreError;
use crate::units::UnitKind;

/// A row of a journal.
#[derive(Debug)]
pub(super) struct Row {
    pub(super) owned: Owned,
    /// The number of the game.
    pub(super) game: i64,
    /// From 0. A journal sends one row at a time.
    pub(super) position: i64,
    pub(super) entries: Vec<u8>,
}

impl Work for Row {
    type Answer = ();
    const MOST: usize = 1_024;

    async fn commit(
        connection: &mut PgConnection,
        rows: &[Arc<Self>],
        _again: bool,
    ) -> sqlx::Result<Answers<Self>> {
        append(connection, rows).await
    }
}

async fn append(connection: &mut PgConnection, rows: &[Arc<Row>]) -> sqlx::Result<Answers<Row>> {
    let inserted: Vec<(i64, i64)> = sqlx::query_as(
        "INSERT INTO journal (game, position, epoch, entries)
         SELECT new.game, new.position, new.epoch, new.entries
         FROM unnest($1::bytea[], $2::bigint[], $3::bigint[], $4::bigint[], $5::bytea[])
              AS new (room, epoch, game, position, entries)
         JOIN owned ON owned.id = new.room AND owned.epoch = new.epoch AND NOT owned.over
         WHERE new.position = 0 OR (SELECT true FROM journal
                                    WHERE game = new.game AND position = new.position - 1)
         ON CONFLICT DO NOTHING
         RETURNING game, position",
    )
    .bind(all(rows, |row| row.owned.id.bytes().as_slice()))
    .bind(all(rows, |row| row.owned.epoch))
    .bind(all(rows, |row| row.game))
    .bind(all(rows, |row| row.position))
    .bind(all(rows, |row| row.entries.as_slice()))
    .fetch_all(&mut *connection)
    .await?;
    let mut inserted: HashSet<(i64, i64)> = inserted.into_iter().collect();
    // A room that has stopped while its row waited, and the one that its node has read again, may both
    // send a row for one place.
    let mut places = HashSet::with_capacity(rows.len());
    for row in rows {
        if !places.insert((row.game, row.position)) {
            inserted.remove(&(row.game, row.position));
        }
    }
    let mut answers = Vec::with_capacity(rows.len());
    for row in rows {
        let kept = inserted.contains(&(row.game, row.position)) || stands(connection, row).await?;
        answers.push(match kept {
            true => Ok(()),
            false => Err(refusal(connection, None, row.owned, row.position).await?),
        });
    }
    Ok(answers)
}

/// Whether a row stands in its place: an earlier attempt without an answer inserted it, or this one,
/// and not another row for that place.
async fn stands(connection: &mut PgConnection, row: &Row) -> sqlx::Result<bool> {
    let stands = sqlx::query(confirming!(
        "game FROM journal WHERE game = $1 AND position = $2 AND epoch = $3 AND entries = $4"
    ))
    .bind(row.game)
    .bind(row.position)
    .bind(row.owned.epoch)
    .bind(row.entries.as_slice())
    .fetch_optional(connection)
    .await?;
    Ok(stands.is_some())
}

/// Why a row at this position was refused: another node has the unit, or the row before it is gone. The
/// journal is that of a unit of this kind, or else of a room.
pub(super) async fn refusal(
    connection: &mut PgConnection,
    kind: Option<UnitKind>,
    owned: Owned,
    position: i64,
) -> sqlx::Result<StoreError> {
    let open = match kind {
        None => "SELECT EXISTS (SELECT FROM owned WHERE id = $1 AND epoch = $2 AND NOT over)
                    AND NOT EXISTS (SELECT FROM owned JOIN games USING (game_id)
                                    JOIN journal ON game = number
                                    WHERE id = $1 AND position >= $3)"
            .into_sql_str(),
        Some(kind) => kind
            .sql(
                "SELECT EXISTS (SELECT FROM owned WHERE id = $1 AND epoch = $2 AND NOT over)
                        AND NOT EXISTS (SELECT FROM {units} JOIN {rows} ON {unit} = number
                                        WHERE {unit_id} = $1 AND position >= $3)",
            )
            .into_sql_str(),
    };
    let is_hole: bool = sqlx::query_scalar(open)
        .bind(owned.id.bytes().as_slice())
        .bind(owned.epoch)
        .bind(position - 1)
        .fetch_one(connection)
        .await?;
    if !is_hole {
        return Ok(owned.fenced());
    }
    let (id, of) = (owned.id, kind.map_or("rooms", UnitKind::plural));
    error!(
        %id,
        of,
        position,
        "the database has lost rows of a journal that it had committed: its owner goes on from what is stored; was a backup put back, or did the database crash with fsync off?"
    );
    Ok(StoreError::Lost(owned.unit))
}

fn all<'a, T>(rows: &'a [Arc<Row>], value: impl Fn(&'a Row) -> T) -> Vec<T> {
    rows.iter().map(|row| value(row)).collect()
}
