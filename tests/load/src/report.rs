//! Output: the figures of the outcomes as JSON and as tables. A scenario's figures are medians of
//! its rounds; its ratios are medians of each round's ratio. `restart` and `vector` print their
//! own.

use comfy_table::{CellAlignment, Table, presets};
use serde::Serialize;

use crate::options::Load;
use crate::pulse::{Latencies, Window};
use crate::scenario::{Outcome, Purpose, Round};
use crate::tally::{Counts, Traffic};

/// Least throughput, as a share of the bare room's.
const GOAL_THROUGHPUT: f64 = 0.90;
/// Most CPU time per decision, as a multiple of the bare room's.
const GOAL_CPU: f64 = 1.15;
/// Least throughput of a shared connection, as a multiple of that of one connection per seat.
const GOAL_SHARED: f64 = 2.0;
/// Least throughput of durable rooms, as a share of that of ephemeral ones.
const GOAL_DURABLE: f64 = 0.5;
/// Most CPU time per decision in durable rooms, as a multiple of that in ephemeral ones.
const GOAL_DURABLE_CPU: f64 = 1.35;
/// Most connections of `--scale` that have goals.
const GOAL_CONNECTIONS: usize = 1_000;
/// Most memory per seat, KiB.
const GOAL_KIB: f64 = 100.0;

/// A whole run.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    pinned: bool,
    seconds: f64,
    #[serde(skip)]
    scale: bool,
    scenarios: Vec<Figures>,
    /// Small synced writes the disk takes per second; only for games on disk.
    disk_syncs_per_second: Option<f64>,
    goals: Vec<Goal>,
    /// Scenarios that ended before their last round, each with its error.
    failed: Vec<String>,
}

/// A scenario.
#[derive(Debug, Serialize)]
struct Figures {
    name: String,
    rooms: usize,
    seats: usize,
    connections: usize,
    rounds: usize,
    server: Side,
    /// Measured by the server: from handing a request to the transport until the answer has been
    /// read.
    decision_time_us: Quantiles,
    /// What the server is compared with.
    beside: &'static str,
    other: Option<Side>,
    throughput_ratio: Option<Spread>,
    server_cpu_ratio: Option<Spread>,
    server_instructions_ratio: Option<Spread>,
    /// The server of the other build, if there is one.
    other_build: Option<OtherBuild>,
    memory_per_seat_kib: Option<f64>,
    bytes_per_decision: PerDecision,
    messages: Traffic,
    checked: Counts,
    other_answers: u64,
}

/// The other build, compared with the same as this one.
#[derive(Debug, Serialize)]
struct OtherBuild {
    server: Side,
    throughput_ratio: Option<Spread>,
    server_cpu_ratio: Option<Spread>,
}

/// One side of a comparison.
#[derive(Debug, Serialize)]
struct Side {
    decisions_per_second: f64,
    server_cpu_us_per_decision: Option<f64>,
    /// If they are counted.
    server_instructions_per_decision: Option<f64>,
    client_cpu_us_per_decision: f64,
    /// From sending an answer until the room's next decision arrives on any stream.
    response_time_us: Quantiles,
    decisions_in_windows: u64,
}

#[derive(Debug, Serialize)]
struct PerDecision {
    request: f64,
    response: f64,
    response_messages: f64,
}

#[derive(Debug, Serialize)]
struct Quantiles {
    p50: f64,
    p99: f64,
}

/// A figure over the rounds.
#[derive(Debug, Clone, Copy, Serialize)]
struct Spread {
    median: f64,
    least: f64,
    most: f64,
}

/// A goal, and how the run compares with it.
#[derive(Debug, Serialize)]
struct Goal {
    what: String,
    aim: String,
    reached: f64,
    met: bool,
}

impl Report {
    /// The report of outcomes.
    pub(crate) fn new(
        load: &Load,
        outcomes: &[Outcome],
        disk_syncs_per_second: Option<f64>,
        failed: &[String],
    ) -> Self {
        let scenarios: Vec<Figures> = outcomes.iter().map(Figures::new).collect();
        Self {
            pinned: load.place.pin,
            seconds: load.seconds.as_secs_f64(),
            scale: load.scale,
            goals: goals(outcomes, &scenarios),
            scenarios,
            disk_syncs_per_second,
            failed: failed.to_vec(),
        }
    }

