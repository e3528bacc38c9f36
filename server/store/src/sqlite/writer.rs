//! The only writer of the database. Rooms send it commands and wait; it executes all waiting
//! commands in one transaction, so that many rooms share one sync of the disk. While a transaction
//! is synced, the next one gathers: no command waits for others to arrive. Most transactions are
//! rows of the journal only; those are written by one call, because every call goes to the
//! database's own thread and back.

use std::collections::BTreeMap;
use std::sync::Arc;

use chefshat_proto::v1;
use prost::Message as _;
use sqlx::sqlite::SqliteConnection;
use sqlx::{AssertSqlSafe, Connection as _, Executor as _};
use tokio::sync::{mpsc, oneshot, watch};
use tokio::time::Instant;
use tracing::{error, warn};

use super::errors::explain;
use super::retained::Units;
use super::rewriting::{empty_log, empty_log_in_place, rewrite};
use super::rows::with_own_rows;
use super::space::Space;
use super::units;
use crate::StoreError;
use crate::forget::Rewrite;
use crate::form::FORM;
use crate::sql::integer;
use crate::units::{UnitKey, UnitWrite};
use chefshat_base::clock::since_epoch_ms;
use chefshat_base::metrics::StoreMetrics;
use chefshat_room::ids::GameId;

/// Commands that may wait for the writer.
pub(super) const QUEUE: usize = 1_024;
/// Most commands in one transaction.
const MAX_COMMANDS_PER_TRANSACTION: usize = 1_024;
/// Unused pages that are given back to the disk with each deletion of games.
const FREED_PAGES: u32 = 2_048;
/// Numbers of rows that one statement inserts. There are only these, so that few statements need to
/// be prepared.
const ROWS: [usize; 5] = [1, 4, 16, 32, 64];

/// A command to the writer.
pub(super) enum WriteCommand {
    /// Creates a game.
    Create {
        number: i64,
        game_id: GameId,
        header: Vec<u8>,
        /// Lowest number of its rows.
        first_row: i64,
        /// Its first row, if there is one.
        first: Option<Row>,
    },
    /// Adds a row to a game.
    Append(Row),
    /// Ends a game.
    Finish {
        number: i64,
        state: i32,
        last_row: Option<i64>,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<Vec<u8>>,
    },
    /// Stores a game that was only in memory until it ended.
    Whole {
        number: i64,
        game_id: GameId,
        header: Vec<u8>,
        row: i64,
        entries: Vec<u8>,
        summary: Box<v1::RecordSummary>,
        signature: Option<Vec<u8>>,
    },
    /// Stores a game that was played elsewhere.
    Import {
        number: i64,
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
    /// Writes something for a tournament or study.
    Unit(UnitKey, UnitWrite),
    /// Removes a participant from games and tournaments that are over.
    Rewrite(Box<Rewrite>),
    /// No command follows.
    Close,
}

impl WriteCommand {
    /// Whether it only deletes.
    fn is_deletion(&self) -> bool {
        matches!(
            self,
            Self::Delete { .. } | Self::Prune { .. } | Self::Unit(_, UnitWrite::Delete)
        )
    }

