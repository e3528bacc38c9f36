//! `chefshat records`: lists, downloads, imports and deletes records of a server. `chefshat verify`
//! checks a downloaded record; a server verifies an imported one.

mod filter;
mod list;
mod prune;
mod transfer;

use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::CommandError;

/// List, download, import and delete records of finished games.
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
    /// Delete old games of a server with their records.
    Prune(prune::Prune),
}

impl RecordsCommand {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        match self.action {
            RecordsAction::List(command) => command.run().await,
            RecordsAction::Get(command) => command.run().await,
            RecordsAction::Stream(command) => command.run().await,
            RecordsAction::Import(command) => command.run().await,
            RecordsAction::Prune(command) => command.run().await,
        }
    }
}
