//! The one writer of the database. Rooms hand it what they want kept and wait; it takes all that has come meanwhile into one transaction,
//! so that many rooms share one sync of the disk. While a transaction is being synced, the next one gathers: nobody waits for others to
//! come.

use chefshat_proto::v1;
use prost::Message as _;
use sqlx::sqlite::SqliteConnection;
use sqlx::{AssertSqlSafe, Connection as _, Executor as _};
use tokio::sync::{mpsc, oneshot, watch};
use tracing::error;

use super::errors::explain;
use super::form::FORM;
use crate::ids::Id;
use crate::room::since_epoch_ms;
use crate::store::StoreError;

/// Orders that wait for the writer.
pub(super) const QUEUE: usize = 1_024;
/// Orders in one transaction.
const MOST_IN_ONE: usize = 1_024;
/// Rows of the journal in one statement; what is left over goes in smaller ones, so that few statements need to be known.
const ROWS: [usize; 4] = [64, 16, 4, 1];

/// Something to be kept.
pub(super) enum Order {
    /// A game begins.
    Create {
        number: i64,
        game_id: Id,
        header: Vec<u8>,
    },
    /// A game goes on.
    Append(Row),
    /// A game is over.
    Finish {
        number: i64,
        state: i32,
        summary: Option<Box<v1::RecordSummary>>,
    },
    /// A game that was kept in memory until it was over.
    Whole {
        number: i64,
        game_id: Id,
        header: Vec<u8>,
        entries: Vec<u8>,
        summary: Box<v1::RecordSummary>,
    },
    /// A game that was played elsewhere.
    Import {
        number: i64,
        game_id: Id,
        record: Vec<u8>,
        summary: Box<v1::RecordSummary>,
    },
    /// The record of a game has been written to a file.
    Filed { game_id: Id },
    /// Nothing more will be ordered.
    Close,
}

/// A row of the journal.
pub(super) struct Row {
    pub(super) game: i64,
    pub(super) position: i64,
    pub(super) entries: Vec<u8>,
}

/// An order and whom to tell when it is kept.
pub(super) type Pending = (Order, oneshot::Sender<Result<(), StoreError>>);

/// Keeps what is ordered until nobody can order any more. After the first failure it keeps nothing: what became of the transaction that
/// failed is not known.
pub(super) async fn run(
    mut connection: SqliteConnection,
    mut orders: mpsc::Receiver<Pending>,
    failed: watch::Sender<Option<StoreError>>,
) {
    let mut pending = Vec::new();
    let mut open = true;
    while open && orders.recv_many(&mut pending, MOST_IN_ONE).await > 0 {
        open = !pending
            .iter()
            .any(|(order, _)| matches!(order, Order::Close));
        let failure = failed.borrow().clone();
        let kept = match failure {
            Some(failure) => Err(failure),
            None => keep(&mut connection, &mut pending).await.map_err(|cause| {
                let failure = StoreError(explain(&cause));
                error!(%failure, "the store fails");
                failed.send_replace(Some(failure.clone()));
                failure
            }),
        };
        for (_, reply) in pending.drain(..) {
            // A room that has gone does not want to know.
            let _ = reply.send(kept.clone());
        }
    }
    // What is in the write-ahead log is as safe as what is in the database: closing only tidies up.
    if let Err(cause) = connection.close().await {
        error!(%cause, "the database was not closed in good order");
    }
}

async fn keep(connection: &mut SqliteConnection, pending: &mut [Pending]) -> sqlx::Result<()> {
    connection.execute("BEGIN IMMEDIATE").await?;
    let written = write(connection, pending).await;
    if let Err(cause) = written {
        // The transaction is given up in any case, at the latest when the file is opened again.
        let _ = connection.execute("ROLLBACK").await;
        return Err(cause);
    }
    connection.execute("COMMIT").await.map(drop)
}

