//! A folder that appears under its name when it is complete, such as a backup or an export.

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::Path;

use chefshat_record::atomic_file::sync_folder_of;
use tempfile::TempDir;

use super::CommandError;

/// A folder being filled. Dropping it before [`finish`](Self::finish) removes it.
pub(super) struct NewFolder<'a> {
    part: TempDir,
    target: &'a Path,
}

impl<'a> NewFolder<'a> {
    /// Creates `TARGET.RANDOM.part` beside `target`. `mode`: its permissions on Unix, less the umask.
    ///
    /// # Errors
    /// It exists, or cannot be created.
    pub(super) fn beside(target: &'a Path, mode: u32) -> Result<Self, CommandError> {
        if target.exists() {
            let target = target.display();
            return Err(format!("{target} exists already; name a new folder").into());
        }
        let name = target
            .file_name()
            .ok_or("name the folder to create, for example data/monday")?;
        let parent = match target.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        let prefix = [name, OsStr::new(".")].join(OsStr::new(""));
        let mut part = tempfile::Builder::new();
        part.prefix(&prefix).suffix(".part");
        #[cfg(unix)]
        part.permissions(std::os::unix::fs::PermissionsExt::from_mode(mode));
        #[cfg(not(unix))]
        let _ = mode;
        let part = part
            .tempdir_in(parent)
            .map_err(|error| at(parent, &error))?;
        Ok(Self { part, target })
    }

    /// Where to write.
    pub(super) fn path(&self) -> &Path {
        self.part.path()
    }

    /// Gives the folder its name. What is in it must be on the disk if that matters.
    ///
    /// # Errors
    /// The file system refused.
    pub(super) fn finish(self) -> Result<(), CommandError> {
        let Self { part, target } = self;
        fs::rename(part.path(), target).map_err(|error| at(target, &error))?;
        // It has another name now, so that nothing is left to remove.
        drop(part.keep());
        sync_folder_of(target).map_err(|error| at(target, &error))
    }
}

/// An error of the file system, with its path.
pub(super) fn at(path: &Path, error: &io::Error) -> CommandError {
    format!("{}: {error}", path.display()).into()
}
