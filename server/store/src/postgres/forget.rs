//! Removing a participant from the database: writes what changes, with one statement for each table: a
//! transaction must end in time, however far away the database is. `forgetting` reads what contains the
//! name, and `store::forget` decides what changes.

use futures::FutureExt as _;
use sqlx::postgres::PgConnection;

use super::reader::Reader;
use super::values::text;
use crate::StoreError;
use crate::forget::{GameRewrite, Rewrite, TournamentRewrite};

/// Games whose journals are searched for a name in one read.
pub(super) const GAMES_AT_A_TIME: i64 = 1_000;

impl Reader {
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
}

/// Writes what changes. The records of the games count as not written to files.
pub(super) async fn rewrite(connection: &mut PgConnection, rewrite: &Rewrite) -> sqlx::Result<()> {
    rewrite_games(connection, &rewrite.games).await?;
    rewrite_journals(connection, &rewrite.games).await?;
    rewrite_records(connection, &rewrite.games).await?;
    rename_seats(connection, &rewrite.games, &rewrite.who.pseudonym).await?;
    rewrite_tournaments(connection, &rewrite.tournaments).await
}

async fn rewrite_games(connection: &mut PgConnection, games: &[GameRewrite]) -> sqlx::Result<()> {
    let summary = |game: &GameRewrite| game.summary.as_ref().map(|(bytes, _)| bytes.clone());
    let room_name = |game: &GameRewrite| {
        let summary = game.summary.as_ref();
        summary.map(|(_, name)| text(name).into_owned())
    };
    sqlx::query(
        "UPDATE games SET header = coalesce(new.header, games.header),
                          summary = coalesce(new.summary, games.summary),
                          room_name = coalesce(new.room_name, games.room_name),
                          signature = new.signature,
                          filed = false
         FROM unnest($1::bigint[], $2::bytea[], $3::bytea[], $4::text[], $5::bytea[])
              AS new (number, header, summary, room_name, signature)
         WHERE games.number = new.number",
    )
    .bind(all(games, |game| game.number))
    .bind(all(games, |game| game.header.as_deref()))
    .bind(all(games, summary))
    .bind(all(games, room_name))
    .bind(all(games, |game| game.signature.as_deref()))
    .execute(connection)
    .await
    .map(drop)
}

async fn rewrite_journals(
    connection: &mut PgConnection,
    games: &[GameRewrite],
) -> sqlx::Result<()> {
    let (mut numbers, mut positions, mut all_entries) = (Vec::new(), Vec::new(), Vec::new());
    for game in games {
        for (position, entries) in &game.journal {
            numbers.push(game.number);
            positions.push(*position);
            all_entries.push(entries.as_slice());
        }
    }
    sqlx::query(
        "UPDATE journal SET entries = new.entries
         FROM unnest($1::bigint[], $2::bigint[], $3::bytea[]) AS new (game, position, entries)
         WHERE journal.game = new.game AND journal.position = new.position",
    )
    .bind(numbers)
    .bind(positions)
    .bind(all_entries)
    .execute(connection)
    .await
    .map(drop)
}

async fn rewrite_records(connection: &mut PgConnection, games: &[GameRewrite]) -> sqlx::Result<()> {
    let (numbers, records): (Vec<i64>, Vec<&[u8]>) = (games.iter())
        .filter_map(|game| Some((game.number, game.record.as_deref()?)))
        .unzip();
    sqlx::query(
        "UPDATE added_records SET record = new.record
         FROM unnest($1::bigint[], $2::bytea[]) AS new (game, record)
         WHERE added_records.game = new.game",
    )
    .bind(numbers)
    .bind(records)
    .execute(connection)
    .await
    .map(drop)
}

async fn rename_seats(
    connection: &mut PgConnection,
    games: &[GameRewrite],
    pseudonym: &str,
) -> sqlx::Result<()> {
    let (numbers, seats): (Vec<i64>, Vec<i64>) = (games.iter())
        .flat_map(|game| game.seats.iter().map(|seat| (game.number, *seat)))
        .unzip();
    sqlx::query(
        "UPDATE participants SET name = $3
         FROM unnest($1::bigint[], $2::bigint[]) AS own (game, seat)
         WHERE participants.game = own.game AND participants.seat = own.seat",
    )
    .bind(numbers)
    .bind(seats)
    .bind(text(pseudonym))
    .execute(connection)
    .await
    .map(drop)
}

async fn rewrite_tournaments(
    connection: &mut PgConnection,
    tournaments: &[TournamentRewrite],
) -> sqlx::Result<()> {
    let (mut numbers, mut positions, mut all_entries) = (Vec::new(), Vec::new(), Vec::new());
    for tournament in tournaments {
        for (position, entries) in &tournament.rows {
            numbers.push(tournament.number);
            positions.push(*position);
            all_entries.push(entries.as_slice());
        }
    }
    sqlx::query(
        "UPDATE tournament_entries SET entries = new.entries
         FROM unnest($1::bigint[], $2::bigint[], $3::bytea[]) AS new (tournament, position, entries)
         WHERE tournament_entries.tournament = new.tournament
           AND tournament_entries.position = new.position",
    )
    .bind(numbers)
    .bind(positions)
    .bind(all_entries)
    .execute(connection)
    .await
    .map(drop)
}

fn all<'g, T>(games: &'g [GameRewrite], value: impl Fn(&'g GameRewrite) -> T) -> Vec<T> {
    games.iter().map(value).collect()
}
