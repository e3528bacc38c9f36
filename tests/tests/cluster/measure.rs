//! What a cluster costs, and how long people wait when something happens to a node: measured, never
//! asserted, with leases as on real machines and a database that syncs. Run one at a time:
//!
//! `cargo test -p chefshat-tests --test cluster measure -- --ignored --nocapture --test-threads 1`
//!
//! with CHEFSHAT_BIN set to the program to measure, and CHEFSHAT_OLD_BIN to that of an earlier version
//! from which nodes are upgraded.

use std::path::Path;
use std::time::{Duration, Instant};

use chefshat_client::Backoff;
use chefshat_proto::v1::{self, record_line::Line};
use chefshat_tests::{BusyRooms, Launch, Ledger, RoomKind, patiently};
use procfs::process::{Process as Running, all_processes};

use crate::cluster::{Cluster, Leases};

const NODES: usize = 3;
/// Rooms whose node is killed or drained.
const ROOMS: usize = 48;
/// Nodes that are killed or drained.
const TIMES: usize = 4;
/// Rooms whose database is killed.
const FAILED_OVER_ROOMS: usize = 100;
/// Rooms during an upgrade.
const UPGRADED_ROOMS: usize = 200;
/// Rooms of the nodes that another one joins.
const JOINED_ROOMS: usize = 300;
/// Rooms whose throughput is measured.
const FAST_ROOMS: usize = 64;
/// How long before and during a window of measurement.
const WARM_UP: Duration = Duration::from_secs(3);
const WINDOW: Duration = Duration::from_secs(10);
/// Rounds of throughput.
const ROUNDS: usize = 2;
/// Decisions of every room before anything happens.
const BEFORE: u64 = 5;

/// Rooms of agents that think up to `pace`, each on one stream.
pub(crate) fn rooms(
    count: usize,
    shifts: u32,
    decision_time_ms: u32,
    pace: Duration,
) -> Vec<RoomKind> {
    let kind = RoomKind {
        rules: v1::RuleSet {
            stop: Some(v1::rule_set::Stop::TargetShifts(shifts)),
            ..v1::RuleSet::default()
        },
        policy: v1::RoomPolicy {
            decision_time_ms: Some(decision_time_ms),
            bank_ms: Some(0),
            ..v1::RoomPolicy::default()
        },
        one_stream: true,
        pace,
        // As the clients of others.
        backoff: Backoff::default(),
        ..RoomKind::default()
    };
    vec![kind; count]
}

pub(crate) async fn all_play(rooms: &BusyRooms) {
    let mut progress = rooms.progress();
    let playing = progress.wait_for(|rooms| rooms.iter().all(|count| *count >= BEFORE));
    patiently("decisions of every room", playing)
        .await
        .expect("the rooms hold the sender");
}

/// The part of ordered figures below which `share` of them are.
fn quantile(ordered: &[f64], share: f64) -> f64 {
    let last = ordered.len().saturating_sub(1);
    ordered
        .get((share * last as f64).round() as usize)
        .copied()
        .unwrap_or(f64::NAN)
}

fn show(what: &str, unit: &str, mut figures: Vec<f64>) {
    figures.sort_by(f64::total_cmp);
    let [least, median, late, most] = [0.0, 0.5, 0.99, 1.0].map(|it| quantile(&figures, it));
    eprintln!(
        "{what}: {} figures, least {least:.2} {unit}, median {median:.2} {unit}, p99 {late:.2} {unit}, most {most:.2} {unit}",
        figures.len()
    );
}

/// The longest time without a decision of a game that had decisions before and after `from`: from
/// the last decision before it on. Seconds.
fn longest_pause(ledger: &Ledger, game: &str, from: Instant) -> Option<f64> {
    let mut times: Vec<Instant> = ledger.times(game).into_iter().map(|it| it.0).collect();
    times.sort_unstable();
    let before = times.partition_point(|time| *time < from).checked_sub(1)?;
    let pauses = times[before..].windows(2).map(|pair| pair[1] - pair[0]);
    pauses.max().map(|pause| pause.as_secs_f64())
}