    /// As tables for people.
    pub(crate) fn to_text(&self) -> String {
        let mut text = String::new();
        if self.scale {
            text.push_str(&scale_table(&self.scenarios));
        } else {
            for figures in &self.scenarios {
                text.push_str(&figures.to_text());
                text.push('\n');
            }
        }
        if !self.goals.is_empty() {
            let mut table = new_table(&["goal", "aim", "reached", ""]);
            for goal in &self.goals {
                let met = if goal.met { "met" } else { "missed" };
                table.add_row([
                    goal.what.clone(),
                    goal.aim.clone(),
                    format!("{:.2}", goal.reached),
                    met.to_owned(),
                ]);
            }
            text.push_str(&format!("{table}\n"));
        }
        for failed in &self.failed {
            text.push_str(&format!("not measured to the end: {failed}\n"));
        }
        let kept = match self.disk_syncs_per_second {
            Some(syncs) => {
                format!("Games are on disk, which takes {syncs:.0} small synced writes a second.")
            }
            None => "Games are in memory.".to_owned(),
        };
        text.push_str(&format!(
            "{kept} Compare ratios: times depend on the machine and the moment.\n"
        ));
        text
    }
}

impl Figures {
    fn new(outcome: &Outcome) -> Self {
        let scenario = &outcome.scenario;
        let windows = |of: fn(&Round) -> Option<Window>| -> Vec<Window> {
            outcome.rounds.iter().filter_map(of).collect()
        };
        let other = windows(|round| round.other);
        let other_build = windows(|round| round.other_build);
        type Pair = fn(&Round) -> Option<(Window, Window)>;
        let ratio = |pair: Pair, of: fn(&Window) -> Option<f64>| {
            Spread::of(outcome.rounds.iter().filter_map(|round| {
                let (server, other) = pair(round)?;
                Some(of(&server)? / of(&other)?).filter(|ratio| ratio.is_finite())
            }))
        };
        let this: Pair = |round| Some((round.server, round.other?));
        let that: Pair = |round| Some((round.other_build?, round.beside_other_build?));
        let per_second: fn(&Window) -> Option<f64> = |window| Some(rate(window));
        let decisions = outcome.counts.answers as f64;
        Self {
            name: scenario.name(),
            rooms: scenario.rooms,
            seats: scenario.seats(),
            connections: scenario.streams,
            rounds: outcome.rounds.len(),
            server: Side::new(&windows(|round| Some(round.server)), &outcome.client_ns),
            decision_time_us: Quantiles::of(&outcome.server_us, 1.0),
            throughput_ratio: ratio(this, per_second),
            server_cpu_ratio: ratio(this, server_cpu_us),
            server_instructions_ratio: ratio(this, server_instructions),
            other_build: (!other_build.is_empty()).then(|| OtherBuild {
                server: Side::new(&other_build, &outcome.other_build_ns),
                throughput_ratio: ratio(that, per_second),
                server_cpu_ratio: ratio(that, server_cpu_us),
            }),
            beside: beside(scenario.purpose),
            other: (!other.is_empty()).then(|| Side::new(&other, &outcome.other_ns)),
            memory_per_seat_kib: median(
                outcome
                    .rounds
                    .iter()
                    .filter_map(|round| round.bytes_per_seat),
            )
            .map(|bytes| bytes / 1024.0),
            bytes_per_decision: PerDecision {
                request: outcome.traffic.request_bytes as f64 / decisions,
                response: outcome.traffic.response_bytes as f64 / decisions,
                response_messages: outcome.traffic.responses as f64 / decisions,
            },
            messages: outcome.traffic,
            checked: outcome.counts.clone(),
            other_answers: outcome.other_answers,
        }
    }

