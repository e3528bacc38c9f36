//! Why a run fails. A benchmark that did not do what it counts fails instead of reporting a slow
//! result.

/// Why a run failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LoadError {
    /// A system call failed.
    #[error("{what}: {error}")]
    Io {
        /// What was attempted.
        what: &'static str,
        /// The system's error.
        error: std::io::Error,
    },
    /// A connection failed or was lost.
    #[error("the connection failed: {0}")]
    Transport(#[from] tonic::transport::Error),
    /// A call was refused.
    #[error("a call was refused: {0}")]
    Status(#[from] tonic::Status),
    /// The server violated the protocol.
    #[error("the server did not keep to the protocol: {0}")]
    Protocol(String),
    /// The counts of both sides differ.
    #[error("the counts do not agree: {0}")]
    Count(String),
    /// Some scenarios, each with its error; the others are reported.
    #[error("not measured to the end: {0}")]
    Scenarios(String),
    /// A command that servers are to be started with is missing.
    #[error("{0:?} cannot be started: install it")]
    Lacks(String),
    /// Something exceeded its time limit.
    #[error("{0} did not come to an end")]
    Stuck(&'static str),
}

impl LoadError {
    /// For `map_err`: adds what was attempted.
    pub(crate) fn io(what: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        move |error| Self::Io { what, error }
    }
}
