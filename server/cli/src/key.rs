//! `chefshat key`: the key with which a server signs its records.

use std::path::PathBuf;
use std::process::ExitCode;

use chefshat_record::signature::PublicKey;
use chefshat_server::signing::{key_of, key_or_new};
use clap::{Args, Subcommand};
use serde_json::json;

use super::{CommandError, data_dir, say};

const HELP: &str = "\
The server creates its key at its first start, as `signing-key` in its data directory, readable only by its owner. Publish the public \
key where people trust it, such as the page of a tournament; they check records with it:

  chefshat verify record.jsonl --key ed25519:...

Examples:
  chefshat key show
  chefshat key show --data-dir ./chefshat-data
  chefshat key create --data-dir ./keys";

/// Show or create the key that signs a server's records.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct KeyCommand {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Print the public key: `ed25519:` and 64 hexadecimal digits.
    Show(Folder),
    /// Create the key if there is none, for example for the nodes of a cluster to share, and print
    /// the public key.
    Create(Folder),
}

#[derive(Debug, Args)]
struct Folder {
    /// Data directory of the server. Default: chefshat in the user's data directory.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl KeyCommand {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        let (key, json) = match self.command {
            Command::Show(Folder { data_dir, json }) => (shown(data_dir)?, json),
            Command::Create(Folder { data_dir, json }) => {
                let folder = data_dir::prepare_without_records(data_dir)?;
                (key_or_new(&folder)?.public(), json)
            }
        };
        match json {
            true => say(json!({ "public_key": key.to_string() }))?,
            false => say(key)?,
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// The public key of a data directory.
fn shown(data_dir: Option<PathBuf>) -> Result<PublicKey, CommandError> {
    let folder = data_dir::name(data_dir)?;
    let key = key_of(&folder)?.ok_or_else(|| {
        format!(
            "no signing key in {} yet: a server creates it when it starts with this data directory",
            folder.display()
        )
    })?;
    Ok(key.public())
}
