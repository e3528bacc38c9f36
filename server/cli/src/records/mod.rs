//! `chefshat records`: lists, downloads and imports records of a server. `chefshat verify` checks a downloaded record; a server verifies an
//! imported one.

mod filter;
mod list;
mod transfer;

use std::process::ExitCode;

use chefshat_client::Client;
use chefshat_client::v1::record_service_client::RecordServiceClient;
use clap::{Args, Subcommand};
use tonic::transport::Channel;

use super::CommandError;

/// Maximum size of a response in bytes: a page of a hundred summaries, or a part of a record.
const MAX_RESPONSE_BYTES: usize = 16 * 1024 * 1024;

/// List, download and import records of finished games.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat records list --participant Greta --json\n  \
                  chefshat records get 5f0c6a4de2b14b7f8a3d9c1e7b60425d --out game.jsonl\n  \
                  chefshat records stream --state finished --out-dir ./games\n  \
                  chefshat records import ./game.jsonl"
)]
pub(super) struct RecordsCommand {
    #[command(subcommand)]
    action: RecordsAction,
}

#[derive(Debug, Subcommand)]
enum RecordsAction {
    /// List the records of a server.
    List(list::List),
    /// Download the record of one game.
    Get(transfer::Get),
    /// Download many records.
    Stream(transfer::Stream),
    /// Import records of games played elsewhere.
    Import(transfer::Import),
}

impl RecordsCommand {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        match self.action {
            RecordsAction::List(command) => command.run().await,
            RecordsAction::Get(command) => command.run().await,
            RecordsAction::Stream(command) => command.run().await,
            RecordsAction::Import(command) => command.run().await,
        }
    }
}

fn service(client: &Client) -> RecordServiceClient<Channel> {
    RecordServiceClient::new(client.channel()).max_decoding_message_size(MAX_RESPONSE_BYTES)
}
