//! Every error a client can see, as a gRPC status with `google.rpc.ErrorInfo`: reason in
//! UPPER_SNAKE, domain `chefshat`, metadata with the field or limit at fault. Errors that a client
//! cannot act on go to the log instead.

use std::collections::HashMap;
use std::convert::Infallible;
use std::time::Duration;

use chefshat_proto::v1;
use chefshat_record::convert::FieldProblem;
use chefshat_referee::Refusal as TableRefusal;
use chefshat_vector::RequestError;
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt as _};

use chefshat_admission::limits::{NotStored, Refused};
use chefshat_hosting::cluster::Elsewhere;
use chefshat_hosting::room::{ReportRefusal, RoomError, RoomGone, SpectateError};
use chefshat_hosting::rooms::CreateError;
use chefshat_room::{
    ExpressError, HintError, JoinError, LeaveError, MARKERS_AT_ONCE, MAX_MARKERS, MarkError,
    ReportError,
};
use chefshat_store::StoreError;
use chefshat_wire::convert;
use chefshat_wire::outbox::StreamEnd;

/// Domain of every `ErrorInfo`.
const DOMAIN: &str = "chefshat";

/// The reason of a marker with a malformed field.
pub const MARKER_REFUSED: &str = "MARKER_REFUSED";

/// Creates a status with its reason and metadata.
pub fn status<const N: usize>(
    code: Code,
    reason: &str,
    message: impl Into<String>,
    metadata: [(&str, &str); N],
) -> Status {
    let metadata = metadata.map(|(key, value)| (key.to_owned(), value.to_owned()));
    with_reason(code, reason, message, metadata.into())
}

fn with_reason(
    code: Code,
    reason: &str,
    message: impl Into<String>,
    metadata: HashMap<String, String>,
) -> Status {
    Status::with_error_details(
        code,
        message,
        ErrorDetails::with_error_info(reason, DOMAIN, metadata),
    )
}

