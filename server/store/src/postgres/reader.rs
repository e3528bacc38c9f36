//! Reads the database over connections of a pool, each read in bounded time.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use chefshat_proto::v1;
use futures::future::BoxFuture;
use futures::{FutureExt as _, TryStreamExt as _};
use sqlx::pool::PoolConnection;
use sqlx::postgres::{PgConnection, PgPool, PgRow};
use sqlx::{Postgres, Row as _};
use tokio::time::timeout;
use tracing::error;

use super::errors::failure;
use super::retained::{Candidate, divided, old};
use super::values::{indexed_name, text};
use crate::decode_pool::DecodePool;
use crate::form::{self, OWNER_WITHIN, Unreadable, check_form, stored_header};
use crate::sql::{MAX_PRUNABLE_READ, integer, list_query};
use crate::{Keep, Listed, Part, StoreError, StoredGame, listed, stored_summary};
use chefshat_base::tasks::short;
use chefshat_room::ids::{GameId, Id};
use chefshat_room::journal::{Entry, GameHeader};

/// How long one read may take.
const READ_LIMIT: Duration = Duration::from_secs(15);
/// How long a connection that is given back may take to answer; then it is dropped.
const RETURN_LIMIT: Duration = Duration::from_secs(1);

/// Reads stored games.
#[derive(Clone)]
pub(super) struct Reader {
    pub(super) pool: PgPool,
    pub(super) decoding: DecodePool,
}

/// A connection of the pool, which waits for its answer without limit when it is given back: one that
/// hangs would keep its place.
struct Lent {
    connection: Option<PoolConnection<Postgres>>,
    /// Whether its work has ended.
    has_ended: bool,
}

impl Drop for Lent {
    fn drop(&mut self) {
        if let Some(connection) = self.connection.take() {
            tokio::spawn(short(
                "gives one connection back",
                give_back(connection, self.has_ended),
            ));
        }
    }
}

async fn give_back(mut connection: PoolConnection<Postgres>, has_ended: bool) {
    if !has_ended {
        // A transaction whose BEGIN has no answer yet is open, and the connection does not know: what
        // others do next would belong to it.
        let rollback = sqlx::raw_sql("ROLLBACK").execute(&mut *connection);
        if !matches!(timeout(RETURN_LIMIT, rollback).await, Ok(Ok(_))) {
            drop(connection.detach());
            return;
        }
    }
    // One that does not answer is dropped.
    let _ = timeout(RETURN_LIMIT, connection.return_to_pool()).await;
}

/// A game that is or was a room's, as stored.
pub(super) struct StoredRoom {
    pub(super) number: i64,
    pub(super) header: GameHeader,
    pub(super) entries: Vec<Entry>,
    /// Number of rows of its journal.
    pub(super) rows: i64,
    /// Whether its end has been committed.
    pub(super) over: bool,
}

