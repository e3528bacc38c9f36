//! What a data directory still has of an earlier server whose database is gone. A new database
//! beside it would make the loss look like a first start. And what says that its games have moved.

use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::path::Path;

use chefshat_record::atomic_file::{AtomicFile, WriteError};
use chefshat_record::{jsonl, samples};

/// The file that a server locks while it uses the data directory.
pub const LOCK_FILE: &str = "games.lock";
/// The file that says where the games of a data directory have moved.
pub(super) const MOVED_FILE: &str = "games.moved";
/// What the lock file says once the directory has a database.
const MARK: &[u8] = b"games.sqlite3 exists\n";

/// Notes in the lock file that the directory has a database.
pub(super) fn mark(mut lock: &File) {
    if lock.metadata().is_ok_and(|about| about.len() == 0) {
        // Without the note, records tell as much. A full disk must not stop the server here.
        let _ = lock.write_all(MARK);
    }
}

/// What shows that a locked directory had a database, if anything does. Records alone do not:
/// programs that simulate or download games write such folders. Neither does a key or a file of
/// tokens, which may be created before the first start, nor the lock of a start that failed.
pub(super) fn trace(data_dir: &Path, lock: &File, had_lock: bool) -> Option<String> {
    let mut text = Vec::new();
    let read = lock.take(MARK.len() as u64).read_to_end(&mut text);
    if read.is_ok() && text == MARK {
        return Some(format!("{LOCK_FILE} says that there was one"));
    }
    let folders = [jsonl::folder_of(data_dir), samples::folder_of(data_dir)];
    let found = folders.into_iter().find_map(|folder| {
        let files = std::fs::read_dir(&folder).ok()?.flatten();
        let mut files = files.map(|file| file.path());
        files.find(|path| {
            let ending = path.extension();
            ending.is_some_and(|ending| ending == "jsonl" || ending == samples::ENDING)
        })
    });
    found
        .filter(|_| had_lock)
        .map(|path| format!("{} is there", path.display()))
}

/// Notes that the games of a directory move to an address. No server uses it from now on.
///
/// # Errors
/// The file cannot be written.
pub(crate) fn note_move(data_dir: &Path, address: &str) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(&data_dir.join(MOVED_FILE))?;
    file.write_all(format!("{address}\n").as_bytes())?;
    file.finish()
}

/// Takes the note back: nothing has moved.
pub(crate) fn forget_move(data_dir: &Path) {
    // If it stays, the server that refuses the directory says what to do.
    let _ = std::fs::remove_file(data_dir.join(MOVED_FILE));
}

/// Where the games of a directory have moved, if they have.
///
/// # Errors
/// The file cannot be read.
pub(super) fn moved_to(data_dir: &Path) -> io::Result<Option<String>> {
    match std::fs::read_to_string(data_dir.join(MOVED_FILE)) {
        Ok(address) => Ok(Some(address.trim_end().to_owned())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}