/// Waits for the next decision of each of these games. Returns after which times they were
/// acknowledged, seconds.
async fn next_decisions(ledger: &Ledger, mut games: Vec<String>, from: Instant) -> Vec<f64> {
    let mut next = Vec::new();
    let all_go_on = async {
        while !games.is_empty() {
            tokio::time::sleep(Duration::from_millis(5)).await;
            games.retain(|game| {
                let times = ledger.times(game).into_iter();
                let first = times.map(|it| it.0).filter(|it| *it > from).min();
                next.extend(first.map(|first| (first - from).as_secs_f64()));
                first.is_none()
            });
        }
    };
    patiently("every game to continue", all_go_on).await;
    next
}

/// The node that owns most games, and those games.
fn busiest(cluster: &Cluster) -> (usize, Vec<String>) {
    let games = (0..cluster.nodes.len()).map(|node| (node, cluster.games_of(node)));
    games.max_by_key(|(_, games)| games.len()).expect("nodes")
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "measures"]
async fn from_a_kill_to_the_next_decision_of_each_game() {
    let mut cluster = Cluster::start(NODES, Leases::Default).await;
    let pace = Duration::from_millis(200);
    let rooms = BusyRooms::start(&cluster.url(), rooms(ROOMS, 100, 3_600_000, pace));
    all_play(&rooms).await;
    let mut all = Vec::new();
    for _ in 0..TIMES {
        let (node, games) = busiest(&cluster);
        cluster.kill(node).await;
        let killed = Instant::now();
        let seconds = next_decisions(&rooms.ledger, games, killed).await;
        show("from the kill to the next decision", "s", seconds.clone());
        all.extend(seconds);
        cluster.restart(node).await;
    }
    show("all kills: from the kill to the next decision", "s", all);
    rooms.ledger.assert_nothing_unexpected();
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "measures"]
async fn from_a_kill_of_the_database_to_the_next_decision_of_each_game() {
    let mut cluster = Cluster::start(NODES, Leases::Default).await;
    let address = cluster.postgres.address();
    let standby = tokio::task::block_in_place(|| cluster.postgres.standby(address));
    let pace = Duration::from_millis(200);
    let rooms = rooms(FAILED_OVER_ROOMS, 4, 3_600_000, pace);
    let rooms = BusyRooms::start(&cluster.url(), rooms);
    all_play(&rooms).await;
    let games = (0..NODES).flat_map(|node| cluster.games_of(node)).collect();
    let killed = cluster.fail_over(standby);
    let promoted = Instant::now();
    let seconds = (promoted - killed).as_secs_f64();
    eprintln!("the standby is the primary after {seconds:.2} s");
    let next = next_decisions(&rooms.ledger, games, promoted).await;
    let next = next.into_iter().map(|next| seconds + next).collect();
    show("from the kill to the next decision", "s", next);
    missed(&cluster, rooms).await;
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "measures"]
async fn games_of_a_drained_node() {
    let mut cluster = Cluster::start(NODES, Leases::Default).await;
    let pace = Duration::from_millis(200);
    let rooms = BusyRooms::start(&cluster.url(), rooms(ROOMS, 4, 3_000, pace));
    all_play(&rooms).await;
    let mut all = Vec::new();
    for _ in 0..TIMES {
        let (node, games) = busiest(&cluster);
        let asked = Instant::now();
        cluster.stop(node).await;
        let stopped = asked.elapsed().as_secs_f64();
        rooms.all_go_on().await;
        let pauses = games.iter();
        let pauses = pauses.filter_map(|game| longest_pause(&rooms.ledger, game, asked));
        let pauses: Vec<f64> = pauses.collect();
        eprintln!(
            "{} games, the node has stopped after {stopped:.2} s",
            games.len()
        );
        show("longest time without a decision", "s", pauses.clone());
        all.extend(pauses);
        cluster.restart(node).await;
    }
    show("all drains: longest time without a decision", "s", all);
    missed(&cluster, rooms).await;
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "measures"]
async fn a_node_joins_full_ones() {
    let mut cluster = Cluster::start(NODES + 1, Leases::Default).await;
    cluster.stop(NODES).await;
    let pace = Duration::from_secs(1);
    let rooms = BusyRooms::start(&cluster.url(), rooms(JOINED_ROOMS, 2, 5_000, pace));
    all_play(&rooms).await;
    let before = rooms.ledger.games();
    eprintln!("rooms of the nodes: {:?}", cluster.rooms_of_nodes());
    cluster.restart(NODES).await;
    let joined = Instant::now();
    cluster.balanced(20).await;
    let seconds = joined.elapsed().as_secs_f64();
    eprintln!(
        "within a fifth after {seconds:.2} s: {:?}",
        cluster.rooms_of_nodes()
    );
    rooms.all_go_on().await;
    let moved = cluster.games_of(NODES);
    let (moved, stayed): (Vec<_>, Vec<_>) = before.iter().partition(|game| moved.contains(game));
    for (what, games) in [("moved", moved), ("stayed", stayed)] {
        let pauses = games.iter();
        let pauses = pauses.filter_map(|game| longest_pause(&rooms.ledger, game, joined));
        show(
            &format!("longest time without a decision of games that {what}"),
            "s",
            pauses.collect(),
        );
    }
    missed(&cluster, rooms).await;
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "measures"]
async fn an_upgrade_of_all_nodes_one_after_another() {
    let old = std::env::var_os("CHEFSHAT_OLD_BIN");
    let from = |launch: Launch| match &old {
        Some(old) => launch.binary(Path::new(old)),
        None => launch,
    };
    let mut cluster = Cluster::start_with(NODES, Leases::Default, from).await;
    let pace = Duration::from_secs(1);
    let rooms = BusyRooms::start(&cluster.url(), rooms(UPGRADED_ROOMS, 1, 5_000, pace));
    all_play(&rooms).await;
    let before = rooms.ledger.games();
    let begun = Instant::now();
    cluster.upgrade();
    for node in 0..NODES {
        let games = cluster.games_of(node).len();
        let asked = Instant::now();
        cluster.stop(node).await;
        let stopped = asked.elapsed().as_secs_f64();
        cluster.restart(node).await;
        let up = asked.elapsed().as_secs_f64();
        eprintln!(
            "node {node} with {games} games: stopped after {stopped:.2} s, up again after {up:.2} s"
        );
        rooms.all_go_on().await;
    }
    eprintln!(
        "all nodes upgraded after {:.2} s",
        begun.elapsed().as_secs_f64()
    );
    let pauses = before.iter();
    let pauses = pauses.filter_map(|game| longest_pause(&rooms.ledger, game, begun));
    show("longest time without a decision", "s", pauses.collect());
    missed(&cluster, rooms).await;
}

