//! Records as JSON Lines: one `RecordLine` a line in its canonical JSON form. A file appears whole or not at all. Whether a record's lines
//! go together is decided in [`crate::replay`].

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Read as _, Write};
use std::path::{Path, PathBuf};

use chefshat_proto::v1::RecordLine;

/// Version of the form that this crate writes, and the newest that it reads.
pub const FORMAT_VERSION: u32 = 1;
/// Longest line of a record, bytes: the largest decision, with all its invalid attempts and annotations, takes a fraction of it.
pub const MAX_LINE_BYTES: usize = 1024 * 1024;
/// Most lines of a record: a server aborts a game that grows beyond a million events, and decisions are fewer.
pub const MAX_LINES: usize = 4_000_000;

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
    #[error("{path}: line {line} {problem}")]
    Line {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// What is wrong with it.
        problem: LineProblem,
    },
}

/// Why a line of a file is no line of a record.
#[derive(Debug, thiserror::Error)]
pub enum LineProblem {
    /// There is no line at all.
    #[error("is missing: the file is empty")]
    Empty,
    /// The file ends within the line.
    #[error("is cut off: the file was not written or copied to its end")]
    CutOff,
    /// It is no text.
    #[error("is not UTF-8 text (at byte {0} of the line)")]
    NotText(usize),
    /// It is longer than any line of a record.
    #[error("is longer than {MAX_LINE_BYTES} bytes, the most that a line of a record may have")]
    TooLong,
    /// There are more lines than any record has.
    #[error("is one too many: a record has at most {MAX_LINES} lines")]
    TooMany,
    /// It is not JSON.
    #[error("is not JSON: {0}")]
    NotJson(String),
    /// It is JSON of something else.
    #[error("is not a line of a record: {0}")]
    NotARecord(String),
}

/// Where the record of a game lies under a data directory: `records/GAME-ID.jsonl`.
pub fn path_of(data_dir: &Path, game_id: &str) -> PathBuf {
    data_dir.join("records").join(format!("{game_id}.jsonl"))
}

/// Writes a record: to a temporary file beside `path`, synced, then renamed, and the folder synced.
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
    let written = write_and_sync(&temporary, lines)
        .and_then(|()| std::fs::rename(&temporary, path))
        .and_then(|()| sync_folder_of(path));
    if written.is_err() {
        // The part that was written is worth nothing, and its removal may fail for the same reason.
        let _ = std::fs::remove_file(&temporary);
    }
    written.map_err(io)
}

/// Sees to it that the folder of a file knows the file for good.
fn sync_folder_of(path: &Path) -> std::io::Result<()> {
    let folder = path.parent().filter(|folder| *folder != Path::new(""));
    File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
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
    let mut file = BufReader::new(File::open(path).map_err(io)?);
    let (mut lines, mut bytes) = (Vec::new(), Vec::new());
    loop {
        let at = |problem| RecordFileError::Line {
            path: path.to_path_buf(),
            line: lines.len() + 1,
            problem,
        };
        bytes.clear();
        let most = u64::try_from(MAX_LINE_BYTES).expect("a mebibyte") + 1;
        let read = (&mut file).take(most).read_until(b'\n', &mut bytes);
        if read.map_err(io)? == 0 {
            break;
        }
        let ended = bytes.last() == Some(&b'\n');
        if bytes.len() > MAX_LINE_BYTES {
            return Err(at(LineProblem::TooLong));
        }
        if lines.len() >= MAX_LINES {
            return Err(at(LineProblem::TooMany));
        }
        match parse(&bytes) {
            Ok(line) => lines.push(line),
            // A file that was cut within a line has no end of it either.
            Err(_) if !ended => return Err(at(LineProblem::CutOff)),
            Err(problem) => return Err(at(problem)),
        }
    }
    if lines.is_empty() {
        return Err(RecordFileError::Line {
            path: path.to_path_buf(),
            line: 1,
            problem: LineProblem::Empty,
        });
    }
    Ok(lines)
}

fn parse(bytes: &[u8]) -> Result<RecordLine, LineProblem> {
    let text = std::str::from_utf8(bytes)
        .map_err(|error| LineProblem::NotText(error.valid_up_to() + 1))?;
    serde_json::from_str(text).map_err(|error| {
        // The parser sees one line at a time: its number says nothing.
        let said = error.to_string();
        let said = said
            .rsplit_once(" at line ")
            .map_or(said.as_str(), |(said, _)| said);
        if error.is_data() {
            LineProblem::NotARecord(said.to_owned())
        } else {
            LineProblem::NotJson(format!("{said} (column {})", error.column()))
        }
    })
}
