//! The key of hidden deals: `chefshat bench deals-key` creates it, `--deals-key` names its file.

use std::path::PathBuf;
use std::process::ExitCode;

use chefshat_benchmark::DealsKey;
use chefshat_cli::error::{CommandError, say};
use chefshat_cli::key_file;
use clap::Args;
use serde_json::json;

/// The flag for hidden deals.
#[derive(Debug, Args)]
pub(super) struct DealsKeyArg {
    /// File with the key of hidden deals, which `chefshat bench deals-key` creates. Default: the
    /// published deals.
    #[arg(long = "deals-key", value_name = "FILE")]
    file: Option<PathBuf>,
}

impl DealsKeyArg {
    pub(super) fn key(&self) -> Result<Option<DealsKey>, CommandError> {
        let Some(file) = &self.file else {
            return Ok(None);
        };
        match key_file::read(file) {
            Ok(Some(key)) => Ok(Some(DealsKey(key))),
            Ok(None) => {
                let file = file.display();
                Err(format!(
                    "--deals-key: {file} does not exist; create it: chefshat bench deals-key {file}"
                )
                .into())
            }
            Err(error) => Err(format!("--deals-key: {error}").into()),
        }
    }
}

/// Create the key of hidden deals, and print its commitment, which is published before the games.
#[derive(Debug, Args)]
pub(super) struct CreateKey {
    /// The file. If it exists, its key stays.
    file: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl CreateKey {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        let commitment = DealsKey(key_file::read_or_create(&self.file)?).commitment();
        match self.json {
            true => say(json!({"deals_commitment": commitment}))?,
            false => anstream::println!("commitment: {commitment}"),
        }
        Ok(ExitCode::SUCCESS)
    }
}
