//! Opens the database: checks that it is ours, that no other process uses it, and that this version
//! can read it. Refuses it otherwise, before anything is written.

use std::fs::File;
use std::path::{Path, PathBuf};

use chefshat_record::private;
use sqlx::migrate::{MigrateError, Migration, MigrationType, Migrator};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteConnection, SqliteJournalMode, SqlitePool, SqlitePoolOptions,
    SqliteSynchronous,
};
use sqlx::{Connection as _, SqlSafeStr as _};

use super::errors::{BUSY_LIMIT, CORRUPT, FILE, NOT_A_DATABASE, explain, has_code};
use super::former::{self, LOCK_FILE};
use super::rows::with_own_rows;
use super::space::give_up_ballast;
use crate::StoreError;

/// Identifies our databases: `PRAGMA application_id` of the first migration.
pub(super) const APPLICATION_ID: i64 = 0x4368_4874;
/// Connections for reading.
const READERS: u32 = 4;
/// Prepared statements per connection.
const STATEMENTS: usize = 64;
/// The migrations, oldest first. A released one never changes.
const MIGRATIONS: [(i64, &str, &str); 6] = [
    (1, "games", include_str!("migrations/0001_games.sql")),
    (
        2,
        "tournaments",
        include_str!("migrations/0002_tournaments.sql"),
    ),
    (3, "listed", include_str!("migrations/0003_listed.sql")),
    (
        4,
        "signature",
        include_str!("migrations/0004_signature.sql"),
    ),
    (
        5,
        "import time",
        include_str!("migrations/0005_import_time.sql"),
    ),
    (6, "studies", include_str!("migrations/0006_studies.sql")),
];

/// Why a data directory cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The file system refused.
    #[error("{path}: {source}; choose another folder with --data-dir")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// Another server uses it.
    #[error("another chefshat server uses {0}; stop it, or choose another folder with --data-dir")]
    InUse(PathBuf),
    /// The file is not a database of ours.
    #[error(
        "{0} is not a database of chefshat; nothing was changed: move it away, or choose another folder with --data-dir"
    )]
    NotOurs(PathBuf),
    /// The database is damaged.
    #[error(
        "{0} is damaged ({1}); nothing was changed: restore a backup, or move it away to start with an empty database (records are in records/)"
    )]
    Damaged(PathBuf, String),
    /// The database is gone, and something else of an earlier server is there.
    #[error(
        "{0} is empty or missing, but a server used this folder before: {1}; nothing was changed: restore a backup or put the database back, or begin with an empty database: chefshat serve --new (records stay)"
    )]
    Gone(PathBuf, String),
    /// The games have moved to a PostgreSQL database.
    #[error(
        "the games of this folder have moved to {1}: connect to that with --database, or choose another folder with --data-dir; only if nothing has arrived there, delete {0} and start again"
    )]
    Moved(PathBuf, String),
    /// The database was written by a newer version.
    #[error(
        "{0} was written by a newer version of chefshat; nothing was changed: use that version, or choose another folder with --data-dir"
    )]
    Newer(PathBuf),
    /// Any other error.
    #[error("{0}: {1}")]
    Other(PathBuf, String),
}

impl OpenError {
    /// That of a database at this path.
    pub(super) fn of(path: &Path, error: &sqlx::Error) -> Self {
        let path = path.to_path_buf();
        if has_code(error, NOT_A_DATABASE) {
            Self::NotOurs(path)
        } else if has_code(error, CORRUPT) {
            Self::Damaged(path, error.to_string())
        } else {
            Self::Other(path, explain(error))
        }
    }
}

/// An opened database.
pub(super) struct Opened {
    pub(super) writer: SqliteConnection,
    pub(super) readers: SqlitePool,
    pub(super) lock: FolderLock,
}

/// A data directory that this process has locked, until this is dropped or the process ends.
pub(super) struct FolderLock(pub(super) File);

