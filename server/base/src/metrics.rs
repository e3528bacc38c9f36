//! What a server counts for its operator: the metrics that `scrape` serves to Prometheus. Counting
//! takes an atomic operation or two; only a refusal and a new stream take a lock. What can be read
//! when it is asked for is not counted here but read by `scrape`. Labels have a fixed set of values:
//! never names or ids.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration;

use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric, MetricEncoder, text};
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::{ConstGauge, Gauge};
use prometheus_client::metrics::{MetricType, TypedMetric};
use prometheus_client::registry::{Registry, Unit};
use tokio::sync::Notify;
use tokio::time::{Instant, sleep};

use chefshat_room::State;
use chefshat_room::journal::{Decided, ParticipantKind, Source};

/// Prefix of the names of all metrics.
const PREFIX: &str = "chefshat";
/// Upper bounds of the buckets of times in the server, microseconds.
const SERVER_TIMES: &[u64] = &[
    50, 100, 250, 500, 1_000, 2_500, 5_000, 10_000, 25_000, 50_000, 100_000, 250_000, 500_000,
    1_000_000, 2_500_000, 5_000_000, 10_000_000,
];
/// Upper bounds of the buckets of thinking times, microseconds.
const THINKING_TIMES: &[u64] = &[
    1_000,
    2_500,
    5_000,
    10_000,
    25_000,
    50_000,
    100_000,
    250_000,
    500_000,
    1_000_000,
    2_500_000,
    5_000_000,
    10_000_000,
    30_000_000,
    60_000_000,
    300_000_000,
];
/// Upper bounds of the buckets of batch sizes.
const BATCH_SIZES: &[u64] = &[1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1_024];
/// Microseconds of a second.
const MICROS: f64 = 1e6;

/// How a decision was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// By the answer of the seat's agent.
    Answered,
    /// By default: time ran out while the agent was connected.
    Timeout,
    /// By default: too many invalid answers.
    Invalid,
    /// By default: time ran out while no agent was connected.
    Disconnected,
    /// By a built-in agent in place of the seat's own.
    Substitute,
    /// By the built-in agent of the seat.
    BuiltIn,
    /// Taken over from a record, or reported from a physical table.
    Recorded,
}

impl Outcome {
    /// The values of the label, in the order of the outcomes.
    const LABELS: [&str; 7] = [
        "answered",
        "timeout",
        "invalid",
        "disconnected",
        "substitute",
        "built_in",
        "recorded",
    ];

    /// The outcome of a decision; `built_in`: the seat belongs to a built-in agent.
    pub fn of(source: Source, built_in: bool) -> Self {
        match source {
            Source::Agent if built_in => Self::BuiltIn,
            Source::Agent => Self::Answered,
            Source::Timeout => Self::Timeout,
            Source::Invalid => Self::Invalid,
            Source::Disconnected => Self::Disconnected,
            Source::Substitute => Self::Substitute,
            Source::Recorded | Source::Table => Self::Recorded,
        }
    }

    /// The value of the label.
    pub fn label(self) -> &'static str {
        Self::LABELS[self as usize]
    }
}

/// How a search in a room ended. Unless it was searched, the agent plays as it would without a
/// search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchOutcome {
    /// Searched.
    Searched,
    /// No thread was free in time, or it got too little time.
    Busy,
    /// Within its budget, no action was tried in enough deals to show a gain.
    TooFewDeals,
    /// The possible deals are too many to count.
    Impossible,
    /// It panicked.
    Failed,
}

impl SearchOutcome {
    const LABELS: [&str; 5] = ["searched", "busy", "too_few_deals", "impossible", "failed"];

    /// The value of the label.
    pub fn label(self) -> &'static str {
        Self::LABELS[self as usize]
    }
}

/// What became of a webhook.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WebhookOutcome {
    /// Received.
    Delivered,
    /// Given up after all attempts.
    Failed,
    /// Dropped, because too many waited.
    Dropped,
    /// Dropped, because the receiver refused it for good.
    Refused,
}

impl WebhookOutcome {
    const LABELS: [&str; 4] = ["delivered", "failed", "dropped", "refused"];
}

