//! What the costs that were measured on one machine say about a cluster of many nodes: CPU, what the
//! database writes and keeps, the time until a decision is acknowledged, the time until games continue
//! after the loss of a node, and what reaches its limit first.
//! `docs/cluster.md` states what is assumed.
//!
//! `cargo run --release -p chefshat-cluster --example scale -- --help`

use std::cmp::{Ordering, Reverse};
use std::collections::{BinaryHeap, VecDeque};

use chefshat_cluster::LeaseTimes;
use clap::Parser;
use rand::rngs::SmallRng;
use rand::seq::index::sample;
use rand::{RngExt as _, SeedableRng as _};

/// Rows that one writer commits at a time, and writers of a node.
const ROWS_AT_ONCE: usize = 1_024;
const WRITERS: usize = 2;
/// Connections of a node to the database.
const CONNECTIONS: usize = 15;
/// Time between two searches for units without an owner, and most that one finds.
const SEARCH_EVERY_MS: f64 = 500.0;
const FOUND_AT_ONCE: usize = 64;
/// Units that a node reads and replays at a time.
const LOADS_AT_ONCE: usize = 4;
/// Longest pause of a gateway that waits for the new owner of a room.
const LOOK_EVERY_MS: f64 = 250.0;
/// Simulated time in which decisions are counted, and the time before it.
const WINDOW_MS: f64 = 2_000.0;
const WARM_UP_MS: f64 = 500.0;
/// Games of a partition of the journal.
const PARTITION: f64 = 262_144.0;
const SECONDS_OF_A_DAY: f64 = 86_400.0;
/// Simulated losses of a node.
const LOSSES: usize = 50;
/// The part of its CPU that a database may use in the long run.
const USABLE: f64 = 0.7;

/// Simulates a large cluster from measured costs.
#[derive(Debug, Parser)]
struct Scale {
    /// Nodes.
    #[arg(long, default_value_t = 100)]
    nodes: usize,
    /// Seats that play.
    #[arg(long, default_value_t = 1_000_000)]
    seats: usize,
    /// Seats of a room.
    #[arg(long, default_value_t = 4)]
    seats_per_room: usize,
    /// Time from one decision of a room to the next, milliseconds.
    #[arg(long, default_value_t = 1_000.0)]
    pace_ms: f64,
    /// Decisions of a game.
    #[arg(long, default_value_t = 261.0)]
    decisions: f64,
    /// Cores of the database.
    #[arg(long, default_value_t = 32)]
    cores: usize,
    /// What the disk of the database writes, MB a second.
    #[arg(long, default_value_t = 500.0)]
    disk_mb: f64,
    /// CPU of a node for a decision of a client that is connected to it, microseconds.
    #[arg(long, default_value_t = 41.0)]
    direct_us: f64,
    /// CPU of both nodes for a decision of a client that is connected to another one, microseconds.
    #[arg(long, default_value_t = 106.0)]
    forwarded_us: f64,
    /// CPU of the database for a decision, with its part of a commit, microseconds.
    #[arg(long, default_value_t = 54.0)]
    database_us: f64,
    /// Time that a commit takes until it is safe, milliseconds.
    #[arg(long, default_value_t = 3.4)]
    sync_ms: f64,
    /// Time between two nodes, there and back, milliseconds.
    #[arg(long, default_value_t = 0.5)]
    hop_ms: f64,
    /// CPU of the database for the start and the end of a game together, microseconds.
    #[arg(long, default_value_t = 1_000.0)]
    game_us: f64,
    /// Ends of games that the database numbers in a second, in the order of their commits.
    #[arg(long, default_value_t = 1_280.0)]
    ends: f64,
    /// Bytes that a decision adds to the log of the database.
    #[arg(long, default_value_t = 232.0)]
    log_bytes: f64,
    /// Bytes that a decision adds to its tables and indexes.
    #[arg(long, default_value_t = 118.0)]
    row_bytes: f64,
    /// CPU of the database for a beat, microseconds.
    #[arg(long, default_value_t = 550.0)]
    beat_us: f64,
    /// CPU of the database for each unit that the answer to a beat names, microseconds.
    #[arg(long, default_value_t = 2.1)]
    owned_us: f64,
    /// CPU of the database for a search for units without an owner, microseconds.
    #[arg(long, default_value_t = 300.0)]
    search_us: f64,
    /// Time that claiming 64 units takes, milliseconds.
    #[arg(long, default_value_t = 50.0)]
    claim_ms: f64,
    /// Time that reading and replaying a unit takes, milliseconds.
    #[arg(long, default_value_t = 20.0)]
    load_ms: f64,
}

