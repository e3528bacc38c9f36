//! `chefshat records`: the records a server holds, listed, fetched and added from the command line. What a record says is checked by
//! `chefshat verify` and by the server that takes one in.

mod filter;
mod list;
mod transfer;

use std::process::ExitCode;

use chefshat_client::Client;
use chefshat_client::v1::record_service_client::RecordServiceClient;
use clap::{Args, Subcommand};
use tonic::transport::Channel;

use super::CommandError;

/// Longest message taken from a server, bytes: a page of a hundred summaries, or a part of a record.
const MAX_RESPONSE_BYTES: usize = 16 * 1024 * 1024;

/// List, fetch and add records of games that have ended.
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
    /// List the records of a server, oldest or newest first.
    List(list::List),
    /// Fetch the record of one game.
    Get(transfer::Get),
    /// Fetch many records.
    Stream(transfer::Stream),
    /// Add records of games played elsewhere.
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
