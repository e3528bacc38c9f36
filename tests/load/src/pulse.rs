//! What the tasks of a segment share, and its window: counters are read when the window opens and
//! closes, so that connecting, warming up and finishing the last games are not part of the figures.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;

use crate::error::LoadError;
use crate::gauge;

/// Interval of checks of the number of decisions, if it limits the window.
const GLANCE: Duration = Duration::from_millis(2);
/// Maximum latency recorded exactly, nanoseconds.
const LONGEST_NS: u64 = 60_000_000_000;

/// A segment: how much to play, and on what.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    /// Rooms at a time.
    pub(crate) rooms: usize,
    /// Streams to spread the seats over.
    pub(crate) streams: usize,
    /// Shifts of a game; 0: games to 15 points.
    pub(crate) shifts: u32,
    /// Whether games are durable.
    pub(crate) durable: bool,
    /// Whether the last games are finished; otherwise their rooms are closed after the window.
    pub(crate) play_to_end: bool,
    /// Warm-up before the window opens.
    pub(crate) warmup: Duration,
    /// Length of the window.
    pub(crate) window: Duration,
    /// Decisions after which the window closes early.
    pub(crate) decisions: Option<u64>,
    /// Seed of the agents.
    pub(crate) seed: u64,
    /// Whether the server runs under callgrind, and its instructions are counted.
    pub(crate) instructions: bool,
}

/// The result of a window.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Window {
    /// Decisions answered in it.
    pub(crate) decisions: u64,
    /// How long it was open.
    pub(crate) elapsed: Duration,
    /// CPU time of the server's process, unless it runs elsewhere.
    pub(crate) server_cpu: Option<Duration>,
    /// Instructions of the server's process, if they are counted.
    pub(crate) server_instructions: Option<u64>,
    /// CPU time of this process.
    pub(crate) client_cpu: Duration,
    /// Memory of the server when the window opened, all seats attached and playing, bytes.
    pub(crate) playing_bytes: Option<u64>,
}

/// Latencies of one kind, in the units they were recorded in.
pub(crate) type Latencies = Histogram<u64>;

/// Creates an empty histogram with a resolution of one percent.
pub(crate) fn latencies() -> Latencies {
    Histogram::new_with_bounds(1, LONGEST_NS, 2).expect("the bounds are in order")
}

/// Shared by the tasks of a segment.
#[derive(Debug)]
pub(crate) struct Pulse {
    epoch: Instant,
    decisions: AtomicU64,
    open: AtomicBool,
    stopping: AtomicBool,
    /// When each room's last answer was sent, nanoseconds after the epoch; 0: none since its game
    /// began.
    answered_ns: Vec<AtomicU64>,
}

impl Pulse {
    /// Creates the state for a number of rooms.
    pub(crate) fn new(rooms: usize) -> Self {
        Self {
            epoch: Instant::now(),
            decisions: AtomicU64::new(0),
            open: AtomicBool::new(false),
            stopping: AtomicBool::new(false),
            answered_ns: (0..rooms).map(|_| AtomicU64::new(0)).collect(),
        }
    }

    /// Records the arrival of a room's decision, with the time since the previous answer.
    pub(crate) fn asked(&self, room: usize, latencies: &mut Latencies) {
        if self.is_open() {
            let answered = self.answered_ns[room].load(Relaxed);
            if answered > 0 {
                latencies.saturating_record(self.now_ns().saturating_sub(answered));
            }
        }
    }

    /// Records the time of an answer.
    pub(crate) fn answer(&self, room: usize) {
        self.answered_ns[room].store(self.now_ns(), Relaxed);
        self.decisions.fetch_add(1, Relaxed);
    }

    /// A room starts a new game: the time until its first decision is not a latency.
    pub(crate) fn begin(&self, room: usize) {
        self.answered_ns[room].store(0, Relaxed);
    }

    /// Whether the window is open.
    pub(crate) fn is_open(&self) -> bool {
        self.open.load(Relaxed)
    }

    /// Stops new games; running ones are finished.
    pub(crate) fn stop(&self) {
        self.stopping.store(true, Relaxed);
    }

    /// Whether new games are stopped.
    pub(crate) fn is_stopping(&self) -> bool {
        self.stopping.load(Relaxed)
    }

    /// Decisions answered so far.
    pub(crate) fn decisions(&self) -> u64 {
        self.decisions.load(Relaxed)
    }

    /// Warms up, opens the window, closes it.
    pub(crate) async fn measure(
        &self,
        plan: &Plan,
        server: Option<u32>,
    ) -> Result<Window, LoadError> {
        tokio::time::sleep(plan.warmup).await;
        let playing_bytes = server
            .map(gauge::resident_bytes)
            .transpose()
            .map_err(LoadError::io("reading the server's memory"))?;
        let before = Reading::take(self, plan, server)?;
        self.open.store(true, Relaxed);
        let end = before.at + plan.window;
        match plan.decisions {
            None => tokio::time::sleep_until(end.into()).await,
            Some(enough) => {
                while Instant::now() < end && self.decisions() - before.decisions < enough {
                    tokio::time::sleep(GLANCE).await;
                }
            }
        }
        let after = Reading::take(self, plan, server)?;
        self.open.store(false, Relaxed);
        Ok(Window {
            decisions: after.decisions - before.decisions,
            elapsed: after.at - before.at,
            server_cpu: after
                .server_cpu
                .zip(before.server_cpu)
                .map(|(after, before)| after.saturating_sub(before)),
            server_instructions: after
                .server_instructions
                .zip(before.server_instructions)
                .map(|(after, before)| after.saturating_sub(before)),
            client_cpu: after.client_cpu.saturating_sub(before.client_cpu),
            playing_bytes,
        })
    }

    fn now_ns(&self) -> u64 {
        u64::try_from(self.epoch.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }
}

/// The counters at one moment.
struct Reading {
    at: Instant,
    decisions: u64,
    server_cpu: Option<Duration>,
    server_instructions: Option<u64>,
    client_cpu: Duration,
}

impl Reading {
    fn take(pulse: &Pulse, plan: &Plan, server: Option<u32>) -> Result<Self, LoadError> {
        let cpu = |pid| gauge::cpu_time(pid).map_err(LoadError::io("reading CPU times"));
        let counted = server.filter(|_| plan.instructions);
        let instructions =
            |pid| gauge::instructions(pid).map_err(LoadError::io("counting instructions"));
        Ok(Self {
            server_cpu: server.map(cpu).transpose()?,
            server_instructions: counted.map(instructions).transpose()?,
            client_cpu: cpu(std::process::id())?,
            decisions: pulse.decisions(),
            at: Instant::now(),
        })
    }
}
