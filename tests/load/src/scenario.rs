//! Scenarios: rooms on streams, and the order of measurements. The sides of a comparison take turns
//! within a round, each in a fresh process, so that a disturbance of the machine hits both.

use std::time::Duration;

use crate::disk;
use crate::error::LoadError;
use crate::options::{Load, SEATS};
use crate::ping::{self, Sizes};
use crate::play::{self, Played};
use crate::pulse::{Latencies, Plan, Window, latencies};
use crate::server::{Kind, Launcher};
use crate::tally::{Counts, Traffic};

/// Decisions after which a window closes with --smoke.
const SMOKE_DECISIONS: u64 = 100;
/// Rooms in the durability scenario without `--rooms`.
const DURABLE_ROOMS: usize = 64;
/// Rooms of the scenarios of `--scale`: 4, 64, 400, 1,000 and 4,000 connections.
const SCALE_ROOMS: [usize; 5] = [1, 16, 100, 250, 1_000];

/// What a scenario is for; this selects its goals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// One connection per seat.
    Apart,
    /// All seats on one connection.
    Shared,
    /// Memory of many seats.
    Memory,
    /// One of several numbers of connections.
    Scale,
    /// Durable rooms beside ephemeral ones.
    Durability,
    /// The user's own.
    Own,
}

/// Rooms on streams.
#[derive(Debug, Clone)]
pub(crate) struct Scenario {
    pub(crate) purpose: Purpose,
    /// Rooms at a time.
    pub(crate) rooms: usize,
    /// Streams, each on a connection of its own.
    pub(crate) streams: usize,
    /// Shifts of a game; 0: games to 15 points.
    pub(crate) shifts: u32,
    /// Measurements of each side.
    pub(crate) rounds: u16,
}

impl Scenario {
    /// Its name in tables.
    pub(crate) fn name(&self) -> String {
        let plural = |count: usize, what: &str| {
            let ending = if count == 1 { "" } else { "s" };
            format!("{count} {what}{ending}")
        };
        format!(
            "{}, {} on {}",
            plural(self.rooms, "room"),
            plural(self.seats(), "seat"),
            plural(self.streams, "connection")
        )
    }

    /// Seats attached at a time.
    pub(crate) fn seats(&self) -> usize {
        self.rooms * SEATS
    }
}

/// The scenarios the options ask for.
pub(crate) fn scenarios(load: &Load) -> Vec<Scenario> {
    let count = |number: u64| usize::try_from(number).expect("bounded by the options");
    let scenario = |purpose, rooms: usize, streams: usize| Scenario {
        purpose,
        rooms,
        streams,
        shifts: load.shifts,
        rounds: load.rounds,
    };
    let apart = |purpose, rooms: usize| scenario(purpose, rooms, rooms * SEATS);
    if load.smoke {
        let short = |purpose, rooms| Scenario {
            shifts: 2,
            rounds: 1,
            ..apart(purpose, rooms)
        };
        return match (load.durability, load.scale) {
            (true, _) => vec![short(Purpose::Durability, 1)],
            (_, true) => vec![short(Purpose::Scale, 1), short(Purpose::Scale, 2)],
            _ => vec![short(Purpose::Own, 1)],
        };
    }
    if load.scale {
        return SCALE_ROOMS.map(|rooms| apart(Purpose::Scale, rooms)).into();
    }
    let rooms = load.rooms.map(count);
    if load.durability {
        let rooms = rooms.unwrap_or(DURABLE_ROOMS);
        let streams = load.streams.map_or(rooms * SEATS, count);
        return vec![scenario(Purpose::Durability, rooms, streams)];
    }
    if let Some(rooms) = rooms {
        let streams = load.streams.map_or(rooms * SEATS, count);
        return vec![scenario(Purpose::Own, rooms, streams)];
    }
    vec![
        apart(Purpose::Apart, 1),
        apart(Purpose::Apart, 16),
        scenario(Purpose::Shared, 16, 1),
        // Games of the usual length, so that a room holds as much as it does for people.
        Scenario {
            shifts: 0,
            rounds: 1,
            ..apart(Purpose::Memory, 100)
        },
    ]
}

/// One measurement of each side.
#[derive(Debug)]
pub(crate) struct Round {
    pub(crate) server: Window,
    /// What the server is compared with; `None` for a server that was not started here.
    pub(crate) other: Option<Window>,
    /// The server of the other build.
    pub(crate) other_build: Option<Window>,
    /// What the other build is compared with.
    pub(crate) beside_other_build: Option<Window>,
    /// Memory of the server's process per seat, attached and playing, bytes.
    pub(crate) bytes_per_seat: Option<f64>,
}

/// What a scenario showed.
#[derive(Debug)]
pub(crate) struct Outcome {
    pub(crate) scenario: Scenario,
    pub(crate) rounds: Vec<Round>,
    /// Decision times measured by the server, microseconds.
    pub(crate) server_us: Latencies,
    /// Response times of the server measured by the client, nanoseconds.
    pub(crate) client_ns: Latencies,
    /// Response times of what the server is compared with, nanoseconds.
    pub(crate) other_ns: Latencies,
    /// Response times of the other build, nanoseconds.
    pub(crate) other_build_ns: Latencies,
    /// What happened on the server, also outside the windows.
    pub(crate) counts: Counts,
    /// Answers to what the server is compared with.
    pub(crate) other_answers: u64,
    /// Messages of the server, also outside the windows.
    pub(crate) traffic: Traffic,
}

