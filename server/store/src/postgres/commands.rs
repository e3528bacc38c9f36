//! What a node writes besides the rows of running games: beginnings and ends of games (`ends`),
//! imports, tournaments. Each command is one statement of a transaction, which keeps what it finds done by
//! itself. Unlike appends, those that belong to a room or tournament lock its row in `owned`, so
//! they and a takeover come one after the other.

use std::sync::Arc;

use chefshat_proto::v1;
use sqlx::postgres::PgConnection;
use sqlx::{Connection as _, Row as _};

use super::ends::{End, Ended, WholeGame, finish, give_up, import, number, whole};
use super::forget::rewrite;
use super::retained::{divided, locked};
use super::units;
use super::values::{Owned, text};
use super::writer::{Answers, Work, confirming};
use crate::StoreError;
use crate::forget::Rewrite;
use crate::form::FORM;
use crate::sql::integer;
use chefshat_room::ids::GameId;

/// A command to a writer. Its answer is the number of the game, if it has one, else 0.
#[derive(Debug)]
pub(super) enum Command {
    /// Creates a room, with its game if that is durable.
    Create {
        owned: Owned,
        node: i64,
        join_code: String,
        game_id: GameId,
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
        game_id: GameId,
        record: Vec<u8>,
        summary: Box<v1::RecordSummary>,
    },
    /// Marks the record of a game as written to a file.
    RecordWritten { game_id: GameId },
    /// Deletes finished games that no tournament or study needs.
    Prune { games: Vec<GameId> },
    /// Deletes finished games.
    Delete { games: Vec<GameId> },
    /// Removes a participant from games and tournaments that are over.
    Rewrite(Rewrite),
    /// Writes something for a tournament or study.
    Unit(units::Change),
}

impl Work for Command {
    type Answer = i64;
    const MOST: usize = 64;

    async fn commit(
        connection: &mut PgConnection,
        work: &[Arc<Self>],
        again: bool,
    ) -> sqlx::Result<Answers<Self>> {
        let mut transaction = connection.begin().await?;
        let mut answers = Vec::with_capacity(work.len());
        let mut listed = Vec::new();
        lock_ids(&mut transaction, work).await?;
        for command in work {
            answers.push(command.run(&mut transaction, again, &mut listed).await?);
        }
        if !listed.is_empty() {
            number(&mut transaction, &listed).await?;
        }
        transaction.commit().await?;
        Ok(answers)
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
                    .bind(game_id.bytes().as_slice())
                    .execute(connection)
                    .await?;
                return Ok(Ok(0));
            }
            Self::Prune { games } => return prune(connection, games).await.map(Ok),
            Self::Delete { games } => return delete(connection, games).await.map(Ok),
            Self::Rewrite(changes) => {
                rewrite(connection, changes).await?;
                return Ok(Ok(0));
            }
            Self::Unit(change) => return change.run(connection, again).await,
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
                 WHERE EXISTS (SELECT FROM game)
                    OR $3 IS NULL AND NOT EXISTS (SELECT FROM games WHERE game_id = $1)
                 ON CONFLICT DO NOTHING RETURNING id
             ), first AS (
                 INSERT INTO journal (game, position, epoch, entries)
                 SELECT number, 0, $8, $11 FROM game, place WHERE $11 IS NOT NULL
             )
             SELECT (SELECT number FROM game), EXISTS (SELECT FROM place), EXISTS (SELECT FROM owner)",
        )
        .bind(game_id.bytes().as_slice())
        .bind(FORM)
        .bind(header)
        .bind(integer(*created_at_ms))
        .bind(*node)
        .bind(owned.id.bytes().as_slice())
        .bind(owned.unit.bytes().as_slice())
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
            let own: Option<Option<i64>> = sqlx::query_scalar(confirming!(
                "number FROM owned LEFT JOIN games USING (game_id)
                 WHERE id = $1 AND game_id = $2 AND epoch = $3 AND header IS NOT DISTINCT FROM $4"
            ))
            .bind(owned.id.bytes().as_slice())
            .bind(game_id.bytes().as_slice())
            .bind(owned.epoch)
            .bind(header)
            .fetch_optional(connection)
            .await?;
            if let Some(number) = own {
                return Ok(Ok(number.unwrap_or_default()));
            }
        }
        Ok(Err(match owner {
            true => StoreError::Taken(game_id.to_string()),
            false => owned.fenced(),
        }))
    }
}

/// Waits for other transactions that take ids of games outside of one another's sight, until the end
/// of this one: an import looks for no running game, and an ephemeral game for no stored one, but
/// neither sees what is not committed. In order, so that nobody waits for each other.
async fn lock_ids(connection: &mut PgConnection, work: &[Arc<Command>]) -> sqlx::Result<()> {
    let mut keys: Vec<i64> = (work.iter())
        .filter_map(|command| match &**command {
            Command::Import { game_id, .. } => Some(game_id),
            Command::Create {
                game_id,
                durable: None,
                ..
            } => Some(game_id),
            _ => None,
        })
        .map(|id| i64::from_be_bytes(std::array::from_fn(|index| id.bytes()[index])))
        .collect();
    keys.sort_unstable();
    keys.dedup();
    for key in keys {
        sqlx::query("SELECT pg_advisory_xact_lock($1)")
            .bind(key)
            .execute(&mut *connection)
            .await?;
    }
    Ok(())
}

/// Deletes those of these finished games that no tournament or study needs. Their journals follow:
/// see [`super::partitions`].
async fn prune(connection: &mut PgConnection, games: &[GameId]) -> sqlx::Result<i64> {
    let games = locked(connection, games).await?;
    let (free, _) = divided(connection, games).await?;
    let free: Vec<i64> = free.iter().map(|game| game.number).collect();
    sqlx::query(
        "WITH game AS (
             DELETE FROM games WHERE number = ANY ($1) RETURNING number
         ), journals AS (
             INSERT INTO pruned (game, at_ms) SELECT number, clock_ms() FROM game
         ), added AS (
             DELETE FROM added_records USING game WHERE game = number
         )
         DELETE FROM participants USING game WHERE game = number",
    )
    .bind(free)
    .execute(connection)
    .await
    .map(|_| 0)
}

async fn delete(connection: &mut PgConnection, games: &[GameId]) -> sqlx::Result<i64> {
    let ids: Vec<&[u8]> = games.iter().map(|id| id.bytes().as_slice()).collect();
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
