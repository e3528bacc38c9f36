//! A client's own games: a random policy steps batches of several sizes, on one stream and on
//! several at once. Measures decisions per second, all of them the client's. The client is the Rust
//! SDK; every batch is decoded completely.

use std::time::{Duration, Instant};

use chefshat_client::{ActionId, Client, RandomAgent, VectorGames};
use chefshat_proto::v1;
use comfy_table::{Table, presets};
use serde::Serialize;
use tokio::task::JoinSet;

use crate::error::LoadError;
use crate::gauge::cpu_time;
use crate::options::{Load, SEATS};
use crate::server::{Kind, Launcher, ServerProcess};

/// Games per stream.
const GAMES: [u32; 3] = [1, 64, 1_024];
/// Parallel streams.
const STREAMS: [usize; 3] = [1, 2, 4];
/// Goal with the most games, decisions per second.
const GOAL: f64 = 4e6;

/// The results of the scenarios.
#[derive(Debug, Serialize)]
struct Report {
    scenarios: Vec<Scenario>,
    aim_decisions_per_second: f64,
    best_decisions_per_second: f64,
    met: bool,
}

/// A number of streams with a number of games each; medians over the rounds.
#[derive(Debug, Serialize)]
struct Scenario {
    streams: usize,
    games: u32,
    decisions: u64,
    decisions_per_second: f64,
    least: f64,
    most: f64,
    bytes_per_decision: f64,
    server_cpu_us: f64,
    client_cpu_us: f64,
}

/// The result of one stream in its window.
#[derive(Debug, Clone, Copy, Default)]
struct Done {
    decisions: u64,
    bytes: u64,
    seconds: f64,
}

/// Measures all scenarios, in turns, and prints the results.
pub(crate) async fn measure(load: &Load) -> Result<(), LoadError> {
    let server = Launcher::new(load).start(Kind::InMemory).await?;
    let scenarios: Vec<(usize, u32)> = (STREAMS.iter())
        .flat_map(|streams| GAMES.map(|games| (*streams, games)))
        .collect();
    let rounds = if load.smoke { 1 } else { load.rounds };
    let mut rows: Vec<Vec<Row>> = scenarios.iter().map(|_| Vec::new()).collect();
    for round in 0..rounds {
        for (&(streams, games), rows) in scenarios.iter().zip(&mut rows) {
            eprintln!(
                "round {}: {streams} streams of {games} games ...",
                round + 1
            );
            rows.push(scenario(load, &server, streams, games).await?);
        }
    }
    server.stop().await?;
    let scenarios: Vec<Scenario> = (scenarios.into_iter().zip(rows))
        .map(|((streams, games), rows)| Scenario::new(streams, games, rows))
        .collect();
    let best = (scenarios.iter())
        .map(|scenario| scenario.decisions_per_second)
        .fold(0.0, f64::max);
    let report = Report {
        scenarios,
        aim_decisions_per_second: GOAL,
        best_decisions_per_second: best,
        met: best >= GOAL,
    };
    if load.json {
        let json = serde_json::to_string_pretty(&report).expect("a report is plain data");
        println!("{json}");
    } else {
        print!("{}", report.to_text());
    }
    Ok(())
}

impl Report {
    fn to_text(&self) -> String {
        let mut table = Table::new();
        table.load_style(presets::UTF8_BORDERS_ONLY);
        table.set_header([
            "streams",
            "games each",
            "decisions/s",
            "least",
            "most",
            "bytes a decision",
            "server CPU µs",
            "client CPU µs",
        ]);
        for row in &self.scenarios {
            table.add_row([
                row.streams.to_string(),
                row.games.to_string(),
                format!("{:.0}", row.decisions_per_second),
                format!("{:.0}", row.least),
                format!("{:.0}", row.most),
                format!("{:.1}", row.bytes_per_decision),
                format!("{:.3}", row.server_cpu_us),
                format!("{:.3}", row.client_cpu_us),
            ]);
        }
        format!(
            "{table}\nbest {:.2} million decisions a second, aim {:.1}, {}\n",
            self.best_decisions_per_second / 1e6,
            self.aim_decisions_per_second / 1e6,
            if self.met { "met" } else { "missed" },
        )
    }
}

/// One round of a scenario.
#[derive(Debug, Clone, Copy)]
struct Row {
    done: Done,
    per_second: f64,
    server_cpu: Duration,
    client_cpu: Duration,
}

impl Scenario {
    fn new(streams: usize, games: u32, mut rows: Vec<Row>) -> Self {
        rows.sort_by(|a, b| a.per_second.total_cmp(&b.per_second));
        let (least, middle, most) = (rows[0], rows[rows.len() / 2], rows[rows.len() - 1]);
        let per_decision = |cpu: Duration| cpu.as_secs_f64() * 1e6 / middle.done.decisions as f64;
        Self {
            streams,
            games,
            decisions: rows.iter().map(|row| row.done.decisions).sum(),
            decisions_per_second: middle.per_second,
            least: least.per_second,
            most: most.per_second,
            bytes_per_decision: middle.done.bytes as f64 / middle.done.decisions as f64,
            server_cpu_us: per_decision(middle.server_cpu),
            client_cpu_us: per_decision(middle.client_cpu),
        }
    }
}

