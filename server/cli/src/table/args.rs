//! The arguments of all commands about a physical table, and the connection to it.

use chefshat_client::v1::{self, table_report::Kind};
use chefshat_client::{Backoff, Client, Error, TableFollower};
use clap::Args;

use super::super::CommandError;
use super::super::connect::{PATIENCE, ServerArg};

/// The table.
#[derive(Debug, Args)]
pub(super) struct TableArgs {
    /// The table's ticket, printed by `chefshat room create --physical`.
    // Optional in the type, since a subcommand has its own.
    #[arg(
        long,
        required = true,
        env = "CHEFSHAT_TABLE_TICKET",
        hide_env_values = true
    )]
    pub(super) ticket: Option<String>,
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
    /// The server does not answer, or the address is invalid.
    pub(super) async fn connect(self) -> Result<Table, CommandError> {
        Ok(Table {
            client: self.server.connect().await?,
            ticket: self.ticket.ok_or("give the table's --ticket")?,
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
        follower.with_backoff(Backoff {
            give_up_after: PATIENCE,
            ..Backoff::default()
        })
    }

    /// Reports what an attendant saw.
    ///
    /// # Errors
    /// The server refuses the report, or does not answer.
    pub(super) async fn report(&self, kind: Kind) -> Result<v1::ReportResponse, Error> {
        let report = v1::TableReport {
            source: v1::ReportSource::Attendant.into(),
            kind: Some(kind),
            ..v1::TableReport::default()
        };
        self.client.report(&self.ticket, report).await
    }
}
