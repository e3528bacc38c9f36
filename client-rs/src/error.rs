//! Errors: the gRPC code, the server's reason in UPPER_SNAKE (google.rpc.ErrorInfo), a message, and
//! the offending field or limit.

use std::collections::BTreeMap;
use std::error::Error as _;
use std::fmt;
use std::path::Path;
use std::time::Duration;

use tonic::{Code, Status};
use tonic_types::StatusExt as _;

use crate::v1;

/// Reason of an invalid address; set by the client.
const ADDRESS_REFUSED: &str = "ADDRESS_REFUSED";
/// Reason of a failed connection; set by the client.
const CONNECT_FAILED: &str = "CONNECT_FAILED";
/// Reason of a connection on which TLS failed; set by the client.
const TLS_FAILED: &str = "TLS_FAILED";
/// Reason of an unusable file of certificate authorities; set by the client.
const CA_REFUSED: &str = "CA_REFUSED";
/// Reason of a malformed secret; set by the client.
const SECRET_REFUSED: &str = "SECRET_REFUSED";
/// Reason of a participant's ticket in place of a seat's; set by the client.
const TICKET_OF_PARTICIPANT: &str = "TICKET_OF_PARTICIPANT";
/// Reason of a malformed token; set by the client.
const TOKEN_REFUSED: &str = "TOKEN_REFUSED";
/// Reason of a record that is larger than a record can be; set by the client.
const RECORD_TOO_LARGE: &str = "RECORD_TOO_LARGE";
/// Reason of a response without a required part; set by the client.
const RESPONSE_INCOMPLETE: &str = "RESPONSE_INCOMPLETE";

/// Reason of a step of games that ended with the previous step; set by the client.
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

    /// The reason in UPPER_SNAKE, for example `JOIN_CODE_WRONG`; `None` if there is none, as after
    /// a lost connection. The client itself sets `ADDRESS_REFUSED`, `CA_REFUSED`,
    /// `CONNECT_FAILED`, `RECORD_TOO_LARGE`, `RESPONSE_INCOMPLETE`, `SECRET_REFUSED`, `STEP_GIVEN_UP`,
    /// `TICKET_OF_PARTICIPANT`, `TLS_FAILED` and `TOKEN_REFUSED`.
    pub fn reason(&self) -> Option<&str> {
        self.reason.as_deref()
    }

    /// The message, for people.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// The offending field or limit.
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.metadata
    }

    /// Whether a stream that ended with this may be opened again: it would not be refused again.
    pub fn may_retry(&self) -> bool {
        may_retry(self.code)
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
        let message = format!(
            "{url:?} is not the address of a server, give http://HOST:PORT or https://HOST: {cause}"
        );
        Self::own(Code::InvalidArgument, ADDRESS_REFUSED, message)
    }

    pub(crate) fn connect(url: &str, cause: &tonic::transport::Error) -> Self {
        let mut message = format!("cannot connect to {url}: {}", with_causes(cause));
        add_scheme_hint(&mut message);
        Self::own(Code::Unavailable, CONNECT_FAILED, message)
    }

    pub(crate) fn tls(url: &str, cause: &str) -> Self {
        let message = format!(
            "no secure connection to {url}: {cause}; for a certificate of a private authority, give the authority's file (--ca or CHEFSHAT_CA); for a server without TLS, give http://"
        );
        Self::own(Code::Unavailable, TLS_FAILED, message)
    }

    pub(crate) fn ca(file: &Path, cause: &str) -> Self {
        let message = format!("cannot use the authorities of {}: {cause}", file.display());
        Self::own(Code::InvalidArgument, CA_REFUSED, message)
    }

    pub(crate) fn token() -> Self {
        let message = "the token is malformed; copy it as `chefshat token create` printed it";
        Self::own(Code::InvalidArgument, TOKEN_REFUSED, message.to_owned())
    }

    pub(crate) fn secret() -> Self {
        let message = "the secret is malformed; give an owner token or a ticket as it was printed";
        Self::own(Code::InvalidArgument, SECRET_REFUSED, message.to_owned())
    }

    pub(crate) fn incomplete(part: &str) -> Self {
        let message = format!("the server's response lacks its {part}");
        Self::own(Code::Internal, RESPONSE_INCOMPLETE, message)
    }

    pub(crate) fn ticket_of_participant() -> Self {
        let message = "this is the ticket of a tournament participant, not of a seat: use `Client::play_tournament`, or `chefshat tournament join`";
        let code = Code::InvalidArgument;
        Self::own(code, TICKET_OF_PARTICIPANT, message.to_owned())
    }

    pub(crate) fn record_too_large() -> Self {
        let message = "the server sends more than a record can have".to_owned();
        Self::own(Code::ResourceExhausted, RECORD_TOO_LARGE, message)
    }

    pub(crate) fn step_given_up() -> Self {
        let message =
            "the previous step was refused or cancelled, which ended these games; start new ones";
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

/// A server with TLS answers a connection without TLS by bytes that are not a frame of HTTP/2.
fn add_scheme_hint(message: &mut String) {
    if message.contains("frame with invalid size") {
        *message += "; a server with TLS has an address with https://";
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
        add_scheme_hint(&mut message);
        if info
            .as_ref()
            .is_some_and(|info| info.reason == "TOKEN_MISSING")
        {
            message += "; give it with --token or CHEFSHAT_TOKEN, in Rust with `ConnectOptions`";
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

/// Formats an error with its causes, each once: transport errors have the details in their causes.
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

/// Whether a stream that ended with this code should be retried: every code except those that would
/// be refused again. tonic reports a lost connection as UNKNOWN, INTERNAL, CANCELLED or
/// UNAVAILABLE, so these are retried.
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
    /// The server refused the seat or the stream; a retry would not help.
    #[error("the server refused the seat: {0}")]
    Refused(Error),
    /// A newer connection has taken the seat.
    #[error("a newer connection has taken the seat")]
    Superseded,
    /// The seat left the stream before its game was over.
    #[error("the seat was detached before its game was over")]
    Detached,
    /// The game is over, but its result is unknown.
    #[error("the game is over, but the server did not say how it ended")]
    EndingUnknown,
    /// The connection was lost and could not be restored in time.
    #[error("no connection for {} s, given up: {last}", outage.as_secs())]
    ConnectionLost {
        /// Length of the outage.
        outage: Duration,
        /// Error of the last attempt.
        last: Error,
    },
}

impl PlayError {
    /// The reason in UPPER_SNAKE: the server's, or `SUPERSEDED`, `DETACHED`, `ENDING_UNKNOWN`,
    /// `CONNECTION_LOST`.
    pub fn reason(&self) -> Option<&str> {
        match self {
            Self::Refused(error) => error.reason(),
            Self::Superseded => Some("SUPERSEDED"),
            Self::Detached => Some("DETACHED"),
            Self::EndingUnknown => Some("ENDING_UNKNOWN"),
            Self::ConnectionLost { .. } => Some("CONNECTION_LOST"),
        }
    }

    /// The message, for people: the server's if it refused the seat.
    pub fn message(&self) -> String {
        match self {
            Self::Refused(error) => error.message().to_owned(),
            error => error.to_string(),
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
