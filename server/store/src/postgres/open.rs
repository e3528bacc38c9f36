//! Connects to the database and checks that its schema is one that this version can use. Creates
//! the schema in an empty database; upgrading an existing one is left to `chefshat migrate`, since
//! other nodes may be using it.

use std::str::FromStr as _;
use std::time::Duration;

use sqlx::migrate::{MigrateError, Migration, MigrationType, Migrator};
use sqlx::postgres::{PgConnectOptions, PgConnection};
use sqlx::{ConnectOptions as _, Connection as _, SqlSafeStr as _};
use tokio::time::{sleep, timeout};

use super::errors::{explain, is_locked};
use crate::StoreError;

/// The migrations, oldest first. They never change: sqlx refuses a database in which one ran with
/// another text.
pub(super) const MIGRATIONS: [(i64, &str, &str); 8] = [
    (1, "games", include_str!("migrations/0001_games.sql")),
    (2, "studies", include_str!("migrations/0002_studies.sql")),
    (3, "reached", include_str!("migrations/0003_reached.sql")),
    (4, "rooms", include_str!("migrations/0004_rooms.sql")),
    (5, "pruned", include_str!("migrations/0005_pruned.sql")),
    (
        6,
        "validated",
        include_str!("migrations/0006_validated.sql"),
    ),
    (
        7,
        "partitions",
        include_str!("migrations/0007_partitions.sql"),
    ),
    (8, "problems", include_str!("migrations/0008_problems.sql")),
];
/// Key of the advisory lock that is held while the schema is created or upgraded: "chefshat" in ASCII.
const SCHEMA_LOCK: i64 = 0x6368_6566_7368_6174;
/// How long connecting may take.
const CONNECT_LIMIT: Duration = Duration::from_secs(5);
/// How long a migration may wait for a lock, and every node with it. A backup holds locks of all
/// tables as long as it runs.
const MIGRATION_LOCK_LIMIT: Duration = Duration::from_secs(1);
/// The pause before the next attempt.
const MIGRATION_PAUSE: Duration = Duration::from_secs(2);
/// Number of attempts, for a minute in all.
const MIGRATION_TRIES: u32 = 20;
/// The settings of each session. Work that depends on nothing but `READ COMMITTED` and takes short;
/// a server that stops in the middle of a transaction must not keep its locks for long.
const SESSION: [(&str, &str); 6] = [
    ("default_transaction_isolation", "read committed"),
    ("statement_timeout", "10s"),
    ("idle_in_transaction_session_timeout", "3s"),
    ("tcp_keepalives_idle", "5"),
    ("tcp_keepalives_interval", "2"),
    ("tcp_keepalives_count", "3"),
];

/// Why a database cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DatabaseError {
    /// The address, which may contain a password, is not one.
    #[error(
        "this is not the address of a database: {0}; an example is postgres://user@host/chefshat"
    )]
    Address(String),
    /// The tables are not ours.
    #[error(
        "the database contains tables of another program; nothing was changed: create a database for chefshat alone, for example with createdb"
    )]
    NotOurs,
    /// There are no tables yet.
    #[error(
        "the database is empty: check its address; `chefshat migrate` or the first node creates the tables"
    )]
    Empty,
    /// The schema is older than this version needs.
    #[error(
        "the tables of the database are of an earlier version; nothing was changed: run `chefshat migrate` with this version, then start the server again"
    )]
    Older,
    /// The schema is too new for this version.
    #[error(
        "the tables of the database are of a later version that this one cannot use; nothing was changed: use the later version"
    )]
    Newer,
    /// Other sessions hold locks of the tables.
    #[error(
        "other sessions still use the tables that are to be changed, for example a backup: wait until they have ended (see pg_locks), then try again"
    )]
    InUse,
    /// Any other error.
    #[error("{0}")]
    Other(String),
}

impl From<sqlx::Error> for DatabaseError {
    fn from(error: sqlx::Error) -> Self {
        Self::Other(explain(&error))
    }
}

impl From<DatabaseError> for StoreError {
    fn from(error: DatabaseError) -> Self {
        Self::Failed(error.to_string())
    }
}

