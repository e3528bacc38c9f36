//! The endpoint that Prometheus scrapes, on a listener of its own, and the metrics that are read
//! when they are asked for: depths of queues, tournaments, disk and process.

use std::fmt;
use std::sync::{Arc, Weak};
use std::time::Duration;

use axum::Router;
use axum::routing::get;
use axum::serve::Listener;
use chefshat_tournament::{State, Tournament};
use http::Response;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::metrics::info::Info;
use prometheus_client::registry::Unit;
use tokio::net::TcpListener;
use tower::Layer as _;
use tower::util::MapResponse;

use crate::tls::Tls;
use crate::web::{OriginLayer, Origins};
use chefshat_admission::limits::{CallLimits, FairSemaphore, Key, Shares};
use chefshat_base::clock::ProcessClock;
use chefshat_base::metrics::Metrics;
use chefshat_base::tasks::short;
use chefshat_hosting::rooms::Rooms;
use chefshat_hosting::tournaments::Tournaments;
use chefshat_store::DiskUsage;

/// The media type of the answers.
const MEDIA_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Connections at a time, of which each address has its share; others are closed.
const MAX_CONNECTIONS: usize = 64;
/// Longest time until the request of a connection has arrived.
const REQUEST_TIME_LIMIT: Duration = Duration::from_secs(2);
/// Longest time of a connection, which serves one request.
const TIME_LIMIT: Duration = Duration::from_secs(10);

/// Answers `GET /metrics` on a listener, without end. `origins`: under which names; no page needs
/// the metrics.
pub async fn serve(listener: TcpListener, metrics: Arc<Metrics>, origins: Origins) {
    serve_within(
        listener,
        metrics,
        origins,
        MAX_CONNECTIONS,
        REQUEST_TIME_LIMIT,
    )
    .await;
}

async fn serve_within(
    mut listener: TcpListener,
    metrics: Arc<Metrics>,
    origins: Origins,
    max_connections: usize,
    request_time_limit: Duration,
) {
    let answer = move || {
        let metrics = Arc::clone(&metrics);
        async move { ([(http::header::CONTENT_TYPE, MEDIA_TYPE)], metrics.text()) }
    };
    let router = Router::new().route("/metrics", get(answer));
    let router = MapResponse::new(router, |answer: Response<axum::body::Body>| {
        answer.map(tonic::body::Body::new)
    });
    let limits = Arc::new(CallLimits::new(Shares::default()));
    let checked = OriginLayer::new(origins, limits).layer(router);
    let places = FairSemaphore::new(max_connections, Shares::default());
    loop {
        // After a failure it tries again.
        let (stream, address) = Listener::accept(&mut listener).await;
        let Some(place) = places.try_take(Key::of_address(Some(address.ip()))) else {
            continue;
        };
        let connection = http1::Builder::new()
            .keep_alive(false)
            .timer(TokioTimer::new())
            .header_read_timeout(request_time_limit)
            .serve_connection(
                TokioIo::new(stream),
                TowerToHyperService::new(checked.clone()),
            );
        tokio::spawn(short("one connection, within its time limit", async move {
            // A client that fails or is too slow is disconnected.
            let _ = tokio::time::timeout(TIME_LIMIT, connection).await;
            drop(place);
        }));
    }
}

/// Adds what is read when it is asked for to the metrics of a server.
pub fn add_state(rooms: &Arc<Rooms>, tournaments: &Arc<Tournaments>) {
    rooms.metrics().add(ServerState {
        rooms: Arc::downgrade(rooms),
        tournaments: Arc::downgrade(tournaments),
    });
    rooms.metrics().add_process(ProcessState);
}

