//! Which files are records: those that are named, and those in folders that are named.

use std::collections::BTreeSet;
use std::io;
use std::path::PathBuf;

/// A file that may be a record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordFile {
    /// Where it is.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
}

/// Why there are no records to read.
#[derive(Debug, thiserror::Error)]
pub enum FindError {
    /// There is nothing at a path, or nothing that may be read.
    #[error("{path}: {source}")]
    Unreadable {
        /// The path.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// There is no record.
    #[error("there is no record (a file *.jsonl) in {0}")]
    NoRecords(String),
}

/// The record files among `paths`: files as they are named, of folders all files `*.jsonl` by name. A file that is named twice comes once.
///
/// # Errors
/// A path that cannot be read, or no record anywhere.
pub fn find_records(paths: &[PathBuf]) -> Result<Vec<RecordFile>, FindError> {
    let mut found: Vec<RecordFile> = Vec::new();
    let mut known = BTreeSet::new();
    for path in paths {
        let unreadable = |source| FindError::Unreadable {
            path: path.clone(),
            source,
        };
        let mut files = if std::fs::metadata(path).map_err(unreadable)?.is_dir() {
            std::fs::read_dir(path)
                .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect())
                .map_err(unreadable)
                .map(|mut files: Vec<PathBuf>| {
                    files.retain(|file| file.extension().is_some_and(|ending| ending == "jsonl"));
                    files
                })?
        } else {
            vec![path.clone()]
        };
        files.sort();
        for path in files {
            let unreadable = |source| FindError::Unreadable {
                path: path.clone(),
                source,
            };
            let bytes = std::fs::metadata(&path).map_err(unreadable)?.len();
            if known.insert(std::fs::canonicalize(&path).map_err(unreadable)?) {
                found.push(RecordFile { path, bytes });
            }
        }
    }
    if found.is_empty() {
        let places: Vec<String> = paths
            .iter()
            .map(|path| path.display().to_string())
            .collect();
        return Err(FindError::NoRecords(places.join(", ")));
    }
    Ok(found)
}
