//! The folder for games on disk, and the speed of that disk.

use std::io::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::error::LoadError;
use crate::options::Load;

/// Duration of the measurement.
const LOOK: Duration = Duration::from_millis(500);
/// Size of a small write: a page of the database.
const PAGE_BYTES: usize = 4_096;

/// An empty folder on the disk to measure, deleted when dropped.
pub(crate) fn folder(load: &Load) -> Result<TempDir, LoadError> {
    match &load.disk {
        Some(folder) => tempfile::tempdir_in(folder),
        None => tempfile::tempdir(),
    }
    .map_err(LoadError::io("making a temporary folder"))
}

/// Small writes per second, each synced before the next.
pub(crate) fn syncs_per_second(load: &Load) -> Result<f64, LoadError> {
    let folder = folder(load)?;
    count_syncs(folder.path()).map_err(LoadError::io("writing to the disk"))
}

fn count_syncs(folder: &Path) -> std::io::Result<f64> {
    let mut file = std::fs::File::create(folder.join("syncs"))?;
    let begun = Instant::now();
    let mut syncs = 0u32;
    while begun.elapsed() < LOOK {
        file.write_all(&[0xa5; PAGE_BYTES])?;
        file.sync_data()?;
        syncs += 1;
    }
    Ok(f64::from(syncs) / begun.elapsed().as_secs_f64())
}
