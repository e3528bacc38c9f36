//! The command line: what is run, how much of it, and where. What the figures mean is in the README beside this crate.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};

/// Seats of a room here.
pub(crate) const SEATS: usize = 4;
/// Most rooms of a run.
const MAX_ROOMS: u64 = 2_000;
/// Longest window, seconds.
const MAX_SECONDS: f64 = 600.0;

/// Measure a Chef's Hat server beside a bare tonic room with messages of the same size, in turns, in the same run.
#[derive(Debug, Parser)]
#[command(
    name = "chefshat-load",
    version,
    after_help = "Examples:\n  chefshat-load                        the standard scenarios\n  chefshat-load --pin --rounds 7       the same with both sides on one core\n  chefshat-load --scale                4 to 4,000 connections on one core\n  chefshat-load --rooms 16 --streams 8 one scenario of your own\n  chefshat-load --durability           durable rooms beside ephemeral ones\n  chefshat-load --restart 1000         a restart with so many unfinished games\n  chefshat-load --vector               batches of a client's own games\n  chefshat-load --server http://127.0.0.1:50051 --rooms 16 --streams 64"
)]
pub(crate) struct Options {
    #[command(subcommand)]
    pub(crate) role: Option<Role>,
    #[command(flatten)]
    pub(crate) load: Load,
}

/// What this process is, when it is not the load program itself.
#[derive(Debug, Subcommand)]
pub(crate) enum Role {
    /// A server to be measured; started by the load program, ends with its standard input.
    #[command(hide = true)]
    Serve(Serve),
}

/// A server to be measured.
#[derive(Debug, Args)]
pub(crate) struct Serve {
    /// The bare room instead of the game server.
    #[arg(long)]
    pub(crate) bare: bool,
    /// Keep games in this folder.
    #[arg(long, conflicts_with = "bare")]
    pub(crate) data_dir: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) place: Place,
}

/// Where a process runs.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Place {
    /// Threads of each side's runtime; 0: as many as there are cores.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u16).range(..=256))]
    pub(crate) threads: u16,
    /// Put both sides on one core, each with a single-threaded runtime: figures then repeat within a few percent.
    #[arg(long, conflicts_with = "threads")]
    pub(crate) pin: bool,
    /// The core that --pin takes for the server, and for the load unless --client-core says otherwise.
    #[arg(long, default_value_t = 0, requires = "pin")]
    pub(crate) core: usize,
    /// With --pin: a core of its own for the load.
    #[arg(long, requires = "pin")]
    pub(crate) client_core: Option<usize>,
}

/// What is run.
#[derive(Debug, Args)]
pub(crate) struct Load {
    /// Rooms at a time, each with four seats. Without it the standard scenarios are run.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=MAX_ROOMS))]
    pub(crate) rooms: Option<u64>,
    /// Streams the seats are spread over, each on a connection of its own; standard: one for each seat.
    #[arg(long, requires = "rooms", value_parser = clap::value_parser!(u64).range(1..=4 * MAX_ROOMS))]
    pub(crate) streams: Option<u64>,
    /// Shifts of each game: many, so that making rooms is no part of what is measured. 0: games to 15 points.
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(..=10_000))]
    pub(crate) shifts: u32,
    /// How often server and bare room take turns.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1_000))]
    pub(crate) rounds: u16,
    /// Length of one measurement, seconds.
    #[arg(long, default_value = "2", value_parser = seconds)]
    pub(crate) seconds: Duration,
    /// What is played before each measurement, seconds.
    #[arg(long, default_value = "0.5", value_parser = seconds)]
    pub(crate) warmup: Duration,
    /// End a measurement after this many decisions even if its time is not up.
    #[arg(long)]
    pub(crate) decisions: Option<u64>,
    /// Seed of the agents' choices.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Measure the load on a server that runs elsewhere; no bare room, no figures from inside the server.
    #[arg(long, value_name = "URL", conflicts_with = "pin")]
    pub(crate) server: Option<String>,
    /// Measure 4, 64, 400, 1,000 and 4,000 connections, with both sides on one core as with --pin.
    #[arg(long, conflicts_with_all = ["rooms", "server", "threads"])]
    pub(crate) scale: bool,
    /// Measure the server of another build of this program as well, in turns with this one's.
    #[arg(long, value_name = "PROGRAM", conflicts_with_all = ["server", "restart"])]
    pub(crate) against: Option<PathBuf>,
    /// Start each server with this command, which must replace itself with it: "valgrind --tool=callgrind", for example.
    #[arg(long, value_name = "COMMAND", conflicts_with = "server")]
    pub(crate) under: Option<String>,
    /// Measure rooms that outlive the server beside rooms that are kept when they end, both on a server that keeps games on disk: 64
    /// rooms unless --rooms says otherwise.
    #[arg(long, conflicts_with_all = ["server", "scale"])]
    pub(crate) durability: bool,
    /// Measure how long a server that was killed takes until so many unfinished games can be played again.
    #[arg(long, value_name = "ROOMS", conflicts_with_all = ["rooms", "server", "durability", "scale"], value_parser = clap::value_parser!(u64).range(1..=MAX_ROOMS))]
    pub(crate) restart: Option<u64>,
    /// Measure games of a client's own, stepped in batches of 1, 64 and 1,024 on one, two and four streams.
    #[arg(long, conflicts_with_all = ["rooms", "server", "durability", "restart", "scale"])]
    pub(crate) vector: bool,
    /// Folder for what --durability and --restart keep on disk; it must lie on the disk that is meant. Standard: the temporary folder.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) disk: Option<PathBuf>,
    /// One room, one round, a moment: does the program work?
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
