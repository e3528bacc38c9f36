//! What a node writes besides the rows of running games: beginnings and ends of games, imports,
//! tournaments. Each command is one statement of a transaction, which keeps what it finds done by
//! itself. Unlike appends, those that belong to a room or tournament lock its row in `owned`, so
//! they and a takeover come one after the other.

use std::borrow::Cow;
use std::sync::Arc;

use chefshat_proto::v1;
use futures::FutureExt as _;
use futures::future::BoxFuture;
use prost::Message as _;
use sqlx::postgres::{PgArguments, PgConnection};
use sqlx::query::Query;
use sqlx::{Connection as _, Postgres, Row as _};

use super::integer;
use super::writer::{Answers, Work};
use crate::clock::since_epoch_ms;
use crate::store::StoreError;
use crate::store::form::FORM;
use chefshat_room::ids::Id;

/// A room or tournament, and the epoch at which its owner writes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Owned {
    pub(super) id: Id,
    pub(super) unit: Id,
    pub(super) epoch: i64,
}

impl Owned {
    fn fenced(self) -> StoreError {
        StoreError::Fenced(self.unit)
    }
}

/// The end of a game with a record.
#[derive(Debug)]
pub(super) struct End {
    pub(super) summary: Box<v1::RecordSummary>,
    pub(super) signature: Option<Vec<u8>>,
}

/// A command to a writer. Its answer is the number of the game, if it has one, else 0.
#[derive(Debug)]
pub(super) enum Command {
    /// Creates a room, with its game if that is durable.
    Create {
        owned: Owned,
        node: i64,
        join_code: String,
        game_id: Id,
        rules_version: u32,
        created_at_ms: u64,
        /// Header and first row; `None`: the game is ephemeral.
        durable: Option<(Vec<u8>, Option<Vec<u8>>)>,
    },
    /// Ends a durable game; without `end` it has no record.
    Finish {
        owned: Owned,
        number: i64,
        /// Number of rows of its journal. An empty row follows, so that no late append can.
        rows: i64,
        end: Option<End>,
    },
    /// Ends an ephemeral game, and stores it if it has a record.
    Whole {
        owned: Owned,
        game: Option<Box<WholeGame>>,
    },
    /// Stores a game that was played elsewhere.
    Import {
        game_id: Id,
        record: Vec<u8>,
        summary: Box<v1::RecordSummary>,
    },
    /// Marks the record of a game as written to a file.
    RecordWritten { game_id: Id },
    /// Deletes finished games.
    Delete { games: Vec<Id> },
    /// Creates a tournament with its first row.
    Tournament {
        id: Id,
        node: i64,
        join_code: String,
        header: Vec<u8>,
        entries: Vec<u8>,
        over: bool,
    },
    /// Adds a row to a tournament.
    TournamentEntries {
        owned: Owned,
        position: i64,
        entries: Vec<u8>,
        over: bool,
    },
}

/// An ephemeral game that has ended.
#[derive(Debug)]
pub(super) struct WholeGame {
    pub(super) game_id: Id,
    pub(super) header: Vec<u8>,
    pub(super) entries: Vec<u8>,
    pub(super) end: End,
}

impl Work for Command {
    type Answer = i64;
    const MOST: usize = 64;

    fn commit<'a>(
        connection: &'a mut PgConnection,
        work: &'a [Arc<Self>],
        again: bool,
    ) -> BoxFuture<'a, sqlx::Result<Answers<Self>>> {
        async move {
            let mut transaction = connection.begin().await?;
            let mut answers = Vec::with_capacity(work.len());
            let mut listed = Vec::new();
            for command in work {
                answers.push(command.run(&mut transaction, again, &mut listed).await?);
            }
            if !listed.is_empty() {
                number(&mut transaction, &listed).await?;
            }
            transaction.commit().await?;
            Ok(answers)
        }
        .boxed()
    }
}