impl Scale {
    fn rooms(&self) -> usize {
        self.seats / self.seats_per_room
    }

    /// Decisions each millisecond.
    fn rate(&self) -> f64 {
        self.rooms() as f64 / self.pace_ms
    }

    /// Games that begin, and that end, each second.
    fn games(&self) -> f64 {
        self.rate() * 1e3 / self.decisions
    }

    /// The part of the decisions whose clients are connected to another node: any one.
    fn forwarded(&self) -> f64 {
        1.0 - 1.0 / self.nodes as f64
    }

    /// Cores of one node.
    fn node_cores(&self) -> f64 {
        let direct = (1.0 - self.forwarded()) * self.direct_us;
        let each = direct + self.forwarded() * self.forwarded_us;
        self.rate() / self.nodes as f64 * each / 1e3
    }

    /// Cores of the database for decisions.
    fn decision_cores(&self) -> f64 {
        self.rate() * self.database_us / 1e3
    }

    /// Cores of the database for starts and ends of games.
    fn game_cores(&self) -> f64 {
        self.games() * self.game_us / 1e6
    }

    /// MB a second that the database logs.
    fn log_mb(&self) -> f64 {
        self.rate() * self.log_bytes / 1e3
    }

    /// What limits the cluster, and at how many times this load.
    fn limits(&self) -> [(&'static str, f64); 3] {
        let cores = self.cores as f64 * USABLE - self.upkeep_cores();
        [
            (
                "the CPU of the database",
                cores / (self.decision_cores() + self.game_cores()),
            ),
            ("the ends of games", self.ends / self.games()),
            ("what the disk writes", self.disk_mb / self.log_mb()),
        ]
    }

    /// Cores of the database for what happens without games.
    fn upkeep_cores(&self) -> f64 {
        let units = (self.rooms() / self.nodes) as f64;
        let beats = (self.beat_us + units * self.owned_us) / beat_every_ms();
        // A gateway reads once a second which nodes have a lease, which costs no more.
        let searches = self.search_us * (1.0 / SEARCH_EVERY_MS + 1.0 / 1e3);
        self.nodes as f64 * (beats + searches) / 1e3
    }

    fn show(&self) {
        println!(
            "{} nodes, {} seats in {} rooms, a decision of each every {} ms",
            self.nodes,
            self.seats,
            self.rooms(),
            self.pace_ms
        );
        let row = |what: &str, value: String| println!("{what:<44} {value}");
        row("decisions a second", format!("{:.0}", self.rate() * 1e3));
        row(
            "of them through another node",
            format!("{:.0} %", self.forwarded() * 100.0),
        );
        row("cores of a node", format!("{:.2}", self.node_cores()));
        row(
            "games that begin and end, a second",
            format!("{:.0}", self.games()),
        );
        row(
            "cores of the database: decisions",
            format!("{:.1} of {}", self.decision_cores(), self.cores),
        );
        row(
            "cores of the database: starts and ends",
            format!("{:.2}", self.game_cores()),
        );
        row(
            "cores of the database: beats and searches",
            format!("{:.2}", self.upkeep_cores()),
        );
        row(
            "connections to the database",
            format!("{}", self.nodes * CONNECTIONS),
        );
        row("log of the database", format!("{:.1} MB/s", self.log_mb()));
        let kept = self.rate() * self.row_bytes * SECONDS_OF_A_DAY / 1e6;
        let partitions = self.games() * SECONDS_OF_A_DAY / PARTITION;
        row(
            "its growth a day",
            format!("{kept:.0} GB, {partitions:.1} partitions"),
        );
        let (latencies, rows) = Decisions::new(self).run();
        row("decisions of a commit", quantiles(rows, "", 1.0));
        row("acknowledged after", quantiles(latencies, " ms", 1.0));
        let mut random = SmallRng::seed_from_u64(1);
        let losses = (0..LOSSES).flat_map(|_| Loss::new(self, &mut random).run(&mut random));
        let losses: Vec<f64> = losses.collect();
        row(
            "a node is lost: next decision after",
            quantiles(losses, " s", 1e-3),
        );
        let mut limits = self.limits();
        limits.sort_by(|one, other| one.1.total_cmp(&other.1));
        for ((limit, times), what) in limits.iter().zip(["limited first by", "then", "then"]) {
            row(what, format!("{limit}, at {times:.1} times this load"));
        }
    }
}

fn beat_every_ms() -> f64 {
    LeaseTimes::DEFAULT.beat_every_ms() as f64
}

fn quantiles(mut figures: Vec<f64>, unit: &str, factor: f64) -> String {
    figures.sort_by(f64::total_cmp);
    let last = figures.len().saturating_sub(1) as f64;
    let [median, late, most] = [0.5, 0.99, 1.0].map(|share| {
        let figure = figures.get((share * last) as usize);
        figure.map_or(f64::NAN, |figure| figure * factor)
    });
    format!(
        "{median:.1}{unit} (median), {late:.1}{unit} (p99), {most:.1}{unit} (most) of {}",
        figures.len()
    )
}

/// An event at a time, in milliseconds.
struct At<E>(f64, E);

impl<E> Ord for At<E> {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl<E> PartialOrd for At<E> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<E> PartialEq for At<E> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl<E> Eq for At<E> {}

/// Decisions on their way through the writers of the nodes, the cores of the database and its log,
/// which is synced for all that wait at once.
struct Decisions<'a> {
    scale: &'a Scale,
    random: SmallRng,
    now: f64,
    events: BinaryHeap<Reverse<At<Event>>>,
    /// By node: when the decisions arrived that wait for a writer, and how many writers are busy.
    waiting: Vec<(VecDeque<f64>, usize)>,
    for_core: VecDeque<Batch>,
    cores_busy: usize,
    for_sync: Vec<Batch>,
    syncing: Vec<Batch>,
    latencies: Vec<f64>,
    /// How many decisions each commit had.
    rows: Vec<f64>,
}

enum Event {
    Decision(usize),
    Executed(Batch),
    Synced,
}

/// The decisions that one writer commits.
struct Batch {
    node: usize,
    arrived: Vec<f64>,
}

impl<'a> Decisions<'a> {
    fn new(scale: &'a Scale) -> Self {
        let mut new = Self {
            scale,
            random: SmallRng::seed_from_u64(0),
            now: 0.0,
            events: BinaryHeap::new(),
            waiting: (0..scale.nodes).map(|_| (VecDeque::new(), 0)).collect(),
            for_core: VecDeque::new(),
            cores_busy: 0,
            for_sync: Vec::new(),
            syncing: Vec::new(),
            latencies: Vec::new(),
            rows: Vec::new(),
        };
        (0..scale.nodes).for_each(|node| new.await_decision(node));
        new
    }

