//! Removes a participant from the database: one transaction over everything that contains the name.
//! Journals are rewritten row by row, so every game still folds. The files of records are not
//! handled here.

use std::path::Path;
use std::sync::Arc;

use chefshat_proto::v1;
use chefshat_record::convert::seat_number;
use chefshat_record::pseudonym::{ParticipantSeats, Pseudonym, Redactions};
use chefshat_tournament::Change as TournamentChange;
use prost::Message as _;
use sqlx::sqlite::{SqliteConnection, SqliteRow};
use sqlx::{Connection as _, Row as _};

use super::errors::explain;
use super::open::{self, Opened};
use super::rows::with_own_rows;
use crate::store::StoreError;
use crate::store::form::{self, Unreadable};
use crate::store::tournaments::TournamentEntry;
use chefshat_room::ids::Id;
use chefshat_room::journal::{Change, Entry};

/// The database of a data directory while a participant is removed. No server has it open
/// meanwhile.
pub struct Forgetting(Opened);

/// What was removed from the database.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Forgotten {
    /// Games that contained the name.
    pub games: u64,
    /// Tournaments that contained the name.
    pub tournaments: u64,
    /// The changes in the games.
    pub redactions: Redactions,
    /// Numbers of the games whose record file must be rewritten.
    filed: Vec<i64>,
}

/// Why a participant cannot be removed; nothing was changed.
#[derive(Debug, thiserror::Error)]
pub enum ForgetError {
    /// A game with the name is not over.
    #[error(
        "{0:?} has a seat in a game that is not over; nothing was changed: start the server, let the game end or close its room, stop the server"
    )]
    GameRunning(String),
    /// A tournament with the name is not over.
    #[error(
        "{0:?} takes part in a tournament that is not over; nothing was changed: start the server, let it end or close it, stop the server"
    )]
    TournamentRunning(String),
    /// Stored data cannot be read.
    #[error("{what} cannot be read: {problem}; nothing was changed")]
    Unreadable {
        /// The data.
        what: String,
        /// The reason.
        problem: String,
    },
    /// The database failed.
    #[error("{0}")]
    Store(#[from] StoreError),
}

impl From<sqlx::Error> for ForgetError {
    fn from(error: sqlx::Error) -> Self {
        Self::Store(StoreError::Failed(explain(&error)))
    }
}

impl Forgetting {
    /// Opens the database of a data directory.
    ///
    /// # Errors
    /// The directory cannot be used, or a server uses it.
    pub async fn open(data_dir: &Path) -> Result<Self, open::OpenError> {
        open::open(data_dir).await.map(Self)
    }

    /// Removes a participant. Marks the records of the games as unwritten: after a crash the server
    /// writes them at its next start.
    ///
    /// # Errors
    /// See [`ForgetError`].
    pub async fn forget(&mut self, who: &Pseudonym) -> Result<Forgotten, ForgetError> {
        let mut transaction = self.0.writer.begin().await?;
        let mut forgotten = Forgotten::default();
        let games = sqlx::query(
            "SELECT number, state, last_row, header, summary, record, filed FROM games LEFT JOIN added_records ON game = number
             WHERE number IN (SELECT game FROM participants WHERE name = $1
                              UNION SELECT game FROM journal WHERE instr(entries, CAST($1 AS BLOB)) > 0
                              UNION SELECT game FROM added_records WHERE instr(record, CAST($1 AS BLOB)) > 0)
             ORDER BY number",
        )
        .bind(who.name.as_str())
        .fetch_all(&mut *transaction)
        .await?;
        for game in &games {
            let redactions = forget_game(&mut transaction, game, who).await?;
            if redactions != Redactions::default() {
                forgotten.games += 1;
                forgotten.redactions += redactions;
                if game.get::<bool, _>("filed") {
                    forgotten.filed.push(game.get("number"));
                }
            }
        }
        forgotten.tournaments = forget_tournaments(&mut transaction, who).await?;
        transaction.commit().await?;
        Ok(forgotten)
    }

    /// The name at a seat of a finished game; `None` for a built-in agent or an unknown game.
    ///
    /// # Errors
    /// The database failed.
    pub async fn name_at(&mut self, game: Id, seat: u32) -> Result<Option<String>, ForgetError> {
        let name = sqlx::query_scalar(
            "SELECT name FROM participants JOIN games ON number = game WHERE game_id = $1 AND seat = $2 AND agent = ''",
        )
        .bind(game.0.as_slice())
        .bind(seat)
        .fetch_optional(&mut self.0.writer)
        .await?;
        Ok(name)
    }

