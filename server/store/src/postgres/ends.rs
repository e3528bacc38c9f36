//! Ends of games: whose room is over, what is found in the list of finished games, and its number
//! there. Imported games end when they are imported.

use chefshat_proto::v1;
use prost::Message as _;
use sqlx::postgres::{PgArguments, PgConnection};
use sqlx::query::Query;
use sqlx::{Postgres, Row as _};

use super::appends::refusal;
use super::values::{Owned, indexed_name, text};
use super::writer::confirming;
use crate::StoreError;
use crate::form::FORM;
use crate::sql::integer;
use chefshat_base::clock::since_epoch_ms;
use chefshat_room::ids::GameId;

/// The end of a game with a record.
#[derive(Debug)]
pub(super) struct End {
    pub(super) summary: Box<v1::RecordSummary>,
    pub(super) signature: Option<Vec<u8>>,
}

/// An ephemeral game that has ended.
#[derive(Debug)]
pub(super) struct WholeGame {
    pub(super) game_id: GameId,
    pub(super) header: Vec<u8>,
    pub(super) entries: Vec<u8>,
    pub(super) end: End,
}

/// What became of the end of a game.
pub(super) enum Ended {
    /// It has ended.
    Now { number: i64, has_record: bool },
    /// An earlier attempt without an answer ended it.
    Before,
    /// It was not ended.
    Refused(StoreError),
}

/// What a room that could not be ended is: over already, at this epoch, or another node's, or one
/// whose journal has lost the last of these rows.
async fn not_ended(
    connection: &mut PgConnection,
    owned: Owned,
    rows: Option<i64>,
) -> sqlx::Result<Ended> {
    let over = sqlx::query(confirming!(
        "id FROM owned WHERE id = $1 AND epoch = $2 AND over"
    ))
    .bind(owned.id.bytes().as_slice())
    .bind(owned.epoch)
    .fetch_optional(&mut *connection)
    .await?;
    if over.is_some() {
        return Ok(Ended::Before);
    }
    Ok(Ended::Refused(match rows {
        Some(rows) => refusal(connection, None, owned, rows).await?,
        None => owned.fenced(),
    }))
}

/// Ends a durable game, whose journal has some rows, with a record. The last of them is there, or it
/// is refused: see [`super::appends`].
pub(super) async fn finish(
    connection: &mut PgConnection,
    owned: Owned,
    (number, rows): (i64, i64),
    end: &End,
) -> sqlx::Result<Ended> {
    let query = sqlx::query(
        "WITH open AS (
             SELECT id FROM owned WHERE id = $12 AND epoch = $13 AND NOT over FOR UPDATE
         ), closed AS (
             INSERT INTO journal (game, position, epoch, entries) SELECT $14, $15, $13, '' FROM open
             WHERE $15 = 0 OR (SELECT true FROM journal WHERE game = $14 AND position = $15 - 1)
             ON CONFLICT DO NOTHING RETURNING game
         ), room AS (
             UPDATE owned SET over = true, ended_ms = clock_ms() FROM closed WHERE id = $12
         ), game AS (
             UPDATE games SET state = $1, summary = $2, origin = $3, room_name = $4, created_at_ms = $5,
                              ended_at_ms = $6, signature = $11
             FROM closed WHERE number = game RETURNING number
         ), seats AS (
             INSERT INTO participants (game, seat, name, agent, kind)
             SELECT number, seat.* FROM game,
                    unnest($7::bigint[], $8::text[], $9::text[], $10::integer[]) AS seat
             ON CONFLICT DO NOTHING
         )
         SELECT number FROM game",
    );
    let finished = with_summary(query, &end.summary)
        .bind(end.signature.as_deref())
        .bind(owned.id.bytes().as_slice())
        .bind(owned.epoch)
        .bind(number)
        .bind(rows)
        .fetch_optional(&mut *connection)
        .await?;
    match finished {
        Some(row) => Ok(Ended::Now {
            number: row.get(0),
            has_record: true,
        }),
        None => not_ended(connection, owned, Some(rows)).await,
    }
}

/// Ends a game without a record; a durable one has a number and a journal with some rows.
pub(super) async fn give_up(
    connection: &mut PgConnection,
    owned: Owned,
    durable: Option<(i64, i64)>,
) -> sqlx::Result<Ended> {
    let (number, rows) = durable.unzip();
    let over = sqlx::query(
        "WITH open AS (
             SELECT id FROM owned WHERE id = $1 AND epoch = $2 AND NOT over FOR UPDATE
         ), closed AS (
             INSERT INTO journal (game, position, epoch, entries)
             SELECT $4, $5, $2, '' FROM open
             WHERE $5 = 0 OR (SELECT true FROM journal WHERE game = $4 AND position = $5 - 1)
             ON CONFLICT DO NOTHING RETURNING game
         ), game AS (
             UPDATE games SET state = $3, ended_at_ms = clock_ms() FROM closed WHERE number = game
         )
         UPDATE owned SET over = true, ended_ms = clock_ms() FROM open
         WHERE owned.id = $1 AND ($4 IS NULL OR EXISTS (SELECT FROM closed))",
    )
    .bind(owned.id.bytes().as_slice())
    .bind(owned.epoch)
    // Only an aborted game can end before the deal.
    .bind(i32::from(v1::RoomState::Aborted))
    .bind(number)
    .bind(rows)
    .execute(&mut *connection)
    .await?;
    match over.rows_affected() {
        0 => not_ended(connection, owned, rows).await,
        _ => Ok(Ended::Now {
            number: number.unwrap_or_default(),
            has_record: false,
        }),
    }
}

