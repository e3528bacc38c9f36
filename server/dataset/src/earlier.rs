//! What may be replaced: an earlier dataset, and nothing but that. A folder in which anything else lies is left as it is.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use super::card;
use super::folder::{CHECKSUMS, FolderError};

/// Bytes of a list of checksums that are read: a hundred characters for each of half a million files. What is listed behind them counts as
/// foreign.
const MAX_CHECKSUMS: u64 = 64 * 1024 * 1024;
/// Bytes of a card that are read: its front matter takes few of them.
const MAX_FRONT_MATTER: u64 = 64 * 1024;

/// A dataset that lies in a folder: whatever is in the folder, each file listed in its checksums.
#[derive(Debug)]
pub(super) struct EarlierDataset {
    /// Its files, with their paths.
    files: Vec<PathBuf>,
    /// Its folders, each before those within it.
    folders: Vec<PathBuf>,
}

impl EarlierDataset {
    /// The dataset in a folder.
    ///
    /// # Errors
    /// The folder holds none, or something else as well.
    pub(super) fn of(folder: &Path) -> Result<Self, FolderError> {
        let no_dataset = |why: String| FolderError::NoDataset {
            folder: folder.to_path_buf(),
            why,
        };
        let sums = beginning(&folder.join(CHECKSUMS), MAX_CHECKSUMS)
            .map_err(|_| no_dataset(format!("it has no file {CHECKSUMS}")))?;
        let is_ours = beginning(&folder.join(card::FILE_NAME), MAX_FRONT_MATTER)
            .is_ok_and(|text| card::is_ours(&text));
        if !is_ours {
            return Err(no_dataset(format!(
                "its {} is not a dataset card of ours",
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
                    return Err(no_dataset(format!(
                        "{} is in it, which {CHECKSUMS} does not list",
                        name.display()
                    )));
                }
            }
        }
        Ok(dataset)
    }

    /// Removes what was found, and the folder if nothing has come into it since.
    pub(super) fn remove(self) -> io::Result<()> {
        self.files.iter().try_for_each(std::fs::remove_file)?;
        self.folders.iter().rev().try_for_each(std::fs::remove_dir)
    }
}

/// What is in a folder, by name. Links are not followed.
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

/// The beginning of a file of text; what is no text in it becomes a mark.
fn beginning(path: &Path, most: u64) -> io::Result<String> {
    let mut bytes = Vec::new();
    File::open(path)?.take(most).read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
