//! `chefshat participant`: what a data folder knows of one participant, given out or taken out. Both need the folder for themselves: the
//! server is stopped first. What is changed in a record is decided in `chefshat-records`, in the database in [`crate::store`].

mod delete;
mod export;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chefshat_proto::v1;
use chefshat_records::jsonl;
use clap::builder::NonEmptyStringValueParser;
use clap::{Args, Subcommand};

use super::{CommandError, data_dir};

/// Give out or delete what is known of a participant.
#[derive(Debug, Args)]
pub(super) struct ParticipantCommand {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write everything that is kept of a participant into a file, JSON Lines.
    Export(export::Export),
    /// Take a participant out of everything that is kept: the name gives way to a pseudonym.
    Delete(delete::Delete),
}

/// The participant, and where it is looked for.
#[derive(Debug, Args)]
struct Who {
    /// The name that the participant played under, exactly.
    #[arg(value_name = "NAME", value_parser = NonEmptyStringValueParser::new())]
    name: String,
    /// Data folder of the server, which must be stopped. Standard: chefshat in the user's data folder.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
}

impl ParticipantCommand {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        match self.command {
            Command::Export(command) => command.run().await,
            Command::Delete(command) => command.run().await,
        }
    }
}

impl Who {
    /// The data folder; a folder that is not there is not made.
    fn data_dir(&self) -> Result<PathBuf, CommandError> {
        let folder = data_dir::name(self.data_dir.clone())?;
        if folder.is_dir() {
            Ok(folder)
        } else {
            let folder = folder.display();
            Err(format!("there is no data folder {folder}; name another with --data-dir").into())
        }
    }
}

/// The records in a data folder in which a name may stand, by the letters in the file: reading each as a record would take long.
fn records_with(data_dir: &Path, name: &str) -> Result<Vec<PathBuf>, CommandError> {
    let folder = data_dir.join("records");
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let unreadable = |error| format!("{}: {error}", folder.display());
    let quoted = serde_json::to_string(name)?;
    let mut found = Vec::new();
    for entry in std::fs::read_dir(&folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if path.extension().is_none_or(|ending| ending != "jsonl") {
            continue;
        }
        let text = std::fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        // Other programs write some letters by their numbers.
        if contains(&text, quoted.as_bytes()) || contains(&text, b"\\u") {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

fn contains(text: &[u8], wanted: &[u8]) -> bool {
    text.windows(wanted.len()).any(|part| part == wanted)
}

/// A record of a data folder.
fn read(path: &Path) -> Result<Vec<v1::RecordLine>, CommandError> {
    jsonl::read(path).map_err(|error| {
        format!("{error}; `chefshat verify` says more, and without this file the rest can be done")
            .into()
    })
}
