//! The folder of a dataset: made beside its place, whole or not at all, and moved there when it is complete. What may be replaced by it is
//! decided in `earlier`.

use std::ffi::{OsStr, OsString};
use std::io;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::earlier::EarlierDataset;
use super::files::FileSummary;
use chefshat_record::atomic_file::sync_folder_of;

/// The file that lists the SHA-256 of the others, in the form that `sha256sum --check` reads.
pub(super) const CHECKSUMS: &str = "SHA256SUMS";

/// Why a folder cannot be where a dataset goes.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The path ends in no name.
    #[error("{0} is no name for a new folder")]
    NoName(PathBuf),
    /// Something else is there.
    #[error("{0} is not a folder")]
    NotAFolder(PathBuf),
    /// The folder holds something, and replacing was not asked for.
    #[error("{0} is not empty; choose another folder, or replace the dataset in it with --force")]
    NotEmpty(PathBuf),
    /// Replacing was asked for, but what is there is no dataset, or not only that.
    #[error("{folder} holds something else than a dataset, so it is not replaced: {why}")]
    NoDataset {
        /// The folder.
        folder: PathBuf,
        /// What is missing in it, or the first foreign file.
        why: String,
    },
    /// The file system refused.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// A folder in the making. What was made is removed again unless it is put in its place.
pub(super) struct NewFolder {
    target: PathBuf,
    parts: TempDir,
    replace: bool,
}

impl NewFolder {
    /// A folder that will be `target`, which must be empty or not exist; with `replace` an earlier dataset may be there. If `target` is a
    /// link, what it leads to is meant.
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

    /// Where files are written for now.
    pub(super) fn path(&self) -> &Path {
        self.parts.path()
    }

    /// Writes the list of checksums and puts the folder in its place.
    pub(super) fn put_in_place(self, files: &[FileSummary]) -> Result<(), FolderError> {
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
        std::fs::File::open(&sums_path)
            .and_then(|file| file.sync_all())
            .map_err(io)?;
        // Somebody may have used the place meanwhile.
        check_target(&self.target, self.replace)?;
        let parts = self.parts.path();
        let old = parts.with_extension("old");
        let replaced = self.target.exists();
        let mut earlier = None;
        if replaced {
            std::fs::rename(&self.target, &old).map_err(io)?;
            // What lies there now is what will be removed, and nobody finds it by its name any more.
            earlier = contents(&old).or_else(|error| {
                std::fs::rename(&old, &self.target).map_err(io)?;
                Err(error)
            })?;
        }
        if let Err(error) = std::fs::rename(parts, &self.target) {
            if replaced {
                // As it was; if even that fails, the old folder still lies beside.
                let _ = std::fs::rename(&old, &self.target);
            }
            return Err(io(error));
        }
        match earlier {
            Some(earlier) => earlier.remove().map_err(io)?,
            None if replaced => std::fs::remove_dir(&old).map_err(io)?,
            None => {}
        }
        // Not every file system can sync a folder, and the files in it are safe already.
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

/// The dataset in a folder; `None` if the folder is empty.
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
