//! Reads and writes records as JSON Lines, one `RecordLine` in canonical JSON per line. Writes are
//! atomic. Contents are verified in [`crate::replay`].

mod lists;

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read as _};
use std::path::{Path, PathBuf};

use chefshat_engine::MAX_SEATS;
use chefshat_engine::limits::MAX_ANNOTATION_BYTES_PER_GAME;
use chefshat_proto::v1::{GameEvent, RecordLine, game_event::Kind, record_line::Line};
use prost::Message;

use crate::atomic_file::{AtomicFile, WriteError};
use crate::private;
use crate::signature::TextHash;
use crate::words::printable;
pub use lists::{Excess, excess};

/// The format version that this crate writes, and the newest it reads.
pub const FORMAT_VERSION: u32 = 1;
/// The longest line, bytes. The largest decision, with ten thousand invalid attempts and all
/// annotations, takes half of it.
pub const MAX_LINE_BYTES: usize = 256 * 1024;
/// The most lines. A server aborts a game after a million events, and decisions are fewer.
pub const MAX_LINES: usize = 2_100_000;
/// The largest record, bytes. A thousand Shifts take about 25 MB; the most events a server allows
/// also stay below it.
pub const MAX_RECORD_BYTES: u64 = 512 * 1024 * 1024;

/// The most annotations of a record, bytes of their messages: each seat has its share.
pub const MAX_ANNOTATION_BYTES_PER_RECORD: usize = MAX_SEATS * MAX_ANNOTATION_BYTES_PER_GAME;

/// A failure to write or read a record.
#[derive(Debug, thiserror::Error)]
pub enum RecordFileError {
    /// An error of the file system.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Its cause.
        source: std::io::Error,
    },
    /// A line is not a record line.
    #[error("{path}: line {line} {problem}")]
    Line {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// The problem.
        problem: LineProblem,
    },
}

/// Why a line of a file is not a line of a record.
#[derive(Debug, thiserror::Error)]
pub enum LineProblem {
    /// The file is empty.
    #[error("is missing: the file is empty")]
    Empty,
    /// The file ends within the line.
    #[error("is truncated: the file was not written or copied completely")]
    CutOff,
    /// The line is not UTF-8.
    #[error("is not UTF-8 text (at byte {0} of the line)")]
    NotText(usize),
    /// The line exceeds [`MAX_LINE_BYTES`].
    #[error("is longer than {MAX_LINE_BYTES} bytes, the most a line may have")]
    TooLong,
    /// The file exceeds [`MAX_LINES`], or what its reader allows.
    #[error("is one too many: this record may have at most {0} lines")]
    TooMany(usize),
    /// The file exceeds [`MAX_RECORD_BYTES`].
    #[error("exceeds the {MAX_RECORD_BYTES} bytes a record may have")]
    TooLarge,
    /// The line has nothing.
    #[error("is empty")]
    Nothing,
    /// A list exceeds its bound.
    #[error("has more than {most} entries in `{field}`")]
    LongList {
        /// The field.
        field: &'static str,
        /// The most entries allowed.
        most: usize,
    },
    /// The file contains a second header.
    #[error("is a second header: a file holds one record")]
    SecondHeader,
    /// The line starts the game again.
    #[error("starts the game a second time: a file holds one record")]
    SecondStart,
    /// The annotations of all lines so far exceed [`MAX_ANNOTATION_BYTES_PER_RECORD`].
    #[error(
        "is one too many with annotations: a record has at most {MAX_ANNOTATION_BYTES_PER_RECORD} bytes of them"
    )]
    Annotations,
    /// The line is not JSON.
    #[error("is not JSON: {0}")]
    NotJson(String),
    /// The line is JSON, but not a `RecordLine`.
    #[error("is not a line of a record: {0}")]
    NotARecord(String),
}

/// The folder of the records in a data directory.
pub fn folder_of(data_dir: &Path) -> PathBuf {
    data_dir.join("records")
}

