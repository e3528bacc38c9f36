//! Moves the database of a data directory here: everything in one transaction, so that nothing or
//! all is moved. What is not over belongs to nobody afterwards; the next node takes it over.

use std::path::Path;

use futures::TryStreamExt as _;
use sqlx::postgres::PgConnection;
use sqlx::{AssertSqlSafe, ConnectOptions as _, Connection as _};
use tracing::error;

use super::errors::{failure, is_temporary};
use super::open::{self, DatabaseError};
use super::partitions;
use super::values::{FIRST_EPOCH, indexed_name, number_of, text};
use crate::form;
use crate::sql::integer;
use crate::sqlite::{self, Contents, GameRow, JournalRow, ParticipantRow, TracesRow, UnitHeader};
use crate::units::UnitKind;
use crate::{DATABASE_FILE, OpenError, StoreError};
use chefshat_record::atomic_file::WriteError;
use chefshat_room::ids::random_bytes;
use chefshat_room::journal::GameHeader;

/// Rows in one statement, and how many bytes of journals at most, nearly.
const ROWS: usize = 1_000;
const BYTES: usize = 4 * 1024 * 1024;

/// What was moved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Transferred {
    /// Games that are over, imported ones included.
    pub finished: u64,
    /// Games that are not over.
    pub unfinished: u64,
    /// Tournaments.
    pub tournaments: u64,
    /// Studies.
    pub studies: u64,
    /// Unfinished games and tournaments that this version cannot read; they are moved, but do not
    /// resume.
    pub unreadable: u64,
}

/// Why nothing was moved.
#[derive(Debug, thiserror::Error)]
pub enum TransferError {
    /// The folder has no database, or an empty file.
    #[error("{0} has no {DATABASE_FILE}, or an empty one; name the data directory of a server")]
    Missing(String),
    /// The folder cannot be used.
    #[error(transparent)]
    Folder(#[from] OpenError),
    /// The database cannot be used.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// The database has games already.
    #[error(
        "the database already has games, tournaments or studies; nothing was changed: create an empty database and name that"
    )]
    NotEmpty,
    /// Reading or writing failed.
    #[error("{0}; nothing was moved")]
    Store(#[from] StoreError),
    /// The folder cannot be marked as moved.
    #[error("{0}; nothing was moved")]
    Mark(#[from] WriteError),
    /// The database did not answer when everything had been sent.
    #[error(
        "{0}; whether everything has moved is not known, and no server starts on the folder: run chefshat migrate again, which says so if the database has the games"
    )]
    Unknown(StoreError),
}

impl From<sqlx::Error> for TransferError {
    fn from(error: sqlx::Error) -> Self {
        Self::Store(failure(&error))
    }
}

/// Moves the games and tournaments of a data directory into a database without any. Creates or
/// upgrades its tables. The folder keeps everything; no server starts on it afterwards, because its
/// unfinished games would resume twice. `progress` receives the number of moved games and of all.
///
/// # Errors
/// Nothing was moved, or it is not known.
pub async fn transfer(
    data_dir: &Path,
    url: &str,
    mut progress: impl FnMut(u64, u64),
) -> Result<Transferred, TransferError> {
    let database = data_dir.join(DATABASE_FILE).metadata();
    if !database.is_ok_and(|about| about.len() > 0) {
        return Err(TransferError::Missing(data_dir.display().to_string()));
    }
    // Its statements may take long.
    let address = open::address(url)?.disable_statement_logging();
    let target = open::shown(&address);
    let contents = Contents::open(data_dir).await?;
    // If that move had no answer, it may be tried again.
    let moved_before = sqlite::moved_to(data_dir)?;
    if let Some(other) = moved_before.filter(|before| *before != target) {
        return Err(sqlite::moved(data_dir, other).into());
    }
    open::migrate(url).await?;
    let mut connection = open::connect_writer(&address).await?;
    let mut transaction = connection.begin().await?;
    // Nobody creates anything meanwhile.
    sqlx::query("LOCK TABLE games, tournaments, studies, owned IN EXCLUSIVE MODE")
        .execute(&mut *transaction)
        .await?;
    let empty: bool = sqlx::query_scalar(
        "SELECT NOT EXISTS (SELECT FROM games) AND NOT EXISTS (SELECT FROM tournaments)
                AND NOT EXISTS (SELECT FROM studies) AND NOT EXISTS (SELECT FROM owned)
                AND NOT EXISTS (SELECT FROM pruned)",
    )
    .fetch_one(&mut *transaction)
    .await?;
    if !empty {
        return Err(TransferError::NotEmpty);
    }
    let mut moved = Transferred::default();
    let tournaments = move_units(UnitKind::Tournament, &contents, &mut transaction).await?;
    (moved.tournaments, moved.unreadable) = tournaments;
    (moved.studies, _) = move_units(UnitKind::Study, &contents, &mut transaction).await?;
    let mut traces = contents.traces();
    while let Some(row) = traces.try_next().await? {
        insert_traces(&mut transaction, &row).await?;
    }
    let all = contents.count().await?;
    partitions::add(&mut transaction, contents.newest_game().await?).await?;
    let mut games = contents.games();
    let mut rows = Vec::new();
    while let Some(game) = games.try_next().await? {
        insert_game(&mut transaction, &game).await?;
        if game.state == 0 {
            moved.unfinished += 1;
            moved.unreadable += u64::from(!own_game(&mut transaction, &game).await?);
        } else {
            moved.finished += 1;
            rows.extend(contents.journal(&game).await?);
            insert_full(&mut transaction, "journal", &mut rows).await?;
        }
        progress(moved.finished + moved.unfinished, all);
    }
    let mut running = contents.running_journals();
    while let Some(row) = running.try_next().await? {
        rows.push(row);
        insert_full(&mut transaction, "journal", &mut rows).await?;
    }
    insert_rows(&mut transaction, "journal", &mut rows).await?;
    let mut participants = contents.participants().try_chunks(ROWS);
    while let Some(some) = participants.try_next().await.map_err(|it| it.1)? {
        insert_participants(&mut transaction, &some).await?;
    }
    for statement in [
        "UPDATE finished SET last = (SELECT coalesce(max(listed), 0) FROM games)",
        "SELECT setval('games_number_seq', greatest(max(number), (SELECT last_value FROM games_number_seq)))
         FROM games HAVING count(*) > 0",
        "SELECT setval(pg_get_serial_sequence('tournaments', 'number'), max(number)) FROM tournaments HAVING count(*) > 0",
        "SELECT setval(pg_get_serial_sequence('studies', 'number'), max(number)) FROM studies HAVING count(*) > 0",
    ] {
        sqlx::query(statement).execute(&mut *transaction).await?;
    }
    // Before the end: if this process dies meanwhile, the games do not go on in both places.
    if let Err(error) = sqlite::note_move(data_dir, &target) {
        sqlite::forget_move(data_dir);
        return Err(error.into());
    }
    match transaction.commit().await {
        Ok(()) => Ok(moved),
        Err(error) if is_temporary(&error) => Err(TransferError::Unknown(failure(&error))),
        Err(error) => {
            sqlite::forget_move(data_dir);
            Err(error.into())
        }
    }
}

