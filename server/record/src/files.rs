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

/// A failure to find records.
#[derive(Debug, thiserror::Error)]
pub enum FindError {
    /// A path does not exist or cannot be read.
    #[error("{path}: {source}")]
    Unreadable {
        /// The path.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// A folder contains no record.
    #[error("{0} contains no records (*.jsonl); a data folder has them in its folder `records`")]
    NoRecords(PathBuf),
}

/// The record files among `paths`: files as given, and the `*.jsonl` files of folders, by name and
/// without subfolders. Duplicates are dropped.
///
/// # Errors
/// A path that cannot be read, or a folder without a record.
pub fn find_records(paths: &[PathBuf]) -> Result<Vec<RecordFile>, FindError> {
    let mut found: Vec<RecordFile> = Vec::new();
    let mut known = BTreeSet::new();
    for path in paths {
        let files = if std::fs::metadata(path).map_err(unreadable(path))?.is_dir() {
            files_in(path)?
        } else {
            vec![path.clone()]
        };
        for path in files {
            let canonical = std::fs::canonicalize(&path).map_err(unreadable(&path))?;
            let bytes = std::fs::metadata(&path).map_err(unreadable(&path))?.len();
            if known.insert(canonical) {
                found.push(RecordFile { path, bytes });
            }
        }
    }
    Ok(found)
}

/// The files `*.jsonl` in a folder, by name; at least one.
fn files_in(folder: &Path) -> Result<Vec<PathBuf>, FindError> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable(folder))? {
        let path = entry.map_err(unreadable(folder))?.path();
        if path.extension().is_some_and(|ending| ending == "jsonl") && path.is_file() {
            files.push(path);
        }
    }
    if files.is_empty() {
        return Err(FindError::NoRecords(folder.to_path_buf()));
    }
    files.sort();
    Ok(files)
}

fn unreadable(path: &Path) -> impl FnOnce(io::Error) -> FindError {
    let path = path.to_path_buf();
    |source| FindError::Unreadable { path, source }
}
