//! Why a run fails. A benchmark that did not do what it counts is a failure, not a slow result.

/// Why a run failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LoadError {
    /// The system refused something.
    #[error("{what}: {error}")]
    Io {
        /// What was tried.
        what: &'static str,
        /// What the system said.
        error: std::io::Error,
    },
    /// A connection could not be made or was lost.
    #[error("the connection failed: {0}")]
    Transport(#[from] tonic::transport::Error),
    /// A call was refused.
    #[error("a call was refused: {0}")]
    Status(#[from] tonic::Status),
    /// The server did something it must not.
    #[error("the server did not keep to the protocol: {0}")]
    Protocol(String),
    /// What was counted on one side is not what was counted on the other.
    #[error("the counts do not agree: {0}")]
    Count(String),
    /// Something took far longer than it may.
    #[error("{0} did not come to an end")]
    Stuck(&'static str),
}

impl LoadError {
    /// For `map_err`: says what was tried.
    pub(crate) fn io(what: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        move |error| Self::Io { what, error }
    }
}
