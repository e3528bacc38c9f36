//! The command line. The README of this crate explains the figures.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};

/// Seats of a room.
pub(crate) const SEATS: usize = 4;
/// Maximum number of rooms.
const MAX_ROOMS: u64 = 2_000;
/// Maximum length of a window, seconds.
const MAX_SECONDS: f64 = 600.0;

/// Measure a Chef's Hat server beside a bare tonic room with messages of the same size, in turns,
/// in the same run.
#[derive(Debug, Parser)]
#[command(
    name = "chefshat-load",
    version,
    after_help = "Examples:\n  chefshat-load                        the standard scenarios\n  chefshat-load --pin --rounds 7       the same with both sides on one core\n  chefshat-load --scale                4 to 4,000 connections on one core\n  chefshat-load --rooms 16 --streams 8 one scenario of your own\n  chefshat-load --durability           durable rooms beside ephemeral ones\n  chefshat-load --restart 1000         a restart with 1,000 unfinished games\n  chefshat-load --vector               batches of a client's own games\n  chefshat-load --server http://127.0.0.1:50051 --rooms 16 --streams 64"
)]
pub(crate) struct Options {
    #[command(subcommand)]
    pub(crate) role: Option<Role>,
    #[command(flatten)]
    pub(crate) load: Load,
}

/// The role of a child process.
#[derive(Debug, Subcommand)]
pub(crate) enum Role {
    /// Run a server to be measured; started by the load program, ends with its standard input.
    #[command(hide = true)]
    Serve(Serve),
}

/// The role of a server process.
#[derive(Debug, Args)]
pub(crate) struct Serve {
    /// Run the bare room instead of the game server.
    #[arg(long)]
    pub(crate) bare: bool,
    /// Store games in this folder.
    #[arg(long, conflicts_with = "bare")]
    pub(crate) data_dir: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) place: Place,
}

/// Threads and cores.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Place {
    /// Threads of each side's runtime. Default: 0, as many as there are cores.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u16).range(..=256))]
    pub(crate) threads: u16,
    /// Run both sides on one core, each with a single-threaded runtime: figures then repeat within
    /// a few percent.
    #[arg(long, conflicts_with = "threads")]
    pub(crate) pin: bool,
    /// Core for --pin, used by the server and, without --client-core, by the load.
    #[arg(long, default_value_t = 0, requires = "pin")]
    pub(crate) core: usize,
    /// With --pin: a separate core for the load.
    #[arg(long, requires = "pin")]
    pub(crate) client_core: Option<usize>,
}

/// What to run.
#[derive(Debug, Args)]
pub(crate) struct Load {
    /// Rooms at a time, each with four seats. Default: the standard scenarios.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=MAX_ROOMS))]
    pub(crate) rooms: Option<u64>,
    /// Streams to spread the seats over, each on its own connection. Default: one per seat.
    #[arg(long, requires = "rooms", value_parser = clap::value_parser!(u64).range(1..=4 * MAX_ROOMS))]
    pub(crate) streams: Option<u64>,
    /// Shifts per game: many, so that creating rooms is not part of the measurement. 0: games to 15
    /// points.
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(..=10_000))]
    pub(crate) shifts: u32,
    /// Rounds: how often server and bare room take turns.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1_000))]
    pub(crate) rounds: u16,
    /// Length of a window, seconds.
    #[arg(long, default_value = "2", value_parser = seconds)]
    pub(crate) seconds: Duration,
    /// Warm-up before each window, seconds.
    #[arg(long, default_value = "0.5", value_parser = seconds)]
    pub(crate) warmup: Duration,
    /// Close a window after this many decisions, even before its time is up.
    #[arg(long)]
    pub(crate) decisions: Option<u64>,
    /// Seed of the agents' choices.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Measure a running server at this address; no bare room, and no figures from inside the
    /// server.
    #[arg(long, value_name = "URL", conflicts_with = "pin")]
    pub(crate) server: Option<String>,
    /// Measure 4, 64, 400, 1,000 and 4,000 connections, with both sides on one core as with --pin.
    #[arg(long, conflicts_with_all = ["rooms", "server", "threads"])]
    pub(crate) scale: bool,
    /// Also measure the server of another build of this program, in turns with this one.
    #[arg(long, value_name = "PROGRAM", conflicts_with_all = ["server", "restart"])]
    pub(crate) against: Option<PathBuf>,
    /// Count each server's instructions, under callgrind. Times are then those of an emulated
    /// processor.
    #[arg(long, conflicts_with_all = ["server", "under", "scale", "restart", "vector"])]
    pub(crate) instructions: bool,
    /// Start each server with this command, which must replace itself with the server, for example
    /// "valgrind --tool=callgrind".
    #[arg(long, value_name = "COMMAND", conflicts_with = "server")]
    pub(crate) under: Option<String>,
    /// Measure durable beside ephemeral rooms, both on a server with a database. Default: 64 rooms.
    #[arg(long, conflicts_with_all = ["server", "scale"])]
    pub(crate) durability: bool,
    /// Measure how long a killed server takes until this many unfinished games are playable again.
    #[arg(long, value_name = "ROOMS", conflicts_with_all = ["rooms", "server", "durability", "scale"], value_parser = clap::value_parser!(u64).range(1..=MAX_ROOMS))]
    pub(crate) restart: Option<u64>,
    /// Measure games of one client, stepped in batches of 1, 64 and 1,024 on one, two and four
    /// streams.
    #[arg(long, conflicts_with_all = ["rooms", "server", "durability", "restart", "scale"])]
    pub(crate) vector: bool,
    /// Folder for the games of --durability and --restart, on the disk to measure. Default: the
    /// temporary folder.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) disk: Option<PathBuf>,
    /// Run one short round of one room, to test that the program works.
    #[arg(long, conflicts_with_all = ["rooms", "rounds", "seconds", "warmup", "decisions", "shifts"])]
    pub(crate) smoke: bool,
    /// Print one JSON document instead of tables.
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) place: Place,
}

fn seconds(text: &str) -> Result<Duration, String> {
    text.parse()
        .ok()
        .filter(|seconds| (0.0..=MAX_SECONDS).contains(seconds))
        .map(Duration::from_secs_f64)
        .ok_or_else(|| format!("{text:?} is not a number of seconds from 0 to {MAX_SECONDS}"))
}
