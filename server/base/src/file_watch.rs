//! Notices that files were changed, by looking at them: the tokens file and the certificate. It
//! follows symbolic links, so a link that is turned to another file counts as a change.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// What changes with a file's content: its time and size, and on Unix its number.
type Mark = Option<(Option<SystemTime>, u64, u64)>;

/// Files that are looked at from time to time.
#[derive(Debug)]
pub struct FileWatch {
    paths: Vec<PathBuf>,
    /// As they were when they were read.
    read: Vec<Mark>,
    /// As they were when they could not be read.
    failed: Option<Vec<Mark>>,
}

impl FileWatch {
    /// Watches these files, which may not exist.
    pub fn of<'a>(paths: impl IntoIterator<Item = &'a Path>) -> Self {
        let paths: Vec<_> = paths.into_iter().map(Path::to_path_buf).collect();
        Self {
            read: marks(&paths),
            paths,
            failed: None,
        }
    }

    /// Runs `read` if any of the files has changed since it last succeeded. It fails silently if it
    /// failed before and nothing has changed since.
    ///
    /// # Errors
    /// `read` failed for the first time.
    pub fn read_changed<E>(&mut self, read: impl FnOnce() -> Result<(), E>) -> Result<(), E> {
        let marks = marks(&self.paths);
        if marks == self.read {
            return Ok(());
        }
        match read() {
            Ok(()) => {
                self.read = marks;
                self.failed = None;
                Ok(())
            }
            Err(_) if self.failed.as_ref() == Some(&marks) => Ok(()),
            Err(error) => {
                self.failed = Some(marks);
                Err(error)
            }
        }
    }
}

fn marks(paths: &[PathBuf]) -> Vec<Mark> {
    paths.iter().map(|path| mark(path)).collect()
}

fn mark(path: &Path) -> Mark {
    let metadata = std::fs::metadata(path).ok()?;
    #[cfg(unix)]
    let number = std::os::unix::fs::MetadataExt::ino(&metadata);
    #[cfg(not(unix))]
    let number = 0;
    Some((metadata.modified().ok(), metadata.len(), number))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a watch reads its files, and `result` is what that gives.
    fn reads(watch: &mut FileWatch, result: Result<(), ()>) -> (bool, Result<(), ()>) {
        let mut read = false;
        let result = watch.read_changed(|| {
            read = true;
            result
        });
        (read, result)
    }

    #[test]
    fn a_file_that_is_made_replaced_or_removed_is_read_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let (path, other) = (folder.path().join("a"), folder.path().join("b"));
        let mut watch = FileWatch::of([path.as_path()]);
        assert!(!reads(&mut watch, Ok(())).0);
        std::fs::write(&path, "1").expect("written");
        assert!(reads(&mut watch, Ok(())).0);
        assert!(!reads(&mut watch, Ok(())).0);
        std::fs::write(&other, "2").expect("written");
        std::fs::rename(&other, &path).expect("renamed");
        assert!(reads(&mut watch, Ok(())).0);
        std::fs::remove_file(&path).expect("removed");
        assert!(reads(&mut watch, Ok(())).0);
        assert!(!reads(&mut watch, Ok(())).0);
    }

    #[test]
    fn what_cannot_be_read_is_tried_again_and_reported_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a");
        let mut watch = FileWatch::of([path.as_path()]);
        std::fs::write(&path, "1").expect("written");
        assert_eq!(reads(&mut watch, Err(())), (true, Err(())));
        assert_eq!(reads(&mut watch, Err(())), (true, Ok(())));
        std::fs::write(&path, "12").expect("written");
        assert_eq!(reads(&mut watch, Err(())), (true, Err(())));
        assert_eq!(reads(&mut watch, Ok(())), (true, Ok(())));
        assert_eq!(reads(&mut watch, Ok(())), (false, Ok(())));
    }
}