    /// The times from decisions to their acknowledgements, and how many each commit had.
    fn run(mut self) -> (Vec<f64>, Vec<f64>) {
        while let Some(Reverse(At(now, event))) = self.events.pop() {
            if now > WARM_UP_MS + WINDOW_MS {
                break;
            }
            self.now = now;
            match event {
                Event::Decision(node) => {
                    self.waiting[node].0.push_back(now);
                    self.await_decision(node);
                    self.write(node);
                }
                Event::Executed(batch) => {
                    self.cores_busy -= 1;
                    self.execute();
                    self.for_sync.push(batch);
                    self.sync();
                }
                Event::Synced => self.synced(),
            }
        }
        (self.latencies, self.rows)
    }

    fn after(&mut self, ms: f64, event: Event) {
        self.events.push(Reverse(At(self.now + ms, event)));
    }

    /// The decisions of a node are independent of each other.
    fn await_decision(&mut self, node: usize) {
        let mean = self.scale.nodes as f64 / self.scale.rate();
        let until = -mean * (1.0 - self.random.random::<f64>()).ln();
        self.after(until, Event::Decision(node));
    }

    fn write(&mut self, node: usize) {
        let (waiting, busy) = &mut self.waiting[node];
        if waiting.is_empty() || *busy == WRITERS {
            return;
        }
        *busy += 1;
        let arrived = waiting.drain(..waiting.len().min(ROWS_AT_ONCE)).collect();
        self.for_core.push_back(Batch { node, arrived });
        self.execute();
    }

