//! Copies the database while a server uses it, and checks a copy. The other files of a data
//! directory are copied by the command `chefshat backup`.

use std::path::Path;

use sqlx::Connection as _;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};

use super::errors::{BUSY_LIMIT, FILE};
use super::open::{APPLICATION_ID, OpenError, SHRINKABLE, make_private};
use chefshat_room::ids::{GameId, Id};

/// What a copy of a database contains.
#[derive(Debug)]
pub struct DatabaseCopy {
    /// Number of finished games.
    pub finished: u64,
    /// Number of games that resume when a server starts.
    pub unfinished: u64,
    /// The games whose record has been written to a file.
    pub recorded: Vec<GameId>,
}

/// Copies the database of a data directory into a folder that has none. A server may use it: the
/// copy is its state at one moment, and nobody waits. It can give back the pages of deleted games,
/// even if the database was created by a version that could not.
///
/// # Errors
/// There is no database of ours, or it cannot be read, or the copy cannot be written.
pub async fn copy_database(data_dir: &Path, folder: &Path) -> Result<DatabaseCopy, OpenError> {
    let (source, copy) = (data_dir.join(FILE), folder.join(FILE));
    let failed = |error| OpenError::of(&source, &error);
    let mut database = open(&source).await?;
    // SQLite writes to an empty file, which keeps its permissions.
    make_private(&copy)?;
    let vacuum: i64 = sqlx::query_scalar("PRAGMA auto_vacuum")
        .fetch_one(&mut database)
        .await
        .map_err(failed)?;
    // For the copy. In a database that can shrink already it would be a write.
    if vacuum == 0 {
        sqlx::query(SHRINKABLE)
            .execute(&mut database)
            .await
            .map_err(failed)?;
    }
    sqlx::query("VACUUM INTO ?")
        .bind(copy.to_string_lossy())
        .execute(&mut database)
        .await
        .map_err(failed)?;
    database.close().await.map_err(failed)?;
    contents(&copy).await
}

/// Checks that a folder has a complete database of ours, as [`copy_database`] leaves it.
///
/// # Errors
/// It has none, or the database is damaged or has a write-ahead log.
pub async fn check_copy(folder: &Path) -> Result<DatabaseCopy, OpenError> {
    let path = folder.join(FILE);
    let log = path.with_extension("sqlite3-wal");
    if log.metadata().is_ok_and(|metadata| metadata.len() > 0) {
        let problem = format!("{} lies beside it, so it is no backup", log.display());
        return Err(OpenError::Damaged(path, problem));
    }
    let mut database = open(&path).await?;
    let found: Vec<String> = sqlx::query_scalar("PRAGMA integrity_check(1)")
        .fetch_all(&mut database)
        .await
        .map_err(|error| OpenError::Damaged(path.clone(), error.to_string()))?;
    if found != ["ok"] {
        return Err(OpenError::Damaged(path, found.join("; ")));
    }
    drop(database);
    contents(&path).await
}

/// Opens a database of ours for reading.
async fn open(path: &Path) -> Result<SqliteConnection, OpenError> {
    path.metadata().map_err(|source| OpenError::Io {
        path: path.to_path_buf(),
        source,
    })?;
    let failed = |error| OpenError::of(path, &error);
    let options = SqliteConnectOptions::new()
        .filename(path)
        .read_only(true)
        .busy_timeout(BUSY_LIMIT);
    let mut database = SqliteConnection::connect_with(&options)
        .await
        .map_err(failed)?;
    let id: i64 = sqlx::query_scalar("PRAGMA application_id")
        .fetch_one(&mut database)
        .await
        .map_err(failed)?;
    match id == APPLICATION_ID {
        true => Ok(database),
        false => Err(OpenError::NotOurs(path.to_path_buf())),
    }
}

async fn contents(path: &Path) -> Result<DatabaseCopy, OpenError> {
    let failed = |error| OpenError::of(path, &error);
    let mut database = open(path).await?;
    let (finished, unfinished): (i64, i64) = sqlx::query_as(
        "SELECT count(*) FILTER (WHERE summary IS NOT NULL), count(*) FILTER (WHERE state = 0) FROM games",
    )
    .fetch_one(&mut database)
    .await
    .map_err(failed)?;
    let recorded: Vec<String> =
        sqlx::query_scalar("SELECT lower(hex(game_id)) FROM games WHERE filed = 1")
            .fetch_all(&mut database)
            .await
            .map_err(failed)?;
    database.close().await.map_err(failed)?;
    Ok(DatabaseCopy {
        finished: finished.unsigned_abs(),
        unfinished: unfinished.unsigned_abs(),
        recorded: recorded.iter().filter_map(|id| Id::parse(id)).collect(),
    })
}
