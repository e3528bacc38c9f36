//! Why a run fails. What an attack meets is not an error: it is counted.

/// Why a run failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum HostileError {
    /// A system call failed.
    #[error("{what}: {error}")]
    Io {
        /// What was attempted.
        what: &'static str,
        /// The system's error.
        error: std::io::Error,
    },
    /// There is no server to start.
    #[error(
        "there is no server at {0}; build it with `cargo build -p chefshat`, or name one with --server"
    )]
    NoServer(std::path::PathBuf),
    /// The server did not start.
    #[error("the server did not start: {0}")]
    Start(String),
    /// This machine lacks what an attack needs.
    #[error("this machine lacks what the attack needs: {0}")]
    Lacks(String),
    /// The honest room could not play before the attack began.
    #[error("the honest room did not play on the quiet server: {0}")]
    Quiet(String),
    /// The attack could not be prepared.
    #[error("preparing the attack failed: {0}")]
    Prepare(String),
}

impl HostileError {
    /// For `map_err`: adds what was attempted.
    pub(crate) fn io(what: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        move |error| Self::Io { what, error }
    }
}
