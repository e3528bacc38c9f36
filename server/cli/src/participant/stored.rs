//! Where a participant's data may be stored: the data directory, and the record files in which the
//! name may occur.

use std::path::{Path, PathBuf};

use chefshat_proto::v1;
use chefshat_record::jsonl;
use clap::Args;
use clap::builder::NonEmptyStringValueParser;

use crate::data_dir;
use crate::error::CommandError;

/// The participant and the data directory.
#[derive(Debug, Args)]
pub(super) struct Who {
    /// The exact name the participant played under.
    #[arg(value_name = "NAME", value_parser = NonEmptyStringValueParser::new())]
    pub(super) name: String,
    /// Data directory of the server, which must be stopped. Default: chefshat in the user's data
    /// directory.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
}

impl Who {
    /// The data directory, which must exist.
    pub(super) fn data_dir(&self) -> Result<PathBuf, CommandError> {
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
pub(super) struct Candidate {
    pub(super) path: PathBuf,
    /// The name occurs, or the file is unreadable; otherwise the name may be escaped.
    named: bool,
}

/// Why files with the name were left unchanged; the command fails after the others are done.
#[derive(Default)]
pub(super) struct Skipped(Vec<String>);

/// The records in which a name may occur, by a search of their bytes: parsing each record would
/// take long.
pub(super) fn records_with(data_dir: &Path, name: &str) -> Result<Vec<Candidate>, CommandError> {
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

impl Skipped {
    /// Reads a candidate; an unreadable one is skipped and need not concern this participant.
    pub(super) fn read(&mut self, candidate: &Candidate) -> Option<Vec<v1::RecordLine>> {
        let lines = jsonl::read(&candidate.path);
        lines
            .map_err(|error| self.note(candidate, error.to_string()))
            .ok()
    }

    /// Notes why a file that may or may not contain the name is left unchanged.
    pub(super) fn note(&mut self, candidate: &Candidate, why: String) {
        if candidate.named {
            self.fail(why);
        } else {
            anstream::eprintln!("chefshat: warning: skipped a file that cannot be read: {why}");
        }
    }

    /// Notes why a file with the name is left unchanged.
    pub(super) fn fail(&mut self, why: String) {
        self.0.push(why);
    }

    /// Fails if the name occurs in a skipped file.
    pub(super) fn check(&self, name: &str) -> Result<(), CommandError> {
        if self.0.is_empty() {
            return Ok(());
        }
        Err(format!(
            "done, except for files that contain {name:?} but could not be read or written: {}; repair or remove them (`chefshat verify` \
             shows what is wrong) and run the command again",
            self.0.join("; ")
        )
        .into())
    }
}
