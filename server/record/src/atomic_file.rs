//! A file that replaces its target atomically: written beside it, synced, then renamed. A link stays
//! one, and what it leads to is replaced; pipes and devices are written to.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, PersistError};

use crate::private;

/// A failed write. The target is unchanged.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {source}")]
pub struct WriteError {
    /// The target.
    pub path: PathBuf,
    /// The error of the file system.
    pub source: io::Error,
}

/// A file being written. Dropping it before [`finish`](Self::finish) leaves the target unchanged
/// and removes what was written.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    file: BufWriter<Target>,
}

/// Where bytes go.
#[derive(Debug)]
enum Target {
    /// The unfinished file.
    Part(NamedTempFile),
    /// A pipe or device, which nothing replaces.
    Through(File),
}

impl Write for Target {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Part(file) => file.write(bytes),
            Self::Through(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Part(file) => file.flush(),
            Self::Through(file) => file.flush(),
        }
    }
}

impl AtomicFile {
    /// Opens a new file `NAME.RANDOM.part` in the folder of `path`. Writers of the same path do
    /// not disturb each other: the last to finish wins.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        // By the standard library, with the permissions of any new file.
        Self::opened_by(path, |part| File::create_new(part))
    }

    /// Like [`create`](Self::create), for a file that only its owner may read.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn create_private(path: &Path) -> Result<Self, WriteError> {
        let mut options = private::options();
        options.write(true).create_new(true);
        Self::opened_by(path, |part| options.open(part))
    }

    /// `open` creates the unfinished file.
    fn opened_by(
        path: &Path,
        open: impl Fn(&Path) -> io::Result<File>,
    ) -> Result<Self, WriteError> {
        let path = match std::fs::read_link(path) {
            // A file that does not exist yet has no canonical path.
            Ok(target) => (path.canonicalize()).unwrap_or_else(|_| folder_of(path).join(target)),
            Err(_) => path.to_path_buf(),
        };
        let opened = match std::fs::metadata(&path) {
            Ok(it) if !it.is_file() && !it.is_dir() => {
                (File::options().write(true).open(&path)).map(Target::Through)
            }
            _ => {
                let mut prefix = path.file_name().unwrap_or_default().to_owned();
                prefix.push(".");
                let part = tempfile::Builder::new()
                    .prefix(&prefix)
                    .suffix(".part")
                    .make_in(folder_of(&path), open);
                part.map(Target::Part)
            }
        };
        match opened {
            Ok(target) => Ok(Self {
                path,
                file: BufWriter::new(target),
            }),
            Err(source) => Err(WriteError { path, source }),
        }
    }

    /// The path of the unfinished file, for another program to write to.
    pub fn part(&self) -> &Path {
        match self.file.get_ref() {
            Target::Part(file) => file.path(),
            Target::Through(_) => &self.path,
        }
    }

    /// Writes bytes.
    ///
    /// # Errors
    /// The write failed.
    pub fn write_all(&mut self, bytes: &[u8]) -> Result<(), WriteError> {
        self.file.write_all(bytes).map_err(|source| WriteError {
            path: self.path.clone(),
            source,
        })
    }

    /// Syncs the file, renames it to the target and syncs the folder.
    ///
    /// # Errors
    /// The file system refused.
    pub fn finish(self) -> Result<(), WriteError> {
        self.finish_by(|file, path| file.persist(path))
    }

    /// Like [`finish`](Self::finish), but replaces no file.
    ///
    /// # Errors
    /// The target exists, or the file system refused.
    pub fn finish_new(self) -> Result<(), WriteError> {
        if let Target::Through(_) = self.file.get_ref() {
            // Nothing is written that waits to be.
            let Self { path, file } = self;
            drop(file.into_parts());
            let source = io::ErrorKind::AlreadyExists.into();
            return Err(WriteError { path, source });
        }
        self.finish_by(|file, path| file.persist_noclobber(path))
    }

    fn finish_by(
        self,
        persist: impl FnOnce(NamedTempFile, &Path) -> Result<File, PersistError>,
    ) -> Result<(), WriteError> {
        let Self { path, file } = self;
        let finish = || match file.into_inner().map_err(io::IntoInnerError::into_error)? {
            Target::Part(file) => {
                file.as_file().sync_all()?;
                persist(file, &path)?;
                sync_folder_of(&path)
            }
            Target::Through(mut file) => file.flush(),
        };
        finish().map_err(|source| WriteError {
            path: path.clone(),
            source,
        })
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

fn folder_of(path: &Path) -> &Path {
    let folder = path.parent().filter(|folder| *folder != Path::new(""));
    folder.unwrap_or(Path::new("."))
}

/// Deletes a file that may be missing.
///
/// # Errors
/// The file system failed.
pub fn remove(path: &Path) -> io::Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Makes the entry of a file or folder in its parent folder durable.
///
/// # Errors
/// The parent folder cannot be opened or synced.
pub fn sync_folder_of(path: &Path) -> io::Result<()> {
    // Other systems neither need it nor can open a folder.
    if cfg!(unix) {
        File::open(folder_of(path))?.sync_all()?;
    }
    Ok(())
}
