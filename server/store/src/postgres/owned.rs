//! Reads what nodes own: rooms as they resume.

use std::collections::HashMap;

use futures::FutureExt as _;
use sqlx::Row as _;
use sqlx::postgres::PgRow;

use super::PostgresStore;
use crate::sql::integer;
use crate::{ResumableGame, StoreError};

/// Most ended games that are read at once.
const MAX_ENDED: i64 = 256;

/// The columns of `Reader::rooms` and the epoch, of durable rooms.
macro_rules! rooms {
    ($rest:literal) => {
        concat!(
            "SELECT number, games.form, header, over, epoch
             FROM owned JOIN games USING (game_id) WHERE durable AND kind = 0 AND ",
            $rest
        )
    };
}

pub(super) use rooms;

impl PostgresStore {
    /// See `Store::resumable_games`.
    pub(super) async fn own_games(
        &self,
        ended_since_ms: u64,
    ) -> Result<Vec<ResumableGame>, StoreError> {
        let node = self.node()?;
        let rows = self.reader.read(|connection| {
            sqlx::query(rooms!(
                "node = $1 AND (NOT over OR number IN (
                     SELECT number FROM games JOIN owned USING (game_id)
                     WHERE node = $1 AND over AND ended_at_ms >= $2
                     ORDER BY ended_at_ms DESC LIMIT $3))
                 ORDER BY number"
            ))
            .bind(node)
            .bind(integer(ended_since_ms))
            .bind(MAX_ENDED)
            .fetch_all(connection)
            .boxed()
        });
        self.resumables(rows.await?).await
    }

    /// The games in rows of `rooms`, with journals that write at the epochs there.
    pub(super) async fn resumables(
        &self,
        rows: Vec<PgRow>,
    ) -> Result<Vec<ResumableGame>, StoreError> {
        let epochs: HashMap<i64, i64> = rows.iter().map(|row| (row.get(0), row.get(4))).collect();
        let rooms = self.reader.rooms(rows).await?;
        Ok((rooms.into_iter())
            .map(|room| {
                let epoch = epochs[&room.number];
                self.resumable(room, epoch)
            })
            .collect())
    }
}