impl Command {
    /// Runs the command; adds the game to `listed` if it belongs into the list of finished games.
    async fn run(
        &self,
        connection: &mut PgConnection,
        again: bool,
        listed: &mut Vec<i64>,
    ) -> sqlx::Result<Result<i64, StoreError>> {
        let ended = match self {
            Self::Create { .. } => return self.create(connection, again).await,
            Self::Finish {
                owned,
                number,
                rows,
                end,
            } => match end {
                Some(end) => finish(connection, *owned, (*number, *rows), end).await?,
                None => give_up(connection, *owned, Some((*number, *rows))).await?,
            },
            Self::Whole { owned, game } => match game {
                Some(game) => whole(connection, *owned, game).await?,
                None => give_up(connection, *owned, None).await?,
            },
            Self::Import {
                game_id,
                record,
                summary,
            } => import(connection, *game_id, record, summary, again).await?,
            Self::RecordWritten { game_id } => {
                sqlx::query("UPDATE games SET filed = true WHERE game_id = $1 AND NOT filed")
                    .bind(game_id.0.as_slice())
                    .execute(connection)
                    .await?;
                return Ok(Ok(0));
            }
            Self::Delete { games } => return delete(connection, games).await.map(Ok),
            Self::Tournament { .. } => return self.create_tournament(connection, again).await,
            Self::TournamentEntries {
                owned,
                position,
                entries,
                over,
            } => {
                let row = (*position, entries.as_slice(), *over);
                return append_tournament(connection, *owned, row).await;
            }
        };
        Ok(match ended {
            Ended::Now { number, has_record } => {
                listed.extend(has_record.then_some(number));
                Ok(number)
            }
            Ended::Before => Ok(0),
            Ended::Refused(error) => Err(error),
        })
    }

    async fn create(
        &self,
        connection: &mut PgConnection,
        again: bool,
    ) -> sqlx::Result<Result<i64, StoreError>> {
        let Self::Create {
            owned,
            node,
            join_code,
            game_id,
            rules_version,
            created_at_ms,
            durable,
        } = self
        else {
            unreachable!("only called for this command");
        };
        let (header, first) = match durable {
            Some((header, first)) => (Some(header.as_slice()), first.as_deref()),
            None => (None, None),
        };
        // A tournament's room is created at the epoch of the tournament, any other by a node that
        // the database knows.
        let row = sqlx::query(
            "WITH game AS (
                 INSERT INTO games (game_id, form, state, header, created_at_ms)
                 SELECT $1, $2, 0, $3, $4 WHERE $3 IS NOT NULL
                 ON CONFLICT DO NOTHING RETURNING number
             ), owner AS (
                 SELECT node FROM nodes WHERE node = $5 AND $6 = $7
                 UNION ALL
                 SELECT node FROM (SELECT node FROM owned
                                   WHERE id = $7 AND $6 <> $7 AND epoch = $8 AND NOT over
                                   FOR SHARE) tournament
             ), place AS (
                 INSERT INTO owned (id, unit, kind, node, epoch, join_code, game_id, durable, form, rules_version)
                 SELECT $6, $7, 0, node, $8, $9, $1, $3 IS NOT NULL, $2, $10 FROM owner
                 WHERE $3 IS NULL OR EXISTS (SELECT FROM game)
                 ON CONFLICT DO NOTHING RETURNING id
             ), first AS (
                 INSERT INTO journal (game, position, epoch, entries)
                 SELECT number, 0, $8, $11 FROM game, place WHERE $11 IS NOT NULL
             )
             SELECT (SELECT number FROM game), EXISTS (SELECT FROM place), EXISTS (SELECT FROM owner)",
        )
        .bind(game_id.0.as_slice())
        .bind(FORM)
        .bind(header)
        .bind(integer(*created_at_ms))
        .bind(*node)
        .bind(owned.id.0.as_slice())
        .bind(owned.unit.0.as_slice())
        .bind(owned.epoch)
        .bind(text(join_code))
        .bind(i64::from(*rules_version))
        .bind(first)
        .fetch_one(&mut *connection)
        .await?;
        let (number, placed, owner): (Option<i64>, bool, bool) =
            (row.get(0), row.get(1), row.get(2));
        if placed {
            return Ok(Ok(number.unwrap_or_default()));
        }
        if let Some(number) = number {
            sqlx::query("DELETE FROM games WHERE number = $1")
                .bind(number)
                .execute(&mut *connection)
                .await?;
        }
        if again {
            let own: Option<Option<i64>> = sqlx::query_scalar(
                "SELECT number FROM owned LEFT JOIN games USING (game_id)
                 WHERE id = $1 AND game_id = $2 AND epoch = $3 AND header IS NOT DISTINCT FROM $4",
            )
            .bind(owned.id.0.as_slice())
            .bind(game_id.0.as_slice())
            .bind(owned.epoch)
            .bind(header)
            .fetch_optional(connection)
            .await?;
            if let Some(number) = own {
                return Ok(Ok(number.unwrap_or_default()));
            }
        }
        Ok(Err(match owner {
            true => StoreError::Taken(*game_id),
            false => owned.fenced(),
        }))
    }

    async fn create_tournament(
        &self,
        connection: &mut PgConnection,
        again: bool,
    ) -> sqlx::Result<Result<i64, StoreError>> {
        let Self::Tournament {
            id,
            node,
            join_code,
            header,
            entries,
            over,
        } = self
        else {
            unreachable!("only called for this command");
        };
        let row = sqlx::query(
            "WITH owner AS (
                 SELECT node FROM nodes WHERE node = $1
             ), place AS (
                 INSERT INTO owned (id, unit, kind, node, epoch, join_code, durable, form, over)
                 SELECT $2, $2, 1, node, 1, $3, true, $4, $5 FROM owner
                 ON CONFLICT DO NOTHING RETURNING id
             ), tournament AS (
                 INSERT INTO tournaments (tournament_id, form, over, header)
                 SELECT $2, $4, $5, $6 FROM place RETURNING number
             ), first AS (
                 INSERT INTO tournament_entries (tournament, position, epoch, entries)
                 SELECT number, 0, 1, $7 FROM tournament
             )
             SELECT EXISTS (SELECT FROM place), EXISTS (SELECT FROM owner),
                    EXISTS (SELECT FROM tournaments WHERE tournament_id = $2 AND header = $6)",
        )
        .bind(*node)
        .bind(id.0.as_slice())
        .bind(text(join_code))
        .bind(FORM)
        .bind(*over)
        .bind(header.as_slice())
        .bind(entries.as_slice())
        .fetch_one(connection)
        .await?;
        let (placed, owner, stands): (bool, bool, bool) = (row.get(0), row.get(1), row.get(2));
        Ok(match placed || (again && stands) {
            true => Ok(0),
            false if owner => Err(StoreError::Taken(*id)),
            false => Err(StoreError::Fenced(*id)),
        })
    }
}

