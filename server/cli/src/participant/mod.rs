//! `chefshat participant`: what a data folder knows of one participant, given out or taken out. Both need the folder for themselves: the
//! server is stopped first. What is changed in a record is decided in `chefshat-records`, in the database in [`chefshat_server::store`].

mod delete;
mod export;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chefshat_proto::v1;
use chefshat_record::jsonl;
use clap::builder::NonEmptyStringValueParser;
use clap::{Args, Subcommand};

use super::{CommandError, data_dir};

/// Give out or delete what is known of a participant.
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

/// A file in which the name may stand.
struct Candidate {
    path: PathBuf,
    /// It does, or the file cannot even be looked into; otherwise it may be written by the numbers of its letters.
    named: bool,
}

/// Why files with the name were left as they are. The others are done first: the command fails when it has.
#[derive(Default)]
struct Left(Vec<String>);

/// The records in a data folder in which a name may stand, by the letters in the file: reading each as a record would take long.
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
        // Other programs write some letters by their numbers.
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
    /// The record of a candidate; one that cannot be read is left, and need not be this participant's.
    fn read(&mut self, candidate: &Candidate) -> Option<Vec<v1::RecordLine>> {
        let lines = jsonl::read(&candidate.path);
        lines
            .map_err(|error| self.note(candidate, error.to_string()))
            .ok()
    }

    /// Notes why a candidate is left as it is.
    fn note(&mut self, candidate: &Candidate, why: String) {
        if candidate.named {
            self.0.push(why);
        } else {
            anstream::eprintln!("chefshat: warning: left out, it cannot be read: {why}");
        }
    }

    /// Fails if the name stands in what was left.
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