/// Adds when the certificates expire that a server shows, by the listener that shows them.
pub fn add_certificates(metrics: &Metrics, shown: Vec<(&'static str, Arc<Tls>)>) {
    if !shown.is_empty() {
        metrics.add(Certificates(shown));
    }
}

/// Reads when certificates expire.
#[derive(Debug)]
struct Certificates(Vec<(&'static str, Arc<Tls>)>);

impl Collector for Certificates {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> fmt::Result {
        let known = |(listener, tls): &(&'static str, Arc<Tls>)| {
            let expires_at = usize::try_from(tls.expires_at()?).ok()?;
            Some((*listener, expires_at))
        };
        let known: Vec<_> = self.0.iter().filter_map(known).collect();
        let (name, label) = ("certificate_expiry_timestamp", "listener");
        let help = "When the first certificate of a chain or of its authorities expires, since the Unix epoch";
        let unit = Some(&Unit::Seconds);
        Encoder(&mut encoder).gauges(name, help, unit, label, &known, |at| *at)
    }
}

/// Reads the state of a server.
#[derive(Debug)]
struct ServerState {
    // The rooms have the metrics, which have this.
    rooms: Weak<Rooms>,
    tournaments: Weak<Tournaments>,
}

impl Collector for ServerState {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> fmt::Result {
        let mut to = Encoder(&mut encoder);
        let version = Info::new([("version", env!("CARGO_PKG_VERSION"))]);
        to.metric("build", "Version of the server", None, &version)?;
        let (Some(rooms), Some(tournaments)) = (self.rooms.upgrade(), self.tournaments.upgrade())
        else {
            return Ok(());
        };
        let draining = u64::from(rooms.is_shutting_down());
        let help = "1 while the server stops, else 0";
        to.gauge("draining", help, None, draining)?;
        let help = "Most rooms that wait or play at a time (--max-rooms)";
        to.gauge("rooms_limit", help, None, rooms.max_rooms() as u64)?;
        pauses(rooms.process_clock(), &mut to)?;
        queues(&rooms, &mut to)?;
        states(&tournaments, &mut to)?;
        match rooms.store().disk() {
            Some(usage) => disk(usage, &mut to),
            None => Ok(()),
        }
    }
}

fn pauses(clock: &ProcessClock, to: &mut Encoder<'_, '_>) -> fmt::Result {
    let count = ConstCounter::new(clock.pause_count());
    let help = "Times that the process did not run for a second or longer";
    to.metric("process_pauses", help, None, &count)?;
    let left_out = ConstCounter::new(clock.left_out().as_secs_f64());
    let help = "Time of these pauses, which no participant is charged for";
    let unit = Some(&Unit::Seconds);
    to.metric("process_paused", help, unit, &left_out)
}

/// The depth of all queues of a kind together, and of the deepest.
fn queues(rooms: &Rooms, to: &mut Encoder<'_, '_>) -> fmt::Result {
    let depths = [
        ("outbox", rooms.metrics().outbox_depths()),
        ("mailbox", rooms.mailbox_depths()),
        ("writer", vec![rooms.store().queue_depth()]),
        ("webhook", vec![rooms.webhooks().waiting()]),
    ];
    let total = |depths: &Vec<usize>| depths.iter().sum();
    let help = "Entries of all queues of a kind";
    to.gauges("queue_depth", help, None, "queue", &depths, total)?;
    let deepest = |depths: &Vec<usize>| depths.iter().copied().max().unwrap_or(0);
    let help = "Entries of the deepest queue of a kind";
    to.gauges("queue_depth_max", help, None, "queue", &depths, deepest)
}

fn states(tournaments: &Tournaments, to: &mut Encoder<'_, '_>) -> fmt::Result {
    let states: Vec<State> = (tournaments.newest(None, None, usize::MAX).iter())
        .map(|(_, handle)| handle.read(Tournament::state))
        .collect();
    let labels = [
        ("open", State::Open),
        ("playing", State::Playing),
        ("finished", State::Finished),
        ("closed", State::Closed),
    ];
    let count = |state: &State| states.iter().filter(|other| *other == state).count();
    let help = "Listed tournaments";
    to.gauges("tournaments", help, None, "state", &labels, count)
}

fn disk(usage: DiskUsage, to: &mut Encoder<'_, '_>) -> fmt::Result {
    let help = "Free space for the data directory";
    to.gauge("disk_free", help, Some(&Unit::Bytes), usage.free_bytes)?;
    let help = "Size of the database and its write-ahead log";
    to.gauge("database", help, Some(&Unit::Bytes), usage.bytes)
}

/// Reads the state of this process, where the system shows it: on Linux, in `/proc/self` (proc(5)).
#[derive(Debug)]
struct ProcessState;

impl Collector for ProcessState {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> fmt::Result {
        let mut to = Encoder(&mut encoder);
        if let Some(stat) = ProcessStat::read() {
            let (help, unit) = ("Memory in use", Some(&Unit::Bytes));
            to.gauge("process_resident_memory", help, unit, stat.resident_bytes)?;
            to.gauge("process_threads", "Threads", None, stat.threads)?;
            let cpu = ConstCounter::new(stat.cpu_seconds);
            to.metric("process_cpu", "Processor time", Some(&Unit::Seconds), &cpu)?;
        }
        if let Ok(open) = std::fs::read_dir("/proc/self/fd") {
            let open = u64::try_from(open.count()).unwrap_or(u64::MAX);
            to.gauge("process_open_fds", "Open file descriptors", None, open)?;
        }
        #[cfg(unix)]
        if let Some(limit) = rustix::process::getrlimit(rustix::process::Resource::Nofile).current {
            to.gauge("process_max_fds", "Most open file descriptors", None, limit)?;
        }
        Ok(())
    }
}

/// What `/proc/self/stat` says.
#[derive(Debug, PartialEq)]
struct ProcessStat {
    resident_bytes: u64,
    threads: u64,
    cpu_seconds: f64,
}

impl ProcessStat {
    #[cfg(target_os = "linux")]
    fn read() -> Option<Self> {
        use rustix::param::{clock_ticks_per_second, page_size};

        let text = std::fs::read_to_string("/proc/self/stat").ok()?;
        let page = u64::try_from(page_size()).ok()?;
        Self::parse(&text, clock_ticks_per_second(), page)
    }

    #[cfg(not(target_os = "linux"))]
    fn read() -> Option<Self> {
        None
    }

    #[cfg_attr(
        not(target_os = "linux"),
        allow(dead_code, reason = "its tests use it")
    )]
    fn parse(text: &str, ticks_per_second: u64, page_bytes: u64) -> Option<Self> {
        // The name of the program, in parentheses, may have spaces and parentheses. The state after
        // it is field 3.
        let (_, after_name) = text.rsplit_once(')')?;
        let fields: Vec<&str> = after_name.split_whitespace().collect();
        let field = |number: usize| fields.get(number - 3)?.parse::<u64>().ok();
        #[allow(clippy::cast_precision_loss, reason = "clock ticks are far below 2^53")]
        let cpu_seconds = (field(14)? + field(15)?) as f64 / ticks_per_second as f64;
        Some(Self {
            resident_bytes: field(24)? * page_bytes,
            threads: field(20)?,
            cpu_seconds,
        })
    }
}

/// Encodes metrics one by one.
struct Encoder<'a, 'b>(&'a mut DescriptorEncoder<'b>);

impl Encoder<'_, '_> {
    fn metric(
        &mut self,
        name: &str,
        help: &str,
        unit: Option<&Unit>,
        metric: &impl EncodeMetric,
    ) -> fmt::Result {
        let encoder = (self.0).encode_descriptor(name, help, unit, metric.metric_type())?;
        metric.encode(encoder)
    }

    fn gauge(&mut self, name: &str, help: &str, unit: Option<&Unit>, value: u64) -> fmt::Result {
        self.metric(name, help, unit, &ConstGauge::new(value))
    }

    /// A gauge for each value of a label.
    fn gauges<T>(
        &mut self,
        name: &str,
        help: &str,
        unit: Option<&Unit>,
        label: &'static str,
        values: &[(&'static str, T)],
        gauge: impl Fn(&T) -> usize,
    ) -> fmt::Result {
        let mut encoder = (self.0).encode_descriptor(name, help, unit, MetricType::Gauge)?;
        for (value, what) in values {
            let count = u64::try_from(gauge(what)).unwrap_or(u64::MAX);
            let labels = [(label, *value)];
            ConstGauge::new(count).encode(encoder.encode_family(&labels)?)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::net::SocketAddr;

    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
    use tokio::net::TcpStream;

    use super::*;

    async fn scraped(mut connection: TcpStream) -> String {
        let request = b"GET /metrics HTTP/1.1\r\nHost: it\r\n\r\n";
        connection.write_all(request).await.expect("sent");
        let mut answer = String::new();
        connection.read_to_string(&mut answer).await.expect("text");
        answer
    }

    async fn two_places(request_time_limit: Duration) -> SocketAddr {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("bound");
        let (metrics, anywhere) = (Arc::default(), Origins::new(&[], None));
        tokio::spawn(serve_within(
            listener,
            metrics,
            anywhere,
            2,
            request_time_limit,
        ));
        address
    }

    #[cfg(target_os = "linux")]
    #[tokio::test]
    async fn idle_connections_take_the_places_of_their_address_alone() {
        let address = two_places(TIME_LIMIT).await;
        let _idle = TcpStream::connect(address).await.expect("it listens");
        let mut refused = TcpStream::connect(address).await.expect("it listens");
        assert_eq!(refused.read(&mut [0]).await.expect("closed"), 0);
        // Another address of this machine.
        let other = tokio::net::TcpSocket::new_v4().expect("a socket");
        let local = "127.0.0.2:0".parse().expect("an address");
        other.bind(local).expect("an address of this machine");
        let answer = scraped(other.connect(address).await.expect("it listens")).await;
        assert!(answer.starts_with("HTTP/1.1 200 OK"), "{answer}");
    }

    #[tokio::test]
    async fn an_idle_connection_is_closed() {
        let address = two_places(Duration::from_millis(20)).await;
        let mut idle = TcpStream::connect(address).await.expect("it listens");
        let mut answer = Vec::new();
        let _ = idle.read_to_end(&mut answer).await;
        assert!(!answer.starts_with(b"HTTP/1.1 200"));
    }

    #[tokio::test]
    async fn a_page_that_points_its_name_here_reads_no_metrics() {
        for (hosts, name, answered) in [
            (Some(vec![]), "rebound.example.net", false),
            (Some(vec![]), "localhost:9464", true),
            (Some(vec![]), "127.0.0.1:9464", true),
            (
                Some(vec!["chef.example.org".into()]),
                "chef.example.org",
                true,
            ),
            (None, "chefshat:9464", true),
        ] {
            let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
            let address = listener.local_addr().expect("bound");
            let origins = Origins::new(&[], hosts);
            tokio::spawn(serve(listener, Arc::default(), origins));
            let mut client = TcpStream::connect(address).await.expect("it listens");
            let request = format!("GET /metrics HTTP/1.1\r\nHost: {name}\r\n\r\n");
            client.write_all(request.as_bytes()).await.expect("sent");
            let mut answer = String::new();
            client.read_to_string(&mut answer).await.expect("text");
            let status = if answered {
                "HTTP/1.1 200 "
            } else {
                "HTTP/1.1 403 "
            };
            assert!(answer.starts_with(status), "{name}: {answer}");
            assert_eq!(answer.contains("chefshat_"), answered, "{name}: {answer}");
        }
    }
}
