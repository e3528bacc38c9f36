//! Records the samples of seats in files beside the records (`chefshat_record::samples`), on threads
//! that may block. A room is only asked whose ticket it is.

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use chefshat_engine::Seat;
use chefshat_proto::v1::SampleChunk;
use chefshat_record::convert::FieldProblem;
use chefshat_record::{private, samples};
use chefshat_room::ids::GameId;
use tokio::task::JoinError;

/// Most bytes of the samples of one seat: 8 channels, 30 times a second, for more than 15 hours.
pub(crate) const MAX_SAMPLE_BYTES: u64 = 64 * 1024 * 1024;
/// Most streams of a seat.
pub(crate) const MAX_STREAMS: usize = 16;
/// How far in the future samples may be: clocks are not known exactly.
const MAX_AHEAD: Duration = Duration::from_secs(1);
/// Most files that stay open while nothing is written to them.
const MAX_IDLE_FILES: usize = 256;
/// Most deleted games whose samples are refused by their id: more than there are rooms that may
/// still have sent some.
const MAX_DELETED_GAMES: usize = 65_536;

/// Why samples are refused.
#[derive(Debug, thiserror::Error)]
pub enum SampleError {
    /// The server has no data directory for them.
    #[error(
        "this server does not record samples: it has no data directory, or shares its games with other servers"
    )]
    Off,
    /// A field is malformed.
    #[error(transparent)]
    Malformed(#[from] FieldProblem),
    /// The seat has too many streams.
    #[error("a seat has at most {MAX_STREAMS} streams of samples")]
    TooManyStreams,
    /// The seat has too many samples.
    #[error("the samples of a seat may take at most {MAX_SAMPLE_BYTES} bytes")]
    TooMany,
    /// The game was deleted.
    #[error("the game was deleted, and its samples with it")]
    Deleted,
    /// The file system failed.
    #[error("{0}")]
    Io(#[from] io::Error),
}

/// The samples of a server.
#[derive(Debug, Default)]
pub struct Samples {
    data_dir: Option<PathBuf>,
    /// By game and seat.
    files: Mutex<HashMap<(GameId, usize), SharedFile>>,
    deleted: Mutex<Deleted>,
}

/// The games that were deleted last. What was on its way for them must not create their files
/// again.
#[derive(Debug, Default)]
struct Deleted {
    games: HashSet<GameId>,
    /// Oldest first.
    in_order: VecDeque<GameId>,
}

impl Deleted {
    fn add(&mut self, game: GameId) {
        if self.games.insert(game) {
            self.in_order.push_back(game);
        }
        if self.in_order.len() > MAX_DELETED_GAMES
            && let Some(oldest) = self.in_order.pop_front()
        {
            self.games.remove(&oldest);
        }
    }
}

/// The file of a seat; `None` while it is not open.
type SharedFile = Arc<Mutex<Option<SeatFile>>>;

/// The open file of a seat.
#[derive(Debug)]
struct SeatFile {
    file: File,
    bytes: u64,
    streams: BTreeMap<String, StreamEnd>,
}

/// What a stream has so far.
#[derive(Debug, PartialEq)]
struct StreamEnd {
    channels: Vec<String>,
    last_us: u64,
}

/// Games whose files could not be deleted, and why.
pub type Undeleted = BTreeMap<GameId, io::Error>;

impl Samples {
    /// Records samples in a data directory; `None`: nowhere.
    pub fn new(data_dir: Option<PathBuf>) -> Self {
        Self {
            data_dir,
            files: Mutex::default(),
            deleted: Mutex::default(),
        }
    }

    /// Adds samples of a seat, in a thread that may block. Returns how many were new.
    ///
    /// # Errors
    /// They are refused, or the file system failed.
    pub async fn add(
        self: Arc<Self>,
        game: GameId,
        seat: Seat,
        chunk: SampleChunk,
        now: Duration,
    ) -> Result<u32, SampleError> {
        samples::check_chunk(&chunk)?;
        let latest = u64::try_from((now + MAX_AHEAD).as_micros()).unwrap_or(u64::MAX);
        if chunk.elapsed_us.last().is_some_and(|last| *last > latest) {
            let problem = "is in the future: read the clock of the room again";
            return Err(FieldProblem::new("elapsed_us", problem).into());
        }
        let adding = tokio::task::spawn_blocking(move || self.append(game, seat.index(), chunk));
        adding.await.map_err(io::Error::other)?
    }

    fn append(&self, game: GameId, seat: usize, chunk: SampleChunk) -> Result<u32, SampleError> {
        let data_dir = self.data_dir.as_deref().ok_or(SampleError::Off)?;
        let file = {
            let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
            if files.len() > MAX_IDLE_FILES {
                files.retain(|_, file| Arc::strong_count(file) > 1);
            }
            Arc::clone(files.entry((game, seat)).or_default())
        };
        let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
        // Once it has the file, no deletion comes before it has written.
        let deleted = self.deleted.lock().unwrap_or_else(PoisonError::into_inner);
        if deleted.games.contains(&game) {
            return Err(SampleError::Deleted);
        }
        drop(deleted);
        let open = match file.take() {
            Some(open) => open,
            None => SeatFile::open(
                data_dir,
                &samples::path_of(data_dir, &game.to_string(), seat),
            )?,
        };
        // After a failure it is opened again, which finds what was written completely.
        let (open, appended) = open.append(chunk)?;
        *file = Some(open);
        appended
    }

    /// The files of a game's samples, one for each seat that has some.
    pub fn files(&self, game: GameId) -> Vec<PathBuf> {
        let Some(data_dir) = &self.data_dir else {
            return Vec::new();
        };
        let game = game.to_string();
        let paths = samples::paths_of(data_dir, &game);
        paths.filter(|path| path.exists()).collect()
    }

    /// Takes no more samples of these games. What is just being written is written when it returns.
    pub async fn refuse(self: &Arc<Self>, games: Vec<GameId>) -> io::Result<()> {
        if self.data_dir.is_none() {
            return Ok(());
        }
        let samples = Arc::clone(self);
        let refusing = tokio::task::spawn_blocking(move || samples.refuse_now(&games));
        refusing.await.map_err(io::Error::other)
    }

    fn refuse_now(&self, games: &[GameId]) {
        let mut deleted = self.deleted.lock().unwrap_or_else(PoisonError::into_inner);
        games.iter().for_each(|game| deleted.add(*game));
        drop(deleted);
        let mut open = Vec::new();
        let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        files.retain(|(of, _), file| {
            let stays = !games.contains(of);
            if !stays {
                open.push(Arc::clone(file));
            }
            stays
        });
        drop(files);
        for file in open {
            // Its present holder finishes first; later ones are refused.
            drop(file.lock().unwrap_or_else(PoisonError::into_inner).take());
        }
    }

    /// Deletes the samples of games, and takes no more of them. Returns the games of which the file
    /// system keeps some.
    ///
    /// # Errors
    /// It is unknown which were deleted.
    pub async fn delete(self: &Arc<Self>, games: Vec<GameId>) -> Result<Undeleted, JoinError> {
        let Some(data_dir) = self.data_dir.clone() else {
            return Ok(Undeleted::new());
        };
        let samples = Arc::clone(self);
        let deleting = move || {
            samples.refuse_now(&games);
            let deleted = games.into_iter().map(|game| {
                let failed = samples::delete(&data_dir, &game.to_string()).err();
                failed.map(|error| (game, error))
            });
            deleted.flatten().collect()
        };
        tokio::task::spawn_blocking(deleting).await
    }
}

impl SeatFile {
    fn open(data_dir: &Path, path: &Path) -> io::Result<Self> {
        let folder = samples::folder_of(data_dir);
        private::create_folder(&folder)?;
        let mut streams = BTreeMap::new();
        let bytes = samples::read(path, |chunk| {
            let last_us = chunk.elapsed_us.last().copied().unwrap_or_default();
            let end = StreamEnd {
                channels: chunk.channels,
                last_us,
            };
            streams.insert(chunk.stream, end);
        })?;
        let mut options = private::options();
        let file = options.create(true).append(true).open(path)?;
        // Without what was not written completely.
        file.set_len(bytes)?;
        Ok(Self {
            file,
            bytes,
            streams,
        })
    }

    /// Appends what is new of a chunk. The file is gone after a failure of the file system.
    fn append(mut self, mut chunk: SampleChunk) -> io::Result<(Self, Result<u32, SampleError>)> {
        let known = self.streams.get(&chunk.stream);
        if known.is_none() && self.streams.len() >= MAX_STREAMS {
            return Ok((self, Err(SampleError::TooManyStreams)));
        }
        if known.is_some_and(|stream| stream.channels != chunk.channels) {
            let problem = "are others than those of the stream so far";
            let problem = FieldProblem::new("channels", problem);
            return Ok((self, Err(problem.into())));
        }
        let last_us = known.map(|stream| stream.last_us);
        let old = chunk
            .elapsed_us
            .partition_point(|at| last_us.is_some_and(|last| *at <= last));
        chunk.values.drain(..old * chunk.channels.len());
        chunk.elapsed_us.drain(..old);
        let Some(last_us) = chunk.elapsed_us.last().copied() else {
            return Ok((self, Ok(0)));
        };
        let bytes = samples::encode(&chunk);
        let length = self.bytes + bytes.len() as u64;
        if length > MAX_SAMPLE_BYTES {
            return Ok((self, Err(SampleError::TooMany)));
        }
        self.file.write_all(&bytes)?;
        self.bytes = length;
        let recorded = u32::try_from(chunk.elapsed_us.len()).unwrap_or(u32::MAX);
        let end = StreamEnd {
            channels: chunk.channels,
            last_us,
        };
        self.streams.insert(chunk.stream, end);
        Ok((self, Ok(recorded)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR: Duration = Duration::from_secs(3_600);

    fn chunk(stream: &str, first: u64, samples: u64) -> SampleChunk {
        SampleChunk {
            stream: stream.into(),
            channels: vec!["valence".into(), "arousal".into()],
            elapsed_us: (first..first + samples).map(|at| at * 33_333).collect(),
            values: (0..2 * samples).map(|value| value as f32).collect(),
        }
    }

    /// The samples in the file of a seat: stream, time and values.
    fn recorded(folder: &Path, game: GameId, seat: usize) -> Vec<(String, u64, Vec<f32>)> {
        let mut all = Vec::new();
        let path = samples::path_of(folder, &game.to_string(), seat);
        let take = |chunk: SampleChunk| {
            let values = chunk.values.chunks(chunk.channels.len());
            let rows = chunk.elapsed_us.iter().zip(values);
            all.extend(rows.map(|(at, values)| (chunk.stream.clone(), *at, values.to_vec())));
        };
        samples::read(&path, take).expect("chunks");
        all
    }

    #[tokio::test]
    async fn an_hour_of_thirty_samples_a_second_is_recorded_once_also_across_a_restart() {
        let folder = tempfile::tempdir().expect("a folder");
        let (game, seat) = (GameId::random(), Seat::new(2));
        let start = || Arc::new(Samples::new(Some(folder.path().to_path_buf())));
        let mut server = start();
        let total = 30 * 3_600;
        for first in (0..total).step_by(300) {
            if first == 54_000 {
                // Killed while it wrote.
                let path = samples::path_of(folder.path(), &game.to_string(), 2);
                let mut file = File::options().append(true).open(path).expect("there");
                let half = samples::encode(&chunk("affect", first, 300));
                file.write_all(&half[..half.len() / 2]).expect("written");
                server = start();
            }
            // Each chunk overlaps with the one before.
            let from = first.saturating_sub(10);
            let chunk = chunk("affect", from, first + 300 - from);
            let added = Arc::clone(&server).add(game, seat, chunk, HOUR).await;
            assert_eq!(added.expect("recorded"), 300);
        }
        let again = chunk("affect", total - 300, 300);
        let added = Arc::clone(&server).add(game, seat, again, HOUR).await;
        assert_eq!(added.expect("known"), 0);
        let recorded = recorded(folder.path(), game, 2);
        let times: Vec<u64> = recorded.iter().map(|(_, at, _)| *at).collect();
        assert_eq!(times, (0..total).map(|at| at * 33_333).collect::<Vec<_>>());
        // Of the overlap the new values are left.
        assert_eq!(recorded[300].2, [20.0, 21.0]);
    }

    #[tokio::test]
    async fn a_file_that_cannot_be_deleted_leaves_no_other_behind() {
        let folder = tempfile::tempdir().expect("a folder");
        let server = Arc::new(Samples::new(Some(folder.path().to_path_buf())));
        let games = [1, 2].map(|id| GameId::from_bytes([id; 16]));
        let path = |game: GameId, seat| samples::path_of(folder.path(), &game.to_string(), seat);
        // A folder with the name of a file, which cannot be removed as a file.
        std::fs::create_dir_all(path(games[0], 0)).expect("created");
        for path in [path(games[0], 1), path(games[1], 0)] {
            std::fs::write(path, "").expect("written");
        }
        let undeleted = server.delete(games.to_vec()).await.expect("no panic");
        assert_eq!(Vec::from_iter(undeleted.into_keys()), [games[0]]);
        assert!(
            ![path(games[0], 1), path(games[1], 0)]
                .iter()
                .any(|path| path.exists())
        );
    }

    #[tokio::test]
    async fn streams_keep_their_channels_and_are_bounded() {
        let folder = tempfile::tempdir().expect("a folder");
        let server = Arc::new(Samples::new(Some(folder.path().to_path_buf())));
        let (game, seat) = (GameId::random(), Seat::new(0));
        let add = async |chunk| Arc::clone(&server).add(game, seat, chunk, HOUR).await;
        for number in 0..MAX_STREAMS {
            let added = add(chunk(&format!("stream{number}"), 0, 1)).await;
            assert_eq!(added.expect("recorded"), 1);
        }
        let refused = add(chunk("one.more", 0, 1)).await.expect_err("too many");
        assert!(matches!(refused, SampleError::TooManyStreams));
        let mut other = chunk("stream0", 1, 1);
        other.channels[1] = "dominance".into();
        let refused = add(other).await.expect_err("other channels");
        assert!(matches!(refused, SampleError::Malformed(problem) if problem.field == "channels"));
        let refused = add(chunk("stream0", 200_000, 1))
            .await
            .expect_err("the future");
        assert!(
            matches!(refused, SampleError::Malformed(problem) if problem.field == "elapsed_us")
        );
        assert_eq!(add(chunk("stream0", 1, 1)).await.expect("still open"), 1);
        assert_eq!(recorded(folder.path(), game, 0).len(), MAX_STREAMS + 1);
        let undeleted = server.delete(vec![game]).await.expect("no panic");
        assert!(undeleted.is_empty(), "{undeleted:?}");
        assert!(recorded(folder.path(), game, 0).is_empty());
        let refused = add(chunk("stream0", 1, 1)).await.expect_err("deleted");
        assert!(matches!(refused, SampleError::Deleted));
        assert!(server.files(game).is_empty(), "it is not created again");
        let nowhere = Arc::new(Samples::new(None));
        let refused = nowhere.add(game, seat, chunk("affect", 0, 1), HOUR).await;
        assert!(matches!(refused, Err(SampleError::Off)));
    }

    /// An append that was on its way when the game was deleted: it has found the file's place before
    /// and comes to it after.
    #[test]
    fn what_is_on_its_way_creates_no_deleted_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let server = Arc::new(Samples::new(Some(folder.path().to_path_buf())));
        let game = GameId::random();
        assert_eq!(server.append(game, 0, chunk("a", 0, 1)).expect("open"), 1);
        let file = Arc::clone(&server.files.lock().expect("no panic")[&(game, 0)]);
        let held = file.lock().expect("no panic");
        std::thread::scope(|scope| {
            let appending = scope.spawn(|| server.append(game, 0, chunk("a", 9, 1)));
            // Until it has the place, it does not hold the file.
            while Arc::strong_count(&file) < 3 {
                std::thread::yield_now();
            }
            let deleting = scope.spawn(|| server.refuse_now(&[game]));
            while !(server.deleted.lock().expect("no panic").games).contains(&game) {
                std::thread::yield_now();
            }
            drop(held);
            deleting.join().expect("no panic");
            let appended = appending.join().expect("no panic");
            assert!(matches!(appended, Err(SampleError::Deleted)));
        });
        let mut deleted = Deleted::default();
        let games = (0..=MAX_DELETED_GAMES).map(|_| GameId::random());
        let games: Vec<GameId> = games.collect();
        games.iter().for_each(|game| deleted.add(*game));
        assert_eq!(deleted.games.len(), MAX_DELETED_GAMES);
        assert!(!deleted.games.contains(&games[0]), "the oldest");
    }
}
