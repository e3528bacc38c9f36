//! Writes a secret to a file for another program: the join code of a room or tournament, or its
//! owner token.

use std::fs::File;
use std::io::{self, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

use super::CommandError;

/// A file for a secret, written atomically and readable only by its owner.
pub(super) struct SecretFile<'a> {
    what: &'static str,
    file: &'a Path,
    part: PathBuf,
    temporary: File,
}

impl<'a> SecretFile<'a> {
    /// Opens a temporary file beside `file`. `flag` named it; `what` is the secret, as in "a join
    /// code".
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn prepare(
        file: &'a Path,
        flag: &str,
        what: &'static str,
    ) -> Result<Self, CommandError> {
        let mut part = file.as_os_str().to_owned();
        part.push(".part");
        let part = PathBuf::from(part);
        let open = || {
            if file.is_dir() {
                return Err(io::ErrorKind::IsADirectory.into());
            }
            // A file left by an interrupted process may have another mode.
            match std::fs::remove_file(&part) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
            let mut options = File::options();
            options.write(true).create_new(true).mode(0o600).open(&part)
        };
        match open() {
            Ok(temporary) => Ok(Self {
                what,
                file,
                part,
                temporary,
            }),
            Err(error) => {
                let file = file.display();
                Err(format!(
                    "{flag}: {what} cannot be written to {file}: {error}; nothing was created"
                )
                .into())
            }
        }
    }

    /// Writes the secret.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(super) fn write(mut self, secret: &str) -> Result<(), CommandError> {
        writeln!(self.temporary, "{secret}")
            .and_then(|()| std::fs::rename(&self.part, self.file))
            .map_err(|error| {
                format!(
                    "everything was created, but {} cannot be written to {}: {error}",
                    self.what,
                    self.file.display()
                )
                .into()
            })
    }
}

impl Drop for SecretFile<'_> {
    fn drop(&mut self) {
        // After success it no longer exists.
        let _ = std::fs::remove_file(&self.part);
    }
}

#[cfg(test)]
mod tests {
    use crate::secret_file::*;

    fn prepare(file: &Path) -> Result<SecretFile<'_>, CommandError> {
        SecretFile::prepare(file, "--code-file", "a join code")
    }

    #[test]
    fn a_secret_is_left_for_its_owner_alone() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("code");
        for code in ["BCDF2345", "BCDF2346"] {
            let prepared = prepare(&file).expect("it can be written");
            prepared.write(code).expect("written");
        }
        assert_eq!(std::fs::read_to_string(&file).expect("read"), "BCDF2346\n");
        let mode = std::fs::metadata(&file)
            .expect("it is there")
            .permissions()
            .mode();
        assert_eq!(mode & 0o777, 0o600);
    }

    #[test]
    fn a_file_that_gets_no_secret_leaves_nothing_behind() {
        let folder = tempfile::tempdir().expect("a folder");
        drop(prepare(&folder.path().join("code")).expect("it can be written"));
        let left = std::fs::read_dir(folder.path())
            .expect("the folder")
            .count();
        assert_eq!(left, 0);
        let refused = prepare(folder.path())
            .err()
            .expect("a folder is not a file");
        assert!(
            refused
                .to_string()
                .starts_with("--code-file: a join code cannot"),
            "{refused}"
        );
    }
}
