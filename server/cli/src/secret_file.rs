//! Writes a secret to a file for another program: the join code of a room or tournament, its owner
//! token, or a ticket.

use std::io;
use std::path::Path;

use chefshat_record::atomic_file::{AtomicFile, WriteError};

use super::CommandError;

/// A file for a secret, written atomically and readable only by its owner.
pub(super) struct SecretFile<'a> {
    what: &'static str,
    path: &'a Path,
    file: AtomicFile,
}

impl<'a> SecretFile<'a> {
    /// Opens a temporary file beside `path`. `flag` named it; `what` is the secret, as in "a join
    /// code".
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn prepare(
        path: &'a Path,
        flag: &str,
        what: &'static str,
    ) -> Result<Self, CommandError> {
        let opened = match path.is_dir() {
            true => Err(io::ErrorKind::IsADirectory.into()),
            false => AtomicFile::create_private(path).map_err(|error| error.source),
        };
        match opened {
            Ok(file) => Ok(Self { what, path, file }),
            Err(error) => {
                let path = path.display();
                Err(format!(
                    "{flag}: {what} cannot be written to {path}: {error}; nothing was created"
                )
                .into())
            }
        }
    }

    /// [`Self::new_only`] for the owner token of what is to be created.
    ///
    /// # Errors
    /// It exists, or cannot be written.
    pub(super) fn for_owner(path: &'a Path) -> Result<Self, CommandError> {
        Self::new_only(path, "--owner-file", "an owner token")
    }

    /// As [`Self::prepare`], for a secret that lasts. A file that exists may be the only copy of
    /// another one.
    ///
    /// # Errors
    /// It exists, or cannot be written.
    pub(super) fn new_only(
        path: &'a Path,
        flag: &str,
        what: &'static str,
    ) -> Result<Self, CommandError> {
        if path.symlink_metadata().is_ok_and(|it| it.is_file()) {
            let path = path.display();
            return Err(format!(
                "{flag}: {path} exists, and what it contains may be nowhere else: choose another file; nothing was created"
            )
            .into());
        }
        Self::prepare(path, flag, what)
    }

    /// Writes the secret.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(super) fn write(self, secret: &str) -> Result<(), CommandError> {
        let Self {
            what,
            path,
            mut file,
        } = self;
        let written = file.write_all(format!("{secret}\n").as_bytes());
        written
            .and_then(|()| file.finish())
            .map_err(|WriteError { source, .. }| {
                let path = path.display();
                format!("everything was created, but {what} cannot be written to {path}: {source}")
                    .into()
            })
    }
}

/// Writes secrets to those files that there are. Call it before printing, which fails if nobody reads,
/// and return its error after that.
///
/// # Errors
/// A file cannot be written; the others are.
pub(super) fn write_all<const N: usize>(
    secrets: [(Option<SecretFile<'_>>, &str); N],
) -> Result<(), CommandError> {
    let written = secrets.map(|(file, secret)| file.map_or(Ok(()), |file| file.write(secret)));
    written.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use crate::secret_file::*;

    fn prepare(file: &Path) -> Result<SecretFile<'_>, CommandError> {
        SecretFile::prepare(file, "--code-file", "a join code")
    }

    #[test]
    fn a_secret_that_lasts_replaces_no_other() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("owner");
        let prepared = SecretFile::for_owner(&file).expect("it can be written");
        prepared.write("first").expect("written");
        let refused = [
            SecretFile::for_owner(&file),
            SecretFile::new_only(&file, "--ticket-file", "a ticket"),
        ];
        for refused in refused.map(|it| it.err().expect("it exists").to_string()) {
            assert!(refused.contains("choose another file"), "{refused}");
        }
        assert_eq!(std::fs::read_to_string(&file).expect("read"), "first\n");
    }

    #[cfg(unix)]
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