impl Reader {
    /// Reads in bounded time. A connection whose answer does not come is dropped, also if the caller
    /// has given up before.
    pub(super) async fn read<T>(
        &self,
        work: impl for<'c> FnOnce(&'c mut PgConnection) -> BoxFuture<'c, sqlx::Result<T>>,
    ) -> Result<T, StoreError> {
        let failed = |error: sqlx::Error| failure(&error);
        let mut lent = Lent {
            connection: Some(self.pool.acquire().await.map_err(failed)?),
            has_ended: false,
        };
        let connection = lent.connection.as_mut().expect("it was just lent");
        match timeout(READ_LIMIT, work(connection)).await {
            Ok(read) => {
                lent.has_ended = true;
                read.map_err(failed)
            }
            Err(_) => {
                let late = std::io::Error::from(std::io::ErrorKind::TimedOut);
                Err(failed(late.into()))
            }
        }
    }

    /// The entries of a game's journal.
    pub(super) async fn entries(&self, number: i64) -> Result<Vec<Entry>, StoreError> {
        match self.journal(number).await? {
            Ok((entries, _)) => Ok(entries),
            Err(problem) => Err(StoreError::Failed(format!(
                "the journal of game number {number} cannot be read back: {problem}"
            ))),
        }
    }

    /// The entries of a game's journal and the number of its rows; the inner result says why it
    /// cannot be read.
    async fn journal(
        &self,
        number: i64,
    ) -> Result<Result<(Vec<Entry>, i64), Unreadable>, StoreError> {
        let mut journals = self.journals(vec![number]).await?;
        let rows = journals.remove(&number).unwrap_or_default();
        self.decode(rows).await
    }

    /// The rows of journals: position and entries, by the number of the game.
    async fn journals(
        &self,
        games: Vec<i64>,
    ) -> Result<HashMap<i64, Vec<(i64, Vec<u8>)>>, StoreError> {
        self.read(|connection| {
            async move {
                let mut rows = sqlx::query(
                    "SELECT game, position, entries FROM journal WHERE game = ANY ($1) ORDER BY game, position",
                )
                .bind(games)
                .fetch(connection);
                let mut journals: HashMap<i64, Vec<_>> = HashMap::new();
                while let Some(row) = rows.try_next().await? {
                    let journal = journals.entry(row.get(0)).or_default();
                    journal.push((row.get(1), row.get(2)));
                }
                Ok(journals)
            }
            .boxed()
        })
        .await
    }

    async fn decode(
        &self,
        rows: Vec<(i64, Vec<u8>)>,
    ) -> Result<Result<(Vec<Entry>, i64), Unreadable>, StoreError> {
        let bytes: usize = rows.iter().map(|(_, entries)| entries.len()).sum();
        let decoding = self.decoding.run(bytes / 64, move || {
            let mut entries = Vec::new();
            let mut next = 0;
            for (position, bytes) in &rows {
                if *position != next {
                    let gap = format!("a part of its journal is missing at {next}");
                    return Err(Unreadable(gap));
                }
                form::read_entries(bytes, &mut entries)?;
                next += 1;
            }
            Ok((entries, next))
        });
        decoding.await
    }

    /// The games in rows of number, form, header and whether it is over. One that cannot be read is
    /// logged.
    pub(super) async fn rooms(&self, games: Vec<PgRow>) -> Result<Vec<StoredRoom>, StoreError> {
        let numbers = games.iter().map(|row| row.get(0)).collect();
        let mut journals = self.journals(numbers).await?;
        let mut rooms = Vec::with_capacity(games.len());
        for row in games {
            let number: i64 = row.get(0);
            let header = check_form(row.get(1)).and_then(|()| stored_header(row.get(2)));
            let journal = self.decode(journals.remove(&number).unwrap_or_default());
            let journal = journal.await?;
            match header.and_then(|header| Ok((header, journal?))) {
                Ok((header, (entries, rows))) => rooms.push(StoredRoom {
                    number,
                    header,
                    entries,
                    rows,
                    over: row.get(3),
                }),
                Err(problem) => {
                    error!(number, %problem, "a game cannot be read; it is left unchanged");
                }
            }
        }
        Ok(rooms)
    }

    /// See `Store::summary`.
    pub(super) async fn summary(
        &self,
        game: GameId,
    ) -> Result<Option<v1::RecordSummary>, StoreError> {
        let summary: Option<Vec<u8>> = (self.read(|connection| {
            sqlx::query_scalar(
                "SELECT summary FROM games WHERE game_id = $1 AND summary IS NOT NULL",
            )
            .bind(game.bytes().to_vec())
            .fetch_optional(connection)
            .boxed()
        }))
        .await?;
        let decoded = summary.map(|bytes| stored_summary(game, &bytes));
        Ok(decoded.transpose()?)
    }

    /// See `Store::finished`.
    pub(super) async fn finished(&self, game: GameId) -> Result<Option<StoredGame>, StoreError> {
        let row = self.read(|connection| {
            sqlx::query(
                "SELECT number, form, header, record, signature
                 FROM games LEFT JOIN added_records ON game = number
                 WHERE game_id = $1 AND summary IS NOT NULL",
            )
            .bind(game.bytes().to_vec())
            .fetch_optional(connection)
            .boxed()
        });
        let Some(row) = row.await? else {
            return Ok(None);
        };
        let unreadable = |problem: Unreadable| {
            StoreError::Unreadable(format!("game {game} cannot be read: {problem}"))
        };
        check_form(row.get(1)).map_err(unreadable)?;
        let record: Option<Vec<u8>> = row.get(3);
        if let Some(record) = record {
            let decoding = self
                .decoding
                .run(record.len() / 64, move || form::lines_from_bytes(&record));
            let lines = decoding.await?.map_err(unreadable)?;
            return Ok(Some(StoredGame::Imported(lines.into())));
        }
        let header = stored_header(row.get(2)).map_err(unreadable)?;
        let (entries, _) = self.journal(row.get(0)).await?.map_err(unreadable)?;
        let signature: Option<&[u8]> = row.get(4);
        let signature = signature.map(form::signature_from_bytes).transpose();
        Ok(Some(StoredGame::Hosted(
            Arc::new(header),
            entries.into(),
            signature.map_err(unreadable)?.map(Arc::new),
        )))
    }

    /// See `Store::list`.
    pub(super) async fn list(
        &self,
        filter: &v1::RecordFilter,
        part: Part,
        count: usize,
    ) -> Result<Vec<Listed>, StoreError> {
        let (query, number) = list_query(part);
        let query = sqlx::query(query)
            .bind(number)
            .bind(filter.state)
            .bind(filter.origin)
            .bind(text(&filter.room_name).into_owned())
            .bind(integer(filter.created_from_ms))
            .bind(integer(filter.created_before_ms))
            .bind(filter.kind)
            .bind(indexed_name(&filter.participant).into_owned())
            .bind(filter.hosted_here)
            .bind(integer(count as u64))
            .bind(OWNER_WITHIN);
        let rows = self.read(|connection| query.fetch_all(connection).boxed());
        let rows = rows.await?;
        Ok(rows
            .iter()
            .map(|row| listed(row.get(0), row.get(2), row.get(1), row.get(3)))
            .collect())
    }

    /// See `Store::finished_games`.
    pub(super) async fn finished_games(&self) -> Result<u64, StoreError> {
        let count: i64 = (self.read(|connection| {
            sqlx::query_scalar("SELECT count(*) FROM games WHERE state <> 0")
                .fetch_one(connection)
                .boxed()
        }))
        .await?;
        Ok(u64::try_from(count).unwrap_or_default())
    }

    /// See `Store::prunable`. Games without a record are none of the newest ones. `unwritten`: also
    /// those whose record is not written to a file.
    pub(super) async fn prunable(
        &self,
        keep: Keep,
        (after, count): (u64, usize),
        unwritten: bool,
    ) -> Result<Vec<(u64, GameId)>, StoreError> {
        let (mut after, mut page) = (integer(after), count);
        let mut found = Vec::new();
        loop {
            let rows =
                self.read(|connection| old(connection, keep, (after, page), unwritten).boxed());
            let rows = rows.await?;
            let Some(last) = rows.last() else {
                return Ok(found);
            };
            after = last.get(0);
            let games = rows.iter().filter_map(Candidate::of).collect();
            let divided = self.read(|connection| divided(connection, games).boxed());
            let (free, _) = divided.await?;
            let left = count - found.len();
            let free = free.iter().take(left);
            found.extend(free.map(|game| (game.number.unsigned_abs(), game.game)));
            if found.len() >= count {
                return Ok(found);
            }
            page = MAX_PRUNABLE_READ.min(page * 2);
        }
    }

    /// Those of these games that are not stored.
    pub(super) async fn missing(&self, mut games: Vec<GameId>) -> Result<Vec<GameId>, StoreError> {
        let ids: Vec<Vec<u8>> = games.iter().map(|id| id.bytes().to_vec()).collect();
        let stored: Vec<Vec<u8>> = (self.read(move |connection| {
            sqlx::query_scalar("SELECT game_id FROM games WHERE game_id = ANY ($1)")
                .bind(ids)
                .fetch_all(connection)
                .boxed()
        }))
        .await?;
        games.retain(|game| !stored.iter().any(|id| id.as_slice() == game.bytes()));
        Ok(games)
    }

    /// See `Store::without_record_file`.
    pub(super) async fn without_record_file(&self) -> Result<Vec<GameId>, StoreError> {
        let ids: Vec<Vec<u8>> = (self.read(|connection| {
            sqlx::query_scalar(
                "SELECT game_id FROM games WHERE NOT filed AND summary IS NOT NULL ORDER BY number",
            )
            .fetch_all(connection)
            .boxed()
        }))
        .await?;
        let id = |bytes: Vec<u8>| bytes.try_into().ok().map(Id::from_bytes);
        Ok(ids.into_iter().filter_map(id).collect())
    }
}
