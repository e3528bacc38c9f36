//! The folder of a dataset: written beside its target and moved into place when complete.
//!
//! It replaces only an earlier dataset; a folder with any other file is left unchanged.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::card;
use super::files::FileSummary;
use chefshat_record::atomic_file::sync_folder_of;

/// The list of checksums, in the format of `sha256sum --check`.
pub(super) const CHECKSUMS: &str = "SHA256SUMS";

/// The most bytes read of a list of checksums: half a million files. Later entries count as
/// foreign.
const MAX_CHECKSUMS: u64 = 64 * 1024 * 1024;
/// The most bytes read of a card.
const MAX_FRONT_MATTER: u64 = 64 * 1024;

/// Why a folder cannot be the target.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The path has no final name.
    #[error("{0} cannot be the name of a new folder")]
    NoName(PathBuf),
    /// The target is not a folder.
    #[error("{0} is not a folder")]
    NotAFolder(PathBuf),
    /// The folder is not empty, and replacing was not requested.
    #[error("{0} is not empty; choose another folder, or replace the dataset in it with --force")]
    NotEmpty(PathBuf),
    /// Replacing was requested, but the folder contains other files.
    #[error("{folder} is not replaced, because it is not only a dataset: {why}")]
    NotADataset {
        /// The folder.
        folder: PathBuf,
        /// The missing or first foreign file.
        why: String,
    },
    /// An error of the file system.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
}

/// A folder being written. Removed on drop unless moved into place.
pub(super) struct NewFolder {
    target: PathBuf,
    parts: TempDir,
    replace: bool,
}

impl NewFolder {
    /// Starts a folder for `target`, which must be empty or not exist; with `replace` it may be an
    /// earlier dataset. Follows a link.
    pub(super) fn begin(target: &Path, replace: bool) -> Result<Self, FolderError> {
        let target = &match target.is_symlink() {
            true => std::fs::canonicalize(target).map_err(|source| FolderError::Io {
                path: target.to_path_buf(),
                source,
            })?,
            false => target.to_path_buf(),
        };
        let name = target
            .file_name()
            .ok_or_else(|| FolderError::NoName(target.to_path_buf()))?;
        check_target(target, replace)?;
        let parts = create_beside(target, name).map_err(|source| FolderError::Io {
            path: target.to_path_buf(),
            source,
        })?;
        Ok(Self {
            target: target.to_path_buf(),
            parts,
            replace,
        })
    }

    /// The folder to write to.
    pub(super) fn path(&self) -> &Path {
        self.parts.path()
    }

    /// Writes the checksums and moves the folder into place.
    pub(super) fn move_into_place(self, files: &[FileSummary]) -> Result<(), FolderError> {
        let target = self.target.clone();
        let io = |source| FolderError::Io {
            path: target.clone(),
            source,
        };
        let sums: String = files
            .iter()
            .map(|file| format!("{}  {}\n", file.sha256, file.path))
            .collect();
        let sums_path = self.parts.path().join(CHECKSUMS);
        std::fs::write(&sums_path, sums).map_err(io)?;
        File::open(&sums_path)
            .and_then(|file| file.sync_all())
            .map_err(io)?;
        // The target may have changed meanwhile.
        check_target(&self.target, self.replace)?;
        let parts = self.parts.path();
        let old = parts.with_extension("old");
        let replaced = self.target.exists();
        let mut earlier = None;
        if replaced {
            std::fs::rename(&self.target, &old).map_err(io)?;
            // Check again what will be removed, now that no other program finds it by its name.
            earlier = contents(&old).or_else(|error| {
                std::fs::rename(&old, &self.target).map_err(io)?;
                Err(error)
            })?;
        }
        if let Err(error) = std::fs::rename(parts, &self.target) {
            if replaced {
                // If restoring fails too, the old folder remains beside the target.
                let _ = std::fs::rename(&old, &self.target);
            }
            return Err(io(error));
        }
        match earlier {
            Some(earlier) => earlier.remove().map_err(io)?,
            None if replaced => std::fs::remove_dir(&old).map_err(io)?,
            None => {}
        }
        // Not every file system can sync a folder; its files are synced already.
        let _ = sync_folder_of(&self.target);
        Ok(())
    }
}

fn check_target(target: &Path, replace: bool) -> Result<(), FolderError> {
    if !target.exists() {
        return Ok(());
    }
    if !target.is_dir() {
        return Err(FolderError::NotAFolder(target.to_path_buf()));
    }
    if replace {
        contents(target).map(|_| ())
    } else if is_empty(target)? {
        Ok(())
    } else {
        Err(FolderError::NotEmpty(target.to_path_buf()))
    }
}

/// The dataset in a folder; `None` if empty.
fn contents(folder: &Path) -> Result<Option<EarlierDataset>, FolderError> {
    if is_empty(folder)? {
        Ok(None)
    } else {
        EarlierDataset::of(folder).map(Some)
    }
}

fn is_empty(folder: &Path) -> Result<bool, FolderError> {
    let mut entries = std::fs::read_dir(folder).map_err(|source| FolderError::Io {
        path: folder.to_path_buf(),
        source,
    })?;
    Ok(entries.next().is_none())
}

/// Creates a hidden folder `.NAME.RANDOM.part` beside the target, and the folders above them.
fn create_beside(target: &Path, name: &OsStr) -> io::Result<TempDir> {
    let mut prefix = OsString::from(".");
    prefix.push(name);
    prefix.push(".");
    let parent = match target.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(parent)?;
    tempfile::Builder::new()
        .prefix(&prefix)
        .suffix(".part")
        .tempdir_in(parent)
}

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
