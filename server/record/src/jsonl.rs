//! Records as JSON Lines: one `RecordLine` a line in its canonical JSON form. A file appears whole or not at all. Whether a record's lines
//! go together is decided in [`crate::replay`].

mod lists;

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read as _};
use std::path::{Path, PathBuf};

use chefshat_proto::v1::{RecordLine, record_line::Line};

use crate::atomic_file::{AtomicFile, WriteError};
pub use lists::{Excess, excess};

/// Version of the form that this crate writes, and the newest that it reads.
pub const FORMAT_VERSION: u32 = 1;
/// Longest line of a record, bytes: the largest decision, with ten thousand invalid attempts and all its annotations, takes half of it.
pub const MAX_LINE_BYTES: usize = 256 * 1024;
/// Most lines of a record: a server aborts a game that grows beyond a million events, and decisions are fewer.
pub const MAX_LINES: usize = 2_100_000;
/// Largest record, bytes. One of a thousand Shifts has some 25 MB; one of as many events as a server allows stays below it, too.
pub const MAX_RECORD_BYTES: u64 = 512 * 1024 * 1024;

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
    /// With it the record is larger than any.
    #[error("goes beyond the {MAX_RECORD_BYTES} bytes that a record may have")]
    TooLarge,
    /// One of its lists is longer than any record's.
    #[error("has more than {most} entries in `{field}`")]
    LongList {
        /// The field.
        field: &'static str,
        /// Most entries that it may have.
        most: usize,
    },
    /// A record begins a second time.
    #[error("is a second header: a file holds one record")]
    SecondHeader,
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

/// Writes a record, whole or not at all; folders on the way to it are made.
///
/// # Errors
/// The first failure of the file system; `path` is then as it was.
pub fn write(path: &Path, lines: &[RecordLine]) -> Result<(), RecordFileError> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|source| io_error(path, source))?;
    }
    let mut file = AtomicFile::create(path)?;
    for line in lines {
        serde_json::to_writer(&mut file, line).map_err(|error| io_error(path, error.into()))?;
        file.write_all(b"\n")?;
    }
    Ok(file.finish()?)
}

impl From<WriteError> for RecordFileError {
    fn from(WriteError { path, source }: WriteError) -> Self {
        Self::Io { path, source }
    }
}

fn io_error(path: &Path, source: io::Error) -> RecordFileError {
    RecordFileError::Io {
        path: path.to_path_buf(),
        source,
    }
}

/// Reads a record.
///
/// # Errors
/// The first failure of the file system, or the first line that is no record line, or that no record can have there.
pub fn read(path: &Path) -> Result<Vec<RecordLine>, RecordFileError> {
    let file = File::open(path).map_err(|source| io_error(path, source))?;
    let mut lines = Vec::new();
    match read_lines(BufReader::new(file), MAX_RECORD_BYTES, &mut lines) {
        Ok(()) => Ok(lines),
        Err(Stopped::Io(source)) => Err(io_error(path, source)),
        Err(Stopped::Line(problem)) => Err(RecordFileError::Line {
            path: path.to_path_buf(),
            line: lines.len() + 1,
            problem,
        }),
    }
}

/// Why reading stopped before the end.
#[derive(Debug)]
enum Stopped {
    Io(io::Error),
    /// The line after those that were read.
    Line(LineProblem),
}

impl From<LineProblem> for Stopped {
    fn from(problem: LineProblem) -> Self {
        Self::Line(problem)
    }
}

/// Reads a record of at most so many bytes to its end.
fn read_lines(
    mut file: impl BufRead,
    most_bytes: u64,
    lines: &mut Vec<RecordLine>,
) -> Result<(), Stopped> {
    let most_of_line = u64::try_from(MAX_LINE_BYTES).expect("a fraction of a mebibyte") + 1;
    let (mut bytes, mut all_bytes) = (Vec::new(), 0u64);
    loop {
        bytes.clear();
        let read = (&mut file)
            .take(most_of_line)
            .read_until(b'\n', &mut bytes)
            .map_err(Stopped::Io)?;
        if read == 0 {
            break;
        }
        all_bytes = all_bytes.saturating_add(u64::try_from(read).unwrap_or(u64::MAX));
        if bytes.len() > MAX_LINE_BYTES {
            return Err(LineProblem::TooLong.into());
        }
        if lines.len() >= MAX_LINES {
            return Err(LineProblem::TooMany.into());
        }
        if all_bytes > most_bytes {
            return Err(LineProblem::TooLarge.into());
        }
        let line = parse(&bytes).map_err(|problem| match bytes.last() {
            Some(b'\n') => problem,
            // A file that was cut within a line has no end of it either.
            _ => LineProblem::CutOff,
        })?;
        check(&line, lines.is_empty())?;
        lines.push(line);
    }
    if lines.is_empty() {
        return Err(LineProblem::Empty.into());
    }
    Ok(())
}

/// Checks a line for what would let a small file become large in memory; the rest is left to a replay.
fn check(line: &RecordLine, is_first: bool) -> Result<(), LineProblem> {
    let Some(line) = &line.line else {
        return Ok(());
    };
    if !is_first && matches!(line, Line::Header(_)) {
        return Err(LineProblem::SecondHeader);
    }
    match excess(line) {
        Some(Excess { field, most }) => Err(LineProblem::LongList { field, most }),
        None => Ok(()),
    }
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

#[cfg(test)]
mod tests {
    use crate::jsonl::*;

    #[test]
    fn a_record_of_too_many_bytes_is_refused_where_they_are_too_many() {
        let text = "{\"footer\":{}}\n".repeat(3);
        let size = u64::try_from(text.len()).expect("a few bytes");
        let read = |most| {
            let mut lines = Vec::new();
            let read = read_lines(text.as_bytes(), most, &mut lines);
            (lines.len(), read)
        };
        assert!(matches!(read(size), (3, Ok(()))));
        let too_large = Err::<(), _>(Stopped::Line(LineProblem::TooLarge));
        for (most, whole) in [(size - 1, 2), (size / 3, 1), (0, 0)] {
            let (lines, read) = read(most);
            assert_eq!(lines, whole, "{most}");
            assert_eq!(format!("{read:?}"), format!("{too_large:?}"), "{most}");
        }
    }

    #[test]
    fn as_many_empty_lines_as_there_may_be_take_less_than_two_gibibytes() {
        // They are what takes most memory for its bytes in the file.
        assert!(size_of::<RecordLine>() * MAX_LINES < 2 * 1024 * 1024 * 1024);
    }
}
