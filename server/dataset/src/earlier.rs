//! Recognizes an earlier dataset, the only thing an export replaces. A folder with any other file
//! is left unchanged.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use super::card;
use super::folder::{CHECKSUMS, FolderError};

/// The most bytes read of a list of checksums: half a million files. Later entries count as
/// foreign.
const MAX_CHECKSUMS: u64 = 64 * 1024 * 1024;
/// The most bytes read of a card.
const MAX_FRONT_MATTER: u64 = 64 * 1024;

/// A dataset: all files of a folder, each listed in its checksums.
#[derive(Debug)]
pub(super) struct EarlierDataset {
    files: Vec<PathBuf>,
    /// Parents come before their subfolders.
    folders: Vec<PathBuf>,
}

impl EarlierDataset {
    /// Reads the dataset in a folder.
    ///
    /// # Errors
    /// The folder contains no dataset, or other files too.
    pub(super) fn of(folder: &Path) -> Result<Self, FolderError> {
        let not_a_dataset = |why: String| FolderError::NotADataset {
            folder: folder.to_path_buf(),
            why,
        };
        let sums = beginning(&folder.join(CHECKSUMS), MAX_CHECKSUMS)
            .map_err(|_| not_a_dataset(format!("it has no file {CHECKSUMS}")))?;
        let is_ours = beginning(&folder.join(card::FILE_NAME), MAX_FRONT_MATTER)
            .is_ok_and(|text| card::is_ours(&text));
        if !is_ours {
            return Err(not_a_dataset(format!(
                "its {} was not written by this program",
                card::FILE_NAME
            )));
        }
        let mut listed = BTreeSet::from([folder.join(CHECKSUMS)]);
        let mut parents = BTreeSet::new();
        for (_, path) in sums.lines().filter_map(|line| line.split_once("  ")) {
            let path = folder.join(path);
            parents.extend(path.parent().map(Path::to_path_buf));
            listed.insert(path);
        }
        let mut dataset = Self {
            files: Vec::new(),
            folders: vec![folder.to_path_buf()],
        };
        let mut next = 0;
        while let Some(inside) = dataset.folders.get(next).cloned() {
            next += 1;
            for (path, kind) in entries(&inside)? {
                if kind.is_file() && listed.contains(&path) {
                    dataset.files.push(path);
                } else if kind.is_dir() && parents.contains(&path) {
                    dataset.folders.push(path);
                } else {
                    let name = path.strip_prefix(folder).unwrap_or(&path);
                    return Err(not_a_dataset(format!(
                        "it contains {}, which {CHECKSUMS} does not list",
                        name.display()
                    )));
                }
            }
        }
        Ok(dataset)
    }

    /// Removes the files, and the folders unless something was added since.
    pub(super) fn remove(self) -> io::Result<()> {
        self.files.iter().try_for_each(std::fs::remove_file)?;
        self.folders.iter().rev().try_for_each(std::fs::remove_dir)
    }
}

/// The entries of a folder, by name. Does not follow links.
fn entries(folder: &Path) -> Result<Vec<(PathBuf, std::fs::FileType)>, FolderError> {
    let entry_of = |entry: io::Result<std::fs::DirEntry>| {
        let entry = entry?;
        Ok((entry.path(), entry.file_type()?))
    };
    let mut entries: Vec<_> = std::fs::read_dir(folder)
        .and_then(|entries| entries.map(entry_of).collect())
        .map_err(|source| FolderError::Io {
            path: folder.to_path_buf(),
            source,
        })?;
    entries.sort_by(|(one, _), (other, _)| one.cmp(other));
    Ok(entries)
}

/// The beginning of a text file, with invalid UTF-8 replaced.
fn beginning(path: &Path, most: u64) -> io::Result<String> {
    let mut bytes = Vec::new();
    File::open(path)?.take(most).read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
