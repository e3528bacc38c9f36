//! `chefshat participant`: exports or deletes a participant's data, in the data directory of a
//! server that is stopped, or on a running one. [`chefshat_server::participants`] does it.

mod delete;
mod export;
mod who;

use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::CommandError;

/// Export or delete a participant's data.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat participant export P07 --out p07.jsonl --server http://127.0.0.1:50051\n  \
                  chefshat participant delete P07 --data-dir ./chefshat-data"
)]
pub(super) struct ParticipantCommand {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Export everything stored about a participant as JSON Lines.
    Export(export::Export),
    /// Delete a participant's data: a pseudonym replaces the name.
    Delete(delete::Delete),
}

impl ParticipantCommand {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        match self.command {
            Command::Export(command) => command.run().await,
            Command::Delete(command) => command.run().await,
        }
    }
}