/// What became of the end of a game.
enum Ended {
    /// It has ended.
    Now { number: i64, has_record: bool },
    /// An earlier attempt without an answer ended it.
    Before,
    /// It was not ended.
    Refused(StoreError),
}

/// What a room that could not be ended is: over already, at this epoch, or another node's.
async fn not_ended(connection: &mut PgConnection, owned: Owned) -> sqlx::Result<Ended> {
    let over: bool = sqlx::query_scalar(
        "SELECT EXISTS (SELECT FROM owned WHERE id = $1 AND epoch = $2 AND over)",
    )
    .bind(owned.id.0.as_slice())
    .bind(owned.epoch)
    .fetch_one(connection)
    .await?;
    Ok(match over {
        true => Ended::Before,
        false => Ended::Refused(owned.fenced()),
    })
}

async fn finish(
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
        .bind(owned.id.0.as_slice())
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
        None => not_ended(connection, owned).await,
    }
}

/// Ends a game without a record; a durable one has a number and a journal with some rows.
async fn give_up(
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
             SELECT $4, $5, $2, '' FROM open WHERE $4 IS NOT NULL
             ON CONFLICT DO NOTHING RETURNING game
         ), game AS (
             UPDATE games SET state = $3, ended_at_ms = clock_ms() FROM closed WHERE number = game
         )
         UPDATE owned SET over = true, ended_ms = clock_ms() FROM open
         WHERE owned.id = $1 AND ($4 IS NULL OR EXISTS (SELECT FROM closed))",
    )
    .bind(owned.id.0.as_slice())
    .bind(owned.epoch)
    // Only an aborted game can end before the deal.
    .bind(i32::from(v1::RoomState::Aborted))
    .bind(number)
    .bind(rows)
    .execute(&mut *connection)
    .await?;
    match over.rows_affected() {
        0 => not_ended(connection, owned).await,
        _ => Ok(Ended::Now {
            number: number.unwrap_or_default(),
            has_record: false,
        }),
    }
}

