//! What a server is configured with, and every limit it keeps.

use std::path::PathBuf;
use std::time::Duration;

/// Largest message a client may send, bytes.
pub const MAX_MESSAGE_BYTES: usize = 64 * 1024;
/// Most streams of one connection.
pub const MAX_STREAMS_PER_CONNECTION: u32 = 1_024;
/// Most seats attached to one stream at a time.
pub const MAX_SEATS_PER_STREAM: usize = 4_096;
/// Most seats named in one Watch.
pub const MAX_SEATS_PER_WATCH: usize = 64;
/// Most commands in one message.
pub const MAX_COMMANDS_PER_MESSAGE: usize = 1_024;
/// Messages that wait for one room.
pub const ROOM_MAILBOX: usize = 256;
/// Largest message of a client that steps games of its own, bytes: room for seeds given one by one.
pub const MAX_VECTOR_MESSAGE_BYTES: usize = 1024 * 1024;
/// Largest batch of such games, bytes: that of the most games of the largest rule set, two Shifts of each having ended at once.
pub const MAX_VECTOR_BATCH_BYTES: usize = 16 * 1024 * 1024;
/// Streams of clients' own games at a time.
pub const MAX_VECTOR_STREAMS: usize = 64;
/// Seats played on all of them together, games times seats: some 5 KB each.
pub const MAX_VECTOR_SEATS_IN_ALL: usize = 131_072;
/// Seeds that may be given one by one.
pub const MAX_VECTOR_SEEDS: usize = 16_384;
/// Games of one such stream whose records are kept.
pub const MAX_VECTOR_RECORDED_GAMES: u32 = 256;
/// How long a client may take to say which games it wants.
pub const VECTOR_SETUP_TIMEOUT: Duration = Duration::from_secs(30);
/// How long a client may think about a batch.
pub const VECTOR_IDLE_TIMEOUT: Duration = Duration::from_secs(3_600);
/// How long a client may take to take in one message.
pub const VECTOR_SEND_TIMEOUT: Duration = Duration::from_secs(60);
/// Largest record that may be imported, bytes as encoded.
pub const MAX_IMPORT_BYTES: usize = 64 * 1024 * 1024;
/// Most lines of a record that may be imported.
pub const MAX_IMPORT_LINES: usize = 1_500_000;
/// How long the whole of a record that is imported may take to arrive.
pub const IMPORT_TIMEOUT: Duration = Duration::from_secs(120);
/// Records that are being received at a time.
pub const MAX_IMPORTS: usize = 2;
/// Records that are put together, or replayed, at a time, for each of the purposes that they serve.
pub const MAX_RECORDS_IN_HAND: usize = 2;
/// Records that are being sent at a time.
pub const MAX_RECORDS_SENT: usize = 8;
/// How long a client may take to take in one message of a record.
pub const RECORD_SEND_TIMEOUT: Duration = Duration::from_secs(30);
/// Most tournaments, ended ones that are still shown included.
pub const MAX_TOURNAMENTS: usize = 256;
/// Messages that wait for one tournament.
pub const TOURNAMENT_MAILBOX: usize = 256;
/// Calls to games that wait for one stream; beyond it the stream is ended.
pub const MAX_CALLS_WAITING: usize = 4_096;
/// How long a tournament stays open that nobody joins or begins.
pub const TOURNAMENT_OPEN_TIME: Duration = Duration::from_secs(7 * 24 * 3_600);
/// When rooms for games of a tournament that could not be made are tried again.
pub const TOURNAMENT_RETRY: Duration = Duration::from_secs(1);
/// Streams that follow tournaments.
pub const MAX_FOLLOWERS: usize = 256;
/// How often those who follow a tournament are told of it at most.
pub const FOLLOW_INTERVAL: Duration = Duration::from_millis(250);
/// Tournaments of which it is worked out at a time what their followers are told; and those whose results are.
pub const MAX_RESULTS_IN_HAND: usize = 2;
/// Most games of which those who follow a tournament are told, so that a message stays well below the 4 MB that clients take by standard. At a
/// time only half as many can be played.
pub const MAX_GAMES_FOLLOWED: usize = 512;
/// How long a follower may take to take in what it is told.
pub const FOLLOW_SEND_TIMEOUT: Duration = Duration::from_secs(30);
/// Most games of a tournament in one page.
pub const MAX_GAMES_PAGE: u32 = 500;
/// Most lines of a leaderboard.
pub const MAX_LEADERBOARD_LINES: u32 = 1_000;
/// How old a leaderboard may be that is shown although games have ended since.
pub const LEADERBOARD_AGE: Duration = Duration::from_secs(2);
/// The part of the time that may go into working it out is one by this.
pub const LEADERBOARD_PART: u32 = 10;
/// How long streams and connections that do not close may hold up a shutdown.
pub const DRAIN_LIMIT: Duration = Duration::from_secs(5);
/// Longest name of a room or participant, characters.
pub const MAX_NAME_CHARS: usize = 64;
/// Most Shifts of a hosted game, and most points it may be played to.
pub const MAX_HOSTED_SHIFTS: u32 = 1_000;
/// How often an idle Watch stream says that it is alive.
pub const HEARTBEAT: Duration = Duration::from_secs(15);

/// What may be set for a server.
#[derive(Debug, Clone)]
pub struct ServerConfig {
    /// Where records of finished games are written; `None`: nowhere.
    pub data_dir: Option<PathBuf>,
    /// Most rooms at a time, ended ones that are still shown included.
    pub max_rooms: usize,
    /// Most connections at a time.
    pub max_connections: usize,
    /// Threads that step the games of clients' own; 0: one for each core.
    pub vector_threads: usize,
    /// How long an ended room is still shown.
    pub retention: Duration,
    /// How long running games may go on after a shutdown was asked for.
    pub grace: Duration,
    /// How long a new connection may stay silent before it is dropped.
    pub first_byte_timeout: Duration,
    /// Whether anybody may add records of games played elsewhere.
    pub allow_import: bool,
    /// Web origins that may call the server from a browser; `*` is all.
    pub allowed_origins: Vec<String>,
}

impl Default for ServerConfig {
    fn default() -> Self {
        Self {
            data_dir: None,
            max_rooms: 10_000,
            max_connections: 10_000,
            vector_threads: 0,
            retention: Duration::from_secs(600),
            grace: Duration::from_secs(30),
            first_byte_timeout: Duration::from_secs(10),
            allow_import: false,
            allowed_origins: Vec::new(),
        }
    }
}
