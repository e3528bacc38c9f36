//! The folder in which a server keeps its records.

use std::path::PathBuf;

use super::CommandError;

/// The folder asked for, or the standard one, made ready for records.
pub(super) fn prepare(wanted: Option<PathBuf>) -> Result<PathBuf, CommandError> {
    let folder = name(wanted)?;
    std::fs::create_dir_all(folder.join("records")).map_err(|error| {
        format!(
            "the data folder {} cannot be used: {error}; choose another with --data-dir",
            folder.display()
        )
    })?;
    Ok(folder)
}

/// The folder asked for, or the standard one, whether it is there or not.
pub(super) fn name(wanted: Option<PathBuf>) -> Result<PathBuf, CommandError> {
    wanted.map_or_else(standard, Ok)
}

/// The folder of records in the data folder asked for, or in the standard one. It is not made.
pub(super) fn records(wanted: Option<PathBuf>) -> Result<PathBuf, CommandError> {
    let folder = name(wanted)?;
    let records = folder.join("records");
    if records.is_dir() {
        Ok(records)
    } else {
        Err(format!(
            "there are no records in {} yet; name files or folders, or another data folder with --data-dir",
            folder.display()
        )
        .into())
    }
}

/// `chefshat` in the user's data folder, as the XDG base directory specification has it.
fn standard() -> Result<PathBuf, CommandError> {
    let absolute = |name| {
        std::env::var_os(name)
            .map(PathBuf::from)
            .filter(|path| path.is_absolute())
    };
    absolute("XDG_DATA_HOME")
        .or_else(|| absolute("HOME").map(|home| home.join(".local/share")))
        .map(|folder| folder.join("chefshat"))
        .ok_or_else(|| "there is no home folder for records; name one with --data-dir".into())
}
