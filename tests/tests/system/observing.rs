//! What an operator sees: the metrics of a server while games are played, the table of them in the
//! docs, and the shipped rules and dashboard in a real Prometheus.

use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use chefshat_client::{Client, ConnectOptions};
use chefshat_proto::v1::{self, record_line::Line};
use chefshat_server::config::ServerConfig;
use chefshat_server::scrape;
use chefshat_server::serve::Server;
use chefshat_server::store::SqliteStore;
use chefshat_server::tls::TlsFiles;
use chefshat_server::web::Origins;
use chefshat_tests::{
    Launch, Prometheus, StreamSeat, get, one_shift, patiently, random_agents, room_of_four, skip,
    source,
};
use serde_json::Value;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::process::Command;

/// A server with a database, a certificate and its metrics.
struct Observed {
    url: String,
    metrics: SocketAddr,
    _data: TempDir,
}

impl Observed {
    async fn start() -> Self {
        let data = tempfile::tempdir().expect("a temporary folder");
        let config = ServerConfig {
            data_dir: Some(data.path().to_path_buf()),
            tls: Some(TlsFiles {
                certificate: source("tests/fixtures/tls/localhost.pem"),
                key: source("tests/fixtures/tls/localhost.key"),
                client_authority: None,
            }),
            ..ServerConfig::default()
        };
        let store = SqliteStore::open(data.path()).await.expect("a store");
        let server = Server::restored(config, Arc::new(store)).await;
        let server = server.expect("an empty database");
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let scraped = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("bound");
        let metrics = scraped.local_addr().expect("bound");
        let names = Origins::new(&[], Some(Vec::new()));
        tokio::spawn(scrape::serve(scraped, Arc::clone(server.metrics()), names));
        tokio::spawn(server.serve(listener, std::future::pending()));
        Self {
            url: format!("https://localhost:{}", address.port()),
            metrics,
            _data: data,
        }
    }

    async fn client(&self) -> Client {
        let options = ConnectOptions {
            token: None,
            ca: Some(source("tests/fixtures/tls/localhost.pem")),
        };
        let client = Client::connect_with(&self.url, &options).await;
        client.expect("it listens")
    }

    /// The metrics as Prometheus gets them.
    async fn text(&self) -> String {
        get(&format!("http://{}/metrics", self.metrics)).await
    }

    /// Plays a game of random agents and returns its id.
    async fn play(&self) -> String {
        let client = self.client().await;
        let (created, tickets) =
            room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
        for outcome in patiently("the game", client.play_many(random_agents(tickets))).await {
            outcome.expect("it ends");
        }
        created.room.expect("a room").game_id
    }
}

/// The value of a sample.
fn value(text: &str, sample: &str) -> f64 {
    let line = text.lines().find_map(|line| line.strip_prefix(sample));
    let value = line.unwrap_or_else(|| panic!("{sample} is not in {text}"));
    value.trim().parse().expect("a number")
}

#[tokio::test]
async fn every_decision_answer_and_refusal_of_a_game_is_counted() {
    let server = Observed::start().await;
    let client = server.client().await;
    let game = server.play().await;
    let unknown = client.get_room("0000").await;
    let refused = unknown.expect_err("there is no such room");
    assert_eq!(refused.reason(), Some("ROOM_UNKNOWN"));

    let record = client.record(&game).await.expect("the game has ended");
    let is_decision = |line: &&v1::RecordLine| matches!(line.line, Some(Line::Decision(_)));
    #[allow(clippy::cast_precision_loss, reason = "a game has few decisions")]
    let decisions = record.iter().filter(is_decision).count() as f64;

    let text = server.text().await;
    for (sample, expected) in [
        ("chefshat_decisions_total{outcome=\"answered\"}", decisions),
        ("chefshat_decisions_total{outcome=\"timeout\"}", 0.0),
        ("chefshat_thinking_seconds_count", decisions),
        ("chefshat_answer_seconds_count", decisions),
        ("chefshat_answer_seconds_bucket{le=\"+Inf\"}", decisions),
        ("chefshat_invalid_answers_total", 0.0),
        ("chefshat_games_ended_total{result=\"finished\"}", 1.0),
        ("chefshat_rooms{state=\"finished\"}", 1.0),
        ("chefshat_rooms{state=\"playing\"}", 0.0),
        ("chefshat_refusals_total{reason=\"ROOM_UNKNOWN\"}", 1.0),
        ("chefshat_queue_depth{queue=\"outbox\"}", 0.0),
        ("chefshat_draining", 0.0),
        // 2126-10-28, as OpenSSL reads it from the file.
        (
            "chefshat_certificate_expiry_timestamp_seconds{listener=\"clients\"}",
            4_948_864_965.0,
        ),
    ] {
        assert_eq!(value(&text, sample), expected, "{sample}");
    }
    for sample in [
        "chefshat_commit_seconds_count",
        "chefshat_connections",
        "chefshat_disk_free_bytes",
        "chefshat_database_bytes",
        "process_resident_memory_bytes",
        "process_open_fds",
    ] {
        assert!(value(&text, sample) > 0.0, "{sample}");
    }
    for secret in [game.as_str(), "agent 0"] {
        assert!(!text.contains(secret), "no names and no ids: {secret}");
    }
    assert!(text.ends_with("# EOF\n"));
}