    fn to_text(&self) -> String {
        let mut table = new_table(&[
            "",
            "decisions/s",
            "server CPU µs",
            "client CPU µs",
            "response p50 µs",
            "p99 µs",
        ]);
        let mut row = |name: &str, side: &Side| {
            table.add_row([
                name.to_owned(),
                format!("{:.0}", side.decisions_per_second),
                side.server_cpu_us_per_decision
                    .map_or_else(|| "-".into(), |us| format!("{us:.2}")),
                format!("{:.2}", side.client_cpu_us_per_decision),
                format!("{:.0}", side.response_time_us.p50),
                format!("{:.0}", side.response_time_us.p99),
            ]);
        };
        row("server", &self.server);
        if let Some(other_build) = &self.other_build {
            row("other build", &other_build.server);
        }
        if let Some(other) = &self.other {
            row(self.beside, other);
        }
        if let (Some(throughput), Some(cpu)) = (self.throughput_ratio, self.server_cpu_ratio) {
            table.add_row(["ratio".into(), throughput.to_string(), cpu.to_string()]);
        }
        if let Some(OtherBuild {
            throughput_ratio: Some(throughput),
            server_cpu_ratio: Some(cpu),
            ..
        }) = &self.other_build
        {
            table.add_row([
                "other build's ratio".into(),
                throughput.to_string(),
                cpu.to_string(),
            ]);
        }
        let per_decision = |side: &Side| side.server_instructions_per_decision;
        let instructions = match (
            per_decision(&self.server),
            self.other.as_ref().and_then(per_decision),
            self.server_instructions_ratio,
        ) {
            (Some(server), Some(other), Some(ratio)) => format!(
                "instructions per decision: server {server:.0}, {} {other:.0}, ratio {ratio}\n",
                self.beside
            ),
            _ => String::new(),
        };
        let memory = self.memory_per_seat_kib.map_or_else(String::new, |kib| {
            format!("; {kib:.0} KiB of memory per seat")
        });
        format!(
            "{}, {} rounds\n{table}\ndecision time by the server's clock: p50 {:.0} µs, p99 {:.0} µs{memory}\n\
             {instructions}bytes per decision: {:.0} to the server, {:.0} from it in {:.2} messages; checked: {} games, {} decisions\n",
            self.name,
            self.rounds,
            self.decision_time_us.p50,
            self.decision_time_us.p99,
            self.bytes_per_decision.request,
            self.bytes_per_decision.response,
            self.bytes_per_decision.response_messages,
            self.checked.games,
            self.checked.accepted,
        )
    }
}

impl Side {
    fn new(windows: &[Window], response_ns: &Latencies) -> Self {
        Self {
            decisions_per_second: median(windows.iter().map(rate)).unwrap_or_default(),
            server_cpu_us_per_decision: median(windows.iter().filter_map(server_cpu_us)),
            server_instructions_per_decision: median(
                windows.iter().filter_map(server_instructions),
            ),
            client_cpu_us_per_decision: median(windows.iter().map(client_cpu_us))
                .unwrap_or_default(),
            response_time_us: Quantiles::of(response_ns, 1_000.0),
            decisions_in_windows: windows.iter().map(|window| window.decisions).sum(),
        }
    }
}

impl Quantiles {
    fn of(latencies: &Latencies, per_us: f64) -> Self {
        let at = |quantile| latencies.value_at_quantile(quantile) as f64 / per_us;
        Self {
            p50: at(0.50),
            p99: at(0.99),
        }
    }
}

impl Spread {
    fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let values: Vec<f64> = values.collect();
        Some(Self {
            median: median(values.iter().copied())?,
            least: values.iter().copied().fold(f64::INFINITY, f64::min),
            most: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        })
    }
}

impl std::fmt::Display for Spread {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            formatter,
            "{:.3} ({:.2}-{:.2})",
            self.median, self.least, self.most
        )
    }
}

/// One line per number of connections; of two builds, the ratios of both.
fn scale_table(scenarios: &[Figures]) -> String {
    let both = (scenarios.iter()).any(|figures| figures.other_build.is_some());
    let mut header = vec![
        "connections",
        "decisions/s",
        "server CPU µs",
        "bare CPU µs",
        "CPU ratio",
        "throughput ratio",
    ];
    if both {
        header.extend(["other build: CPU ratio", "throughput ratio"]);
    }
    let mut table = new_table(&header);
    let time = |side: Option<&Side>| {
        side.and_then(|side| side.server_cpu_us_per_decision)
            .map_or_else(|| "-".to_owned(), |us| format!("{us:.2}"))
    };
    let spread = |spread: Option<Spread>| spread.map_or("-".into(), |spread| spread.to_string());
    for figures in scenarios {
        let mut row = vec![
            figures.connections.to_string(),
            format!("{:.0}", figures.server.decisions_per_second),
            time(Some(&figures.server)),
            time(figures.other.as_ref()),
            spread(figures.server_cpu_ratio),
            spread(figures.throughput_ratio),
        ];
        if both {
            let other = figures.other_build.as_ref();
            row.push(spread(other.and_then(|other| other.server_cpu_ratio)));
            row.push(spread(other.and_then(|other| other.throughput_ratio)));
        }
        table.add_row(row);
    }
    format!("{table}\n")
}