impl Drop for FolderLock {
    /// Unlocks it, rather than only closing the file: a process that another thread is just
    /// starting has a copy of every descriptor until it runs its program.
    fn drop(&mut self) {
        // Closing the file is what is left to try.
        let _ = self.0.unlock();
    }
}

/// Lets the next VACUUM make a database that can give back the pages of deleted games.
pub(super) const SHRINKABLE: &str = "PRAGMA auto_vacuum = INCREMENTAL";

/// Lets a new database give back the pages of deleted games while rooms commit. Later that would
/// take a copy of the database.
async fn make_shrinkable(writer: &mut SqliteConnection) -> sqlx::Result<()> {
    let pages: i64 = sqlx::query_scalar("PRAGMA page_count")
        .fetch_one(&mut *writer)
        .await?;
    if pages <= 1 {
        for text in [SHRINKABLE, "VACUUM"] {
            sqlx::query(text).execute(&mut *writer).await?;
        }
    }
    Ok(())
}

/// What happens if the database is empty or missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum IfGone {
    /// It is created, unless the directory shows that there was one.
    CreateFirst,
    /// It is created.
    Create,
}

/// Opens the database of a data directory; creates it if it is missing. Reading a database takes some
/// space, too: on a full disk it takes what was kept for that.
pub(super) async fn open(data_dir: &Path, if_gone: IfGone) -> Result<Opened, OpenError> {
    let had_lock = data_dir.join(LOCK_FILE).exists();
    let lock = lock(data_dir)?;
    let trace = match if_gone {
        IfGone::CreateFirst => former::trace(data_dir, &lock.0, had_lock),
        IfGone::Create => None,
    };
    let trace = trace.as_deref();
    let (writer, readers) = match open_database(data_dir, trace).await {
        Err(OpenError::Other(..)) if give_up_ballast(data_dir) => {
            open_database(data_dir, trace).await
        }
        opened => opened,
    }?;
    former::mark(&lock.0);
    Ok(Opened {
        writer,
        readers,
        lock,
    })
}

/// Where the games of a data directory have moved, if they have.
///
/// # Errors
/// The note that says so cannot be read.
pub(crate) fn moved_to(data_dir: &Path) -> Result<Option<String>, OpenError> {
    former::moved_to(data_dir).map_err(|source| OpenError::Io {
        path: data_dir.join(former::MOVED_FILE),
        source,
    })
}

/// Why a data directory whose games have moved to an address is not used.
pub(crate) fn moved(data_dir: &Path, address: String) -> OpenError {
    OpenError::Moved(data_dir.join(former::MOVED_FILE), address)
}

/// Opens the database of a data directory that this process has locked. `trace` shows that it had
/// one: an empty one is not created then.
async fn open_database(
    data_dir: &Path,
    trace: Option<&str>,
) -> Result<(SqliteConnection, SqlitePool), OpenError> {
    let path = data_dir.join(FILE);
    check_log(&path)?;
    let mut is_empty = true;
    let options = SqliteConnectOptions::new()
        .filename(&path)
        .busy_timeout(BUSY_LIMIT)
        .statement_cache_capacity(STATEMENTS);
    let failed = |error| OpenError::of(&path, &error);
    if path.metadata().is_ok_and(|metadata| metadata.len() > 0) {
        // Checked before any setting: setting the journal mode writes.
        let mut looking = SqliteConnection::connect_with(&options.clone().read_only(true))
            .await
            .map_err(failed)?;
        let id: i64 = sqlx::query_scalar("PRAGMA application_id")
            .fetch_one(&mut looking)
            .await
            .map_err(failed)?;
        let tables: i64 = sqlx::query_scalar("SELECT count(*) FROM sqlite_schema")
            .fetch_one(&mut looking)
            .await
            .map_err(failed)?;
        // A server that died right at its first start leaves an empty database.
        if id != APPLICATION_ID
            && tables > 0
            && !only_migrations(&mut looking).await.map_err(failed)?
        {
            return Err(OpenError::NotOurs(path));
        }
        looking.close().await.map_err(failed)?;
        is_empty = id != APPLICATION_ID;
    }
    if is_empty && let Some(trace) = trace {
        return Err(OpenError::Gone(path, trace.to_owned()));
    }
    make_private(&path)?;
    let options = options
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        // What is deleted, such as a participant's data, is overwritten.
        .pragma("secure_delete", "on");
    let mut writer = SqliteConnection::connect_with(&options)
        .await
        .map_err(failed)?;
    make_shrinkable(&mut writer).await.map_err(failed)?;
    migrations()
        .run(&mut writer)
        .await
        .map_err(|error| match error {
            MigrateError::VersionMissing(_) | MigrateError::VersionMismatch(_) => {
                OpenError::Newer(path.clone())
            }
            MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _) => {
                failed(error)
            }
            error => OpenError::Other(path.clone(), error.to_string()),
        })?;
    // Games that were abandoned before the deal leave nothing behind.
    for forgotten in [
        with_own_rows!(
            "(row, game) IN (SELECT last_row, number FROM games WHERE state <> 0 AND summary IS NULL)",
            "DELETE FROM journal WHERE row IN (SELECT row FROM own)"
        ),
        "DELETE FROM games WHERE state <> 0 AND summary IS NULL",
    ] {
        sqlx::query(forgotten)
            .execute(&mut writer)
            .await
            .map_err(failed)?;
    }
    let readers = SqlitePoolOptions::new()
        .max_connections(READERS)
        .connect_with(options.read_only(true).create_if_missing(false))
        .await
        .map_err(failed)?;
    Ok((writer, readers))
}