async fn whole(
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
        .bind(owned.id.0.as_slice())
        .bind(owned.epoch)
        .bind(game.game_id.0.as_slice())
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
            None => Ended::Refused(StoreError::Taken(game.game_id)),
        }),
        None => not_ended(connection, owned).await,
    }
}

async fn import(
    connection: &mut PgConnection,
    game_id: Id,
    record: &[u8],
    summary: &v1::RecordSummary,
    again: bool,
) -> sqlx::Result<Ended> {
    let query = sqlx::query(
        "WITH game AS (
             INSERT INTO games (game_id, form, added, state, summary, origin, room_name, created_at_ms, ended_at_ms)
             VALUES ($11, $12, true, $1, $2, $3, $4, $5, $6)
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
        .bind(game_id.0.as_slice())
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
    let stands = again
        && sqlx::query_scalar(
            "SELECT EXISTS (SELECT FROM games JOIN added_records ON game = number
                            WHERE game_id = $1 AND record = $2)",
        )
        .bind(game_id.0.as_slice())
        .bind(record)
        .fetch_one(connection)
        .await?;
    Ok(match stands {
        true => Ended::Before,
        false => Ended::Refused(StoreError::Taken(game_id)),
    })
}

/// Adds games to the end of the list of finished games. From here to the commit, nobody else does.
async fn number(connection: &mut PgConnection, games: &[i64]) -> sqlx::Result<()> {
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

async fn delete(connection: &mut PgConnection, games: &[Id]) -> sqlx::Result<i64> {
    let ids: Vec<&[u8]> = games.iter().map(|id| id.0.as_slice()).collect();
    sqlx::query(
        "WITH game AS (
             DELETE FROM games WHERE number IN (
                 SELECT number FROM games WHERE game_id = ANY ($1) AND state <> 0
                 ORDER BY number FOR UPDATE)
             RETURNING number
         ), rows AS (
             DELETE FROM journal USING game WHERE game = number
         ), added AS (
             DELETE FROM added_records USING game WHERE game = number
         )
         DELETE FROM participants USING game WHERE game = number",
    )
    .bind(ids)
    .execute(connection)
    .await
    .map(|_| 0)
}

async fn append_tournament(
    connection: &mut PgConnection,
    owned: Owned,
    (position, entries, over): (i64, &[u8], bool),
) -> sqlx::Result<Result<i64, StoreError>> {
    let kept: bool = sqlx::query_scalar(
        "WITH owner AS (
             SELECT id FROM owned WHERE id = $1 AND epoch = $2 FOR UPDATE
         ), row AS (
             INSERT INTO tournament_entries (tournament, position, epoch, entries)
             SELECT number, $3, $2, $4 FROM owner JOIN tournaments ON tournament_id = id
             ON CONFLICT DO NOTHING RETURNING tournament
         ), over_owned AS (
             UPDATE owned SET over = true, ended_ms = clock_ms() FROM row WHERE id = $1 AND $5
         ), over_tournament AS (
             UPDATE tournaments SET over = true FROM row WHERE number = tournament AND $5
         )
         SELECT EXISTS (SELECT FROM row)
                OR EXISTS (SELECT FROM tournaments JOIN tournament_entries ON tournament = number
                           WHERE tournament_id = $1 AND position = $3 AND epoch = $2 AND entries = $4)",
    )
    .bind(owned.id.0.as_slice())
    .bind(owned.epoch)
    .bind(position)
    .bind(entries)
    .bind(over)
    .fetch_one(connection)
    .await?;
    Ok(match kept {
        true => Ok(0),
        false => Err(owned.fenced()),
    })
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
        seats.iter().map(|seat| text(value(seat)).into()).collect()
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

/// A text as the database takes it: it has no NUL.
pub(super) fn text(text: &str) -> Cow<'_, str> {
    match text.contains('\0') {
        true => text.replace('\0', "\u{fffd}").into(),
        false => text.into(),
    }
}
