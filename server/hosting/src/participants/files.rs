//! The files of records in which a participant's name may occur. Files that cannot be read do not
//! stop what is done for the others.

use std::io;
use std::path::{Path, PathBuf};

use chefshat_proto::v1;
use chefshat_record::jsonl;

/// A file that may contain the name.
pub(super) struct Candidate {
    pub(super) path: PathBuf,
    /// The name occurs, or the file is unreadable; otherwise the name may be escaped.
    named: bool,
}

/// Files that were left as they are.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Skipped {
    /// Those that contain the name, or may: why each could not be read or written.
    pub named: Vec<String>,
    /// Those that need not concern the participant: why each could not be read.
    pub other: Vec<String>,
}

/// The records in which a name may occur, by a search of their bytes: parsing each record would
/// take long.
pub(super) fn records_with(data_dir: &Path, name: &str) -> io::Result<Vec<Candidate>> {
    let folder = jsonl::folder_of(data_dir);
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let quoted = serde_json::to_string(name)?;
    let mut found = Vec::new();
    for entry in std::fs::read_dir(&folder)? {
        let path = entry?.path();
        if path.extension().is_none_or(|ending| ending != "jsonl") || path.is_dir() {
            continue;
        }
        let text = std::fs::read(&path);
        let named = (text.as_ref()).map_or(true, |text| contains(text, quoted.as_bytes()));
        // Other programs may escape letters, and a marker contains the name among other words.
        let may_be = |text: &Vec<u8>| contains(text, b"\\u") || contains(text, name.as_bytes());
        if named || text.is_ok_and(|text| may_be(&text)) {
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
    /// Reads a candidate; one that cannot be read is skipped.
    pub(super) fn read(&mut self, candidate: &Candidate) -> Option<Vec<v1::RecordLine>> {
        let lines = jsonl::read(&candidate.path);
        lines
            .map_err(|error| self.note(candidate, error.to_string()))
            .ok()
    }

    /// Notes why a file that may or may not contain the name is left unchanged.
    pub(super) fn note(&mut self, candidate: &Candidate, why: String) {
        match candidate.named {
            true => self.named.push(why),
            false => self.other.push(why),
        }
    }
}