/// Reads an address: a URL as PostgreSQL's own programs take it.
pub(super) fn address(url: &str) -> Result<PgConnectOptions, DatabaseError> {
    let options = PgConnectOptions::from_str(url)
        .map_err(|error| DatabaseError::Address(error.to_string()))?;
    Ok(options.application_name("chefshat"))
}

/// An address as people may read it: without its user and password.
pub(super) fn shown(address: &PgConnectOptions) -> String {
    let (host, port) = (address.get_host(), address.get_port());
    let database = address.get_database().unwrap_or_default();
    format!("postgres://{host}:{port}/{database}")
}

/// Sessions of nodes.
pub(super) fn sessions(address: PgConnectOptions) -> PgConnectOptions {
    address.options(SESSION)
}

/// Sessions that write. A plan that was made while the tables were nearly empty still finds a row
/// by its index when they are not. A plan that reads a whole table all the same then counts as so
/// costly that PostgreSQL would compile it, at each execution.
pub(super) fn writers(sessions: PgConnectOptions) -> PgConnectOptions {
    sessions.options([("enable_seqscan", "off"), ("jit", "off")])
}

/// Sessions that wait this long for a lock.
pub(super) fn with_lock_limit(sessions: PgConnectOptions, limit: Duration) -> PgConnectOptions {
    sessions.options([("lock_timeout", format!("{}ms", limit.as_millis()))])
}

/// Lets a session wait this long for a lock from now on.
pub(super) async fn set_lock_limit(
    connection: &mut PgConnection,
    limit: Duration,
) -> sqlx::Result<()> {
    let set = sqlx::query("SELECT set_config('lock_timeout', $1, false)");
    let set = set.bind(format!("{}ms", limit.as_millis()));
    set.execute(connection).await.map(drop)
}

/// Connects, in bounded time.
pub(super) async fn connect(options: &PgConnectOptions) -> sqlx::Result<PgConnection> {
    let connecting = timeout(CONNECT_LIMIT, PgConnection::connect_with(options));
    connecting.await.unwrap_or_else(|_| Err(too_late()))
}

/// Connects to write. What is acknowledged is on disk, and at a synchronous standby if one is named,
/// whatever the database is set to, now or later; a setting that waits for a standby stays.
pub(super) async fn connect_writer(options: &PgConnectOptions) -> sqlx::Result<PgConnection> {
    let mut connection = connect(options).await?;
    let set = sqlx::query(
        "SELECT set_config('synchronous_commit',
                           CASE WHEN setting IN ('off', 'local') THEN 'on' ELSE setting END, false)
         FROM pg_settings WHERE name = 'synchronous_commit'",
    );
    timeout(CONNECT_LIMIT, set.execute(&mut connection))
        .await
        .map_err(|_| too_late())??;
    Ok(connection)
}

fn too_late() -> sqlx::Error {
    let kind = std::io::ErrorKind::TimedOut;
    sqlx::Error::Io(std::io::Error::new(kind, "it does not answer"))
}

/// What is in a database.
enum Schema {
    Empty,
    /// Tables of ours: the newest migration, and the oldest schema whose programs can use it.
    Ours {
        version: i64,
        oldest: i64,
    },
    Foreign,
}

impl Schema {
    /// Whether it has all that this version needs.
    fn is_complete(&self) -> bool {
        matches!(self, Self::Ours { version, .. } if *version >= NEWEST)
    }
}

/// Waits until nobody else creates or upgrades the schema. The lock ends with the connection.
pub(super) async fn lock(connection: &mut PgConnection) -> sqlx::Result<()> {
    let locking = sqlx::query("SELECT pg_advisory_lock($1)").bind(SCHEMA_LOCK);
    locking.execute(connection).await.map(drop)
}

