//! Which files are records: those that are named, and those in folders that are named. How one is read is in [`crate::jsonl`].

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

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
    /// A folder has no record in it.
    #[error("{0} holds no records (*.jsonl); in a data folder they are in its folder `records`")]
    NoRecords(PathBuf),
}

/// The record files among `paths`: files as they are named, of folders all files `*.jsonl` by name (not those of folders within). A file
/// that is named twice comes once.
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
            let whole = std::fs::canonicalize(&path).map_err(unreadable(&path))?;
            let bytes = std::fs::metadata(&path).map_err(unreadable(&path))?.len();
            if known.insert(whole) {
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