/// Ends and stores an ephemeral game.
pub(super) async fn whole(
    connection: &mut PgConnection,
    owned: Owned,
    game: &WholeGame,
) -> sqlx::Result<Ended> {
    let query = sqlx::query(
        "WITH room AS (
             UPDATE owned SET over = true, ended_ms = clock_ms()
             WHERE id = $12 AND epoch = $13 AND NOT over RETURNING id
         ), game AS (
             INSERT INTO games (game_id, form, header, state, summary, origin, room_name, created_at_ms,
                                ended_at_ms, signature)
             SELECT $14, $15, $16, $1, $2, $3, $4, $5, $6, $11 FROM room
             ON CONFLICT DO NOTHING RETURNING number
         ), row AS (
             INSERT INTO journal (game, position, epoch, entries)
             SELECT number, 0, $13, $17 FROM game
         ), seats AS (
             INSERT INTO participants (game, seat, name, agent, kind)
             SELECT number, seat.* FROM game,
                    unnest($7::bigint[], $8::text[], $9::text[], $10::integer[]) AS seat
             ON CONFLICT DO NOTHING
         )
         SELECT (SELECT number FROM game) FROM room",
    );
    let ended = with_summary(query, &game.end.summary)
        .bind(game.end.signature.as_deref())
        .bind(owned.id.bytes().as_slice())
        .bind(owned.epoch)
        .bind(game.game_id.bytes().as_slice())
        .bind(FORM)
        .bind(game.header.as_slice())
        .bind(game.entries.as_slice())
        .fetch_optional(&mut *connection)
        .await?;
    match ended {
        Some(row) => Ok(match row.get(0) {
            Some(number) => Ended::Now {
                number,
                has_record: true,
            },
            None => Ended::Refused(StoreError::Taken(game.game_id.to_string())),
        }),
        None => not_ended(connection, owned, None).await,
    }
}

/// Stores a game that was played elsewhere.
pub(super) async fn import(
    connection: &mut PgConnection,
    game_id: GameId,
    record: &[u8],
    summary: &v1::RecordSummary,
    again: bool,
) -> sqlx::Result<Ended> {
    let query = sqlx::query(
        "WITH game AS (
             INSERT INTO games (game_id, form, added, state, summary, origin, room_name, created_at_ms, ended_at_ms)
             SELECT $11, $12, true, $1, $2, $3, $4, $5, $6
             WHERE NOT EXISTS (SELECT FROM owned WHERE game_id = $11 AND NOT over)
             ON CONFLICT DO NOTHING RETURNING number
         ), added AS (
             INSERT INTO added_records (game, record) SELECT number, $13 FROM game
         ), seats AS (
             INSERT INTO participants (game, seat, name, agent, kind)
             SELECT number, seat.* FROM game,
                    unnest($7::bigint[], $8::text[], $9::text[], $10::integer[]) AS seat
             ON CONFLICT DO NOTHING
         )
         SELECT number FROM game",
    );
    let imported = with_summary(query, summary)
        .bind(game_id.bytes().as_slice())
        .bind(FORM)
        .bind(record)
        .fetch_optional(&mut *connection)
        .await?;
    if let Some(row) = imported {
        return Ok(Ended::Now {
            number: row.get(0),
            has_record: true,
        });
    }
    if again {
        let own = sqlx::query(confirming!(
            "number FROM games JOIN added_records ON game = number
             WHERE game_id = $1 AND record = $2"
        ))
        .bind(game_id.bytes().as_slice())
        .bind(record)
        .fetch_optional(connection)
        .await?;
        if own.is_some() {
            return Ok(Ended::Before);
        }
    }
    Ok(Ended::Refused(StoreError::Taken(game_id.to_string())))
}

/// Adds games to the end of the list of finished games. From here to the commit, nobody else does.
pub(super) async fn number(connection: &mut PgConnection, games: &[i64]) -> sqlx::Result<()> {
    sqlx::query(
        "WITH counted AS (
             UPDATE finished SET last = last + cardinality($1) RETURNING last
         )
         UPDATE games SET listed = counted.last - cardinality($1) + game.place
         FROM counted, unnest($1) WITH ORDINALITY AS game (number, place)
         WHERE games.number = game.number",
    )
    .bind(games)
    .execute(connection)
    .await
    .map(drop)
}

/// Binds the search fields of a summary to the first ten places of a statement.
fn with_summary<'q>(
    query: Query<'q, Postgres, PgArguments>,
    summary: &v1::RecordSummary,
) -> Query<'q, Postgres, PgArguments> {
    // How long an imported game is kept counts from its import.
    let ended_at_ms = match summary.added {
        true => since_epoch_ms(),
        false => summary.ended_at_ms,
    };
    let seats = &summary.seats;
    let column = |value: fn(&v1::Participant) -> &str| -> Vec<String> {
        seats
            .iter()
            .map(|seat| indexed_name(value(seat)).into())
            .collect()
    };
    query
        .bind(summary.state)
        .bind(summary.encode_to_vec())
        .bind(summary.origin)
        .bind(text(&summary.room_name).into_owned())
        .bind(integer(summary.created_at_ms))
        .bind(integer(ended_at_ms))
        .bind(
            seats
                .iter()
                .map(|it| i64::from(it.seat))
                .collect::<Vec<_>>(),
        )
        .bind(column(|seat| &seat.name))
        .bind(column(|seat| &seat.built_in_agent))
        .bind(seats.iter().map(|it| it.kind).collect::<Vec<_>>())
}
