//! What rooms and the database do when it has millions of rows: measured, never asserted.
//!
//! `cargo test -p chefshat-tests --test cluster growth -- --ignored --nocapture`
//!
//! with CHEFSHAT_BIN set to the program to measure. CHEFSHAT_ROWS: rows of the journal.

use std::process::{Child, Command};
use std::sync::Arc;
use std::time::{Duration, Instant};

use chefshat_tests::{BusyRooms, Launch, patiently, set_up};

use crate::cluster::{Cluster, Leases};
use crate::measure::{acknowledged, all_play, rooms, throughput};

/// Rows of the journal, by default.
const ROWS: usize = 10_000_000;
/// Rooms that play games, of which all others are copies.
const ROOMS: usize = 8;
/// The next copy has a number larger by this, so that they fill several partitions.
const APART: usize = 25;
/// Games that are copied in one statement.
const AT_ONCE: usize = 2_000;
/// Games of a partition.
const PARTITION: usize = 262_144;
/// Games that are kept.
const KEPT: usize = 1_000;
/// Hours of a day.
const HOURS: usize = 24;
/// Decisions of an hour: of 250 seats, each of which decides every twenty seconds.
const OF_AN_HOUR: u64 = 45_000;
/// Rooms that play them, as fast as they can.
const FAST_ROOMS: usize = 64;
/// Bytes of what a journal and its indexes take.
const BYTES: &str = "SELECT sum(pg_total_relation_size(inhrelid)) FROM pg_inherits WHERE inhparent = 'journal'::regclass";

/// Rows of all journals.
const JOURNAL: &str = "SELECT count(*) FROM journal";
/// What the database has tidied up by itself.
const VACUUMS: &str = "SELECT format('%s vacuums, %s dead rows', sum(autovacuum_count), sum(n_dead_tup)) FROM pg_stat_user_tables";

fn number(cluster: &Cluster, sql: &str) -> f64 {
    let said = cluster.select(sql);
    said.parse().unwrap_or_else(|_| panic!("{sql}: {said}"))
}

/// A token for a node that has not started.
fn admin_token(launch: &Launch) -> String {
    let mut create = Command::new(set_up("CHEFSHAT_BIN"));
    create.args(["token", "create", "--role", "admin", "--data-dir"]);
    let created = create.arg(launch.data_dir()).output();
    let token = String::from_utf8(created.expect("the binary starts").stdout);
    token.expect("text").trim().to_owned()
}

/// Copies the games that are over until the journal has this many rows. Returns how many games were
/// added.
fn copy(cluster: &Cluster, rows: usize) -> usize {
    let played = "SELECT string_agg(number::text, ',') FROM games WHERE listed IS NOT NULL";
    let played = cluster.select(played);
    let count = played.split(',').count();
    let own = number(
        cluster,
        "SELECT count(*) FROM journal JOIN games ON game = number WHERE listed IS NOT NULL",
    );
    let games = (rows as f64 / own * count as f64) as usize;
    let first = number(cluster, "SELECT last_value FROM games_number_seq") as usize + 1;
    for from in (0..games).step_by(AT_ONCE) {
        let to = first + (games.min(from + AT_ONCE) - 1) * APART;
        let from = first + from * APART;
        // Partitions are added as by a node.
        for partition in from / PARTITION..=to / PARTITION + 1 {
            let (begin, end) = (partition * PARTITION, (partition + 1) * PARTITION);
            let name = partition + 1;
            cluster.select(&format!(
                "CREATE TABLE IF NOT EXISTS journal_{name} PARTITION OF journal FOR VALUES FROM ({begin}) TO ({end})"
            ));
        }
        let copies = format!(
            "generate_series({from}, {to}, {APART}) AS copy
             JOIN games ON games.number = (ARRAY[{played}])[1 + copy / {APART} % {count}]"
        );
        cluster.select(&format!(
            "INSERT INTO journal SELECT copy, position, epoch, entries FROM {copies} JOIN journal ON game = number;
             INSERT INTO participants SELECT copy, seat, name, agent, kind FROM {copies} JOIN participants ON game = number;
             INSERT INTO games (number, game_id, form, state, ended_at_ms, filed, origin, room_name, created_at_ms, summary,
                                header, listed)
             OVERRIDING SYSTEM VALUE
             SELECT copy, decode(md5(copy::text), 'hex'), form, state, ended_at_ms, true, origin, room_name, created_at_ms,
                    summary, header, copy FROM {copies};
             UPDATE finished SET last = {to};
             SELECT setval('games_number_seq', {to})"
        ));
        eprint!("\r{} of {games} games", (to - first) / APART + 1);
    }
    eprintln!();
    games
}

