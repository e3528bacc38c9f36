//! Removing a participant from the database: reads what contains the name.

use std::sync::Arc;

use async_trait::async_trait;
use futures::FutureExt as _;
use sqlx::Row as _;
use sqlx::postgres::PgRow;

use super::PostgresStore;
use super::commands::Command;
use super::forget::GAMES_AT_A_TIME;
use super::values::indexed_name;
use crate::StoreError;
use crate::decode_pool::DecodePool;
use crate::forget::{GameRows, Rewritable, Rewrite, TournamentRow};
use crate::units::TOURNAMENT_ROWS;
use chefshat_room::ids::Id;

#[async_trait]
impl Rewritable for PostgresStore {
    async fn games_with(&self, name: &str) -> Result<Vec<i64>, StoreError> {
        let last: Option<i64> = (self.reader.read(|connection| {
            sqlx::query_scalar("SELECT max(number) FROM games")
                .fetch_one(connection)
                .boxed()
        }))
        .await?;
        let mut games = Vec::new();
        let mut after = 0;
        while after < last.unwrap_or_default() {
            let (bytes, name) = (name.as_bytes().to_vec(), indexed_name(name).into_owned());
            let found = self.reader.read(|connection| {
                sqlx::query_scalar(
                    "SELECT number FROM games WHERE number > $1 AND number <= $2 AND (
                         number IN (SELECT game FROM participants WHERE name = $3)
                         OR EXISTS (SELECT FROM journal WHERE game = number AND position($4 IN entries) > 0)
                         OR EXISTS (SELECT FROM added_records WHERE game = number AND position($4 IN record) > 0)
                         OR state = 0 AND position($4 IN header) > 0)
                     ORDER BY number",
                )
                .bind(after)
                .bind(after + GAMES_AT_A_TIME)
                .bind(name)
                .bind(bytes)
                .fetch_all(connection)
                .boxed()
            });
            games.append(&mut found.await?);
            after += GAMES_AT_A_TIME;
        }
        Ok(games)
    }

    async fn tournaments_with(&self, name: &str) -> Result<Vec<i64>, StoreError> {
        let name = name.as_bytes().to_vec();
        let tournaments = self.reader.read(|connection| {
            sqlx::query_scalar(
                "SELECT DISTINCT tournament FROM tournament_entries WHERE position($1 IN entries) > 0",
            )
            .bind(name)
            .fetch_all(connection)
            .boxed()
        });
        tournaments.await
    }

    async fn game_rows(&self, number: i64) -> Result<Option<GameRows>, StoreError> {
        let game: Option<PgRow> = (self.reader.read(|connection| {
            sqlx::query(
                "SELECT game_id, state, filed, header, summary, record, signature, form
                 FROM games LEFT JOIN added_records ON game = number WHERE number = $1",
            )
            .bind(number)
            .fetch_optional(connection)
            .boxed()
        }))
        .await?;
        let Some(game) = game else { return Ok(None) };
        let id: Vec<u8> = game.get(0);
        let id = id.try_into().map(Id::from_bytes).map_err(|_| {
            StoreError::Failed(format!("game number {number} has an id that is damaged"))
        })?;
        let journal = self.reader.read(|connection| {
            sqlx::query_as(
                "SELECT position, entries FROM journal WHERE game = $1 ORDER BY position",
            )
            .bind(number)
            .fetch_all(connection)
            .boxed()
        });
        Ok(Some(GameRows {
            number,
            id,
            form: game.get(7),
            is_running: game.get::<i32, _>(1) == 0,
            is_filed: game.get(2),
            header: game.get(3),
            summary: game.get(4),
            record: game.get(5),
            signature: game.get(6),
            journal: journal.await?,
        }))
    }

    async fn tournament_rows(&self, number: i64) -> Result<Vec<TournamentRow>, StoreError> {
        let rows = self.reader.read(|connection| {
            sqlx::query_as(TOURNAMENT_ROWS)
                .bind(number)
                .fetch_all(connection)
                .boxed()
        });
        rows.await
    }

    async fn write(&self, rewrite: Rewrite) -> Result<(), StoreError> {
        let rewrite = Command::Rewrite(rewrite);
        self.commands.commit(Arc::new(rewrite)).await.map(drop)
    }

    fn decoding(&self) -> &DecodePool {
        &self.decoding
    }
}