async fn scenario(
    load: &Load,
    server: &ServerProcess,
    streams: usize,
    games: u32,
) -> Result<Row, LoadError> {
    let (warmup, window) = if load.smoke {
        (Duration::ZERO, Duration::from_millis(200))
    } else {
        (load.warmup, load.seconds)
    };
    let mut opened = Vec::new();
    for stream in 0..streams as u64 {
        opened.push(Stream::open(server, games, load.seed + stream).await?);
    }
    let mut opened = run(opened, warmup).await?.0;
    let cpu = || -> Result<(Duration, Duration), LoadError> {
        let read = |pid| cpu_time(pid).map_err(LoadError::io("reading CPU times"));
        Ok((read(server.pid())?, read(std::process::id())?))
    };
    let before = cpu()?;
    let mut done = Done::default();
    let mut per_second = 0.0;
    let streams = std::mem::take(&mut opened);
    let (streams, parts) = run(streams, window).await?;
    let after = cpu()?;
    for part in parts {
        done.decisions += part.decisions;
        done.bytes += part.bytes;
        per_second += part.decisions as f64 / part.seconds;
    }
    for stream in &streams {
        stream.check()?;
    }
    Ok(Row {
        done,
        per_second,
        server_cpu: after.0.saturating_sub(before.0),
        client_cpu: after.1.saturating_sub(before.1),
    })
}

/// Steps all streams in parallel for a while.
async fn run(
    streams: Vec<Stream>,
    window: Duration,
) -> Result<(Vec<Stream>, Vec<Done>), LoadError> {
    let mut tasks = JoinSet::new();
    for stream in streams {
        tasks.spawn(stream.run(window));
    }
    let mut ended = Vec::new();
    let mut parts = Vec::new();
    while let Some(task) = tasks.join_next().await {
        let (stream, done) = task.expect("a stream's task does not panic")?;
        ended.push(stream);
        parts.push(done);
    }
    Ok((ended, parts))
}

/// One stream of games; the client has all seats.
struct Stream {
    games: VectorGames,
    batch: Box<v1::VectorBatch>,
    agent: RandomAgent,
    /// Answers given so far.
    answered: u64,
}

impl Stream {
    /// Opens a stream on its own connection.
    async fn open(server: &ServerProcess, games: u32, seed: u64) -> Result<Self, LoadError> {
        let refused = |error: chefshat_client::Error| LoadError::Protocol(error.to_string());
        let client = Client::connect(server.url()).await.map_err(refused)?;
        let setup = v1::VectorSetup {
            games,
            seeds: Some(v1::vector_setup::Seeds::BaseSeed(seed)),
            reward_scheme: v1::RewardScheme::Paper.into(),
            ..v1::VectorSetup::default()
        };
        let (games, batch) = client.vector(setup).await.map_err(refused)?;
        Ok(Self {
            games,
            batch,
            agent: RandomAgent::new(seed),
            answered: 0,
        })
    }

    async fn run(mut self, window: Duration) -> Result<(Self, Done), LoadError> {
        let start = Instant::now();
        let mut done = Done::default();
        while start.elapsed() < window {
            let rows = self.batch.rows as usize;
            let width = self.batch.action_masks.len() / rows.max(1);
            let mut actions = Vec::with_capacity(rows);
            for mask in self.batch.action_masks.chunks_exact(width.max(1)) {
                let legal = self.agent.choose(mask);
                actions.push(legal.ok_or_else(|| LoadError::Protocol("no legal action".into()))?);
            }
            if actions.len() != rows || rows == 0 {
                let problem = format!("{} masks for {rows} rows", actions.len());
                return Err(LoadError::Protocol(problem));
            }
            self.step(actions).await?;
            done.decisions += rows as u64;
            done.bytes += prost::Message::encoded_len(&*self.batch) as u64;
        }
        self.answered += done.decisions;
        done.seconds = start.elapsed().as_secs_f64();
        Ok((self, done))
    }

    async fn step(&mut self, actions: Vec<ActionId>) -> Result<(), LoadError> {
        let stepped = self.games.step(actions).await;
        self.batch = stepped.map_err(|error| LoadError::Protocol(error.to_string()))?;
        Ok(())
    }

    /// Compares the answers given with the server's counts.
    fn check(&self) -> Result<(), LoadError> {
        let totals = self.batch.totals.unwrap_or_default();
        let counted = (totals.client_decisions, totals.decisions);
        if counted == (self.answered, self.answered) && self.answered > 0 {
            return Ok(());
        }
        Err(LoadError::Count(format!(
            "{} answers, {counted:?} decisions of the client and in all (all {SEATS} seats are the client's)",
            self.answered
        )))
    }
}