/// The path of a game's record in a data directory: `records/GAME-ID.jsonl`.
pub fn path_of(data_dir: &Path, game_id: &str) -> PathBuf {
    folder_of(data_dir).join(format!("{game_id}.jsonl"))
}

/// Removes what killed writers left in the `records` folder of a data directory: files that end in
/// `.part`. The caller holds the data directory, so that no writer is at work.
///
/// # Errors
/// The first error of the file system. A folder that does not exist is none.
pub fn remove_unfinished(data_dir: &Path) -> io::Result<()> {
    let entries = match std::fs::read_dir(folder_of(data_dir)) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries?,
    };
    for entry in entries {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == "part") {
            std::fs::remove_file(path)?;
        }
    }
    Ok(())
}

/// Writes a record atomically, creating parent folders.
///
/// # Errors
/// The first error of the file system; `path` is then unchanged.
pub fn write(path: &Path, lines: &[RecordLine]) -> Result<(), RecordFileError> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|source| io_error(path, source))?;
    }
    let file = AtomicFile::create(path)?;
    write_to(file, path, all_of(lines))
}

/// Passes on lines that are all in memory, for [`write_private`].
pub fn all_of(lines: &[RecordLine]) -> impl FnOnce(&mut dyn FnMut(&RecordLine)) -> io::Result<()> {
    move |write| {
        lines.iter().for_each(write);
        Ok(())
    }
}

/// Copies the text of a record atomically, creating parent folders.
///
/// # Errors
/// The first error of the file system; `to` is then unchanged.
pub fn copy(from: &Path, to: &Path) -> Result<(), RecordFileError> {
    if let Some(folder) = to.parent() {
        std::fs::create_dir_all(folder).map_err(|source| io_error(to, source))?;
    }
    copy_to(AtomicFile::create(to)?, from)
}

/// [`copy`] into a data directory, as [`write_private`].
///
/// # Errors
/// As [`copy`].
pub fn copy_private(from: &Path, to: &Path) -> Result<(), RecordFileError> {
    if let Some(folder) = to.parent() {
        private::create_folder(folder).map_err(|source| io_error(to, source))?;
    }
    copy_to(AtomicFile::create_private(to)?, from)
}

fn copy_to(mut file: AtomicFile, from: &Path) -> Result<(), RecordFileError> {
    let text = File::open(from).and_then(|mut text| io::copy(&mut text, &mut file));
    text.map_err(|source| io_error(from, source))?;
    Ok(file.finish()?)
}

/// Writes a record, whose lines `lines` passes on one by one, into a data directory. Only its owner
/// may look into the folder of the records, as into the database: they have expressions that were
/// not public.
///
/// # Errors
/// The first error of the file system, or that of `lines`; the record is then unchanged.
pub fn write_private(
    path: &Path,
    lines: impl FnOnce(&mut dyn FnMut(&RecordLine)) -> io::Result<()>,
) -> Result<(), RecordFileError> {
    if let Some(folder) = path.parent() {
        private::create_folder(folder).map_err(|source| io_error(path, source))?;
    }
    write_to(AtomicFile::create_private(path)?, path, lines)
}

fn write_to(
    mut file: AtomicFile,
    path: &Path,
    lines: impl FnOnce(&mut dyn FnMut(&RecordLine)) -> io::Result<()>,
) -> Result<(), RecordFileError> {
    let mut written = Ok(());
    let passed_on = lines(&mut |line| {
        if written.is_ok() {
            written = write_line(&mut file, line);
        }
    });
    written
        .and(passed_on)
        .map_err(|source| io_error(path, source))?;
    Ok(file.finish()?)
}

fn write_line(mut to: impl io::Write, line: &RecordLine) -> io::Result<()> {
    serde_json::to_writer(&mut to, line)?;
    to.write_all(b"\n")
}