/// Moves the tournaments or studies with their journals. Returns how many there are, and how many of
/// them cannot be read.
async fn move_units(
    kind: UnitKind,
    contents: &Contents,
    connection: &mut PgConnection,
) -> Result<(u64, u64), TransferError> {
    let (mut moved, mut unreadable) = (0, 0);
    let mut units = contents.units(kind);
    while let Some(unit) = units.try_next().await? {
        moved += 1;
        unreadable += u64::from(!insert_unit(connection, kind, &unit).await?);
    }
    let table = match kind {
        UnitKind::Tournament => "tournament_entries",
        UnitKind::Study => "study_changes",
    };
    let mut rows = Vec::new();
    let mut journals = contents.unit_journals(kind);
    while let Some(row) = journals.try_next().await? {
        rows.push(row);
        insert_full(connection, table, &mut rows).await?;
    }
    insert_rows(connection, table, &mut rows).await?;
    Ok((moved, unreadable))
}

async fn insert_traces(
    connection: &mut PgConnection,
    traces: &TracesRow,
) -> Result<(), TransferError> {
    sqlx::query(
        "INSERT INTO study_traces (trace_id, study, participant, game_id, traces)
         VALUES ($1, $2, $3, $4, $5)",
    )
    .bind(random_bytes::<16>().as_slice())
    .bind(traces.study)
    .bind(traces.participant)
    .bind(traces.game_id.as_slice())
    .bind(traces.traces.as_slice())
    .execute(connection)
    .await?;
    Ok(())
}

/// Inserts a tournament or study, which the next node takes over; `false` if it is a tournament that
/// cannot be read, so that nobody resumes it.
async fn insert_unit(
    connection: &mut PgConnection,
    kind: UnitKind,
    unit: &UnitHeader,
) -> Result<bool, TransferError> {
    sqlx::query(kind.sql(
        "INSERT INTO {units} (number, {unit_id}, form, header)
         OVERRIDING SYSTEM VALUE VALUES ($1, $2, $3, $4)",
    ))
    .bind(unit.number)
    .bind(unit.id.as_slice())
    .bind(unit.form)
    .bind(unit.header.as_slice())
    .execute(&mut *connection)
    .await?;
    if unit.over {
        sqlx::query("UPDATE tournaments SET over = true WHERE number = $1")
            .bind(unit.number)
            .execute(&mut *connection)
            .await?;
    }
    let join_code = match kind {
        UnitKind::Study => None,
        UnitKind::Tournament => match form::tournament_from_bytes(&unit.header) {
            Ok(header) => Some(header.join_code),
            Err(problem) => {
                error!(number = unit.number, %problem, "a tournament cannot be read");
                return Ok(false);
            }
        },
    };
    sqlx::query(
        "INSERT INTO owned (id, unit, kind, epoch, join_code, durable, form, over, ended_ms)
         VALUES ($1, $1, $2, $3, coalesce($4, 'study ' || encode($1, 'hex')), true, $5, $6,
                 CASE WHEN $6 THEN clock_ms() END)",
    )
    .bind(unit.id.as_slice())
    .bind(number_of(kind))
    .bind(FIRST_EPOCH)
    .bind(join_code.as_deref().map(text))
    .bind(unit.form)
    .bind(unit.over)
    .execute(connection)
    .await?;
    Ok(true)
}