/// What a stream is for.
#[derive(Debug, Clone, Copy)]
pub enum StreamKind {
    /// `PlayService.Play`.
    Play,
    /// `PlayService.Watch`.
    Watch,
    /// `SpectatorService.Watch`.
    Spectate,
    /// `VectorService.Run`.
    Vector,
    /// `TournamentService.Follow`.
    Follow,
}

impl StreamKind {
    const LABELS: [&str; 5] = ["play", "watch", "spectate", "vector", "follow"];
}

/// The metrics of a server.
#[derive(Debug)]
pub struct Metrics {
    registry: Mutex<Registry>,
    rooms: [Gauge; 4],
    seats: [Gauge; 4],
    spectators: Gauge,
    streams: [Gauge; 5],
    connections: Gauge,
    decisions: [Counter; 7],
    searches: [Counter; 5],
    invalid_answers: Counter,
    thinking: Histogram,
    answers: Histogram,
    games_ended: [Counter; 2],
    /// Refused requests, by reason.
    refusals: Family<[(&'static str, String); 1], Counter>,
    webhooks: [Counter; 4],
    vector_decisions: Counter,
    vector_games: Gauge,
    node_lease: Gauge,
    node_reached: Gauge,
    takeovers: Counter,
    handovers: Counter,
    not_resumed: Counter,
    peer_errors: Counter,
    peers_unreachable: Gauge,
    peers_other_key: Gauge,
    outboxes: Mutex<Vec<Weak<dyn Queue>>>,
}

impl Default for Metrics {
    fn default() -> Self {
        let mut registry = Registry::default();
        let all = registry.sub_registry_with_prefix(PREFIX);
        let rooms = ["waiting", "playing", "finished", "aborted"];
        let kinds = ["agent", "human", "robot", "model"];
        let help = "1 while the server may publish, 0 while a node of a cluster has no lease";
        let node_lease: Gauge = plain(all, "node_lease", help);
        node_lease.set(1);
        let help =
            "0 while no other node has reached a node of a cluster since it joined, otherwise 1";
        let node_reached: Gauge = plain(all, "node_reached", help);
        node_reached.set(1);
        Self {
            rooms: labelled(all, "rooms", "Listed rooms", "state", rooms),
            seats: labelled(
                all,
                "seats_connected",
                "Seats with a connection",
                "kind",
                kinds,
            ),
            spectators: plain(all, "spectators", "Spectators of all rooms"),
            streams: labelled(
                all,
                "streams",
                "Open streams",
                "service",
                StreamKind::LABELS,
            ),
            connections: plain(all, "connections", "Open connections"),
            decisions: labelled(
                all,
                "decisions",
                "Decisions of rooms",
                "outcome",
                Outcome::LABELS,
            ),
            searches: labelled(
                all,
                "searches",
                "Searches in rooms, for built-in agents and hints",
                "outcome",
                SearchOutcome::LABELS,
            ),
            invalid_answers: plain(all, "invalid_answers", "Illegal actions that were sent"),
            thinking: timed(
                all,
                "thinking",
                "Time that participants took for a decision",
                THINKING_TIMES,
            ),
            answers: timed(
                all,
                "answer",
                "Time from reading an answer to publishing its result",
                SERVER_TIMES,
            ),
            games_ended: labelled(
                all,
                "games_ended",
                "Games that ended",
                "result",
                ["finished", "aborted"],
            ),
            refusals: plain(all, "refusals", "Refused requests"),
            webhooks: labelled(
                all,
                "webhooks",
                "Webhooks, when they are settled",
                "outcome",
                WebhookOutcome::LABELS,
            ),
            vector_decisions: plain(all, "vector_decisions", "Decisions of vector games"),
            vector_games: plain(all, "vector_games", "Games of open vector streams"),
            node_lease,
            node_reached,
            takeovers: plain(
                all,
                "takeovers",
                "Rooms, tournaments and studies that the node took over from others or had to read again",
            ),
            handovers: plain(
                all,
                "handovers",
                "Rooms, tournaments and studies that the node handed over to one that was less full",
            ),
            not_resumed: plain(
                all,
                "not_resumed",
                "Rooms, tournaments and studies that could not be resumed and stand still",
            ),
            peer_errors: plain(
                all,
                "peer_errors",
                "Connections to other nodes that could not be opened",
            ),
            peers_unreachable: plain(
                all,
                "peers_unreachable",
                "Other nodes with a lease that this node does not reach",
            ),
            peers_other_key: plain(
                all,
                "peers_other_key",
                "Other nodes with a lease that sign records with another key",
            ),
            outboxes: Mutex::default(),
            registry: Mutex::new(registry),
        }
    }
}

impl Metrics {
    /// Adds metrics of the server that are read whenever all are.
    pub fn add(&self, collector: impl Collector) {
        self.registry(|registry| {
            let registry = registry.sub_registry_with_prefix(PREFIX);
            registry.register_collector(Box::new(collector));
        });
    }

    /// Adds metrics of the process, whose names are those that other programs use, too.
    pub fn add_process(&self, collector: impl Collector) {
        self.registry(|registry| registry.register_collector(Box::new(collector)));
    }

    /// Adds those of a store.
    pub fn add_store(&self, store: &StoreMetrics) {
        self.registry(|registry| {
            let registry = registry.sub_registry_with_prefix(PREFIX);
            let help = "Time to commit a transaction";
            registry.register_with_unit("commit", help, Unit::Seconds, store.commit.clone());
            let help = "Commands of one transaction";
            registry.register("commit_commands", help, store.commands.clone());
            let help = "Transactions that were sent again because they had no answer";
            registry.register("commit_retries", help, store.retries.clone());
            let help = "Rooms, tournaments and studies that had to stop because the database had lost what it had committed";
            registry.register("commits_lost", help, store.losses.clone());
            registry.register_collector(Box::new(store.clone()));
        });
    }

    /// All metrics in the text format of OpenMetrics.
    pub fn text(&self) -> String {
        let mut text = String::new();
        self.registry(|registry| {
            text::encode(&mut text, registry).expect("a String takes everything");
        });
        text
    }

    fn registry<T>(&self, work: impl FnOnce(&mut Registry) -> T) -> T {
        work(&mut self.registry.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Counts a room in a state while the guard lives.
    pub fn room(&self, state: State) -> Counted {
        let index = match state {
            State::Waiting => 0,
            State::Playing => 1,
            State::Finished => 2,
            State::Aborted(_) => 3,
        };
        Counted::new(&self.rooms[index])
    }

    /// Counts a connected seat while the guard lives.
    pub fn seat(&self, kind: ParticipantKind) -> Counted {
        let index = match kind {
            ParticipantKind::Agent => 0,
            ParticipantKind::Human => 1,
            ParticipantKind::Robot => 2,
            ParticipantKind::Model => 3,
        };
        Counted::new(&self.seats[index])
    }

    /// Counts a spectator while the guard lives.
    pub fn spectator(&self) -> Counted {
        Counted::new(&self.spectators)
    }

    /// Counts a stream while the guard lives.
    pub fn stream(&self, kind: StreamKind) -> Counted {
        Counted::new(&self.streams[kind as usize])
    }

    /// The gauge of open connections.
    pub fn connections(&self) -> &Gauge {
        &self.connections
    }

    /// Counts a decision.
    pub fn decided(&self, decided: &Decided, outcome: Outcome) {
        self.decisions[outcome as usize].inc();
        if outcome == Outcome::Answered {
            self.thinking.observe(decided.time_us);
        }
    }

    /// Number of searches that ended in this way.
    #[cfg(any(test, feature = "testing"))]
    pub fn searches(&self, outcome: SearchOutcome) -> u64 {
        self.searches[outcome as usize].get()
    }

    /// Counts a search.
    pub fn searched(&self, outcome: SearchOutcome) {
        self.searches[outcome as usize].inc();
    }

    /// Counts a webhook.
    pub fn webhook(&self, outcome: WebhookOutcome) {
        self.webhooks[outcome as usize].inc();
    }

    /// Number of webhooks with this outcome.
    #[cfg(any(test, feature = "testing"))]
    pub fn webhooks(&self, outcome: WebhookOutcome) -> u64 {
        self.webhooks[outcome as usize].get()
    }

    /// Counts an illegal action.
    pub fn invalid_answer(&self) {
        self.invalid_answers.inc();
    }

    /// Counts an answer whose result was published this long after it had been read.
    pub fn answered(&self, after: Duration) {
        self.answers.observe_duration(after);
    }

    /// Counts the end of a game.
    pub fn game_ended(&self, finished: bool) {
        self.games_ended[usize::from(!finished)].inc();
    }

    /// Counts a refused request. `reason`: a constant of this server, never text of a client.
    pub fn refused(&self, reason: &str) {
        let labels = [("reason", reason.to_owned())];
        self.refusals.get_or_create(&labels).inc();
    }

    /// Counts decisions of vector games.
    pub fn vector_decided(&self, decisions: u64) {
        self.vector_decisions.inc_by(decisions);
    }

    /// Counts the games of a vector stream while the guard lives.
    pub fn vector_games(&self, games: u32) -> Counted {
        Counted::several(&self.vector_games, games.into())
    }

    /// Says whether the node of a cluster has a lease.
    pub fn leased(&self, has_lease: bool) {
        self.node_lease.set(has_lease.into());
    }

    /// Says whether the node of a cluster has been reached since it joined.
    pub fn reached(&self, is_reached: bool) {
        self.node_reached.set(is_reached.into());
    }

    /// Counts a unit that the node is about to resume.
    pub fn taken_over(&self) {
        self.takeovers.inc();
    }

    /// Counts a unit that the node has handed over to one that was less full.
    pub fn handed_over(&self) {
        self.handovers.inc();
    }

    /// Counts a connection to another node that could not be opened.
    pub fn peer_error(&self) {
        self.peer_errors.inc();
    }

    /// Says how many other nodes this one does not reach, and how many sign records with another key.
    pub fn peers(&self, unreachable: usize, other_key: usize) {
        let number = |peers| i64::try_from(peers).unwrap_or(i64::MAX);
        self.peers_unreachable.set(number(unreachable));
        self.peers_other_key.set(number(other_key));
    }

    /// How many other nodes this one does not reach.
    pub fn unreachable_peers(&self) -> u32 {
        u32::try_from(self.peers_unreachable.get()).unwrap_or(0)
    }

    /// Counts a unit that could not be resumed.
    pub fn not_resumed(&self) {
        self.not_resumed.inc();
    }

    /// Includes an outbox in the depths of queues.
    pub fn add_outbox<Q: Queue>(&self, outbox: &Arc<Q>) {
        let mut outboxes = self.outboxes();
        if outboxes.len() == outboxes.capacity() {
            outboxes.retain(|outbox| outbox.strong_count() > 0);
        }
        let outbox: Weak<Q> = Arc::downgrade(outbox);
        outboxes.push(outbox);
    }

    /// Updates and events in each outbox.
    pub fn outbox_depths(&self) -> Vec<usize> {
        let outboxes: Vec<_> = self.outboxes().iter().filter_map(Weak::upgrade).collect();
        outboxes.iter().map(|outbox| outbox.depth()).collect()
    }

    fn outboxes(&self) -> std::sync::MutexGuard<'_, Vec<Weak<dyn Queue>>> {
        (self.outboxes.lock()).expect("no code that holds this lock can panic")
    }
}

/// A queue whose depth is counted.
pub trait Queue: std::fmt::Debug + Send + Sync + 'static {
    /// Number of items that wait.
    fn depth(&self) -> usize;
}

/// How long nothing is committed until that is a stall.
const STALL: Duration = Duration::from_secs(10);
/// How often that is looked at while something waits.
const LOOK: Duration = Duration::from_secs(1);

/// The metrics of a store with a writer.
#[derive(Debug, Clone)]
pub struct StoreMetrics {
    commit: Histogram,
    commands: Histogram,
    retries: Counter,
    losses: Counter,
    waiting: Arc<Mutex<Waiting>>,
    /// A transaction waits, and none did before.
    begun: Arc<Notify>,
}

/// The transactions that wait for their commit.
#[derive(Debug)]
struct Waiting {
    /// By number, in the order in which they began.
    transactions: BTreeMap<u64, Transaction>,
    /// How many have begun.
    begun: u64,
    last_commit: Instant,
}

#[derive(Debug, Clone, Copy)]
struct Transaction {
    since: Instant,
    /// Whether it is about a row that is locked.
    is_aside: bool,
}

impl Default for StoreMetrics {
    fn default() -> Self {
        let waiting = Waiting {
            transactions: BTreeMap::new(),
            begun: 0,
            last_commit: Instant::now(),
        };
        Self {
            commit: Histogram::new(SERVER_TIMES, MICROS),
            commands: Histogram::new(BATCH_SIZES, 1.0),
            retries: Counter::default(),
            losses: Counter::default(),
            waiting: Arc::new(Mutex::new(waiting)),
            begun: Arc::default(),
        }
    }
}

impl StoreMetrics {
    /// Counts a transaction.
    pub fn committed(&self, commands: usize, time: Duration) {
        self.commit.observe_duration(time);
        (self.commands).observe(u64::try_from(commands).unwrap_or(u64::MAX));
        locked(&self.waiting).last_commit = Instant::now();
    }

    /// Counts a transaction that is sent again.
    pub fn retried(&self) {
        self.retries.inc();
    }

    /// Counts units of which the database has lost rows.
    pub fn lost(&self, units: u64) {
        self.losses.inc_by(units);
    }

    /// A transaction waits for its commit while the guard lives.
    pub fn waits(&self) -> Waits {
        let mut waiting = locked(&self.waiting);
        if waiting.transactions.is_empty() {
            self.begun.notify_one();
        }
        let number = waiting.begun;
        waiting.begun += 1;
        let transaction = Transaction {
            since: Instant::now(),
            is_aside: false,
        };
        waiting.transactions.insert(number, transaction);
        Waits(Arc::clone(&self.waiting), number)
    }

    /// How long the oldest transaction has waited.
    fn longest_wait(&self) -> Duration {
        let waiting = locked(&self.waiting);
        let oldest = waiting.transactions.values().next();
        oldest.map_or(Duration::ZERO, |oldest| oldest.since.elapsed())
    }

    /// Whether nothing can be committed: for ten seconds nothing was, although a transaction has waited for
    /// as long. A single one that is set aside may meet a lock that concerns no other.
    pub fn is_stalled(&self) -> bool {
        let waiting = locked(&self.waiting);
        let late = (waiting.transactions.values()).filter(|it| it.since.elapsed() >= STALL);
        let (mut aside, mut others) = (0, 0);
        late.for_each(|it| match it.is_aside {
            true => aside += 1,
            false => others += 1,
        });
        waiting.last_commit.elapsed() >= STALL && (others > 0 || aside > 1)
    }

    /// Waits until [`StoreMetrics::is_stalled`] is not this any more.
    pub async fn is_not(&self, stalled: bool) {
        while self.is_stalled() == stalled {
            let is_idle = locked(&self.waiting).transactions.is_empty();
            if is_idle {
                self.begun.notified().await;
            }
            sleep(LOOK).await;
        }
    }
}

fn locked(waiting: &Mutex<Waiting>) -> MutexGuard<'_, Waiting> {
    waiting
        .lock()
        .expect("no code that holds this lock can panic")
}

impl Collector for StoreMetrics {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> std::fmt::Result {
        let waits = ConstGauge::new(self.longest_wait().as_secs_f64());
        let help = "How long the oldest transaction has waited for its commit";
        let (unit, kind) = (Some(&Unit::Seconds), waits.metric_type());
        waits.encode(encoder.encode_descriptor("commit_waiting", help, unit, kind)?)
    }
}

/// Says that a transaction waits, until it is dropped.
#[derive(Debug)]
pub struct Waits(Arc<Mutex<Waiting>>, u64);

impl Waits {
    /// It meets a lock, and is tried apart from the others.
    pub fn set_aside(&self) {
        if let Some(transaction) = locked(&self.0).transactions.get_mut(&self.1) {
            transaction.is_aside = true;
        }
    }
}

impl Drop for Waits {
    fn drop(&mut self) {
        locked(&self.0).transactions.remove(&self.1);
    }
}

/// Counts something in a gauge while it lives.
#[derive(Debug)]
pub struct Counted {
    gauge: Gauge,
    count: i64,
}

impl Counted {
    /// Counts one.
    pub fn new(gauge: &Gauge) -> Self {
        Self::several(gauge, 1)
    }