#[tokio::test]
async fn connected_seats_streams_and_late_decisions_are_counted() {
    let server = Observed::start().await;
    let client = server.client().await;
    // Nobody answers: each decision ends at once by default, then substitutes play.
    let policy = v1::RoomPolicy {
        decision_time_ms: Some(10),
        bank_ms: Some(0),
        ..v1::RoomPolicy::default()
    };
    let (_, tickets) = room_of_four(&client, one_shift(), policy).await;
    let mut seats = Vec::new();
    for ticket in &tickets[..3] {
        seats.push(StreamSeat::attached(client.channel(), ticket).await);
    }
    let text = server.text().await;
    let connected = "chefshat_seats_connected{kind=\"agent\"}";
    assert_eq!(value(&text, connected), 3.0);
    assert_eq!(value(&text, "chefshat_streams{service=\"play\"}"), 3.0);
    assert_eq!(value(&text, "chefshat_rooms{state=\"waiting\"}"), 1.0);

    seats.push(StreamSeat::attached(client.channel(), &tickets[3]).await);
    let over = "chefshat_games_ended_total{result=\"finished\"}";
    let aborted = "chefshat_games_ended_total{result=\"aborted\"}";
    let text = patiently("the game to end", async {
        loop {
            let text = server.text().await;
            if value(&text, over) + value(&text, aborted) > 0.0 {
                return text;
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    })
    .await;
    assert!(value(&text, "chefshat_decisions_total{outcome=\"timeout\"}") > 0.0);
    assert_eq!(
        value(&text, "chefshat_decisions_total{outcome=\"answered\"}"),
        0.0
    );
    drop(seats);
    // The room learns of a lost stream after the stream has ended.
    for gauge in ["chefshat_streams{service=\"play\"}", connected] {
        patiently("the seats to leave", async {
            while value(&server.text().await, gauge) > 0.0 {
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        })
        .await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn each_decision_is_logged_in_the_spans_of_its_room_and_itself() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(folder.path())
        .flags(&["--log-json"])
        .with("--log", "chefshat=debug");
    let server = launch.start().await.expect("the server starts");
    let client = Client::connect(&launch.url()).await.expect("it listens");
    let (created, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let playing = client.play_many(random_agents(tickets.clone()));
    for outcome in patiently("the game", playing).await {
        outcome.expect("it ends");
    }
    let room = created.room.expect("a room");
    let record = client.record(&room.game_id).await.expect("it has ended");
    let mut decided = Vec::new();
    for line in &record {
        if let Some(Line::Decision(decision)) = &line.line {
            decided.push(u64::from(decision.seat));
        }
    }
    let ended = server.stop().await;
    assert!(ended.status.success(), "{ended:?}");

    let lines = (ended.said.lines()).filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let logged: Vec<Value> = lines
        .filter(|line| line["fields"]["message"] == "a decision was taken")
        .collect();
    let seats: Vec<u64> = (logged.iter())
        .map(|line| line["span"]["seat"].as_u64().expect("a seat"))
        .collect();
    assert_eq!(seats, decided);
    for line in &logged {
        assert_eq!(line["fields"]["outcome"], "answered");
        let names = [&line["spans"][0]["name"], &line["span"]["name"]];
        assert_eq!(names, ["room", "decision"]);
        assert_eq!(line["spans"][0]["room"], room.room_id.as_str());
        assert_eq!(line["spans"][0]["game"], room.game_id.as_str());
    }
    for secret in tickets
        .iter()
        .chain([&created.owner_token, &created.join_code])
    {
        assert!(!ended.said.contains(secret), "a secret in the log");
    }
}

/// The text of a file of the repository.
fn read(path: &str) -> String {
    let path = source(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The rows of the table in the docs that these metrics should have.
fn rows(text: &str) -> BTreeSet<String> {
    let mut helps = BTreeMap::new();
    let mut types = BTreeMap::new();
    let mut labels: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for line in text.lines() {
        if let Some((name, help)) = line
            .strip_prefix("# HELP ")
            .and_then(|it| it.split_once(' '))
        {
            helps.insert(name, help.trim_end_matches('.'));
        } else if let Some((name, kind)) = line
            .strip_prefix("# TYPE ")
            .and_then(|it| it.split_once(' '))
        {
            types.insert(name, kind);
        } else if let Some((sample, rest)) = line.split_once('{') {
            let names = rest
                .split('"')
                .step_by(2)
                .map(|it| it.trim_matches(['}', ',', '=']));
            let names =
                names.filter(|it| !it.starts_with('}') && it.chars().all(char::is_alphabetic));
            let names = names.filter(|name| !name.is_empty() && *name != "le");
            labels.entry(sample).or_default().extend(names);
        }
    }
    helps
        .into_iter()
        .map(|(name, help)| {
            let kind = types[name];
            let sample = match kind {
                "counter" => format!("{name}_total"),
                "info" => format!("{name}_info"),
                _ => name.to_owned(),
            };
            let labels = labels.get(sample.as_str()).into_iter().flatten();
            let labels: Vec<String> = labels.map(|label| format!("`{label}`")).collect();
            format!("| `{sample}` | {kind} | {} | {help} |", labels.join(", "))
        })
        .collect()
}

#[tokio::test]
async fn the_docs_list_every_metric() {
    let server = Observed::start().await;
    server.play().await;
    let unknown = server.client().await.get_room("0000").await;
    unknown.expect_err("there is no such room");
    let expected = rows(&server.text().await);
    let docs = read("docs/observing.md");
    let is_row = |line: &&str| line.starts_with("| `chefshat_") || line.starts_with("| `process_");
    let listed: BTreeSet<String> = docs.lines().filter(is_row).map(str::to_owned).collect();
    assert_eq!(listed, expected);
}

#[tokio::test]
async fn the_alerts_of_a_cluster_fire_while_their_fault_lasts() {
    let checked = Command::new("promtool")
        .args(["test", "rules"])
        .arg(source("tests/fixtures/alerts_test.yml"))
        .output()
        .await;
    let Ok(checked) = checked else {
        return skip("the_alerts_of_a_cluster…", "Prometheus is not installed");
    };
    assert!(checked.status.success(), "{checked:?}");
}

#[tokio::test]
async fn the_shipped_dashboard_and_alerts_have_data_in_a_real_prometheus() {
    let server = Observed::start().await;
    server.play().await;
    let unknown = server.client().await.get_room("0000").await;
    unknown.expect_err("there is no such room");
    let Some(prometheus) = Prometheus::start(&[server.metrics], "100ms").await else {
        return skip("the_shipped_dashboard…", "Prometheus is not installed");
    };

    let dashboard: Value =
        serde_json::from_str(&read("docker/prometheus/dashboard.json")).expect("JSON");
    let panels = dashboard["panels"].as_array().expect("panels");
    let targets = panels
        .iter()
        .filter_map(|panel| panel["targets"].as_array());
    let expressions: Vec<String> = (targets.flatten())
        .map(|target| target["expr"].as_str().expect("an expression"))
        .map(|expr| {
            expr.replace("$instance", ".*")
                .replace("$__rate_interval", "30s")
        })
        .collect();
    assert!(expressions.len() > 30, "{expressions:#?}");
    for expression in &expressions {
        prometheus.has_data(expression).await;
    }

    // An alert has data when its threshold is left out, and is evaluated without an error.
    let groups = prometheus.api("rules").await;
    let rules = groups["data"]["groups"][0]["rules"]
        .as_array()
        .expect("rules")
        .clone();
    assert!(rules.len() >= 10, "{groups}");
    for rule in &rules {
        let expression = rule["query"].as_str().expect("an expression");
        let (measured, _) = expression
            .rsplit_once(['<', '>', '='])
            .expect("a threshold");
        prometheus.has_data(measured.trim_end_matches('=')).await;
    }
    patiently("all rules to be evaluated", async {
        loop {
            let groups = prometheus.api("rules").await;
            let rules = groups["data"]["groups"][0]["rules"]
                .as_array()
                .expect("rules");
            let health = |rule: &Value| rule["health"].as_str().expect("a text").to_owned();
            assert!(rules.iter().all(|rule| health(rule) != "err"), "{groups}");
            if rules.iter().all(|rule| health(rule) == "ok") {
                return;
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    })
    .await;
}
