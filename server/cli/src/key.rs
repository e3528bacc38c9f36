//! `chefshat key show`: the public key with which a server signs its records.

use std::path::PathBuf;
use std::process::ExitCode;

use chefshat_server::signing::key_of;
use clap::{Args, Subcommand};
use serde_json::json;

use super::{CommandError, data_dir, say};

const HELP: &str = "\
The server creates its key at its first start, as `signing-key` in its data directory, readable only by its owner. Publish the public \
key where people trust it, such as the page of a tournament; they check records with it:

  chefshat verify record.jsonl --key ed25519:...

Examples:
  chefshat key show
  chefshat key show --data-dir ./chefshat-data";

/// Show the key that signs a server's records.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct KeyCommand {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Print the public key: `ed25519:` and 64 hexadecimal digits.
    Show(Show),
}

#[derive(Debug, Args)]
struct Show {
    /// Data directory of the server. Default: chefshat in the user's data directory.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl KeyCommand {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        let Command::Show(show) = self.command;
        let folder = data_dir::name(show.data_dir)?;
        let Some(key) = key_of(&folder)? else {
            return Err(format!(
                "no signing key in {} yet: a server creates it when it starts with this data directory",
                folder.display()
            )
            .into());
        };
        match show.json {
            true => say(json!({ "public_key": key.public().to_string() }))?,
            false => say(key.public())?,
        }
        Ok(ExitCode::SUCCESS)
    }
}