async fn insert_game(connection: &mut PgConnection, game: &GameRow) -> Result<(), TransferError> {
    let header = game.header.as_deref().map(form::header_from_bytes);
    let created_at_ms = match (game.created_at_ms, &header) {
        (None, Some(Ok(header))) => Some(integer(header.created_at_ms)),
        (created_at_ms, _) => created_at_ms,
    };
    sqlx::query(
        "INSERT INTO games (number, game_id, form, state, ended_at_ms, filed, origin, room_name, created_at_ms, added,
                            summary, header, listed, signature)
         OVERRIDING SYSTEM VALUE VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14)",
    )
    .bind(game.number)
    .bind(game.game_id.as_slice())
    .bind(game.form)
    .bind(game.state)
    .bind(game.ended_at_ms)
    .bind(game.filed)
    .bind(game.origin)
    .bind(game.room_name.as_deref().map(text))
    .bind(created_at_ms)
    .bind(game.added)
    .bind(game.summary.as_deref())
    .bind(game.header.as_deref())
    .bind(game.listed)
    .bind(game.signature.as_deref())
    .execute(&mut *connection)
    .await?;
    if let Some(record) = game.record.as_deref() {
        sqlx::query("INSERT INTO added_records (game, record) VALUES ($1, $2)")
            .bind(game.number)
            .bind(record)
            .execute(connection)
            .await?;
    }
    Ok(())
}

/// Lets the next node take over a game that is not over; `false` if it cannot be read.
async fn own_game(connection: &mut PgConnection, game: &GameRow) -> Result<bool, TransferError> {
    let header: GameHeader = match game.header.as_deref().map(form::header_from_bytes) {
        Some(Ok(header)) => header,
        Some(Err(problem)) => {
            error!(number = game.number, %problem, "a game cannot be read");
            return Ok(false);
        }
        None => return Ok(false),
    };
    sqlx::query(
        "INSERT INTO owned (id, unit, kind, epoch, join_code, game_id, durable, form, rules_version)
         VALUES ($1, $2, 0, $3, $4, $5, true, $6, $7)",
    )
    .bind(header.room_id.bytes().as_slice())
    .bind(header.unit().bytes().as_slice())
    .bind(FIRST_EPOCH)
    .bind(text(&header.join_code))
    .bind(game.game_id.as_slice())
    .bind(game.form)
    .bind(i64::from(header.rules_version))
    .execute(connection)
    .await?;
    Ok(true)
}

/// Inserts rows of journals once there are many.
async fn insert_full(
    connection: &mut PgConnection,
    table: &'static str,
    rows: &mut Vec<JournalRow>,
) -> Result<(), TransferError> {
    let bytes: usize = rows.iter().map(|row| row.entries.len()).sum();
    match rows.len() >= ROWS || bytes >= BYTES {
        true => insert_rows(connection, table, rows).await,
        false => Ok(()),
    }
}

async fn insert_rows(
    connection: &mut PgConnection,
    table: &'static str,
    rows: &mut Vec<JournalRow>,
) -> Result<(), TransferError> {
    // The names of our own tables. Both call the number of game or tournament differently.
    let statement = format!(
        "INSERT INTO {table} SELECT number, position, $1, entries
         FROM unnest($2::bigint[], $3::bigint[], $4::bytea[]) AS new (number, position, entries)"
    );
    sqlx::query(AssertSqlSafe(statement))
        .bind(FIRST_EPOCH)
        .bind(rows.iter().map(|row| row.of).collect::<Vec<_>>())
        .bind(rows.iter().map(|row| row.position).collect::<Vec<_>>())
        .bind(
            (rows.iter())
                .map(|row| row.entries.as_slice())
                .collect::<Vec<_>>(),
        )
        .execute(connection)
        .await?;
    rows.clear();
    Ok(())
}

async fn insert_participants(
    connection: &mut PgConnection,
    rows: &[ParticipantRow],
) -> Result<(), TransferError> {
    sqlx::query(
        "INSERT INTO participants (game, seat, name, agent, kind)
         SELECT * FROM unnest($1::bigint[], $2::bigint[], $3::text[], $4::text[], $5::integer[])",
    )
    .bind(rows.iter().map(|row| row.game).collect::<Vec<_>>())
    .bind(rows.iter().map(|row| row.seat).collect::<Vec<_>>())
    .bind(
        (rows.iter())
            .map(|row| indexed_name(&row.name).into_owned())
            .collect::<Vec<_>>(),
    )
    .bind(
        (rows.iter())
            .map(|row| indexed_name(&row.agent).into_owned())
            .collect::<Vec<_>>(),
    )
    .bind(rows.iter().map(|row| row.kind).collect::<Vec<_>>())
    .execute(connection)
    .await?;
    Ok(())
}
