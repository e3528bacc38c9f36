//! `--ticket-file` of commands that take a seat or a place in a tournament: the file that keeps its
//! ticket until the game or tournament is over, so that the same command can be run again.

use std::path::Path;
use std::{fs, io};

use super::CommandError;
use super::error::tell;
use super::secret_file::SecretFile;

/// The flag.
const FLAG: &str = "--ticket-file";

/// The ticket in a file; `None` without a file, or while it has none.
///
/// # Errors
/// The file is unreadable.
pub(super) fn kept(file: Option<&Path>) -> Result<Option<String>, CommandError> {
    let Some(file) = file else {
        return Ok(None);
    };
    match fs::read_to_string(file) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(format!("{FLAG}: {}: {error}", file.display()).into()),
        Ok(text) => Ok(Some(text.trim().to_owned()).filter(|ticket| !ticket.is_empty())),
    }
}

/// Prepares the file for a ticket: before there is one, which would be lost.
///
/// # Errors
/// The file cannot be written.
pub(super) fn prepare(file: Option<&Path>) -> Result<Option<SecretFile<'_>>, CommandError> {
    let prepare = |file| SecretFile::prepare(file, FLAG, "a ticket");
    file.map(prepare).transpose()
}

/// Keeps a ticket in its file. Without one, tells the person who started the command, and nobody else,
/// what it is for: it grants the seat or place.
pub(super) fn keep(file: Option<SecretFile<'_>>, ticket: &str, what_for: &str) {
    match file.map(|file| file.write(ticket)) {
        Some(Ok(())) => return,
        Some(Err(error)) => tell(error),
        None => {}
    }
    tell(format_args!("{what_for} with --ticket {ticket}"));
}

/// Deletes the file of a ticket that is used up, unless it has another one by now.
pub(super) fn forget(file: Option<&Path>, ticket: &str) {
    let Some(file) = file.filter(|file| file.is_file()) else {
        return;
    };
    if kept(Some(file)).is_ok_and(|kept| kept.as_deref() == Some(ticket))
        && let Err(error) = fs::remove_file(file)
    {
        let file = file.display();
        tell(format_args!("{FLAG}: {file} cannot be deleted: {error}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ticket_is_kept_until_it_is_used_up() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("ticket");
        let file = Some(path.as_path());
        let kept_now = || kept(file).expect("it can be read");
        assert_eq!(kept_now(), None);
        keep(prepare(file).expect("it can be written"), "T", "resume");
        assert_eq!(kept_now().as_deref(), Some("T"));
        forget(file, "of another game");
        assert_eq!(kept_now().as_deref(), Some("T"));
        forget(file, "T");
        assert!(!path.exists());
        assert_eq!(kept(None).expect("no file"), None);
        kept(Some(folder.path())).expect_err("it is a folder");
    }
}
