//! Finds the record files among files and folders.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

/// A file that may be a record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordFile {
    /// Its path.
    pub path: PathBuf,
    /// Its size in bytes.
    pub bytes: u64,
}

/// Records that were looked for.
#[derive(Debug, Default)]
pub struct Found {
    /// Their files.
    pub files: Vec<RecordFile>,
    /// The paths where none is.
    pub missing: Vec<Missing>,
}

/// A path where no record is.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {problem}")]
pub struct Missing {
    /// The path.
    pub path: PathBuf,
    /// The cause.
    pub problem: FindProblem,
}

/// Why no record is at a path.
#[derive(Debug, thiserror::Error)]
pub enum FindProblem {
    /// It does not exist or cannot be read.
    #[error(transparent)]
    Unreadable(#[from] io::Error),
    /// It is a folder without a record.
    #[error("contains no records (*.jsonl); a data folder has them in its folder `records`")]
    NoRecords,
}

/// The record files among `paths`: files as given, and the `*.jsonl` files of folders, by name and
/// without subfolders. Duplicates are dropped.
pub fn find_records(paths: &[PathBuf]) -> Found {
    let mut found = Found::default();
    let mut known = BTreeSet::new();
    for path in paths {
        match files_at(path) {
            Ok(files) => {
                let new = files.into_iter();
                found.files.extend(
                    new.filter_map(|(canonical, file)| known.insert(canonical).then_some(file)),
                );
            }
            Err(problem) => found.missing.push(Missing {
                path: path.clone(),
                problem,
            }),
        }
    }
    found
}

/// The file at a path, or the files `*.jsonl` in a folder, by name; at least one. Each with its
/// canonical path.
fn files_at(path: &Path) -> Result<Vec<(PathBuf, RecordFile)>, FindProblem> {
    if !std::fs::metadata(path)?.is_dir() {
        return Ok(vec![file_at(path.to_owned())?]);
    }
    let mut files = Vec::new();
    for entry in std::fs::read_dir(path)? {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == "jsonl") && path.is_file() {
            match file_at(path) {
                // A server may have deleted it since.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                file => files.push(file?),
            }
        }
    }
    if files.is_empty() {
        return Err(FindProblem::NoRecords);
    }
    files.sort_by(|(_, one), (_, other)| one.path.cmp(&other.path));
    Ok(files)
}

fn file_at(path: PathBuf) -> io::Result<(PathBuf, RecordFile)> {
    let canonical = std::fs::canonicalize(&path)?;
    let bytes = std::fs::metadata(&path)?.len();
    Ok((canonical, RecordFile { path, bytes }))
}