/// The text of a record.
///
/// # Errors
/// A line has no JSON form: a number is not finite.
pub fn text(lines: &[RecordLine]) -> io::Result<Vec<u8>> {
    let mut text = Vec::new();
    for line in lines {
        write_line(&mut text, line)?;
    }
    Ok(text)
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

/// A record from a file.
#[derive(Debug, Clone, Default)]
pub struct Record {
    /// Its lines.
    pub lines: Vec<RecordLine>,
    /// The hash of its text as it stands in the file, which is what was signed.
    pub text: TextHash,
}

/// Reads a record.
///
/// # Errors
/// The first error of the file system, or the first line that is malformed or exceeds a bound.
pub fn read(path: &Path) -> Result<Vec<RecordLine>, RecordFileError> {
    read_record(path).map(|record| record.lines)
}

/// Reads a record with the hash of its text, to verify its signature.
///
/// # Errors
/// See [`read`].
pub fn read_record(path: &Path) -> Result<Record, RecordFileError> {
    read_record_of(path, MAX_LINES)
}

/// As [`read_record`], for a record of at most this many lines, each of which takes memory.
///
/// # Errors
/// See [`read`].
pub fn read_record_of(path: &Path, most_lines: usize) -> Result<Record, RecordFileError> {
    let file = File::open(path).map_err(|source| io_error(path, source))?;
    read_within(path, BufReader::new(file), most_lines)
}

/// Reads a record from anything that has its text. `path` names it in errors.
///
/// # Errors
/// See [`read`].
pub fn read_text(path: &Path, text: impl BufRead) -> Result<Record, RecordFileError> {
    read_within(path, text, MAX_LINES)
}

fn read_within(
    path: &Path,
    text: impl BufRead,
    most_lines: usize,
) -> Result<Record, RecordFileError> {
    let mut record = Record::default();
    match read_lines(text, MAX_RECORD_BYTES, most_lines, &mut record) {
        Ok(()) => Ok(record),
        Err(Stopped::Io(source)) => Err(io_error(path, source)),
        Err(Stopped::Line(problem)) => Err(RecordFileError::Line {
            path: path.to_path_buf(),
            line: record.lines.len() + 1,
            problem,
        }),
    }
}

/// Why reading stopped.
#[derive(Debug)]
enum Stopped {
    Io(io::Error),
    /// A problem of the next line.
    Line(LineProblem),
}

impl From<LineProblem> for Stopped {
    fn from(problem: LineProblem) -> Self {
        Self::Line(problem)
    }
}

/// Reads a record of at most `most_bytes` and `most_lines`.
fn read_lines(
    mut file: impl BufRead,
    most_bytes: u64,
    most_lines: usize,
    record: &mut Record,
) -> Result<(), Stopped> {
    let Record { lines, text } = record;
    let most_of_line = u64::try_from(MAX_LINE_BYTES).expect("a fraction of a mebibyte") + 1;
    let (mut bytes, mut all_bytes) = (Vec::new(), 0u64);
    let mut bounds = Bounds::default();
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
        if lines.len() >= most_lines {
            return Err(LineProblem::TooMany(most_lines).into());
        }
        if all_bytes > most_bytes {
            return Err(LineProblem::TooLarge.into());
        }
        let line = parse(&bytes).map_err(|problem| match bytes.last() {
            Some(b'\n') => problem,
            // A truncated file has no final line feed.
            _ => LineProblem::CutOff,
        })?;
        bounds.check(&line, lines.is_empty())?;
        *text = text.and_read(&line, bytes.strip_suffix(b"\n").unwrap_or(&bytes));
        lines.push(line);
    }
    if lines.is_empty() {
        return Err(LineProblem::Empty.into());
    }
    Ok(())
}

/// The bounds that keep a small file from becoming large in memory; the replay checks the rest.
#[derive(Default)]
struct Bounds {
    has_started: bool,
    annotation_bytes: usize,
}