    fn several(gauge: &Gauge, count: i64) -> Self {
        gauge.inc_by(count);
        Self {
            gauge: gauge.clone(),
            count,
        }
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.gauge.dec_by(self.count);
    }
}

fn plain<M: prometheus_client::registry::Metric + Default + Clone>(
    registry: &mut Registry,
    name: &str,
    help: &str,
) -> M {
    let metric = M::default();
    registry.register(name, help, metric.clone());
    metric
}

/// The metrics for the values of a label, in their order.
fn labelled<M, const N: usize>(
    registry: &mut Registry,
    name: &str,
    help: &str,
    label: &'static str,
    values: [&'static str; N],
) -> [M; N]
where
    M: EncodeMetric + TypedMetric + Default + Clone + std::fmt::Debug + Send + Sync + 'static,
{
    let family: Family<[(&str, &str); 1], M> = plain(registry, name, help);
    values.map(|value| family.get_or_create_owned(&[(label, value)]))
}

fn timed(registry: &mut Registry, name: &str, help: &str, bounds: &'static [u64]) -> Histogram {
    let histogram = Histogram::new(bounds, MICROS);
    registry.register_with_unit(name, help, Unit::Seconds, histogram.clone());
    histogram
}

/// A histogram of integers without a lock, unlike that of the library.
#[derive(Debug, Clone)]
struct Histogram(Arc<Buckets>);

#[derive(Debug)]
struct Buckets {
    /// Upper bounds; a last bucket has none.
    bounds: &'static [u64],
    counts: Box<[AtomicU64]>,
    sum: AtomicU64,
    /// How many make one unit of the metric.
    scale: f64,
}

impl Histogram {
    fn new(bounds: &'static [u64], scale: f64) -> Self {
        Self(Arc::new(Buckets {
            bounds,
            counts: (0..=bounds.len()).map(|_| AtomicU64::new(0)).collect(),
            sum: AtomicU64::new(0),
            scale,
        }))
    }

    fn observe(&self, value: u64) {
        let bucket = self.0.bounds.partition_point(|bound| *bound < value);
        self.0.counts[bucket].fetch_add(1, Ordering::Relaxed);
        self.0.sum.fetch_add(value, Ordering::Relaxed);
    }

    fn observe_duration(&self, time: Duration) {
        self.observe(u64::try_from(time.as_micros()).unwrap_or(u64::MAX));
    }
}

impl TypedMetric for Histogram {
    const TYPE: MetricType = MetricType::Histogram;
}

impl EncodeMetric for Histogram {
    #[allow(
        clippy::cast_precision_loss,
        reason = "sums beyond 2^53 microseconds are approximate"
    )]
    fn encode(&self, mut encoder: MetricEncoder<'_>) -> Result<(), std::fmt::Error> {
        let Buckets {
            bounds,
            counts,
            sum,
            scale,
        } = &*self.0;
        let bounds = bounds.iter().map(|bound| *bound as f64 / scale);
        let bounds = bounds.chain([f64::INFINITY]);
        let counts = counts.iter().map(|count| count.load(Ordering::Relaxed));
        let buckets: Vec<(f64, u64)> = bounds.zip(counts).collect();
        let count = buckets.iter().map(|(_, count)| count).sum();
        let sum = sum.load(Ordering::Relaxed) as f64 / scale;
        encoder.encode_histogram::<[(&str, &str); 0]>(sum, count, &buckets, None)
    }