/// A node whose games all others are copies of, and a token that may delete them.
async fn played_a_few_games() -> (Cluster, String) {
    let mut token = String::new();
    let cluster = Cluster::start_with(1, Leases::Default, |launch| {
        token = admin_token(&launch);
        launch.with("--access", "open")
    });
    let cluster = cluster.await;
    let games = rooms(ROOMS, 2, 3_600_000, Duration::ZERO);
    let busy_rooms = BusyRooms::start(&cluster.nodes[0].url(), games);
    all_play(&busy_rooms).await;
    let played = busy_rooms.finish().await.len();
    let written = async {
        while cluster.select("SELECT last FROM finished") != played.to_string() {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    patiently("the games to be over", written).await;
    (cluster, token)
}

/// Copies games until the journal is long. Returns how many there are.
fn fill(cluster: &Cluster) -> usize {
    let rows = std::env::var("CHEFSHAT_ROWS").map_or(ROWS, |rows| rows.parse().expect("a number"));
    let begun = Instant::now();
    let games = tokio::task::block_in_place(|| copy(cluster, rows));
    cluster.select("ANALYZE; CHECKPOINT");
    eprintln!(
        "{games} games, {:.0} rows of {:.0} B with their index, in {:.0} partitions, copied within {:.0} s",
        number(cluster, JOURNAL),
        number(cluster, BYTES) / number(cluster, JOURNAL),
        number(
            cluster,
            "SELECT count(*) FROM pg_inherits WHERE inhparent = 'journal'::regclass"
        ),
        begun.elapsed().as_secs_f64()
    );
    games
}

/// Bytes of the write-ahead log so far.
fn wal(cluster: &Cluster) -> f64 {
    number(cluster, "SELECT pg_current_wal_lsn() - '0/0'")
}

/// Deletes all games but the newest.
fn prune(keep: usize, url: &str, token: &str) -> Child {
    let mut prune = Command::new(set_up("CHEFSHAT_BIN"));
    prune.args(["records", "prune", "--keep", &keep.to_string()]);
    prune.args(["--server", url, "--token", token]);
    prune.spawn().expect("the binary starts")
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "measures"]
async fn play_beside_a_long_journal_and_its_deletion() {
    let (cluster, token) = played_a_few_games().await;
    let (url, ids) = (cluster.nodes[0].url(), cluster.process_ids());
    let before = wal(&cluster);
    throughput("an empty database", &url, &url, &ids).await;
    eprintln!(
        "WAL of a row of the journal, ends of games and checkpoints included: {:.0} B",
        (wal(&cluster) - before) / number(&cluster, JOURNAL)
    );

    fill(&cluster);
    throughput("beside them", &url, &url, &ids).await;

    let full = number(&cluster, BYTES);
    let begun = Instant::now();
    let mut pruning = prune(KEPT, &url, &token);
    throughput("while they are deleted", &url, &url, &ids).await;
    let pruned = tokio::task::block_in_place(|| pruning.wait());
    assert!(pruned.expect("it ends").success());
    eprintln!("deleted within {:.0} s", begun.elapsed().as_secs_f64());
    throughput("while their journals are deleted", &url, &url, &ids).await;
    while cluster.select("SELECT count(*) FROM pruned") != "0" {
        tokio::time::sleep(Duration::from_secs(1)).await;
    }
    eprintln!(
        "all of it within {:.0} s; the journal takes {:.0} MB, {:.0} MB before",
        begun.elapsed().as_secs_f64(),
        number(&cluster, BYTES) / 1e6,
        full / 1e6
    );
    let begun = Instant::now();
    cluster.select("VACUUM");
    eprintln!("a vacuum takes {:.1} s", begun.elapsed().as_secs_f64());
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "measures"]
async fn a_day_of_play_beside_a_long_journal() {
    let (cluster, token) = played_a_few_games().await;
    let url = cluster.nodes[0].url();
    let kept = fill(&cluster);
    for hour in 1..=HOURS {
        let (begun, wal_before) = (Instant::now(), wal(&cluster));
        let games = rooms(FAST_ROOMS, 2, 3_600_000, Duration::ZERO);
        let busy_rooms = BusyRooms::start(&url, games);
        let ledger = Arc::clone(&busy_rooms.ledger);
        let mut pruning = prune(kept, &url, &token);
        ledger.reaches(OF_AN_HOUR).await;
        let seconds = begun.elapsed().as_secs_f64();
        let played = busy_rooms.finish().await.len();
        let pruned = tokio::task::block_in_place(|| pruning.wait());
        assert!(pruned.expect("it ends").success());
        eprintln!(
            "hour {hour}: {:.0} decisions/s, {}; {played} games; {:.0} rows; the journal takes {:.0} MB; WAL {:.0} MB; {}",
            OF_AN_HOUR as f64 / seconds,
            acknowledged(&ledger, begun),
            number(&cluster, JOURNAL),
            number(&cluster, BYTES) / 1e6,
            (wal(&cluster) - wal_before) / 1e6,
            cluster.select(VACUUMS),
        );
    }
}