impl Bounds {
    fn check(&mut self, line: &RecordLine, is_first: bool) -> Result<(), LineProblem> {
        let line = line.line.as_ref().ok_or(LineProblem::Nothing)?;
        let starts = |event: &GameEvent| matches!(event.kind, Some(Kind::GameStarted(_)));
        match line {
            Line::Header(_) if !is_first => return Err(LineProblem::SecondHeader),
            Line::Event(event) if starts(event) && self.has_started => {
                return Err(LineProblem::SecondStart);
            }
            Line::Event(event) => self.has_started |= starts(event),
            Line::Decision(decision) => {
                let annotations = decision.annotations.as_ref();
                self.annotation_bytes += annotations.map_or(0, Message::encoded_len);
                if self.annotation_bytes > MAX_ANNOTATION_BYTES_PER_RECORD {
                    return Err(LineProblem::Annotations);
                }
            }
            _ => {}
        }
        match excess(line) {
            Some(Excess { field, most }) => Err(LineProblem::LongList { field, most }),
            None => Ok(()),
        }
    }
}

fn parse(bytes: &[u8]) -> Result<RecordLine, LineProblem> {
    let text = std::str::from_utf8(bytes)
        .map_err(|error| LineProblem::NotText(error.valid_up_to() + 1))?;
    serde_json::from_str(text).map_err(|error| {
        // The parser sees one line at a time; drop its line number.
        let message = error.to_string();
        let message = message
            .rsplit_once(" at line ")
            .map_or(message.as_str(), |(message, _)| message);
        if error.is_data() {
            // It quotes the line, which could otherwise write anything to a terminal.
            LineProblem::NotARecord(printable(message))
        } else {
            LineProblem::NotJson(format!("{message} (column {})", error.column()))
        }
    })
}

#[cfg(test)]
mod tests {
    use crate::jsonl::*;

    #[test]
    fn a_record_is_rejected_at_the_line_that_exceeds_the_bytes_allowed() {
        let text = "{\"footer\":{}}\n".repeat(3);
        let size = u64::try_from(text.len()).expect("a few bytes");
        let read = |most| {
            let mut record = Record::default();
            let read = read_lines(text.as_bytes(), most, MAX_LINES, &mut record);
            (record.lines.len(), read)
        };
        assert!(matches!(read(size), (3, Ok(()))));
        let too_large = Err::<(), _>(Stopped::Line(LineProblem::TooLarge));
        for (most, complete) in [(size - 1, 2), (size / 3, 1), (0, 0)] {
            let (lines, read) = read(most);
            assert_eq!(lines, complete, "{most}");
            assert_eq!(format!("{read:?}"), format!("{too_large:?}"), "{most}");
        }
    }

    #[test]
    fn a_small_file_takes_little_memory() {
        // The shortest lines take the most memory per byte of the file.
        assert!(size_of::<RecordLine>() <= 200);
        let read = |text: &str, most| {
            let mut record = Record::default();
            let read = read_lines(text.as_bytes(), MAX_RECORD_BYTES, most, &mut record);
            (record.lines.len(), read)
        };
        assert!(matches!(
            read("{}\n", MAX_LINES),
            (0, Err(Stopped::Line(LineProblem::Nothing)))
        ));
        // Six seats of a start take a kilobyte.
        let start = "{\"event\":{\"gameStarted\":{\"seats\":[{},{},{},{},{},{}]}}}\n";
        assert!(matches!(
            read(&start.repeat(2), MAX_LINES),
            (1, Err(Stopped::Line(LineProblem::SecondStart)))
        ));
        // So does an entry of a few bytes.
        let keys: Vec<String> = (0..500).map(|key| format!("\"{key:03}\":\"\"")).collect();
        let annotations = format!("{{\"extra\":{{{}}}}}", keys.join(","));
        let decision = format!("{{\"decision\":{{\"annotations\":{annotations}}}}}\n");
        let (lines, too_many) = read(&decision.repeat(1_000), MAX_LINES);
        assert!((300..500).contains(&lines), "{lines}");
        assert!(matches!(
            too_many,
            Err(Stopped::Line(LineProblem::Annotations))
        ));
        let text = "{\"event\":{}}\n".repeat(3);
        assert!(matches!(read(&text, 3), (3, Ok(()))));
        let (lines, too_many) = read(&text, 2);
        assert_eq!(lines, 2);
        assert!(matches!(
            too_many,
            Err(Stopped::Line(LineProblem::TooMany(2)))
        ));
    }
}