impl Outcome {
    /// Mean bytes per decision so far.
    fn sizes(&self) -> Sizes {
        let mean = |bytes: u64| {
            usize::try_from(bytes.div_ceil(self.counts.answers.max(1)))
                .expect("a mean size fits memory")
        };
        Sizes {
            request: mean(self.traffic.request_bytes),
            response: mean(self.traffic.response_bytes),
        }
    }

    /// Nothing yet.
    fn of(scenario: Scenario) -> Self {
        Self {
            scenario,
            rounds: Vec::new(),
            server_us: latencies(),
            client_ns: latencies(),
            other_ns: latencies(),
            other_build_ns: latencies(),
            counts: Counts::default(),
            other_answers: 0,
            traffic: Traffic::default(),
        }
    }

    /// Adds a round that was measured to its end.
    fn add(&mut self, round: Self) {
        self.rounds.extend(round.rounds);
        self.server_us += round.server_us;
        self.client_ns += round.client_ns;
        self.other_ns += round.other_ns;
        self.other_build_ns += round.other_build_ns;
        self.counts.add(&round.counts);
        self.other_answers += round.other_answers;
        self.traffic.add(&round.traffic);
    }
}

/// Runs one scenario: what its finished rounds showed, and why it ended before its last one, if it
/// did.
pub(crate) async fn run(load: &Load, scenario: Scenario) -> (Outcome, Option<LoadError>) {
    let mut plan = Plan {
        rooms: scenario.rooms,
        streams: scenario.streams,
        shifts: scenario.shifts,
        durable: true,
        // To the end, a thousand long games take minutes.
        play_to_end: scenario.purpose != Purpose::Scale,
        warmup: load.warmup,
        window: load.seconds,
        decisions: load.decisions,
        seed: load.seed,
        instructions: load.instructions,
    };
    if load.smoke {
        plan.warmup = Duration::from_millis(50);
        // On a busy machine a short time may have no decision at all.
        plan.decisions = Some(SMOKE_DECISIONS);
        plan.window = Duration::from_mins(1);
    }
    let mut outcome = Outcome::of(scenario);
    for _ in 0..outcome.scenario.rounds {
        plan.seed = plan.seed.wrapping_add(plan.streams as u64);
        match round(load, &plan, outcome.scenario.clone()).await {
            Ok(measured) => outcome.add(measured),
            Err(error) => return (outcome, Some(error)),
        }
    }
    (outcome, None)
}

/// Measures each side once.
async fn round(load: &Load, plan: &Plan, scenario: Scenario) -> Result<Outcome, LoadError> {
    let mut outcome = Outcome::of(scenario);
    let purpose = outcome.scenario.purpose;
    let this_build = Launcher::new(load);
    let other_build = Launcher::of_other_build(load);
    let ephemeral = Plan {
        durable: false,
        ..plan.clone()
    };
    let (played, idle_bytes) = match &load.server {
        Some(url) => (play::segment(url, None, plan).await?, None),
        None => on_server(load, this_build, plan, purpose).await?,
    };
    outcome.server_us += &played.server_us;
    outcome.client_ns += &played.client_ns;
    outcome.counts.add(&played.counts);
    outcome.traffic.add(&played.traffic);
    let grown = (played.window.playing_bytes.zip(idle_bytes))
        .map(|(playing, idle)| playing.saturating_sub(idle));
    let mut round = Round {
        server: played.window,
        other: None,
        other_build: None,
        beside_other_build: None,
        bytes_per_seat: grown.map(|bytes| bytes as f64 / outcome.scenario.seats() as f64),
    };
    if let Some(launcher) = other_build {
        let (played, _) = on_server(load, launcher, plan, purpose).await?;
        outcome.other_build_ns += &played.client_ns;
        round.other_build = Some(played.window);
    }
    if purpose == Purpose::Durability {
        let (played, _) = on_server(load, this_build, &ephemeral, purpose).await?;
        outcome.other_ns += &played.client_ns;
        outcome.other_answers += played.counts.answers;
        round.other = Some(played.window);
        if let Some(launcher) = other_build {
            let (played, _) = on_server(load, launcher, &ephemeral, purpose).await?;
            round.beside_other_build = Some(played.window);
        }
    } else if load.server.is_none() {
        let pinged = on_bare_room(this_build, plan, outcome.sizes()).await?;
        outcome.other_ns += &pinged.client_ns;
        outcome.other_answers += pinged.answers;
        round.other = Some(pinged.window);
        round.beside_other_build = other_build.map(|_| pinged.window);
    }
    outcome.rounds.push(round);
    Ok(outcome)
}

/// Plays on a server; also returns the memory its process had before the first connection.
async fn on_server(
    load: &Load,
    launcher: Launcher<'_>,
    plan: &Plan,
    purpose: Purpose,
) -> Result<(Played, Option<u64>), LoadError> {
    let folder = disk::folder(load)?;
    let kind = match purpose {
        Purpose::Durability => Kind::OnDisk(folder.path()),
        _ => Kind::InMemory,
    };
    let server = launcher.start(kind).await?;
    let idle = crate::gauge::resident_bytes(server.pid())
        .map_err(LoadError::io("reading the server's memory"))?;
    let played = play::segment(&server.url(), Some(server.pid()), plan).await?;
    server.stop().await?;
    Ok((played, Some(idle)))
}

async fn on_bare_room(
    launcher: Launcher<'_>,
    plan: &Plan,
    sizes: Sizes,
) -> Result<ping::Pinged, LoadError> {
    let server = launcher.start(Kind::Bare).await?;
    let pinged = ping::segment(&server.url(), server.pid(), plan, sizes).await?;
    server.stop().await?;
    Ok(pinged)
}