/// Lets the games end; says and returns how many decisions were not those of their agents.
pub(crate) async fn missed(cluster: &Cluster, rooms: BusyRooms) -> usize {
    let ledger = std::sync::Arc::clone(&rooms.ledger);
    let games = rooms.finish().await;
    let client = cluster.nodes[0].client().await;
    let mut missed = 0;
    for game in &games {
        let record = client.record(game).await.expect("a stored record");
        ledger.assert_committed(game, &record);
        let late = |line: &&v1::RecordLine| match &line.line {
            Some(Line::Decision(decision)) => decision.source() != v1::DecisionSource::Agent,
            _ => false,
        };
        missed += record.iter().filter(late).count();
    }
    eprintln!(
        "{} games, {} decisions acknowledged, all of them recorded; deadlines missed: {missed}",
        games.len(),
        ledger.count()
    );
    missed
}

/// The CPU time of processes so far, seconds.
fn cpu(processes: impl IntoIterator<Item = Running>) -> f64 {
    let ticks = processes
        .into_iter()
        .filter_map(|process| process.stat().ok());
    let ticks: u64 = ticks.map(|stat| stat.utime + stat.stime).sum();
    ticks as f64 / procfs::ticks_per_second() as f64
}

fn servers(ids: &[u32]) -> f64 {
    let ids = ids.iter().filter_map(|id| i32::try_from(*id).ok());
    cpu(ids.filter_map(|id| Running::new(id).ok()))
}

