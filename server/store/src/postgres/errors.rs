//! Explains PostgreSQL's errors to the person who runs the server, with advice.

use crate::StoreError;

/// What is to be written is locked.
pub(super) const LOCKED: &str =
    "another session of the database has locked what is to be written: see pg_locks";

/// Explains an error, with advice.
pub(super) fn explain(error: &sqlx::Error) -> String {
    let code = error.as_database_error().and_then(|error| error.code());
    let advice = match code.as_deref() {
        Some("53100") => "the disk of the database is full: free some space",
        Some("55P03") => LOCKED,
        Some("53300") => {
            "the database has no connection left: raise its max_connections, or run fewer nodes"
        }
        Some("28000" | "28P01") => "the database refuses the user or password: check the address",
        Some("3D000") => "the database does not exist: create it, for example with createdb",
        Some("42501" | "25006") => {
            "the user may not write to the database: grant it, or name the primary server"
        }
        Some("42P01" | "42703" | "42883") => {
            "the tables are not those of this version: run `chefshat migrate`"
        }
        _ => match error {
            sqlx::Error::Io(_) | sqlx::Error::PoolTimedOut => {
                "the database cannot be reached: check that it runs and that the address is right"
            }
            sqlx::Error::Tls(_) => {
                "the connection to the database cannot be encrypted: check sslmode and sslrootcert"
            }
            _ => return format!("the database failed: {error}"),
        },
    };
    format!("{advice} ({error})")
}

/// The error of the store for an error of the database.
pub(super) fn failure(error: &sqlx::Error) -> StoreError {
    StoreError::Failed(explain(error))
}

/// Whether another session has locked what was to be written. Nothing was.
pub(super) fn is_locked(error: &sqlx::Error) -> bool {
    let code = error.as_database_error().and_then(|error| error.code());
    code.as_deref() == Some("55P03")
}

/// Whether the same statement can succeed later: the connection is gone, the server stops or
/// starts, is a standby, has no space or met a conflict.
pub(super) fn is_temporary(error: &sqlx::Error) -> bool {
    match error {
        sqlx::Error::Database(error) => {
            let code = error.code().unwrap_or_default();
            // Classes: connection, rollback, resources, locks, operator, system, internal; and
            // read-only.
            ["08", "40", "53", "55", "57", "58", "XX"]
                .iter()
                .any(|class| code.starts_with(class))
                || code == "25006"
                // Idle in a transaction for too long.
                || code == "25P03"
        }
        sqlx::Error::Io(_)
        | sqlx::Error::Tls(_)
        | sqlx::Error::Protocol(_)
        | sqlx::Error::PoolTimedOut
        | sqlx::Error::WorkerCrashed => true,
        _ => false,
    }
}
