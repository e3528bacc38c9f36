//! Leaving a join code in a file, for programs that are started beside the one that makes the room.

use std::fs::File;
use std::io::{self, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

use super::super::CommandError;

/// A file that a join code is going to be left in: whole or not at all, and for its owner alone.
pub(super) struct CodeFile<'a> {
    file: &'a Path,
    part: PathBuf,
    whole: File,
}

impl<'a> CodeFile<'a> {
    /// Begins it under another name, beside where it is to be.
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn prepare(file: &'a Path) -> Result<Self, CommandError> {
        let mut part = file.as_os_str().to_owned();
        part.push(".part");
        let part = PathBuf::from(part);
        let open = || {
            if file.is_dir() {
                return Err(io::ErrorKind::IsADirectory.into());
            }
            // One left behind by a process that was stopped may have been made otherwise.
            match std::fs::remove_file(&part) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
            let mut options = File::options();
            options.write(true).create_new(true).mode(0o600).open(&part)
        };
        match open() {
            Ok(whole) => Ok(Self { file, part, whole }),
            Err(error) => {
                let file = file.display();
                Err(format!(
                    "--code-file: a join code cannot be left in {file}: {error}; no room was made"
                )
                .into())
            }
        }
    }

    /// Leaves the code.
    pub(super) fn leave(mut self, code: &str) -> Result<(), CommandError> {
        writeln!(self.whole, "{code}")
            .and_then(|()| std::fs::rename(&self.part, self.file))
            .map_err(|error| {
                format!(
                    "the room was made, but its join code cannot be left in {}: {error}",
                    self.file.display()
                )
                .into()
            })
    }
}

impl Drop for CodeFile<'_> {
    fn drop(&mut self) {
        // Nothing is there any more once the code was left.
        let _ = std::fs::remove_file(&self.part);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_is_left_for_its_owner_alone() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("code");
        for code in ["BCDF2345", "BCDF2346"] {
            let prepared = CodeFile::prepare(&file).expect("it can be written");
            prepared.leave(code).expect("written");
        }
        assert_eq!(std::fs::read_to_string(&file).expect("read"), "BCDF2346\n");
        let mode = std::fs::metadata(&file)
            .expect("it is there")
            .permissions()
            .mode();
        assert_eq!(mode & 0o777, 0o600);
    }

    #[test]
    fn a_file_that_gets_no_code_leaves_nothing_behind() {
        let folder = tempfile::tempdir().expect("a folder");
        drop(CodeFile::prepare(&folder.path().join("code")).expect("it can be written"));
        let left = std::fs::read_dir(folder.path())
            .expect("the folder")
            .count();
        assert_eq!(left, 0);
        assert!(CodeFile::prepare(folder.path()).is_err(), "a folder");
    }
}