/// The CPU time of the database: all processes of PostgreSQL that this one has started.
fn database() -> f64 {
    let own = i32::try_from(std::process::id()).expect("small");
    let is_ours = |process: &Running| {
        let mut at = process.stat();
        let is_postgres = at.as_ref().is_ok_and(|stat| stat.comm == "postgres");
        while let Ok(stat) = &at
            && stat.ppid > 1
            && stat.ppid != own
        {
            at = Running::new(stat.ppid).and_then(|parent| parent.stat());
        }
        is_postgres && at.is_ok_and(|stat| stat.ppid == own)
    };
    let all = all_processes().expect("/proc").flatten();
    cpu(all.filter(is_ours))
}

/// Measures rooms that play as fast as they can: opened at one URL, played at another. Returns the
/// CPU time of the servers for each decision.
pub(crate) async fn throughput(what: &str, opened_at: &str, played_at: &str, ids: &[u32]) -> f64 {
    let kinds = rooms(FAST_ROOMS, 50, 3_600_000, Duration::ZERO);
    let rooms = BusyRooms::start_apart(opened_at, played_at, kinds);
    all_play(&rooms).await;
    tokio::time::sleep(WARM_UP).await;
    let (begun, count, cpu, of_database) = (
        Instant::now(),
        rooms.ledger.count(),
        servers(ids),
        database(),
    );
    tokio::time::sleep(WINDOW).await;
    let seconds = begun.elapsed().as_secs_f64();
    let decisions = (rooms.ledger.count() - count) as f64;
    let (cpu, of_database) = (servers(ids) - cpu, database() - of_database);
    eprintln!(
        "{what}: {:.0} decisions/s; for each {:.0} us CPU of the servers and {:.0} us of the database; {}",
        decisions / seconds,
        cpu / decisions * 1e6,
        of_database / decisions * 1e6,
        acknowledged(&rooms.ledger, begun),
    );
    cpu / decisions
}

/// After which times decisions since then were acknowledged.
pub(crate) fn acknowledged(ledger: &Ledger, since: Instant) -> String {
    let mut times: Vec<f64> = (ledger.games().iter())
        .flat_map(|game| ledger.times(game))
        .filter(|(at, _)| *at >= since)
        .map(|(_, time)| time.as_secs_f64() * 1e3)
        .collect();
    times.sort_by(f64::total_cmp);
    format!(
        "acknowledged after {:.1} ms (median), {:.1} ms (p99)",
        quantile(&times, 0.5),
        quantile(&times, 0.99)
    )
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "measures"]
async fn throughput_of_durable_rooms() {
    for _ in 0..ROUNDS {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut launch = Launch::new(folder.path());
        let server = launch.start().await.expect("the server starts");
        let url = launch.url();
        throughput("SQLite", &url, &url, &[server.id()]).await;
        server.kill().await;

        let cluster = Cluster::start(1, Leases::Default).await;
        let url = cluster.nodes[0].url();
        throughput("PostgreSQL, one node", &url, &url, &cluster.process_ids()).await;
        drop(cluster);

        let cluster = Cluster::start(NODES, Leases::Default).await;
        let url = cluster.url();
        let ids = cluster.process_ids();
        throughput("PostgreSQL, three nodes behind the proxy", &url, &url, &ids).await;
        let (owner, other) = (cluster.nodes[0].url(), cluster.nodes[1].url());
        let direct = throughput("directly at the owner", &owner, &owner, &ids).await;
        let forwarded = throughput("through another node", &owner, &other, &ids).await;
        eprintln!(
            "a forwarded decision costs {:.2} times the CPU of a direct one",
            forwarded / direct
        );
    }
}
