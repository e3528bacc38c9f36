//! Removing a participant from the database: reads what contains the name, and writes what changes
//! in one transaction. `store::forget` decides what changes.

use chefshat_record::pseudonym::Pseudonym;
use futures::FutureExt as _;
use sqlx::Row as _;
use sqlx::postgres::{PgConnection, PgRow};

use super::reader::Reader;
use super::values::text;
use crate::ForgetError;
use crate::StoreError;
use crate::forget::{GameRows, Rewrite};
use chefshat_room::ids::Id;

/// Games whose journals are searched for a name in one read.
const GAMES_AT_A_TIME: i64 = 1_000;

impl Reader {
    /// What removing a participant changes.
    ///
    /// # Errors
    /// See [`ForgetError`].
    pub(super) async fn forgetting(&self, who: &Pseudonym) -> Result<Rewrite, ForgetError> {
        let mut rewrite = Rewrite::new(who);
        for number in self.games_with(&who.of.name).await? {
            if let Some(rows) = self.game_rows(number).await? {
                let bytes: usize = rows.journal.iter().map(|(_, bytes)| bytes.len()).sum();
                let bytes = bytes + rows.record.as_ref().map_or(0, Vec::len);
                let redacting = self
                    .decoding
                    .run(bytes / 64, move || rewrite.with_game(rows));
                rewrite = redacting.await??;
            }
        }
        let name = who.of.name.as_bytes().to_vec();
        let tournaments: Vec<i64> = (self.read(|connection| {
            sqlx::query_scalar(
                "SELECT DISTINCT tournament FROM tournament_entries WHERE position($1 IN entries) > 0",
            )
            .bind(name)
            .fetch_all(connection)
            .boxed()
        }))
        .await?;
        for number in tournaments {
            let rows = self.read(|connection| {
                sqlx::query_as(
                    "SELECT position, entries FROM tournament_entries WHERE tournament = $1 ORDER BY position",
                )
                .bind(number)
                .fetch_all(connection)
                .boxed()
            });
            rewrite = rewrite.with_tournament(number, rows.await?)?;
        }
        Ok(rewrite)
    }

    /// The numbers of the games that contain a name.
    async fn games_with(&self, name: &str) -> Result<Vec<i64>, StoreError> {
        let last: Option<i64> = (self.read(|connection| {
            sqlx::query_scalar("SELECT max(number) FROM games")
                .fetch_one(connection)
                .boxed()
        }))
        .await?;
        let mut games = Vec::new();
        let mut after = 0;
        while after < last.unwrap_or_default() {
            let (bytes, name) = (name.as_bytes().to_vec(), text(name).into_owned());
            let found = self.read(|connection| {
                sqlx::query_scalar(
                    "SELECT number FROM games WHERE number > $1 AND number <= $2 AND (
                         number IN (SELECT game FROM participants WHERE name = $3)
                         OR EXISTS (SELECT FROM journal WHERE game = number AND position($4 IN entries) > 0)
                         OR EXISTS (SELECT FROM added_records WHERE game = number AND position($4 IN record) > 0))
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

    /// Deletes the rows that contain a name from the journals of games that retention has deleted.
    pub(super) async fn forget_pruned(&self, name: &str) -> Result<(), StoreError> {
        let mut after = 0;
        loop {
            let games: Vec<i64> = (self.read(|connection| {
                sqlx::query_scalar("SELECT game FROM pruned WHERE game > $1 ORDER BY game LIMIT $2")
                    .bind(after)
                    .bind(GAMES_AT_A_TIME)
                    .fetch_all(connection)
                    .boxed()
            }))
            .await?;
            let Some(last) = games.last() else {
                return Ok(());
            };
            after = *last;
            let name = name.as_bytes().to_vec();
            let deleting = self.read(|connection| {
                sqlx::query(
                    "DELETE FROM journal WHERE game = ANY ($1) AND position($2 IN entries) > 0",
                )
                .bind(games)
                .bind(name)
                .execute(connection)
                .boxed()
            });
            deleting.await?;
        }
    }

    /// The rows of a game; `None` if it was deleted.
    async fn game_rows(&self, number: i64) -> Result<Option<GameRows>, StoreError> {
        let game: Option<PgRow> = (self.read(|connection| {
            sqlx::query(
                "SELECT game_id, state, filed, header, summary, record, signature
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
        let journal = self.read(|connection| {
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
            is_running: game.get::<i32, _>(1) == 0,
            is_filed: game.get(2),
            header: game.get(3),
            summary: game.get(4),
            record: game.get(5),
            signature: game.get(6),
            journal: journal.await?,
        }))
    }
}

/// Writes what changes. The records of the games count as not written to files.
pub(super) async fn rewrite(connection: &mut PgConnection, rewrite: &Rewrite) -> sqlx::Result<()> {
    for game in &rewrite.games {
        let (positions, entries): (Vec<i64>, Vec<&[u8]>) = (game.journal.iter())
            .map(|(position, entries)| (*position, entries.as_slice()))
            .unzip();
        sqlx::query(
            "UPDATE journal SET entries = new.entries
             FROM unnest($2::bigint[], $3::bytea[]) AS new (position, entries)
             WHERE game = $1 AND journal.position = new.position",
        )
        .bind(game.number)
        .bind(positions)
        .bind(entries)
        .execute(&mut *connection)
        .await?;
        if let Some(record) = &game.record {
            sqlx::query("UPDATE added_records SET record = $2 WHERE game = $1")
                .bind(game.number)
                .bind(record.as_slice())
                .execute(&mut *connection)
                .await?;
        }
        if let Some(header) = &game.header {
            sqlx::query("UPDATE games SET header = $2 WHERE number = $1")
                .bind(game.number)
                .bind(header.as_slice())
                .execute(&mut *connection)
                .await?;
        }
        if let Some((summary, room_name)) = &game.summary {
            sqlx::query(
                "UPDATE games SET summary = $2, room_name = $3, filed = false, signature = $4
                 WHERE number = $1",
            )
            .bind(game.number)
            .bind(summary.as_slice())
            .bind(text(room_name))
            .bind(game.signature.as_deref())
            .execute(&mut *connection)
            .await?;
        }
        sqlx::query("UPDATE participants SET name = $3 WHERE game = $1 AND seat = ANY($2)")
            .bind(game.number)
            .bind(&game.seats)
            .bind(text(&rewrite.who.pseudonym))
            .execute(&mut *connection)
            .await?;
    }
    for tournament in &rewrite.tournaments {
        let (positions, entries): (Vec<i64>, Vec<&[u8]>) = (tournament.rows.iter())
            .map(|(position, entries)| (*position, entries.as_slice()))
            .unzip();
        sqlx::query(
            "UPDATE tournament_entries SET entries = new.entries
             FROM unnest($2::bigint[], $3::bytea[]) AS new (position, entries)
             WHERE tournament = $1 AND tournament_entries.position = new.position",
        )
        .bind(tournament.number)
        .bind(positions)
        .bind(entries)
        .execute(&mut *connection)
        .await?;
    }
    Ok(())
}