async fn schema(connection: &mut PgConnection) -> sqlx::Result<Schema> {
    let (migrations, support): (bool, bool) = sqlx::query_as(
        "SELECT to_regclass('_sqlx_migrations') IS NOT NULL, to_regclass('schema_support') IS NOT NULL",
    )
    .fetch_one(&mut *connection)
    .await?;
    if migrations && support {
        let (version, oldest) = sqlx::query_as(
            "SELECT (SELECT max(version) FROM _sqlx_migrations WHERE success), (SELECT oldest FROM schema_support)",
        )
        .fetch_one(&mut *connection)
        .await?;
        return Ok(Schema::Ours { version, oldest });
    }
    let others: i64 = sqlx::query_scalar(
        "SELECT count(*) FROM pg_tables WHERE schemaname = current_schema() AND tablename <> '_sqlx_migrations'",
    )
    .fetch_one(&mut *connection)
    .await?;
    Ok(match others {
        0 => Schema::Empty,
        _ => Schema::Foreign,
    })
}

/// The newest schema that this version knows, which it needs.
pub(super) const NEWEST: i64 = MIGRATIONS[MIGRATIONS.len() - 1].0;

/// What becomes of an empty database.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum IfEmpty {
    /// It gets the schema.
    Create,
    /// It is refused, and stays empty.
    Refuse,
}

/// Checks that this version can use a database.
pub(super) async fn check(
    address: &PgConnectOptions,
    if_empty: IfEmpty,
) -> Result<(), DatabaseError> {
    let mut connection = connect(address).await?;
    let mut found = schema(&mut connection).await?;
    if !found.is_complete() {
        // Another node may be about to create it.
        lock(&mut connection).await?;
        found = schema(&mut connection).await?;
    }
    let usable = match found {
        Schema::Empty if if_empty == IfEmpty::Refuse => Err(DatabaseError::Empty),
        Schema::Empty => run(&MIGRATIONS, &mut connection).await,
        Schema::Ours { version, .. } if version < NEWEST => Err(DatabaseError::Older),
        Schema::Ours { oldest, .. } if oldest > NEWEST => Err(DatabaseError::Newer),
        Schema::Ours { .. } => Ok(()),
        Schema::Foreign => Err(DatabaseError::NotOurs),
    };
    // What was checked is known; how the connection ends changes nothing.
    let _ = connection.close().await;
    usable
}

/// Creates the schema or upgrades it to the newest that this version knows. Returns the version
/// before (0: empty) and after.
///
/// # Errors
/// The database cannot be reached, is another program's, or is newer than this version.
pub async fn migrate(url: &str) -> Result<(i64, i64), DatabaseError> {
    // Its statements may take long.
    let address = address(url)?.disable_statement_logging();
    let mut connection = connect(&address).await?;
    lock(&mut connection).await?;
    let before = match schema(&mut connection).await? {
        Schema::Empty => 0,
        Schema::Ours { version, .. } if version > NEWEST => return Err(DatabaseError::Newer),
        Schema::Ours { version, .. } => version,
        Schema::Foreign => return Err(DatabaseError::NotOurs),
    };
    run(&MIGRATIONS, &mut connection).await?;
    // The migrations are committed.
    let _ = connection.close().await;
    Ok((before, NEWEST))
}

/// Runs those of these migrations that are missing, each in a transaction. The caller has the lock.
/// While it waits for a table, nobody else gets that table, and no node its lease: so it waits
/// briefly, and often.
pub(super) async fn run(
    migrations: &[(i64, &'static str, &'static str)],
    connection: &mut PgConnection,
) -> Result<(), DatabaseError> {
    let all = migrations.iter().map(|(version, name, sql)| {
        let sql = (*sql).into_sql_str();
        Migration::new(*version, (*name).into(), MigrationType::Simple, sql, false)
    });
    let migrator = Migrator::with_migrations(all.collect());
    set_lock_limit(connection, MIGRATION_LOCK_LIMIT).await?;
    for attempt in 0..MIGRATION_TRIES {
        if attempt > 0 {
            sleep(MIGRATION_PAUSE).await;
        }
        match migrator.run(&mut *connection).await {
            Ok(()) => return Ok(()),
            Err(MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _))
                if is_locked(&error) => {}
            Err(error) => {
                let problem = format!("creating the tables failed: {error}");
                return Err(DatabaseError::Other(problem));
            }
        }
    }
    Err(DatabaseError::InUse)
}