/// Statuses that are always the same: their names, codes, reasons, messages, and the fields at fault.
macro_rules! statuses {
    ($($(#[$doc:meta])* $vis:vis $name:ident: $code:ident, $reason:tt $(in $field:literal)?, $message:literal;)+) => {
        $(
            $(#[$doc])*
            $vis fn $name() -> Status {
                status(Code::$code, $reason, $message, [$(("field", $field))?])
            }
        )+
    };
}

statuses! {
    /// Too many calls to games wait for a stream.
    pub calls_not_taken: Unavailable, "CALLS_NOT_TAKEN",
        "too many calls to games are waiting for this stream; connect again and attach fewer participants to one stream";
    /// Replies to commands wait for a stream that is not read.
    updates_not_taken: Unavailable, "UPDATES_NOT_TAKEN",
        "replies to commands wait, and the stream is not read; connect again, and read what it sends";
    /// No tournament has this id.
    pub tournament_unknown: NotFound, "TOURNAMENT_UNKNOWN" in "tournament_id",
        "this tournament does not exist";
    /// There is no such room.
    pub room_unknown: NotFound, "ROOM_UNKNOWN",
        "this room does not exist; it may have been closed";
    /// No study has this id, or another owner token.
    pub(super) study_unknown: NotFound, "STUDY_UNKNOWN" in "study_id",
        "this server has no study with this id and owner token";
    /// No participant has this link.
    pub(super) link_unknown: Unauthenticated, "LINK_UNKNOWN" in "link",
        "this is not a link of a study on this server; check that it is complete";
    /// No room has this join code.
    pub(super) join_code_wrong: PermissionDenied, "JOIN_CODE_WRONG" in "join_code",
        "no room has this join code; ask the room's creator for it, or join the tournament if the room belongs to one";
    /// Those of this kind do not take part in a tournament.
    pub(super) kind_not_admitted: FailedPrecondition, "KIND_NOT_ADMITTED" in "kind",
        "this tournament does not admit this kind of participant";
    /// Games with the same deals are being played.
    pub(super) series_open: FailedPrecondition, SERIES_OPEN in "game_id",
        "other games with the same deals are being played; the record is available when they have ended";
    /// A token is not that of the room's creator.
    pub owner_token_wrong: PermissionDenied, "OWNER_TOKEN_WRONG" in "owner_token",
        "this is not the owner token that CreateRoom returned for this room";
    /// No seat has this ticket.
    pub ticket_unknown: Unauthenticated, "TICKET_UNKNOWN" in "ticket",
        "no seat has this ticket: it is mistyped, the seat was freed, or the room is gone; join again";
    /// No physical table has this ticket.
    pub table_unknown: Unauthenticated, "TICKET_UNKNOWN" in "table_ticket",
        "no physical table has this ticket: it is mistyped, or the room is gone; use `table_ticket` of CreateRoom, or of GetPhysicalTable in a tournament";
    /// The server's store failed, and the server stops.
    pub store_failed: Unavailable, "STORE_FAILED",
        "the server's storage failed and the server is stopping; everything it has acknowledged is stored: reconnect when it is back";
    /// The server failed in a way that clients cannot resolve.
    pub internal: Internal, "INTERNAL",
        "the server failed to do this; see its log";
    /// The server is shutting down.
    pub shutting_down: Unavailable, "SHUTTING_DOWN",
        "the server is shutting down";
    /// A spectator was disconnected because it reads too slowly.
    pub spectator_too_slow: ResourceExhausted, "SPECTATOR_TOO_SLOW",
        "the stream was not read fast enough; watch again from the number after the last event received";
    /// A room became unreachable: it has just ended, or was suspended because the server stops.
    pub room_gone: Unavailable, "ROOM_GONE",
        "the room cannot be reached here: it has just ended, the server is stopping, or it does not reach the one that has the room; connect again";
    /// This node does not have what a request is about. Only nodes see it: the one that has passed the
    /// request on looks for the owner again.
    not_owner: Unavailable, NOT_OWNER,
        "another node has this room or tournament";
    /// The node that has a room or tournament cannot be reached, or is just handing it over.
    pub owner_unreachable: Unavailable, OWNER_UNREACHABLE,
        "the server that runs this room or tournament cannot be reached, or another one is just taking over; try again";
}

/// The status for a refused request of a vector stream.
pub fn vector_refused(error: RequestError) -> Status {
    let code = match error.reason {
        "RECORDS_TOO_LONG" | "STATES_TOO_LARGE" => Code::ResourceExhausted,
        _ => Code::InvalidArgument,
    };
    let metadata = error.metadata.into_iter();
    let metadata = metadata.map(|(key, value)| (key.to_owned(), value));
    with_reason(code, error.reason, error.message, metadata.collect())
}

/// Whether a status has this reason.
pub fn has_reason(status: &Status, reason: &str) -> bool {
    (status.get_details_error_info()).is_some_and(|info| info.reason == reason)
}

/// Converts a status to the message that refuses a command on a stream.
pub fn refused(request_id: u32, status: &Status) -> v1::Refused {
    let (reason, metadata) = status
        .get_details_error_info()
        .map(|info| (info.reason, info.metadata.into_iter().collect()))
        .unwrap_or_default();
    v1::Refused {
        request_id,
        reason,
        message: status.message().to_owned(),
        metadata,
        code: u32::try_from(i32::from(status.code())).unwrap_or_default(),
    }
}

/// The status for an invalid field.
pub fn field(reason: &str, problem: &FieldProblem) -> Status {
    status(
        Code::InvalidArgument,
        reason,
        problem.to_string(),
        [("field", problem.field)],
    )
}

/// The status for an invalid field, and what is wrong with it.
pub fn invalid(reason: &str, name: &'static str, problem: impl Into<String>) -> Status {
    field(reason, &FieldProblem::new(name, problem))
}

/// Reason of the error while the server that has what a call is about cannot be reached.
pub(super) const OWNER_UNREACHABLE: &str = "OWNER_UNREACHABLE";

/// Reason of the error while games with the same deals are being played.
pub(super) const SERIES_OPEN: &str = "SERIES_OPEN";

/// The status for a client when the store cannot be read.
pub fn read_failed(error: StoreError) -> Status {
    tracing::error!(%error, "reading a record failed");
    match error {
        StoreError::Unreadable(_) => status(
            Code::DataLoss,
            RECORD_UNREADABLE,
            UNREADABLE,
            [("field", "game_id")],
        ),
        _ => internal(),
    }
}

/// Reason of the error for a record that cannot be read.
pub const RECORD_UNREADABLE: &str = "RECORD_UNREADABLE";
/// Its message.
pub const UNREADABLE: &str = "the server has this record but cannot read it; its log says why";

/// A request id was reused with other content.
pub fn request_id_used(message: &str) -> Status {
    status(
        Code::AlreadyExists,
        "REQUEST_ID_USED",
        message,
        [("field", "request_id")],
    )
}

/// The disk has no space for more games.
pub fn disk_nearly_full(message: &str) -> Status {
    status(Code::ResourceExhausted, "DISK_NEARLY_FULL", message, [])
}

/// The status for a client that has not received a part of `what` within `limit`.
pub(super) fn reader_too_slow(what: &str, limit: Duration) -> Status {
    let seconds = limit.as_secs();
    status(
        Code::ResourceExhausted,
        "READER_TOO_SLOW",
        format!("a part of {what} was not received within {seconds} s; request it again"),
        [],
    )
}

/// No other node reaches this one, which therefore accepts nothing new.
fn node_not_reached(message: &str) -> Status {
    status(Code::Unavailable, "NODE_NOT_REACHED", message, [])
}

/// The status for the end of a stream.
pub fn stream_ended(end: StreamEnd) -> Status {
    match end {
        StreamEnd::Complete => Status::ok(""),
        StreamEnd::ShuttingDown => shutting_down(),
        StreamEnd::StoreFailed => store_failed(),
        StreamEnd::RoomGone => room_gone(),
        StreamEnd::SpectatorTooSlow => spectator_too_slow(),
        StreamEnd::CallsNotTaken => calls_not_taken(),
        StreamEnd::UpdatesNotTaken => updates_not_taken(),
        StreamEnd::RequestsFailed => internal(),
    }
}

/// Reason of [`not_owner`].
const NOT_OWNER: &str = "NOT_OWNER";

/// What a request is about is at another node. `forward` sends the request there.
pub fn elsewhere(elsewhere: Elsewhere) -> Status {
    let mut status = not_owner();
    status.set_source(std::sync::Arc::new(elsewhere));
    status
}

/// Where a request must go, if this status says so.
pub fn is_elsewhere(status: &Status) -> Option<&Elsewhere> {
    std::error::Error::source(status)?.downcast_ref()
}

/// Whether the answer of another node says that it does not have what the request is about.
pub fn is_not_owner(headers: &http::HeaderMap) -> bool {
    Status::from_header_map(headers).is_some_and(|status| has_reason(&status, NOT_OWNER))
}

/// Whether another node has refused a call: not if it could not be reached, or does not have what the
/// call is about.
pub fn is_refusal(status: &Status) -> bool {
    (status.get_details_error_info()).is_some_and(|info| info.reason != NOT_OWNER)
}

/// A message sets no command.
pub fn command_missing() -> Status {
    invalid("COMMAND_MISSING", "command", "set a command")
}

/// The status for an error of a room; `unknown`: if it does not know the secret.
pub fn room_failed<E>(unknown: fn() -> Status) -> impl FnOnce(RoomError<E>) -> Status
where
    Refusal: From<E>,
{
    move |error| match error {
        RoomError::Gone(RoomGone) => room_gone(),
        RoomError::SecretUnknown => unknown(),
        RoomError::Refused(error) => Refusal::from(error).into(),
    }
}

impl From<RoomGone> for Refusal {
    fn from(_: RoomGone) -> Self {
        Self(room_gone())
    }
}

/// A wrapper to convert other errors to a status.
#[derive(Debug)]
pub struct Refusal(pub Status);

impl From<Refusal> for Status {
    fn from(refusal: Refusal) -> Self {
        refusal.0
    }
}

impl From<Infallible> for Refusal {
    fn from(never: Infallible) -> Self {
        match never {}
    }
}

impl From<Refused> for Refusal {
    fn from(refused: Refused) -> Self {
        let metadata = [("limit".to_owned(), refused.limit.to_string())];
        let mut details = ErrorDetails::with_error_info(refused.reason, DOMAIN, metadata);
        details.set_retry_info(Some(refused.retry_after));
        let message = refused.to_string();
        Self(Status::with_error_details(
            Code::ResourceExhausted,
            message,
            details,
        ))
    }
}

impl From<JoinError> for Refusal {
    fn from(error: JoinError) -> Self {
        let (code, reason) = match error {
            JoinError::RoomFull => (Code::ResourceExhausted, "ROOM_FULL"),
            JoinError::TooManySeatings => (Code::ResourceExhausted, "TOO_MANY_SEATINGS"),
            JoinError::SeatTaken => (Code::FailedPrecondition, "SEAT_TAKEN"),
            JoinError::NoSuchSeat => (Code::InvalidArgument, "NO_SUCH_SEAT"),
            JoinError::ClientHasSeat => (Code::FailedPrecondition, "CLIENT_HAS_SEAT"),
            JoinError::KindNotAdmitted => (Code::FailedPrecondition, "KIND_NOT_ADMITTED"),
            JoinError::RequestIdUsed => (Code::AlreadyExists, "REQUEST_ID_USED"),
            JoinError::GameStarted => (Code::FailedPrecondition, "GAME_STARTED"),
            JoinError::GameOver => (Code::FailedPrecondition, "GAME_OVER"),
        };
        Self(status(code, reason, error.to_string(), []))
    }
}

impl From<LeaveError> for Refusal {
    fn from(error: LeaveError) -> Self {
        let reason = match error {
            LeaveError::GameStarted => "GAME_STARTED",
            LeaveError::GameOver => "GAME_OVER",
            LeaveError::Assigned => "SEAT_ASSIGNED",
        };
        Self(status(
            Code::FailedPrecondition,
            reason,
            error.to_string(),
            [],
        ))
    }
}

impl From<ExpressError> for Refusal {
    fn from(error: ExpressError) -> Self {
        let refused = convert::express_refused(error);
        let code = Code::from(i32::try_from(refused.code).unwrap_or_default());
        Self(status(code, &refused.reason, refused.message, []))
    }
}

impl From<NotStored> for Refusal {
    fn from(error: NotStored) -> Self {
        match error {
            NotStored::DiskNearlyFull => Self(disk_nearly_full(&error.to_string())),
            NotStored::TooFast(refused) => refused.into(),
        }
    }
}

impl From<HintError> for Refusal {
    fn from(error: HintError) -> Self {
        let (code, reason) = match error {
            HintError::Off => (Code::FailedPrecondition, "HINTS_OFF"),
            HintError::Closed => (Code::FailedPrecondition, "DECISION_CLOSED"),
            HintError::TooMany => (Code::ResourceExhausted, "TOO_MANY_HINTS"),
        };
        Self(status(code, reason, error.to_string(), []))
    }
}

impl From<MarkError> for Refusal {
    fn from(error: MarkError) -> Self {
        let too_many = |limit: &str| {
            let metadata = [("limit", limit)];
            status(
                Code::ResourceExhausted,
                "TOO_MANY_MARKERS",
                error.to_string(),
                metadata,
            )
        };
        Self(match error {
            MarkError::GameOver => {
                status(Code::FailedPrecondition, "GAME_OVER", error.to_string(), [])
            }
            MarkError::TooMany => too_many(&MAX_MARKERS.to_string()),
            MarkError::TooFast => too_many(&MARKERS_AT_ONCE.to_string()),
            MarkError::Future => invalid(MARKER_REFUSED, "elapsed_us", error.to_string()),
        })
    }
}

/// A room, tournament or study was not created. `settings`: the status for a setting that is refused.
pub fn not_created<P: std::error::Error>(
    error: CreateError<P>,
    settings: impl FnOnce(P) -> Status,
) -> Status {
    let message = error.to_string();
    match error {
        CreateError::Settings(problem) => settings(problem),
        CreateError::TooMany(limit) => status(
            Code::ResourceExhausted,
            "TOO_MANY_ROOMS",
            message,
            [("max_rooms", &limit.to_string())],
        ),
        CreateError::Refused(refused) => Refusal::from(refused).into(),
        CreateError::RequestIdUsed => request_id_used(&message),
        CreateError::ShuttingDown => shutting_down(),
        CreateError::NotReached => node_not_reached(&message),
        CreateError::DiskNearlyFull => disk_nearly_full(&message),
        CreateError::Store(error) => {
            tracing::error!(%error, "creating a room, tournament or study failed");
            store_failed()
        }
    }
}

impl From<ReportRefusal> for Refusal {
    fn from(refusal: ReportRefusal) -> Self {
        let error = match refusal {
            ReportRefusal::Malformed(problem) => return Self(field("REPORT_REFUSED", &problem)),
            ReportRefusal::Refused(error) => error,
        };
        let (code, reason) = match error {
            ReportError::GameNotStarted => (Code::FailedPrecondition, "GAME_NOT_STARTED"),
            ReportError::GameOver => (Code::FailedPrecondition, "GAME_OVER"),
            ReportError::IdUsed => (Code::AlreadyExists, "REPORT_ID_USED"),
            ReportError::Refused(unjudged) => match unjudged {
                TableRefusal::TooManyQuestions => (Code::ResourceExhausted, "TOO_MANY_QUESTIONS"),
                TableRefusal::ReservedQuestionId => {
                    let name = "question.question_id";
                    return Self(invalid("REPORT_REFUSED", name, error.to_string()));
                }
                TableRefusal::NoSuchOption => (Code::FailedPrecondition, "NO_SUCH_OPTION"),
                TableRefusal::TooManyHeld => (Code::FailedPrecondition, "TOO_MANY_HELD_REPORTS"),
                TableRefusal::NotCorrectable => (Code::FailedPrecondition, "NOT_CORRECTABLE"),
                TableRefusal::NotOver => (Code::FailedPrecondition, "GAME_NOT_OVER"),
            },
        };
        Self(status(code, reason, error.to_string(), []))
    }
}

impl From<SpectateError> for Refusal {
    fn from(error: SpectateError) -> Self {
        Self(match error {
            SpectateError::NotAdmitted => status(
                Code::PermissionDenied,
                "SPECTATORS_NOT_ADMITTED",
                "this room does not admit spectators",
                [],
            ),
            SpectateError::Full => status(
                Code::ResourceExhausted,
                "TOO_MANY_SPECTATORS",
                "this room has no space for more spectators, or none for more of yours",
                [],
            ),
            SpectateError::SnapshotDelayed => status(
                Code::FailedPrecondition,
                "SNAPSHOT_DELAYED",
                "this room delays its events for spectators; request events instead of a snapshot",
                [("field", "snapshot")],
            ),
        })
    }
}
