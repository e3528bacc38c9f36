//! The arguments of all commands about a physical table, and the connection to it.

use std::path::PathBuf;
use std::time::Duration;

use chefshat_client::v1::{self, table_report::Kind};
use chefshat_client::{Client, Error, TableFollower};
use chefshat_room::ids::random_bytes;
use clap::Args;
use tonic::Code;

use super::super::CommandError;
use super::super::connect::{ServerArg, TABLE_TICKET, patience, patiently, secret_in};

/// Time between two attempts to report.
const PAUSE: Duration = Duration::from_secs(1);

/// The table.
#[derive(Debug, Args)]
pub(super) struct TableArgs {
    /// The table's ticket, printed by `chefshat room create --physical`.
    // Optional in the type, since a subcommand has its own.
    #[arg(
        long,
        required_unless_present = "ticket_file",
        env = TABLE_TICKET,
        hide_env_values = true
    )]
    pub(super) ticket: Option<String>,
    /// File with that ticket.
    #[arg(long, value_name = "FILE")]
    ticket_file: Option<PathBuf>,
    #[command(flatten)]
    server: ServerArg,
    /// Print states and verdicts as JSON lines.
    #[arg(long)]
    pub(super) json: bool,
}

impl TableArgs {
    /// Connects to the table.
    ///
    /// # Errors
    /// The server does not answer, the address is invalid, or the file is unreadable.
    pub(super) async fn connect(self) -> Result<Table, CommandError> {
        let ticket = match &self.ticket_file {
            Some(file) => secret_in(file, "--ticket-file")?,
            None => self.ticket.ok_or("give the table's --ticket")?,
        };
        Ok(Table {
            client: self.server.connect().await?,
            ticket,
        })
    }
}

/// A table and its server.
pub(super) struct Table {
    client: Client,
    ticket: String,
}

impl Table {
    /// Follows the state of the table.
    pub(super) fn follow(&self) -> TableFollower {
        let follower = self.client.follow_table(&self.ticket);
        follower.with_backoff(patience())
    }

    /// Reports what an attendant saw, again and again while the server is away, as the states are
    /// followed.
    ///
    /// # Errors
    /// The server refuses the report, or does not answer.
    pub(super) async fn report(&self, kind: Kind) -> Result<v1::ReportResponse, Error> {
        let report = v1::TableReport {
            source: v1::ReportSource::Attendant.into(),
            kind: Some(kind),
            ..v1::TableReport::default()
        };
        let id = hex::encode(random_bytes::<16>());
        let send = async || {
            let (ticket, id) = (self.ticket.as_str(), id.as_str());
            (self.client)
                .report_with_id(ticket, id, report.clone())
                .await
        };
        let is_away = |error: &Error| error.may_retry() && !is_passing(error);
        patiently(PAUSE, send, is_away, || {}).await
    }
}

/// Whether other reports can follow a refused one.
pub(super) fn is_passing(error: &Error) -> bool {
    let refused = [Code::FailedPrecondition, Code::InvalidArgument];
    refused.contains(&error.code()) || error.reason() == Some("TOO_MANY_QUESTIONS")
}

#[cfg(test)]
mod tests {
    use tonic::Status;
    use tonic_types::{ErrorDetails, StatusExt as _};

    use super::*;

    fn error(code: Code, reason: &str) -> Error {
        let details = ErrorDetails::with_error_info(reason, "chefshat", []);
        Status::with_error_details(code, "no", details).into()
    }

    #[test]
    fn only_what_is_wrong_with_the_table_ends_the_reports() {
        use Code::{FailedPrecondition, InvalidArgument, ResourceExhausted, Unauthenticated};
        for (code, reason, expected) in [
            (InvalidArgument, "REPORT_REFUSED", true),
            (FailedPrecondition, "GAME_NOT_STARTED", true),
            (FailedPrecondition, "GAME_NOT_OVER", true),
            (FailedPrecondition, "GAME_OVER", true),
            (FailedPrecondition, "NOT_CORRECTABLE", true),
            (FailedPrecondition, "NO_SUCH_OPTION", true),
            (FailedPrecondition, "TOO_MANY_HELD_REPORTS", true),
            (ResourceExhausted, "TOO_MANY_QUESTIONS", true),
            (Unauthenticated, "TICKET_UNKNOWN", false),
            (Code::Unavailable, "ROOM_GONE", false),
        ] {
            assert_eq!(is_passing(&error(code, reason)), expected, "{reason}");
        }
    }
}