    /// The names of the participants who sat down in a hosted game, in order, whether they stayed
    /// or not; empty if the game is unknown.
    ///
    /// # Errors
    /// The database failed, or the game's journal cannot be read.
    pub async fn seated_names(&mut self, game: Id) -> Result<Vec<String>, ForgetError> {
        let row = sqlx::query("SELECT number, last_row FROM games WHERE game_id = $1")
            .bind(game.0.as_slice())
            .fetch_optional(&mut self.0.writer)
            .await?;
        let Some(row) = row else {
            return Ok(Vec::new());
        };
        let mut names = Vec::new();
        for row in journal_of(&mut self.0.writer, &row).await? {
            let seated = entries_of(&row)?
                .into_iter()
                .filter_map(|entry| match entry.change {
                    Change::Seated { participant, .. } => Some(participant.name),
                    _ => None,
                });
            names.extend(seated);
        }
        Ok(names)
    }

    /// Marks the records as written and compacts the database, so that unused pages and the
    /// write-ahead log contain nothing of the participant. This needs as much free disk space as
    /// the database has.
    ///
    /// # Errors
    /// The database failed.
    pub async fn finish(mut self, forgotten: &Forgotten) -> Result<(), ForgetError> {
        for number in &forgotten.filed {
            sqlx::query("UPDATE games SET filed = 1 WHERE number = $1")
                .bind(*number)
                .execute(&mut self.0.writer)
                .await?;
        }
        self.0.readers.close().await;
        for tidying in [
            open::SHRINKABLE,
            "VACUUM",
            "PRAGMA wal_checkpoint(TRUNCATE)",
        ] {
            sqlx::query(tidying).execute(&mut self.0.writer).await?;
        }
        Ok(self.0.writer.close().await?)
    }
}

/// Removes a participant from one game, which loses its signature if it changes.
async fn forget_game(
    connection: &mut SqliteConnection,
    game: &SqliteRow,
    who: &Pseudonym,
) -> Result<Redactions, ForgetError> {
    let number: i64 = game.get("number");
    let unreadable = |problem: Unreadable| ForgetError::Unreadable {
        what: format!("game number {number}"),
        problem: problem.to_string(),
    };
    let mut redactions = forget_journal(connection, game, who).await?;
    if let Some(record) = game.get::<Option<Vec<u8>>, _>("record") {
        let mut lines = form::lines_from_bytes(&record).map_err(unreadable)?;
        redactions += who.redact(&mut lines);
        sqlx::query("UPDATE added_records SET record = $2 WHERE game = $1")
            .bind(number)
            .bind(form::lines_to_bytes(&lines))
            .execute(&mut *connection)
            .await?;
    }
    if redactions == Redactions::default() {
        return Ok(redactions);
    }
    if game.get::<i64, _>("state") == 0 {
        return Err(ForgetError::GameRunning(who.name.clone()));
    }
    if let Some(header) = game.get::<Option<Vec<u8>>, _>("header") {
        let mut header = form::header_from_bytes(&header).map_err(unreadable)?;
        redactions.names += who.in_text(&mut header.name);
        if let Some(study) = (header.study.as_mut()).filter(|it| it.participant == who.name) {
            Arc::make_mut(study).participant.clone_from(&who.pseudonym);
            redactions.names += 1;
        }
        sqlx::query("UPDATE games SET header = $2 WHERE number = $1")
            .bind(number)
            .bind(form::header_to_bytes(&header))
            .execute(&mut *connection)
            .await?;
    }
    if let Some(summary) = game.get::<Option<Vec<u8>>, _>("summary") {
        let mut summary = v1::RecordSummary::decode(summary.as_slice())
            .map_err(|error| unreadable(error.into()))?;
        who.in_seats(&mut summary.seats);
        who.in_text(&mut summary.room_name);
        sqlx::query("UPDATE games SET summary = $2, room_name = $3, filed = 0, signature = NULL WHERE number = $1")
            .bind(number)
            .bind(summary.encode_to_vec())
            .bind(summary.room_name.as_str())
            .execute(&mut *connection)
            .await?;
    }
    sqlx::query("UPDATE participants SET name = $3 WHERE game = $1 AND name = $2 AND agent = ''")
        .bind(number)
        .bind(who.name.as_str())
        .bind(who.pseudonym.as_str())
        .execute(&mut *connection)
        .await?;
    Ok(redactions)
}

/// The rows of a game's journal, in order. They are decoded one by one with [`entries_of`], because
/// a long decoded game is much larger.
async fn journal_of(
    connection: &mut SqliteConnection,
    game: &SqliteRow,
) -> Result<Vec<SqliteRow>, ForgetError> {
    let number: i64 = game.get("number");
    let last_row: Option<i64> = game.get("last_row");
    let rows = sqlx::query(match last_row {
        Some(_) => with_own_rows!(
            "row = $1 AND game = $2",
            "SELECT row, entries FROM journal WHERE row IN (SELECT row FROM own) ORDER BY row"
        ),
        // The game is not over: the position of its last row is unknown.
        None => "SELECT row, entries FROM journal WHERE $1 IS NULL AND game = $2 ORDER BY row",
    })
    .bind(last_row)
    .bind(number)
    .fetch_all(&mut *connection)
    .await?;
    Ok(rows)
}

