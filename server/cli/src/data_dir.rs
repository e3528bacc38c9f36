//! The data directory, which has the database and the records.

use std::path::PathBuf;

use etcetera::BaseStrategy as _;

use super::CommandError;

/// The given or default data directory, created with its folder of records.
pub(super) fn prepare(wanted: Option<PathBuf>) -> Result<PathBuf, CommandError> {
    let folder = name(wanted)?;
    std::fs::create_dir_all(folder.join("records")).map_err(|error| {
        format!(
            "cannot use the data directory {}: {error}; choose another with --data-dir",
            folder.display()
        )
    })?;
    Ok(folder)
}

/// The given or default data directory; it may not exist.
pub(super) fn name(wanted: Option<PathBuf>) -> Result<PathBuf, CommandError> {
    wanted.map_or_else(default, Ok)
}

/// The existing folder of records in the given or default data directory.
///
/// # Errors
/// It does not exist.
pub(super) fn records(wanted: Option<PathBuf>) -> Result<PathBuf, CommandError> {
    let folder = name(wanted)?;
    let records = folder.join("records");
    if records.is_dir() {
        Ok(records)
    } else {
        Err(format!(
            "there are no records in {} yet; name files or folders, or choose another data directory with --data-dir",
            folder.display()
        )
        .into())
    }
}

/// `chefshat` in the user's data directory, by the XDG base directory specification.
fn default() -> Result<PathBuf, CommandError> {
    let base = etcetera::choose_base_strategy()
        .map_err(|_| "there is no home directory for records; choose one with --data-dir")?;
    Ok(base.data_dir().join("chefshat"))
}