/// Whether the database contains nothing but an incomplete first migration.
async fn only_migrations(connection: &mut SqliteConnection) -> Result<bool, sqlx::Error> {
    let others: i64 = sqlx::query_scalar(
        "SELECT count(*) FROM sqlite_schema WHERE tbl_name <> '_sqlx_migrations'",
    )
    .fetch_one(connection)
    .await?;
    Ok(others == 0)
}

fn migrations() -> Migrator {
    Migrator::with_migrations(
        MIGRATIONS
            .iter()
            .map(|(version, name, sql)| {
                Migration::new(
                    *version,
                    (*name).into(),
                    MigrationType::Simple,
                    (*sql).into_sql_str(),
                    false,
                )
            })
            .collect(),
    )
}

/// Locks the data directory for this process.
fn lock(data_dir: &Path) -> Result<FolderLock, OpenError> {
    let path = data_dir.join(LOCK_FILE);
    let io = |source| OpenError::Io {
        path: path.clone(),
        source,
    };
    std::fs::create_dir_all(data_dir).map_err(io)?;
    let file = File::options()
        .create(true)
        .truncate(false)
        .read(true)
        .write(true)
        .open(&path)
        .map_err(io)?;
    match file.try_lock() {
        Ok(()) => Ok(FolderLock(file)),
        Err(std::fs::TryLockError::WouldBlock) => Err(OpenError::InUse(data_dir.to_path_buf())),
        Err(std::fs::TryLockError::Error(error)) => Err(io(error)),
    }
}

/// Refuses a database of which only the write-ahead log is left: opening it would create an empty
/// one and lose the log.
fn check_log(path: &Path) -> Result<(), OpenError> {
    let length = |path: &Path| path.metadata().map_or(0, |metadata| metadata.len());
    let log = path.with_extension("sqlite3-wal");
    if length(path) == 0 && length(&log) > 0 {
        let problem = format!("it is empty or missing, but {} exists", log.display());
        return Err(OpenError::Damaged(path.to_path_buf(), problem));
    }
    Ok(())
}

/// Creates the database file, if it is missing, unreadable for other users: it contains the seeds
/// of running games.
pub(super) fn make_private(path: &Path) -> Result<(), OpenError> {
    private::options()
        .create(true)
        .append(true)
        .open(path)
        .map(drop)
        .map_err(|source| OpenError::Io {
            path: path.to_path_buf(),
            source,
        })
}

impl From<OpenError> for StoreError {
    fn from(error: OpenError) -> Self {
        Self::Failed(error.to_string())
    }
}
