//! The arguments of all commands about a physical table: the server, and the table's ticket.

use chefshat_client::{Backoff, Client, TableFollower};
use clap::Args;

use super::super::CommandError;
use super::super::connect::{PATIENCE, ServerArg};

/// The table.
#[derive(Debug, Args)]
pub(super) struct TableArgs {
    /// The table's ticket, printed by `chefshat room create --physical`.
    #[arg(long, env = "CHEFSHAT_TABLE_TICKET", hide_env_values = true)]
    pub(super) ticket: String,
    #[command(flatten)]
    server: ServerArg,
    /// Print states and verdicts as JSON lines.
    #[arg(long)]
    pub(super) json: bool,
}

impl TableArgs {
    /// Connects to the server and follows the table.
    ///
    /// # Errors
    /// The server does not answer, or the address is invalid.
    pub(super) async fn connect(&self) -> Result<(Client, TableFollower), CommandError> {
        let client = self.server.connect().await?;
        let follower = client.follow_table(&self.ticket).with_backoff(Backoff {
            give_up_after: PATIENCE,
            ..Backoff::default()
        });
        Ok((client, follower))
    }
}
