//! The data directory, which has the database and the records.

use std::path::{Path, PathBuf};

use chefshat_record::files::{Found, find_records};
use clap::Args;
use etcetera::BaseStrategy as _;

use super::CommandError;

/// The given or default data directory, created with its folder of records.
pub fn prepare(wanted: Option<PathBuf>) -> Result<PathBuf, CommandError> {
    let folder = name(wanted)?;
    create(&folder, "records")?;
    Ok(folder)
}

/// The given or default data directory, created without a folder of records, which a node of a
/// cluster does not have. A directory that exists may be read-only.
pub fn prepare_without_records(wanted: Option<PathBuf>) -> Result<PathBuf, CommandError> {
    let folder = name(wanted)?;
    create(&folder, "")?;
    Ok(folder)
}

/// Creates a folder inside a data directory, and the directory.
fn create(data_dir: &Path, folder: &str) -> Result<(), CommandError> {
    std::fs::create_dir_all(data_dir.join(folder)).map_err(|error| {
        format!(
            "cannot use the data directory {}: {error}; choose another with --data-dir",
            data_dir.display()
        )
        .into()
    })
}

/// The given or default data directory; it may not exist.
pub fn name(wanted: Option<PathBuf>) -> Result<PathBuf, CommandError> {
    wanted.map_or_else(default, Ok)
}

/// Records to read.
#[derive(Debug, Args)]
pub struct RecordsArg {
    /// Records (GAME-ID.jsonl) or directories of them. Default: the records of the data directory.
    #[arg(value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Data directory to read records from if no PATH is given. Default: chefshat in the user's
    /// data directory.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
}

impl RecordsArg {
    /// The files of the records, at least one, and the paths where none is.
    ///
    /// # Errors
    /// There are none.
    pub fn find(&self) -> Result<Found, CommandError> {
        let found = |paths: &[PathBuf]| {
            let mut found = find_records(paths);
            match found.files.is_empty() && !found.missing.is_empty() {
                true => Err(found.missing.swap_remove(0).into()),
                false => Ok(found),
            }
        };
        if !self.paths.is_empty() {
            return found(&self.paths);
        }
        let folder = name(self.data_dir.clone())?;
        let records = folder.join("records");
        if records.is_dir() {
            return found(&[records]);
        }
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