/// The entries of a row of a journal.
fn entries_of(row: &SqliteRow) -> Result<Vec<Entry>, ForgetError> {
    let mut entries = Vec::new();
    form::read_entries(row.get("entries"), &mut entries).map_err(|problem| {
        let row: i64 = row.get("row");
        ForgetError::Unreadable {
            what: format!("row {row} of the journal"),
            problem: problem.to_string(),
        }
    })?;
    Ok(entries)
}

/// Removes a participant from the journal of a game; writes only the rows that change.
async fn forget_journal(
    connection: &mut SqliteConnection,
    game: &SqliteRow,
    who: &Pseudonym,
) -> Result<Redactions, ForgetError> {
    let (mut own, mut all) = (ParticipantSeats::default(), Redactions::default());
    for row in journal_of(connection, game).await? {
        let mut entries = entries_of(&row)?;
        let redactions = forget_entries(&mut entries, &mut own, who);
        if redactions == Redactions::default() {
            continue;
        }
        all += redactions;
        let mut bytes = Vec::new();
        for entry in &entries {
            form::put_entry(entry, &mut bytes);
        }
        sqlx::query("UPDATE journal SET entries = $2 WHERE row = $1")
            .bind(row.get::<i64, _>("row"))
            .bind(bytes)
            .execute(&mut *connection)
            .await?;
    }
    Ok(all)
}

fn forget_entries(
    entries: &mut Vec<Entry>,
    own: &mut ParticipantSeats,
    who: &Pseudonym,
) -> Redactions {
    let mut out = Redactions::default();
    entries.retain_mut(|entry| match &mut entry.change {
        Change::Seated { seat, participant } => {
            let is_own = participant.name == who.name;
            own.seated(seat_number(*seat), is_own);
            if is_own {
                participant.name.clone_from(&who.pseudonym);
                out.names += 1;
            }
            true
        }
        Change::Vacated(seat) => {
            own.vacated(seat_number(*seat));
            true
        }
        Change::Decided(decided) => {
            if own.has(seat_number(decided.seat)) && decided.annotations.take().is_some() {
                out.annotations += 1;
            }
            true
        }
        Change::Expressed { seat, .. } => {
            let drop = own.has(seat_number(*seat));
            out.expressions += u64::from(drop);
            !drop
        }
        _ => true,
    });
    out
}

/// Removes a participant from the tournaments. Returns how many changed.
async fn forget_tournaments(
    connection: &mut SqliteConnection,
    who: &Pseudonym,
) -> Result<u64, ForgetError> {
    let tournaments: Vec<i64> = sqlx::query_scalar(
        "SELECT DISTINCT tournament FROM tournament_entries WHERE instr(entries, CAST($1 AS BLOB)) > 0",
    )
    .bind(who.name.as_str())
    .fetch_all(&mut *connection)
    .await?;
    let mut changed = 0;
    for tournament in tournaments {
        changed += u64::from(forget_tournament(connection, tournament, who).await?);
    }
    Ok(changed)
}

async fn forget_tournament(
    connection: &mut SqliteConnection,
    tournament: i64,
    who: &Pseudonym,
) -> Result<bool, ForgetError> {
    let parts = sqlx::query(
        "SELECT position, entries FROM tournament_entries WHERE tournament = $1 ORDER BY position",
    )
    .bind(tournament)
    .fetch_all(&mut *connection)
    .await?;
    let (mut is_in_it, mut over) = (false, false);
    for part in parts {
        let read = form::tournament_entries_from_bytes(part.get("entries"));
        let mut entries = read.map_err(|problem| ForgetError::Unreadable {
            what: format!("tournament number {tournament}"),
            problem: problem.to_string(),
        })?;
        let mut changed = false;
        for entry in &mut entries {
            match entry {
                TournamentEntry::Change(
                    TournamentChange::Joined(entrant)
                    | TournamentChange::Replaced { by: entrant, .. },
                ) if entrant.built_in.is_none() && entrant.name == who.name => {
                    entrant.name.clone_from(&who.pseudonym);
                    changed = true;
                }
                TournamentEntry::Change(TournamentChange::Finished | TournamentChange::Closed) => {
                    over = true
                }
                _ => {}
            }
        }
        if changed {
            is_in_it = true;
            sqlx::query(
                "UPDATE tournament_entries SET entries = $3 WHERE tournament = $1 AND position = $2",
            )
            .bind(tournament)
            .bind(part.get::<i64, _>("position"))
            .bind(form::tournament_entries_to_bytes(&entries))
            .execute(&mut *connection)
            .await?;
        }
    }
    if is_in_it && !over {
        return Err(ForgetError::TournamentRunning(who.name.clone()));
    }
    Ok(is_in_it)
}