async fn write(connection: &mut SqliteConnection, pending: &mut [Pending]) -> sqlx::Result<()> {
    let mut rows = Vec::with_capacity(pending.len());
    // A game has one order at a time, so that those of different kinds may go in any order.
    for (order, _) in pending {
        match order {
            Order::Append(row) => rows.push(row),
            Order::Close => {}
            Order::Create {
                number,
                game_id,
                header,
            } => create(connection, *number, *game_id, header).await?,
            Order::Finish {
                number,
                state,
                summary,
            } => {
                sqlx::query("UPDATE games SET state = $2, ended_at_ms = $3 WHERE number = $1")
                    .bind(*number)
                    .bind(*state)
                    .bind(i64::try_from(since_epoch_ms()).unwrap_or(i64::MAX))
                    .execute(&mut *connection)
                    .await?;
                if let Some(summary) = summary {
                    summarise(connection, *number, summary).await?;
                }
            }
            Order::Whole {
                number,
                game_id,
                header,
                entries,
                summary,
            } => {
                create(connection, *number, *game_id, header).await?;
                let row = Row {
                    game: *number,
                    position: 0,
                    entries: std::mem::take(entries),
                };
                append(connection, &[&row]).await?;
                summarise(connection, *number, summary).await?;
            }
            Order::Import {
                number,
                game_id,
                record,
                summary,
            } => {
                // Its id comes from outside: that it is there already is no failure of the store.
                let added = sqlx::query(
                    "INSERT INTO games (number, game_id, form, state, added) VALUES ($1, $2, $3, 0, 1)
                     ON CONFLICT (game_id) DO NOTHING",
                )
                .bind(*number)
                .bind(game_id.0.as_slice())
                .bind(FORM)
                .execute(&mut *connection)
                .await?;
                if added.rows_affected() > 0 {
                    sqlx::query("INSERT INTO added_records (game, record) VALUES ($1, $2)")
                        .bind(*number)
                        .bind(record.as_slice())
                        .execute(&mut *connection)
                        .await?;
                    summarise(connection, *number, summary).await?;
                }
            }
            Order::Filed { game_id } => {
                sqlx::query("UPDATE games SET filed = 1 WHERE game_id = $1")
                    .bind(game_id.0.as_slice())
                    .execute(&mut *connection)
                    .await?;
            }
        }
    }
    let mut rest: Vec<&Row> = rows.into_iter().map(|row| &*row).collect();
    for count in ROWS {
        while rest.len() >= count {
            append(connection, &rest.split_off(rest.len() - count)).await?;
        }
    }
    Ok(())
}

async fn create(
    connection: &mut SqliteConnection,
    number: i64,
    game_id: Id,
    header: &[u8],
) -> sqlx::Result<()> {
    sqlx::query(
        "INSERT INTO games (number, game_id, form, header, state) VALUES ($1, $2, $3, $4, 0)",
    )
    .bind(number)
    .bind(game_id.0.as_slice())
    .bind(FORM)
    .bind(header)
    .execute(connection)
    .await
    .map(drop)
}

async fn append(connection: &mut SqliteConnection, rows: &[&Row]) -> sqlx::Result<()> {
    let places: Vec<String> = (0..rows.len())
        .map(|row| format!("(${}, ${}, ${})", 3 * row + 1, 3 * row + 2, 3 * row + 3))
        .collect();
    let text = format!(
        "INSERT INTO journal (game, position, entries) VALUES {}",
        places.join(", ")
    );
    // Nothing but numbered places is put into the text.
    let mut query = sqlx::query(AssertSqlSafe(text));
    for row in rows {
        query = query
            .bind(row.game)
            .bind(row.position)
            .bind(row.entries.as_slice());
    }
    query.execute(connection).await.map(drop)
}

/// Notes how a game ended, and by what it is to be found.
async fn summarise(
    connection: &mut SqliteConnection,
    number: i64,
    summary: &v1::RecordSummary,
) -> sqlx::Result<()> {
    sqlx::query(
        "UPDATE games SET state = $2, summary = $3, origin = $4, room_name = $5, created_at_ms = $6, ended_at_ms = $7
         WHERE number = $1",
    )
    .bind(number)
    .bind(summary.state)
    .bind(summary.encode_to_vec())
    .bind(summary.origin)
    .bind(summary.room_name.as_str())
    .bind(i64::try_from(summary.created_at_ms).unwrap_or(i64::MAX))
    .bind(i64::try_from(summary.ended_at_ms).unwrap_or(i64::MAX))
    .execute(&mut *connection)
    .await?;
    for seat in &summary.seats {
        sqlx::query(
            "INSERT OR REPLACE INTO participants (game, seat, name, kind) VALUES ($1, $2, $3, $4)",
        )
        .bind(number)
        .bind(seat.seat)
        .bind(seat.name.as_str())
        .bind(seat.kind)
        .execute(&mut *connection)
        .await?;
    }
    Ok(())
}