    /// Whether what it overwrites must not stay in the log.
    fn forgets(&self) -> bool {
        let rewrites = matches!(
            self,
            Self::Rewrite(_) | Self::Unit(_, UnitWrite::Rewrite { .. })
        );
        self.is_deletion() || rewrites
    }
}

/// A row of the journal.
pub(super) struct Row {
    /// Its number, nearly in the order of all games' rows.
    pub(super) number: i64,
    pub(super) game: i64,
    /// Its number in its game, from 0.
    pub(super) position: i64,
    /// The number of the game's previous row.
    pub(super) previous: Option<i64>,
    pub(super) entries: Vec<u8>,
    /// Whether the game has an older encoding, to which the entries may be unknown.
    pub(super) raises_form: bool,
}

/// A command and the sender of its result.
pub(super) type Pending = (WriteCommand, oneshot::Sender<Result<(), StoreError>>);

/// Ids of commands that were refused because it is taken, by the index of the command.
type Taken = BTreeMap<usize, String>;

/// Executes commands until all senders are gone. While the disk is full, all but deletions wait:
/// nothing of such a transaction was committed. After any other failure it executes none: the outcome of the failed
/// transaction is unknown.
///
/// `last_listed` is the highest number in the list of finished games.
pub(super) async fn run(
    mut connection: SqliteConnection,
    mut last_listed: i64,
    mut commands: mpsc::Receiver<Pending>,
    failed: watch::Sender<Option<StoreError>>,
    metrics: StoreMetrics,
    space: Arc<Space>,
) {
    let mut pending = Vec::new();
    let mut open = true;
    while open
        && commands
            .recv_many(&mut pending, MAX_COMMANDS_PER_TRANSACTION)
            .await
            > 0
    {
        let failure = failed.borrow().clone();
        let began = Instant::now();
        let waits = metrics.waits();
        let committed = match failure {
            Some(failure) => Err(failure),
            None => {
                let log = &mut last_listed;
                commit_with_space(&mut connection, &mut pending, &mut commands, log, &space)
                    .await
                    .map_err(|cause| {
                        let failure = StoreError::Failed(explain(&cause));
                        error!(%failure, "a commit failed; the store stops");
                        failed.send_replace(Some(failure.clone()));
                        failure
                    })
            }
        };
        drop(waits);
        metrics.committed(pending.len(), began.elapsed());
        open = !pending
            .iter()
            .any(|(order, _)| matches!(order, WriteCommand::Close));
        let forgets = committed.is_ok() && pending.iter().any(|(order, _)| order.forgets());
        let deletes = forgets && pending.iter().any(|(order, _)| order.is_deletion());
        send_replies(&mut pending, &committed);
        if deletes {
            free_pages(&mut connection).await;
        }
        if forgets {
            empty_log(&mut connection).await;
        }
    }
    // The write-ahead log is as safe as the database: closing only tidies up.
    if let Err(cause) = connection.close().await {
        error!(%cause, "closing the database failed");
    }
}

fn send_replies(pending: &mut Vec<Pending>, committed: &Result<Taken, StoreError>) {
    for (index, (_, reply)) in pending.drain(..).enumerate() {
        let answer = match committed {
            Ok(taken) => taken
                .get(&index)
                .map_or(Ok(()), |id| Err(StoreError::Taken(id.clone()))),
            Err(failure) => Err(failure.clone()),
        };
        // The room may have gone.
        let _ = reply.send(answer);
    }
}

/// Commits commands, as soon as there is space for them on the disk. Meanwhile it takes all that
/// arrive, since a deletion may be behind the others. The numbers of rooms, tournaments and studies
/// bound them: each waits for its command before it sends the next, and a full disk refuses new ones.
async fn commit_with_space(
    connection: &mut SqliteConnection,
    pending: &mut Vec<Pending>,
    commands: &mut mpsc::Receiver<Pending>,
    last_listed: &mut i64,
    space: &Space,
) -> sqlx::Result<Taken> {
    let began = Instant::now();
    let listed_before = *last_listed;
    loop {
        match commit(connection, pending, last_listed).await {
            Ok(taken) => {
                space.found();
                return Ok(taken);
            }
            Err(cause) if space.explains(&cause) => {
                *last_listed = listed_before;
                while let Ok(next) = commands.try_recv() {
                    pending.push(next);
                }
                if !delete_first(connection, pending, space).await? && !space.wait(began).await {
                    return Err(cause);
                }
            }
            Err(cause) => return Err(cause),
        }
    }
}

/// Commits the deletions among commands that wait for space: they may be what frees it. Returns
/// whether there were any, and the space sufficed for them.
async fn delete_first(
    connection: &mut SqliteConnection,
    pending: &mut Vec<Pending>,
    space: &Space,
) -> sqlx::Result<bool> {
    let mut deletions: Vec<Pending> = pending
        .extract_if(.., |(order, _)| order.is_deletion())
        .collect();
    if deletions.is_empty() {
        return Ok(false);
    }
    // A deletion writes to the log, which has the space of what it contained once that is in the
    // database, and if that does not suffice, the space that was kept for a start.
    empty_log_in_place(connection).await;
    let mut committed = commit(connection, &mut deletions, &mut 0).await;
    if matches!(&committed, Err(cause) if space.explains(cause)) && space.give_up_ballast() {
        committed = commit(connection, &mut deletions, &mut 0).await;
    }
    match committed {
        Ok(taken) => {
            send_replies(&mut deletions, &Ok(taken));
            free_pages(connection).await;
            empty_log(connection).await;
            Ok(true)
        }
        Err(cause) => {
            pending.append(&mut deletions);
            match space.explains(&cause) {
                true => Ok(false),
                false => Err(cause),
            }
        }
    }
}

/// Commits commands.
async fn commit(
    connection: &mut SqliteConnection,
    pending: &mut [Pending],
    last_listed: &mut i64,
) -> sqlx::Result<Taken> {
    let written = write(connection, pending, last_listed).await;
    if written.is_err() {
        // The transaction is rolled back in any case, at the latest when the file is opened again.
        let _ = connection.execute("ROLLBACK").await;
    }
    written
}

/// Writes commands in one transaction.
async fn write(
    connection: &mut SqliteConnection,
    pending: &mut [Pending],
    last_listed: &mut i64,
) -> sqlx::Result<Taken> {
    let mut taken = BTreeMap::new();
    let mut rows = Vec::with_capacity(pending.len());
    let rows_alone = (pending.iter())
        .all(|(order, _)| matches!(order, WriteCommand::Append(row) if !row.raises_form));
    if !rows_alone {
        connection.execute("BEGIN IMMEDIATE").await?;
    }
    // A game has at most one command at a time, so commands of different kinds may run in any
    // order.
    for (index, (order, _)) in pending.iter_mut().enumerate() {
        match order {
            WriteCommand::Append(row) => {
                if row.raises_form {
                    raise_form(connection, row.game).await?;
                }
                rows.push(row);
            }
            WriteCommand::Close => {}
            WriteCommand::Create {
                number,
                game_id,
                header,
                first_row,
                first,
            } => {
                if create(connection, *number, *game_id, header, *first_row).await? {
                    rows.extend(first);
                } else {
                    taken.insert(index, game_id.to_string());
                }
            }
            WriteCommand::Finish {
                number,
                state,
                last_row,
                summary,
                signature,
            } => {
                sqlx::query(
                    "UPDATE games SET state = $2, ended_at_ms = $3, last_row = $4, signature = $5
                     WHERE number = $1",
                )
                .bind(*number)
                .bind(*state)
                .bind(integer(since_epoch_ms()))
                .bind(*last_row)
                .bind(signature.as_deref())
                .execute(&mut *connection)
                .await?;
                if let Some(summary) = summary {
                    summarise(connection, *number, last_listed, summary).await?;
                }
            }
            WriteCommand::Whole {
                number,
                game_id,
                header,
                row,
                entries,
                summary,
                signature,
            } => {
                if !create(connection, *number, *game_id, header, *row).await? {
                    taken.insert(index, game_id.to_string());
                    continue;
                }
                sqlx::query("UPDATE games SET last_row = $2, signature = $3 WHERE number = $1")
                    .bind(*number)
                    .bind(*row)
                    .bind(signature.as_deref())
                    .execute(&mut *connection)
                    .await?;
                sqlx::query(
                    "INSERT INTO journal (row, game, position, entries) VALUES ($1, $2, 0, $3)",
                )
                .bind(*row)
                .bind(*number)
                .bind(entries.as_slice())
                .execute(&mut *connection)
                .await?;
                summarise(connection, *number, last_listed, summary).await?;
            }
            WriteCommand::Import {
                number,
                game_id,
                record,
                summary,
            } => {
                let added = sqlx::query(
                    "INSERT INTO games (number, game_id, form, state, added) VALUES ($1, $2, $3, 0, 1)
                     ON CONFLICT (game_id) DO NOTHING",
                )
                .bind(*number)
                .bind(game_id.bytes().as_slice())
                .bind(FORM)
                .execute(&mut *connection)
                .await?;
                if added.rows_affected() > 0 {
                    sqlx::query("INSERT INTO added_records (game, record) VALUES ($1, $2)")
                        .bind(*number)
                        .bind(record.as_slice())
                        .execute(&mut *connection)
                        .await?;
                    summarise(connection, *number, last_listed, summary).await?;
                } else {
                    taken.insert(index, game_id.to_string());
                }
            }
            WriteCommand::Unit(unit, change) => {
                if !units::write(connection, *unit, change).await? {
                    taken.insert(index, unit.id().to_string());
                }
            }
            WriteCommand::Prune { games } => prune(connection, games).await?,
            WriteCommand::Delete { games } => {
                for game in games {
                    delete(connection, *game).await?;
                }
            }
            WriteCommand::Rewrite(changes) => rewrite(connection, changes).await?,
            WriteCommand::RecordWritten { game_id } => {
                sqlx::query("UPDATE games SET filed = 1 WHERE game_id = $1")
                    .bind(game_id.bytes().as_slice())
                    .execute(&mut *connection)
                    .await?;
            }
        }
    }
    let begin = if rows_alone { "BEGIN IMMEDIATE; " } else { "" };
    rows.sort_by_key(|row| row.number);
    // The text only has placeholders for values.
    let text = format!("{begin}{}COMMIT", insert(rows.len()));
    let mut query = sqlx::query(AssertSqlSafe(text));
    for row in rows {
        query = query
            .bind(row.number)
            .bind(row.game)
            .bind(row.position)
            .bind(row.previous)
            .bind(row.entries.as_slice());
    }
    query.execute(&mut *connection).await?;
    Ok(taken)
}

/// Gives unused pages back to the disk, some at a time: rooms wait for it. The rest is used again.
async fn free_pages(connection: &mut SqliteConnection) {
    let text = format!("PRAGMA incremental_vacuum({FREED_PAGES})");
    if let Err(cause) = connection.execute(AssertSqlSafe(text)).await {
        // It needs space in the write-ahead log. What was committed before is safe.
        warn!(%cause, "the disk space of deleted games could not be given back");
    }
}

/// Deletes those of these finished games that no tournament or study needs.
async fn prune(connection: &mut SqliteConnection, games: &[GameId]) -> sqlx::Result<()> {
    let mut units = Units::default();
    for game in games {
        let row: Option<(i64, Option<Vec<u8>>)> =
            sqlx::query_as("SELECT form, header FROM games WHERE game_id = $1 AND state <> 0")
                .bind(game.bytes().as_slice())
                .fetch_optional(&mut *connection)
                .await?;
        let Some((form, header)) = row else { continue };
        if !units.need(connection, form, header.as_deref()).await? {
            delete(connection, *game).await?;
        }
    }
    Ok(())
}

/// Deletes a finished game.
async fn delete(connection: &mut SqliteConnection, game: GameId) -> sqlx::Result<()> {
    for text in [
        with_own_rows!(
            "(row, game) = (SELECT last_row, number FROM games WHERE game_id = $1 AND state <> 0)",
            "DELETE FROM journal WHERE row IN (SELECT row FROM own)"
        ),
        "DELETE FROM added_records WHERE game = (SELECT number FROM games WHERE game_id = $1 AND state <> 0)",
        "DELETE FROM participants WHERE game = (SELECT number FROM games WHERE game_id = $1 AND state <> 0)",
        "DELETE FROM games WHERE game_id = $1 AND state <> 0",
    ] {
        sqlx::query(text)
            .bind(game.bytes().as_slice())
            .execute(&mut *connection)
            .await?;
    }
    Ok(())
}

/// Statements that insert this number of rows into the journal. Unused placeholders of the last one
/// stay unbound, which SQLite reads as NULL. If one fails, the whole transaction is rolled back, so
/// SQLite need not keep an undo log for the statement.
fn insert(mut rows: usize) -> String {
    let mut text = String::new();
    while rows > 0 {
        let places = (ROWS.into_iter())
            .find(|places| *places >= rows)
            .unwrap_or(ROWS[ROWS.len() - 1]);
        let values = vec!["(?, ?, ?, ?, ?)"; places].join(", ");
        text.push_str(&format!(
            "INSERT OR ROLLBACK INTO journal (row, game, position, previous, entries)
             SELECT * FROM (VALUES {values}) WHERE column1 IS NOT NULL; "
        ));
        rows = rows.saturating_sub(places);
    }
    text
}

/// Says that a game has the encoding of this version, so that earlier ones leave it alone.
async fn raise_form(connection: &mut SqliteConnection, number: i64) -> sqlx::Result<()> {
    sqlx::query("UPDATE games SET form = $2 WHERE number = $1")
        .bind(number)
        .bind(FORM)
        .execute(connection)
        .await
        .map(drop)
}

/// Inserts a game; `false` if its id is taken.
async fn create(
    connection: &mut SqliteConnection,
    number: i64,
    game_id: GameId,
    header: &[u8],
    first_row: i64,
) -> sqlx::Result<bool> {
    sqlx::query(
        "INSERT INTO games (number, game_id, form, header, first_row, state)
         VALUES ($1, $2, $3, $4, $5, 0)
         ON CONFLICT (game_id) DO NOTHING",
    )
    .bind(number)
    .bind(game_id.bytes().as_slice())
    .bind(FORM)
    .bind(header)
    .bind(first_row)
    .execute(connection)
    .await
    .map(|created| created.rows_affected() > 0)
}

/// Writes the end and the search fields of a game, and adds it to the list of finished games.
async fn summarise(
    connection: &mut SqliteConnection,
    number: i64,
    last_listed: &mut i64,
    summary: &v1::RecordSummary,
) -> sqlx::Result<()> {
    *last_listed += 1;
    // How long an imported game is kept counts from its import.
    let ended_at_ms = match summary.added {
        true => since_epoch_ms(),
        false => summary.ended_at_ms,
    };
    sqlx::query(
        "UPDATE games SET state = $2, summary = $3, origin = $4, room_name = $5, created_at_ms = $6, ended_at_ms = $7,
                          listed = $8
         WHERE number = $1",
    )
    .bind(number)
    .bind(summary.state)
    .bind(summary.encode_to_vec())
    .bind(summary.origin)
    .bind(summary.room_name.as_str())
    .bind(integer(summary.created_at_ms))
    .bind(integer(ended_at_ms))
    .bind(*last_listed)
    .execute(&mut *connection)
    .await?;
    for seat in &summary.seats {
        sqlx::query(
            "INSERT OR REPLACE INTO participants (game, seat, name, agent, kind)
             VALUES ($1, $2, $3, $4, $5)",
        )
        .bind(number)
        .bind(seat.seat)
        .bind(seat.name.as_str())
        .bind(seat.built_in_agent.as_str())
        .bind(seat.kind)
        .execute(&mut *connection)
        .await?;
    }
    Ok(())
}
