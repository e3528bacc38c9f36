//! Streams of samples (affect, gaze, physiology) of the seats of a game, in files beside its record:
//! `samples/GAME-ID.SEAT.samples` in a data directory, one `SampleChunk` after the other, each
//! preceded by its length as in protocol buffers. A chunk that was not written completely is ignored.

use std::fs::File;
use std::io::{self, BufReader, Read as _};
use std::path::{Path, PathBuf};

use chefshat_engine::MAX_SEATS;
use chefshat_proto::v1::SampleChunk;
use prost::Message as _;

use crate::atomic_file;
use crate::convert::FieldProblem;

/// Most samples of a chunk.
pub const MAX_SAMPLES_PER_CHUNK: usize = 512;
/// Most channels of a stream.
pub const MAX_CHANNELS: usize = 16;
/// Longest name of a stream or channel, bytes.
pub const MAX_NAME: usize = 32;
/// Largest encoded chunk, bytes. Those that a server accepts are smaller.
const MAX_CHUNK_BYTES: usize = 256 * 1024;
/// What the name of a file of samples ends with.
pub const ENDING: &str = "samples";

/// The folder of the samples in a data directory.
pub fn folder_of(data_dir: &Path) -> PathBuf {
    data_dir.join("samples")
}

/// The file of a seat's samples in a data directory.
pub fn path_of(data_dir: &Path, game_id: &str, seat: usize) -> PathBuf {
    folder_of(data_dir).join(format!("{game_id}.{seat}.{ENDING}"))
}

/// The file of a seat's samples beside a record in the folder `records` of a data directory. The
/// record may be named relative to any folder.
pub fn beside(record: &Path, game_id: &str, seat: usize) -> Option<PathBuf> {
    let record = std::path::absolute(record).ok()?;
    let mut records = record.parent()?.to_owned();
    if records.ends_with("..") {
        records = records.canonicalize().ok()?;
    }
    Some(path_of(records.parent()?, game_id, seat))
}

/// Deletes the samples of all seats of a game in a data directory.
///
/// # Errors
/// The first failure of the file system, after all others were deleted.
pub fn delete(data_dir: &Path, game_id: &str) -> io::Result<()> {
    let removed = paths_of(data_dir, game_id).map(|path| atomic_file::remove(&path));
    removed.collect::<Vec<_>>().into_iter().collect()
}

/// The files that the samples of a game's seats may have in a data directory.
pub fn paths_of(data_dir: &Path, game_id: &str) -> impl Iterator<Item = PathBuf> {
    (0..MAX_SEATS).map(move |seat| path_of(data_dir, game_id, seat))
}

/// Checks a chunk.
///
/// # Errors
/// The first wrong field.
pub fn check_chunk(chunk: &SampleChunk) -> Result<(), FieldProblem> {
    let problem = |field, text: String| Err(FieldProblem::new(field, text));
    check_name("stream", &chunk.stream)?;
    let channels = chunk.channels.len();
    if !(1..=MAX_CHANNELS).contains(&channels) {
        return problem(
            "channels",
            format!("{channels}, must be 1..={MAX_CHANNELS}"),
        );
    }
    for (index, name) in chunk.channels.iter().enumerate() {
        check_name("channels", name)?;
        if chunk.channels[..index].contains(name) {
            return problem("channels", format!("{name:?} is there twice"));
        }
    }
    let samples = chunk.elapsed_us.len();
    if !(1..=MAX_SAMPLES_PER_CHUNK).contains(&samples) {
        let text = format!("{samples} samples, must be 1..={MAX_SAMPLES_PER_CHUNK}");
        return problem("elapsed_us", text);
    }
    if !chunk.elapsed_us.is_sorted_by(|a, b| a < b) {
        return problem("elapsed_us", "must ascend".to_owned());
    }
    if chunk.values.len() != samples * channels {
        let (have, need) = (chunk.values.len(), samples * channels);
        return problem(
            "values",
            format!("{have}, must be {need}: one of each channel for each sample"),
        );
    }
    match chunk.values.iter().any(|value| value.is_infinite()) {
        true => problem(
            "values",
            "must be finite, or NaN where there is none".to_owned(),
        ),
        false => Ok(()),
    }
}

fn check_name(field: &'static str, name: &str) -> Result<(), FieldProblem> {
    let allowed = |letter: char| letter.is_ascii_alphanumeric() || "_-.".contains(letter);
    match (1..=MAX_NAME).contains(&name.len()) && name.chars().all(allowed) {
        true => Ok(()),
        false => {
            let text = format!("{name:?} is not 1..={MAX_NAME} ASCII letters, digits, _, - or .");
            Err(FieldProblem::new(field, text))
        }
    }
}

/// Encodes a chunk as it stands in a file.
pub fn encode(chunk: &SampleChunk) -> Vec<u8> {
    chunk.encode_length_delimited_to_vec()
}

