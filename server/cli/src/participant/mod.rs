//! `chefshat participant`: exports or deletes a participant's data in a data directory. The server must be stopped. `chefshat-record`
//! changes the records, [`chefshat_server::store`] the database.

mod delete;
mod export;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chefshat_proto::v1;
use chefshat_record::jsonl;
use clap::builder::NonEmptyStringValueParser;
use clap::{Args, Subcommand};

use super::{CommandError, data_dir};

/// Export or delete a participant's data.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat participant export P07 --out p07.jsonl --data-dir ./chefshat-data\n  \
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

/// The participant and the data directory.
#[derive(Debug, Args)]
struct Who {
    /// The exact name the participant played under.
    #[arg(value_name = "NAME", value_parser = NonEmptyStringValueParser::new())]
    name: String,
    /// Data directory of the server, which must be stopped. Default: chefshat in the user's data directory.
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
    /// The data directory, which must exist.
    fn data_dir(&self) -> Result<PathBuf, CommandError> {
        let folder = data_dir::name(self.data_dir.clone())?;
        if folder.is_dir() {
            Ok(folder)
        } else {
            let folder = folder.display();
            Err(
                format!("there is no data directory {folder}; choose another with --data-dir")
                    .into(),
            )
        }
    }
}

/// A file that may contain the name.
struct Candidate {
    path: PathBuf,
    /// The name occurs, or the file is unreadable; otherwise the name may be escaped.
    named: bool,
}

/// Why files with the name were left unchanged; the command fails after the others are done.
#[derive(Default)]
struct Left(Vec<String>);

/// The records in which a name may occur, by a search of their bytes: parsing each record would take long.
fn records_with(data_dir: &Path, name: &str) -> Result<Vec<Candidate>, CommandError> {
    let folder = data_dir.join("records");
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let unreadable = |error| format!("{}: {error}", folder.display());
    let quoted = serde_json::to_string(name)?;
    let mut found = Vec::new();
    for entry in std::fs::read_dir(&folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if path.extension().is_none_or(|ending| ending != "jsonl") || path.is_dir() {
            continue;
        }
        let text = std::fs::read(&path);
        let named = (text.as_ref()).map_or(true, |text| contains(text, quoted.as_bytes()));
        // Other programs may escape letters.
        if named || text.is_ok_and(|text| contains(&text, b"\\u")) {
            found.push(Candidate { path, named });
        }
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(found)
}

fn contains(text: &[u8], wanted: &[u8]) -> bool {
    text.windows(wanted.len()).any(|part| part == wanted)
}

impl Left {
    /// Reads a candidate; an unreadable one is skipped and need not concern this participant.
    fn read(&mut self, candidate: &Candidate) -> Option<Vec<v1::RecordLine>> {
        let lines = jsonl::read(&candidate.path);
        lines
            .map_err(|error| self.note(candidate, error.to_string()))
            .ok()
    }

    /// Notes why a candidate is left unchanged.
    fn note(&mut self, candidate: &Candidate, why: String) {
        if candidate.named {
            self.0.push(why);
        } else {
            anstream::eprintln!("chefshat: warning: left out, it cannot be read: {why}");
        }
    }

    /// Fails if the name occurs in a skipped file.
    fn check(&self, name: &str) -> Result<(), CommandError> {
        if self.0.is_empty() {
            return Ok(());
        }
        Err(format!(
            "everything else is done, but {name:?} also stands in what could not be read or written: {}; `chefshat verify` says more: \
             mend or remove this and run the command again",
            self.0.join("; ")
        )
        .into())
    }
}
