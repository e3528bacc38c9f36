//! Records as JSON Lines: one `RecordLine` a line in its canonical JSON form. A file appears whole or not at all.

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

use chefshat_proto::v1::RecordLine;

/// Version of the form that this crate writes, and the newest that it reads.
pub const FORMAT_VERSION: u32 = 1;

/// Why a record could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordFileError {
    /// The file system refused.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A line is not a record line.
    #[error("{path}: line {line} is not a line of a record: {source}")]
    Line {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// What is wrong with it.
        source: serde_json::Error,
    },
}

/// Where the record of a game lies under a data directory: `records/GAME-ID.jsonl`.
pub fn path_of(data_dir: &Path, game_id: &str) -> PathBuf {
    data_dir.join("records").join(format!("{game_id}.jsonl"))
}

/// Writes a record: to a temporary file beside `path`, synced, then renamed.
///
/// # Errors
/// The first failure of the file system; `path` is then as it was.
pub fn write(path: &Path, lines: &[RecordLine]) -> Result<(), RecordFileError> {
    let io = |source| RecordFileError::Io {
        path: path.to_path_buf(),
        source,
    };
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(io)?;
    }
    let temporary = path.with_extension("jsonl.part");
    let written =
        write_and_sync(&temporary, lines).and_then(|()| std::fs::rename(&temporary, path));
    if written.is_err() {
        // The part that was written is worth nothing, and its removal may fail for the same reason.
        let _ = std::fs::remove_file(&temporary);
    }
    written.map_err(io)
}

fn write_and_sync(path: &Path, lines: &[RecordLine]) -> std::io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    for line in lines {
        serde_json::to_writer(&mut file, line)?;
        file.write_all(b"\n")?;
    }
    file.into_inner()?.sync_all()
}

/// Reads a record.
///
/// # Errors
/// The first failure of the file system, or the first line that is no record line.
pub fn read(path: &Path) -> Result<Vec<RecordLine>, RecordFileError> {
    let io = |source| RecordFileError::Io {
        path: path.to_path_buf(),
        source,
    };
    let mut lines = Vec::new();
    for (index, line) in BufReader::new(File::open(path).map_err(io)?)
        .lines()
        .enumerate()
    {
        let line = line.map_err(io)?;
        lines.push(
            serde_json::from_str(&line).map_err(|source| RecordFileError::Line {
                path: path.to_path_buf(),
                line: index + 1,
                source,
            })?,
        );
    }
    Ok(lines)
}