/// Reads the chunks of a file in order. Returns the bytes that they take: what follows was not
/// written completely. A file that does not exist has none.
///
/// # Errors
/// The file cannot be read, or has something else than chunks.
pub fn read(path: &Path, mut take: impl FnMut(SampleChunk)) -> io::Result<u64> {
    let mut file = match File::open(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(0),
        file => BufReader::new(file?),
    };
    let malformed = |problem: String| io::Error::new(io::ErrorKind::InvalidData, problem);
    let mut complete = 0;
    loop {
        let Some((length, prefix)) = read_length(&mut file)? else {
            return Ok(complete);
        };
        if length > MAX_CHUNK_BYTES {
            return Err(malformed(format!("a chunk of {length} bytes")));
        }
        let mut bytes = vec![0; length];
        match file.read_exact(&mut bytes) {
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(complete),
            read => read?,
        }
        let chunk = SampleChunk::decode(bytes.as_slice());
        let chunk = chunk.map_err(|error| malformed(error.to_string()))?;
        check_chunk(&chunk).map_err(|error| malformed(error.to_string()))?;
        complete += prefix + length as u64;
        take(chunk);
    }
}

/// Reads the length of the next chunk, and how many bytes it takes; `None` at the end.
fn read_length(file: &mut impl io::Read) -> io::Result<Option<(usize, u64)>> {
    let mut length = 0_usize;
    for index in 0..4_u32 {
        let mut byte = [0];
        if file.read(&mut byte)? == 0 {
            return Ok(None);
        }
        length |= usize::from(byte[0] & 0x7f) << (7 * index);
        if byte[0] & 0x80 == 0 {
            return Ok(Some((length, u64::from(index) + 1)));
        }
    }
    Err(io::Error::new(io::ErrorKind::InvalidData, "not a chunk"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chunk(first_us: u64, samples: usize) -> SampleChunk {
        SampleChunk {
            stream: "affect".into(),
            channels: vec!["valence".into(), "arousal".into()],
            elapsed_us: (0..samples as u64).map(|index| first_us + index).collect(),
            values: vec![0.5; 2 * samples],
        }
    }

    #[test]
    fn a_file_has_the_chunks_that_were_written_completely() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = path_of(folder.path(), "game", 2);
        let mut read_back = Vec::new();
        assert_eq!(read(&path, |_| panic!("nothing")).expect("none"), 0);
        std::fs::create_dir(folder_of(folder.path())).expect("made");
        let written = [chunk(1, 30), chunk(100, MAX_SAMPLES_PER_CHUNK)];
        let bytes = written.iter().map(encode).collect::<Vec<_>>().concat();
        let complete = bytes.len() as u64;
        for cut in [0, 1, 50] {
            let mut bytes = bytes.clone();
            bytes.extend(&encode(&chunk(10_000, 30))[..cut]);
            std::fs::write(&path, &bytes).expect("written");
            read_back.clear();
            let length = read(&path, |chunk| read_back.push(chunk)).expect("chunks");
            assert_eq!(length, complete, "{cut}");
            assert_eq!(read_back, written);
        }
        std::fs::write(&path, [bytes.as_slice(), &[3, 1, 2, 3]].concat()).expect("written");
        assert!(read(&path, |_| {}).is_err(), "something else");
        std::fs::write(&path, [0xff; 8]).expect("written");
        assert!(read(&path, |_| {}).is_err(), "too long");
    }

    #[test]
    fn samples_are_found_beside_a_record_however_it_is_named() {
        let here = std::env::current_dir().expect("a folder");
        let above = here.parent().expect("it is not the root");
        let higher = above.parent().expect("it is not the root");
        let full = here.join("game.jsonl");
        for (record, data_dir) in [
            (Path::new("game.jsonl"), above),
            (Path::new("./game.jsonl"), above),
            (full.as_path(), above),
            (Path::new("../game.jsonl"), higher),
        ] {
            let expected = Some(path_of(data_dir, "game", 2));
            assert_eq!(beside(record, "game", 2), expected, "{record:?}");
        }
    }

    #[test]
    fn chunks_are_bounded() {
        check_chunk(&chunk(1, 30)).expect("a chunk");
        let with = |edit: fn(&mut SampleChunk)| {
            let mut chunk = chunk(1, 30);
            edit(&mut chunk);
            check_chunk(&chunk).expect_err("refused").field
        };
        assert_eq!(with(|it| it.stream.clear()), "stream");
        assert_eq!(with(|it| it.stream = "a b".into()), "stream");
        assert_eq!(with(|it| it.channels.clear()), "channels");
        assert_eq!(with(|it| it.channels[1] = "valence".into()), "channels");
        assert_eq!(with(|it| it.channels = vec!["x".repeat(33)]), "channels");
        assert_eq!(with(|it| it.elapsed_us[1] = 1), "elapsed_us");
        assert_eq!(with(|it| it.elapsed_us.clear()), "elapsed_us");
        assert_eq!(with(|it| it.values.truncate(59)), "values");
        assert_eq!(with(|it| it.values[7] = f32::INFINITY), "values");
        let mut missing = chunk(1, 30);
        missing.values[7] = f32::NAN;
        check_chunk(&missing).expect("a value may be missing");
        check_chunk(&chunk(1, MAX_SAMPLES_PER_CHUNK + 1)).expect_err("too many");
    }
}
