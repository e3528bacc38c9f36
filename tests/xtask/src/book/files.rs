//! The files of the source tree.

use std::fs;
use std::path::Path;

use crate::failure::Failure;
use crate::setup::at;

/// Folders without sources.
const NOT_SOURCES: [&str; 5] = ["target", "node_modules", "dist", "__pycache__", "venv"];

/// The files in a folder of the source tree and in those in it whose names end like this, by
/// their paths in the tree.
pub(super) fn files(root: &Path, folder: &str, ending: &str) -> Result<Vec<String>, Failure> {
    let mut files = Vec::new();
    let path = root.join(folder);
    let mut entries = fs::read_dir(&path)
        .and_then(Iterator::collect::<std::io::Result<Vec<_>>>)
        .map_err(|error| at(&path, &error))?;
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with('.') || NOT_SOURCES.contains(&name.as_str()) {
            continue;
        }
        let path = match folder {
            "" => name,
            folder => format!("{folder}/{name}"),
        };
        if entry.path().is_dir() {
            files.extend(self::files(root, &path, ending)?);
        } else if path.ends_with(ending) {
            files.push(path);
        }
    }
    Ok(files)
}