/// The goals of the scenarios.
fn goals(outcomes: &[Outcome], scenarios: &[Figures]) -> Vec<Goal> {
    let mut goals = Vec::new();
    let with = |purpose| {
        outcomes
            .iter()
            .zip(scenarios)
            .filter(move |(outcome, _)| outcome.scenario.purpose == purpose)
            .map(|(_, figures)| figures)
    };
    let scaled = with(Purpose::Scale).filter(|figures| figures.connections <= GOAL_CONNECTIONS);
    for figures in with(Purpose::Apart).chain(scaled) {
        if let Some(throughput) = figures.throughput_ratio {
            goals.push(Goal {
                what: format!("throughput to bare, {}", figures.name),
                aim: format!(">= {GOAL_THROUGHPUT:.2}"),
                reached: throughput.median,
                met: throughput.median >= GOAL_THROUGHPUT,
            });
        }
        if let Some(cpu) = figures.server_cpu_ratio {
            goals.push(Goal {
                what: format!("server CPU to bare, {}", figures.name),
                aim: format!("<= {GOAL_CPU:.2}"),
                reached: cpu.median,
                met: cpu.median <= GOAL_CPU,
            });
        }
    }
    for shared in with(Purpose::Shared) {
        if let Some(apart) = with(Purpose::Apart).find(|apart| apart.seats == shared.seats) {
            let times = shared.server.decisions_per_second / apart.server.decisions_per_second;
            goals.push(Goal {
                what: "throughput of one shared connection to connections apart".into(),
                aim: format!(">= {GOAL_SHARED:.2}"),
                reached: times,
                met: times >= GOAL_SHARED,
            });
        }
    }
    for figures in with(Purpose::Durability) {
        if let Some(throughput) = figures.throughput_ratio {
            goals.push(Goal {
                what: format!("throughput of durable to ephemeral rooms, {}", figures.name),
                aim: format!(">= {GOAL_DURABLE:.2}"),
                reached: throughput.median,
                met: throughput.median >= GOAL_DURABLE,
            });
        }
        if let Some(cpu) = figures.server_cpu_ratio {
            goals.push(Goal {
                what: format!("server CPU of durable to ephemeral rooms, {}", figures.name),
                aim: format!("<= {GOAL_DURABLE_CPU:.2}"),
                reached: cpu.median,
                met: cpu.median <= GOAL_DURABLE_CPU,
            });
        }
    }
    for figures in with(Purpose::Memory) {
        if let Some(kib) = figures.memory_per_seat_kib {
            goals.push(Goal {
                what: format!("KiB of memory per seat, {}", figures.name),
                aim: format!("<= {GOAL_KIB:.0}"),
                reached: kib,
                met: kib <= GOAL_KIB,
            });
        }
    }
    goals
}

/// What the server is compared with.
fn beside(purpose: Purpose) -> &'static str {
    match purpose {
        Purpose::Durability => "ephemeral rooms",
        _ => "bare room",
    }
}

fn rate(window: &Window) -> f64 {
    window.decisions as f64 / window.elapsed.as_secs_f64()
}

fn server_cpu_us(window: &Window) -> Option<f64> {
    let cpu = window.server_cpu?;
    Some(cpu.as_secs_f64() * 1e6 / window.decisions as f64)
}

fn server_instructions(window: &Window) -> Option<f64> {
    Some(window.server_instructions? as f64 / window.decisions as f64)
}

fn client_cpu_us(window: &Window) -> f64 {
    window.client_cpu.as_secs_f64() * 1e6 / window.decisions as f64
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let upper = *values.get(values.len() / 2)?;
    let lower = values[(values.len() - 1) / 2];
    Some(f64::midpoint(lower, upper))
}

fn new_table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::UTF8_BORDERS_ONLY);
    table.set_header(header.iter().copied());
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