    fn execute(&mut self) {
        while self.cores_busy < self.scale.cores
            && let Some(batch) = self.for_core.pop_front()
        {
            self.cores_busy += 1;
            let takes = batch.arrived.len() as f64 * self.scale.database_us / 1e3;
            self.after(takes, Event::Executed(batch));
        }
    }

    fn sync(&mut self) {
        if self.syncing.is_empty() && !self.for_sync.is_empty() {
            self.syncing = std::mem::take(&mut self.for_sync);
            self.after(self.scale.sync_ms, Event::Synced);
        }
    }

    fn synced(&mut self) {
        for batch in std::mem::take(&mut self.syncing) {
            self.rows.push(batch.arrived.len() as f64);
            for arrived in batch.arrived {
                let hop = match self.random.random_bool(self.scale.forwarded()) {
                    true => self.scale.hop_ms,
                    false => 0.0,
                };
                if arrived >= WARM_UP_MS {
                    self.latencies.push(self.now - arrived + hop);
                }
            }
            self.waiting[batch.node].1 -= 1;
            self.write(batch.node);
        }
        self.sync();
    }
}

/// A node is lost, and the others take its units over.
struct Loss<'a> {
    scale: &'a Scale,
    /// When its lease ends; it is lost at 0.
    expires: f64,
    /// Whether each of its units is claimed.
    claimed: Vec<bool>,
    /// By node: when each of its loads has ended.
    loads: Vec<[f64; LOADS_AT_ONCE]>,
    events: BinaryHeap<Reverse<At<Takeover>>>,
}

enum Takeover {
    Search(usize),
    /// A node has claimed these units, unless others were faster.
    Claimed(usize, Vec<usize>),
}

impl<'a> Loss<'a> {
    fn new(scale: &'a Scale, random: &mut SmallRng) -> Self {
        let since_beat = random.random::<f64>() * beat_every_ms();
        let mut events = BinaryHeap::new();
        for node in 1..scale.nodes {
            let at = random.random::<f64>() * SEARCH_EVERY_MS;
            events.push(Reverse(At(at, Takeover::Search(node))));
        }
        Self {
            scale,
            expires: LeaseTimes::DEFAULT.expire_after_ms() as f64 - since_beat,
            claimed: vec![false; scale.rooms() / scale.nodes],
            loads: vec![[0.0; LOADS_AT_ONCE]; scale.nodes],
            events,
        }
    }

    /// The times from the loss to the next decision of each room.
    fn run(mut self, random: &mut SmallRng) -> Vec<f64> {
        let mut resumed = Vec::with_capacity(self.claimed.len());
        while resumed.len() < self.claimed.len()
            && let Some(Reverse(At(now, event))) = self.events.pop()
        {
            match event {
                Takeover::Search(node) => {
                    let next = At(now + SEARCH_EVERY_MS, Takeover::Search(node));
                    self.events.push(Reverse(next));
                    self.search(node, now, random);
                }
                Takeover::Claimed(node, mut units) => {
                    units.retain(|unit| !self.claimed[*unit]);
                    for unit in &units {
                        self.claimed[*unit] = true;
                        let runs = self.load(node, now);
                        resumed.push(runs + random.random::<f64>() * LOOK_EVERY_MS);
                    }
                    if !units.is_empty() {
                        self.search(node, now, random);
                    }
                }
            }
        }
        resumed
    }

    fn search(&mut self, node: usize, now: f64, random: &mut SmallRng) {
        if now < self.expires {
            return;
        }
        let units = 0..self.claimed.len();
        let left: Vec<usize> = units.filter(|unit| !self.claimed[*unit]).collect();
        if left.is_empty() {
            return;
        }
        // Each node has an order of its own.
        let found = sample(random, left.len(), left.len().min(FOUND_AT_ONCE));
        let found: Vec<usize> = found.into_iter().map(|index| left[index]).collect();
        let answered = now + self.scale.search_us / 1e3 + self.scale.claim_ms;
        let claimed = At(answered, Takeover::Claimed(node, found));
        self.events.push(Reverse(claimed));
    }

    /// When the next unit that a node has claimed runs.
    fn load(&mut self, node: usize, now: f64) -> f64 {
        let loads = self.loads[node].iter_mut();
        let first = loads.min_by(|one, other| one.total_cmp(other));
        let first = first.expect("a node loads some at a time");
        *first = first.max(now) + self.scale.load_ms;
        *first
    }
}

fn main() {
    Scale::parse().show();
}
