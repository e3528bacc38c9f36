//! The endpoint that Prometheus scrapes, on a listener of its own, and the metrics that are read
//! when they are asked for: depths of queues, tournaments, disk and process.

use std::fmt;
use std::io;
use std::path::Path;
use std::sync::{Arc, Weak};

use axum::Router;
use axum::routing::get;
use chefshat_tournament::{State, Tournament};
use procfs::process::{LimitValue, Process};
use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::metrics::info::Info;
use prometheus_client::registry::Unit;
use tokio::net::TcpListener;

use crate::metrics::Metrics;
use crate::rooms::Rooms;
use crate::tournaments::Tournaments;

/// The media type of the answers.
const MEDIA_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Answers `GET /metrics` on a listener, without end.
///
/// # Errors
/// The listener failed.
pub async fn serve(listener: TcpListener, metrics: Arc<Metrics>) -> io::Result<()> {
    let answer = move || {
        let metrics = Arc::clone(&metrics);
        async move { ([(http::header::CONTENT_TYPE, MEDIA_TYPE)], metrics.text()) }
    };
    axum::serve(listener, Router::new().route("/metrics", get(answer))).await
}

/// Adds what is read when it is asked for to the metrics of a server.
pub fn add_state(rooms: &Arc<Rooms>, tournaments: &Arc<Tournaments>) {
    rooms.metrics().add(ServerState {
        rooms: Arc::downgrade(rooms),
        tournaments: Arc::downgrade(tournaments),
    });
    rooms.metrics().add_process(ProcessState);
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
        queues(&rooms, &mut to)?;
        states(&tournaments, &mut to)?;
        match rooms.record_writer().data_dir() {
            Some(folder) => disk(folder, &mut to),
            None => Ok(()),
        }
    }
}

/// The depth of all queues of a kind together, and of the deepest.
fn queues(rooms: &Rooms, to: &mut Encoder<'_, '_>) -> fmt::Result {
    let depths = [
        ("outbox", rooms.metrics().outbox_depths()),
        ("mailbox", rooms.mailbox_depths()),
        ("writer", vec![rooms.store().queue_depth()]),
    ];
    let total = |depths: &Vec<usize>| depths.iter().sum();
    let help = "Entries of all queues of a kind";
    to.gauges("queue_depth", help, "queue", &depths, total)?;
    let deepest = |depths: &Vec<usize>| depths.iter().copied().max().unwrap_or(0);
    let help = "Entries of the deepest queue of a kind";
    to.gauges("queue_depth_max", help, "queue", &depths, deepest)
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
    to.gauges("tournaments", "Listed tournaments", "state", &labels, count)
}

fn disk(folder: &Path, to: &mut Encoder<'_, '_>) -> fmt::Result {
    if let Ok(disk) = rustix::fs::statvfs(folder) {
        let help = "Free space for the data directory";
        to.gauge(
            "disk_free",
            help,
            Some(&Unit::Bytes),
            disk.f_bavail * disk.f_frsize,
        )?;
    }
    let files = ["games.sqlite3", "games.sqlite3-wal"];
    let sizes = files.map(|file| std::fs::metadata(folder.join(file)).map_or(0, |it| it.len()));
    let help = "Size of the database and its write-ahead log";
    to.gauge("database", help, Some(&Unit::Bytes), sizes.iter().sum())
}

/// Reads the state of this process, where the system shows it.
#[derive(Debug)]
struct ProcessState;

impl Collector for ProcessState {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> fmt::Result {
        let mut to = Encoder(&mut encoder);
        let Ok(process) = Process::myself() else {
            return Ok(());
        };
        if let Ok(stat) = process.stat() {
            let bytes = stat.rss * procfs::page_size();
            let help = "Memory in use";
            to.gauge("process_resident_memory", help, Some(&Unit::Bytes), bytes)?;
            let threads = u64::try_from(stat.num_threads).unwrap_or_default();
            to.gauge("process_threads", "Threads", None, threads)?;
            #[allow(clippy::cast_precision_loss, reason = "clock ticks are far below 2^53")]
            let seconds = (stat.utime + stat.stime) as f64 / procfs::ticks_per_second() as f64;
            let cpu = ConstCounter::new(seconds);
            to.metric("process_cpu", "Processor time", Some(&Unit::Seconds), &cpu)?;
        }
        if let Ok(open) = process.fd_count() {
            let open = u64::try_from(open).unwrap_or(u64::MAX);
            to.gauge("process_open_fds", "Open file descriptors", None, open)?;
        }
        if let Ok(limits) = process.limits()
            && let LimitValue::Value(limit) = limits.max_open_files.soft_limit
        {
            to.gauge("process_max_fds", "Most open file descriptors", None, limit)?;
        }
        Ok(())
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
        label: &'static str,
        values: &[(&'static str, T)],
        gauge: impl Fn(&T) -> usize,
    ) -> fmt::Result {
        let mut encoder = (self.0).encode_descriptor(name, help, None, MetricType::Gauge)?;
        for (value, what) in values {
            let count = u64::try_from(gauge(what)).unwrap_or(u64::MAX);
            let labels = [(label, *value)];
            ConstGauge::new(count).encode(encoder.encode_family(&labels)?)?;
        }
        Ok(())
    }
}
