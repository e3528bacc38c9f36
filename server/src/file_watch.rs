//! Notices that files were changed, by looking at them: the tokens file and the certificate. It
//! follows symbolic links, so a link that is turned to another file counts as a change.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// What changes with a file's content: its time and size, and on Unix its number.
type Mark = Option<(Option<SystemTime>, u64, u64)>;

/// Files that are looked at from time to time.
#[derive(Debug)]
pub struct FileWatch {
    files: Vec<(PathBuf, Mark)>,
}

impl FileWatch {
    /// Watches these files, which may not exist.
    pub fn of<'a>(files: impl IntoIterator<Item = &'a Path>) -> Self {
        let marked = |path: &'a Path| (path.to_path_buf(), mark(path));
        Self {
            files: files.into_iter().map(marked).collect(),
        }
    }

    /// Whether any of the files has changed since the last look.
    pub fn has_changed(&mut self) -> bool {
        let mut changed = false;
        for (path, known) in &mut self.files {
            let now = mark(path);
            changed |= now != *known;
            *known = now;
        }
        changed
    }
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

    #[test]
    fn a_file_that_is_made_replaced_or_removed_has_changed() {
        let folder = tempfile::tempdir().expect("a folder");
        let (path, other) = (folder.path().join("a"), folder.path().join("b"));
        let mut watch = FileWatch::of([path.as_path()]);
        assert!(!watch.has_changed());
        std::fs::write(&path, "1").expect("written");
        assert!(watch.has_changed());
        assert!(!watch.has_changed());
        std::fs::write(&other, "2").expect("written");
        std::fs::rename(&other, &path).expect("renamed");
        assert!(watch.has_changed());
        std::fs::remove_file(&path).expect("removed");
        assert!(watch.has_changed());
        assert!(!watch.has_changed());
    }
}
