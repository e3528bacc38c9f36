//! What can go wrong, in a form one can act on: the gRPC code, the reason in UPPER_SNAKE that the server names (google.rpc.ErrorInfo),
//! words, and the offending field or limit.

use std::collections::BTreeMap;
use std::error::Error as _;
use std::fmt;
use std::time::Duration;

use tonic::{Code, Status};
use tonic_types::StatusExt as _;

use crate::v1;

/// Reason of an address that names no server; made by the client.
const ADDRESS_REFUSED: &str = "ADDRESS_REFUSED";
/// Reason of a connection that could not be made; made by the client.
const CONNECT_FAILED: &str = "CONNECT_FAILED";
/// Reason of a response without a part that the protocol promises; made by the client.
const RESPONSE_INCOMPLETE: &str = "RESPONSE_INCOMPLETE";

/// Reason of a step of games that have ended with the step before; made by the client.
const STEP_GIVEN_UP: &str = "STEP_GIVEN_UP";

/// A call that failed.
#[derive(Clone, Debug)]
pub struct Error {
    code: Code,
    reason: Option<String>,
    message: String,
    metadata: BTreeMap<String, String>,
}

impl Error {
    /// The gRPC code.
    pub fn code(&self) -> Code {
        self.code
    }

    /// The reason in UPPER_SNAKE, for instance `JOIN_CODE_WRONG`; `None` if whoever failed named none, as when a connection breaks.
    /// The client's own are `ADDRESS_REFUSED`, `CONNECT_FAILED`, `RESPONSE_INCOMPLETE` and `STEP_GIVEN_UP`.
    pub fn reason(&self) -> Option<&str> {
        self.reason.as_deref()
    }

    /// What is wrong, in words.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// The offending field or limit.
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.metadata
    }

    fn own(code: Code, reason: &str, message: String) -> Self {
        Self {
            code,
            reason: Some(reason.to_owned()),
            message,
            metadata: BTreeMap::new(),
        }
    }

    pub(crate) fn address(url: &str, cause: &str) -> Self {
        let message =
            format!("{url:?} is not the address of a server, give http://HOST:PORT: {cause}");
        Self::own(Code::InvalidArgument, ADDRESS_REFUSED, message)
    }

    pub(crate) fn connect(url: &str, cause: &tonic::transport::Error) -> Self {
        let message = format!("cannot connect to {url}: {}", with_causes(cause));
        Self::own(Code::Unavailable, CONNECT_FAILED, message)
    }

    pub(crate) fn incomplete(part: &str) -> Self {
        let message = format!("the server's response lacks its {part}");
        Self::own(Code::Internal, RESPONSE_INCOMPLETE, message)
    }

    pub(crate) fn step_given_up() -> Self {
        let message =
            "the step before was refused or given up, which ended these games; begin new ones";
        Self::own(Code::FailedPrecondition, STEP_GIVEN_UP, message.to_owned())
    }

    pub(crate) fn refused(refused: v1::Refused) -> Self {
        Self {
            code: i32::try_from(refused.code).map_or(Code::Unknown, Code::from),
            reason: Some(refused.reason).filter(|reason| !reason.is_empty()),
            message: refused.message,
            metadata: refused.metadata.into_iter().collect(),
        }
    }
}

impl From<Status> for Error {
    fn from(status: Status) -> Self {
        let info = status.get_details_error_info();
        let mut message = status.message().to_owned();
        if let Some(cause) = status.source() {
            let causes = with_causes(cause);
            if !message.contains(&causes) {
                message = format!("{message}: {causes}");
            }
        }
        let (reason, metadata) = match info {
            Some(info) => (Some(info.reason), info.metadata.into_iter().collect()),
            None => (None, BTreeMap::new()),
        };
        Self {
            code: status.code(),
            reason: reason.filter(|reason| !reason.is_empty()),
            message,
            metadata,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.reason {
            Some(reason) => write!(f, "{} ({reason})", self.message),
            None => write!(f, "{} ({:?})", self.message, self.code),
        }
    }
}

impl std::error::Error for Error {}

/// An error and all that caused it, each once: transport errors keep what happened in their causes.
pub(crate) fn with_causes(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let words = cause.to_string();
        if !text.contains(&words) {
            text = format!("{text}: {words}");
        }
        next = cause.source();
    }
    text
}

/// Whether a stream that ended with this code may be tried again: everything but what would only be refused once more. tonic reports
/// a broken connection as UNKNOWN, INTERNAL, CANCELLED or UNAVAILABLE, so these must be tried.
pub(crate) fn may_retry(code: Code) -> bool {
    !matches!(
        code,
        Code::InvalidArgument
            | Code::NotFound
            | Code::AlreadyExists
            | Code::PermissionDenied
            | Code::FailedPrecondition
            | Code::OutOfRange
            | Code::Unimplemented
            | Code::Unauthenticated
    )
}

/// Why a seat was not played to the end of its game.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlayError {
    /// The server refused the seat or the stream; trying again would not help.
    #[error("the server refused the seat: {0}")]
    Refused(Error),
    /// A newer connection has the seat.
    #[error("a newer connection has taken the seat")]
    Superseded,
    /// The seat has left the stream before its game was over.
    #[error("the seat was detached before its game was over")]
    Detached,
    /// The game is over, but how it ended was not told.
    #[error("the game is over, but the server did not say how it ended")]
    EndingUnknown,
    /// The connection was lost and could not be made again in time.
    #[error("no connection for {} s, given up: {last}", outage.as_secs())]
    ConnectionLost {
        /// How long there was none.
        outage: Duration,
        /// What the last attempt said.
        last: Error,
    },
}

impl PlayError {
    /// The reason in UPPER_SNAKE: the server's, or `SUPERSEDED`, `DETACHED`, `ENDING_UNKNOWN`, `CONNECTION_LOST`.
    pub fn reason(&self) -> Option<&str> {
        match self {
            Self::Refused(error) => error.reason(),
            Self::Superseded => Some("SUPERSEDED"),
            Self::Detached => Some("DETACHED"),
            Self::EndingUnknown => Some("ENDING_UNKNOWN"),
            Self::ConnectionLost { .. } => Some("CONNECTION_LOST"),
        }
    }
}

#[cfg(test)]
mod tests {
    use tonic_types::ErrorDetails;

    use super::*;

    #[test]
    fn takes_reason_and_metadata_from_the_details() {
        let details = ErrorDetails::with_error_info(
            "RULE_SET_REFUSED",
            "chefshat",
            [("field".to_owned(), "faces".to_owned())],
        );
        let status = Status::with_error_details(Code::InvalidArgument, "4 to 15 faces", details);
        let error = Error::from(status);
        assert_eq!(error.code(), Code::InvalidArgument);
        assert_eq!(error.reason(), Some("RULE_SET_REFUSED"));
        assert_eq!(error.message(), "4 to 15 faces");
        assert_eq!(
            error.metadata().get("field").map(String::as_str),
            Some("faces")
        );
        assert_eq!(error.to_string(), "4 to 15 faces (RULE_SET_REFUSED)");
    }

    #[test]
    fn a_status_without_details_has_no_reason() {
        let error = Error::from(Status::unavailable("gone"));
        assert_eq!(error.reason(), None);
        assert!(error.metadata().is_empty());
        assert_eq!(error.to_string(), "gone (Unavailable)");
    }
}