    fn metric_type(&self) -> MetricType {
        Self::TYPE
    }
}

#[cfg(test)]
mod tests {
    use tokio::time::timeout;

    use super::*;

    fn lines<'a>(text: &'a str, name: &str) -> Vec<&'a str> {
        let samples = text.lines().filter(|line| !line.starts_with('#'));
        samples.filter(|line| line.starts_with(name)).collect()
    }

    #[test]
    fn a_histogram_counts_each_value_in_the_bucket_that_it_does_not_exceed() {
        let metrics = Metrics::default();
        for micros in [0, 50, 51, 100, 10_000_001] {
            metrics.answered(Duration::from_micros(micros));
        }
        let text = metrics.text();
        let lines = lines(&text, "chefshat_answer_seconds");
        for line in [
            "chefshat_answer_seconds_count 5",
            "chefshat_answer_seconds_sum 10.000202",
            "chefshat_answer_seconds_bucket{le=\"0.00005\"} 2",
            "chefshat_answer_seconds_bucket{le=\"0.0001\"} 4",
            "chefshat_answer_seconds_bucket{le=\"10.0\"} 4",
            "chefshat_answer_seconds_bucket{le=\"+Inf\"} 5",
        ] {
            assert!(lines.contains(&line), "{line} is not in {lines:#?}");
        }
    }

    #[test]
    fn guards_count_while_they_live() {
        let metrics = Metrics::default();
        let room = metrics.room(State::Playing);
        let games = metrics.vector_games(16);
        let text = metrics.text();
        assert!(text.contains("chefshat_rooms{state=\"playing\"} 1\n"));
        assert!(text.contains("chefshat_vector_games 16\n"));
        drop((room, games));
        let text = metrics.text();
        assert!(text.contains("chefshat_rooms{state=\"playing\"} 0\n"));
        assert!(text.contains("chefshat_vector_games 0\n"));
    }

    #[tokio::test(start_paused = true)]
    async fn the_oldest_transaction_is_known_while_it_waits() {
        let store = StoreMetrics::default();
        assert_eq!(store.longest_wait(), Duration::ZERO);
        let second = Duration::from_secs(1);
        let first = store.waits();
        sleep(2 * second).await;
        let next = store.waits();
        sleep(second).await;
        assert_eq!(store.longest_wait(), 3 * second);
        drop(first);
        assert_eq!(store.longest_wait(), second);
        drop(next);
        assert_eq!(store.longest_wait(), Duration::ZERO);
    }

    #[tokio::test(start_paused = true)]
    async fn a_stall_is_noticed_and_its_end_and_one_lock_is_none() {
        let store = StoreMetrics::default();
        let day = Duration::from_secs(86_400);
        let stalls = || timeout(day, store.is_not(false));
        assert!(stalls().await.is_err(), "nothing waits");
        let begun = Instant::now();
        let waits = store.waits();
        stalls().await.expect("nothing is committed");
        assert!((STALL..STALL + 2 * LOOK).contains(&begun.elapsed()));
        store.committed(1, Duration::ZERO);
        drop(waits);
        timeout(2 * LOOK, store.is_not(true))
            .await
            .expect("it ends");

        // A lock that one transaction meets keeps nobody else away; those of several may.
        let one = store.waits();
        one.set_aside();
        assert!(stalls().await.is_err(), "one lock");
        let other = store.waits();
        other.set_aside();
        stalls().await.expect("several locks");
        // Others are committed meanwhile.
        store.committed(1, Duration::ZERO);
        assert!(!store.is_stalled());
    }

    #[derive(Debug)]
    struct Waiting(usize);

    impl Queue for Waiting {
        fn depth(&self) -> usize {
            self.0
        }
    }

    #[test]
    fn outboxes_count_until_they_are_gone() {
        let metrics = Metrics::default();
        let outbox = Arc::new(Waiting(4));
        metrics.add_outbox(&outbox);
        assert_eq!(metrics.outbox_depths(), [4]);
        drop(outbox);
        assert!(metrics.outbox_depths().is_empty());
        for _ in 0..1_000 {
            metrics.add_outbox(&Arc::new(Waiting(1)));
        }
        assert!(metrics.outboxes().len() <= 4, "the ones gone are forgotten");
    }
}
