//! Scenarios: which rooms on which streams, and the order of measurements. What is measured and what it is measured beside take turns
//! within a scenario, each time in processes of their own, so that what disturbs the machine disturbs both.

use std::time::Duration;

use crate::disk;
use crate::error::LoadError;
use crate::options::{Load, Place, SEATS};
use crate::ping::{self, Sizes};
use crate::play;
use crate::pulse::{Latencies, Plan, Window, latencies};
use crate::server::{Kind, ServerProcess};
use crate::tally::{Counts, Traffic};

/// Rooms in the scenario of durability, unless the options say otherwise.
const DURABLE_ROOMS: usize = 64;

/// What a scenario is for, which decides the goals it is held to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// Each seat on a connection of its own.
    Apart,
    /// All seats on one connection.
    Shared,
    /// Many seats, for their memory.
    Memory,
    /// Rooms that outlive the server, beside rooms that do not.
    Durability,
    /// Anything else.
    Own,
}

/// Rooms on streams.
#[derive(Debug, Clone)]
pub(crate) struct Scenario {
    /// What it is for.
    pub(crate) purpose: Purpose,
    /// Rooms at a time.
    pub(crate) rooms: usize,
    /// Streams, each on a connection of its own.
    pub(crate) streams: usize,
    /// Shifts of a game; 0: games to 15 points.
    pub(crate) shifts: u32,
    /// Measurements.
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

/// The scenarios that were asked for.
pub(crate) fn scenarios(load: &Load) -> Vec<Scenario> {
    let count = |number: u64| usize::try_from(number).expect("bounded by the options");
    let scenario = |purpose, rooms: usize, streams: usize| Scenario {
        purpose,
        rooms,
        streams,
        shifts: load.shifts,
        rounds: load.rounds,
    };
    if load.smoke {
        let purpose = match load.durability {
            true => Purpose::Durability,
            false => Purpose::Own,
        };
        return vec![Scenario {
            shifts: 2,
            rounds: 1,
            ..scenario(purpose, 1, 4)
        }];
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
        scenario(Purpose::Apart, 1, 4),
        scenario(Purpose::Apart, 16, 64),
        scenario(Purpose::Shared, 16, 1),
        // Games as people play them, so that what a room remembers is what it remembers of such a game.
        Scenario {
            shifts: 0,
            rounds: 1,
            ..scenario(Purpose::Memory, 100, 400)
        },
    ]
}

/// One measurement of the server, and the one of what it is measured beside that followed it.
#[derive(Debug)]
pub(crate) struct Round {
    /// The server.
    pub(crate) server: Window,
    /// What it is measured beside; none where the server runs elsewhere.
    pub(crate) other: Option<Window>,
    /// Memory of the server's process per seat, attached and playing, bytes.
    pub(crate) bytes_per_seat: Option<f64>,
}

/// What a scenario showed.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// The scenario.
    pub(crate) scenario: Scenario,
    /// Its measurements.
    pub(crate) rounds: Vec<Round>,
    /// Decision times as the server measured them, microseconds.
    pub(crate) server_us: Latencies,
    /// Response times of the server as the client saw them, nanoseconds.
    pub(crate) client_ns: Latencies,
    /// Response times of what it is measured beside, nanoseconds.
    pub(crate) other_ns: Latencies,
    /// What was done on the server in the measured segments.
    pub(crate) counts: Counts,
    /// Answers in the measured segments of what it is measured beside.
    pub(crate) other_answers: u64,
    /// The messages of the segments on the server.
    pub(crate) traffic: Traffic,
}

impl Outcome {
    /// Mean bytes of a decision's messages so far.
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
}

/// Runs one scenario.
pub(crate) async fn run(load: &Load, scenario: Scenario) -> Result<Outcome, LoadError> {
    let mut plan = Plan {
        rooms: scenario.rooms,
        streams: scenario.streams,
        shifts: scenario.shifts,
        durable: true,
        warmup: load.warmup,
        window: load.seconds,
        decisions: load.decisions,
        seed: load.seed,
    };
    if load.smoke {
        plan.warmup = Duration::from_millis(50);
        plan.window = Duration::from_millis(200);
    }
    let mut outcome = Outcome {
        scenario,
        rounds: Vec::new(),
        server_us: latencies(),
        client_ns: latencies(),
        other_ns: latencies(),
        counts: Counts::default(),
        other_answers: 0,
        traffic: Traffic::default(),
    };
    for _ in 0..outcome.scenario.rounds {
        plan.seed = plan.seed.wrapping_add(plan.streams as u64);
        let (played, idle_bytes) = on_server(load, &plan, outcome.scenario.purpose).await?;
        outcome.server_us += &played.server_us;
        outcome.client_ns += &played.client_ns;
        outcome.counts.add(&played.counts);
        outcome.traffic.add(&played.traffic);
        let other = if outcome.scenario.purpose == Purpose::Durability {
            let ephemeral = Plan {
                durable: false,
                ..plan.clone()
            };
            let (played, _) = on_server(load, &ephemeral, outcome.scenario.purpose).await?;
            outcome.other_ns += &played.client_ns;
            outcome.other_answers += played.counts.answers;
            Some(played.window)
        } else if load.server.is_none() {
            let pinged = on_bare_room(load.place, &plan, outcome.sizes()).await?;
            outcome.other_ns += &pinged.client_ns;
            outcome.other_answers += pinged.answers;
            Some(pinged.window)
        } else {
            None
        };
        let seats = outcome.scenario.seats() as f64;
        outcome.rounds.push(Round {
            server: played.window,
            other,
            bytes_per_seat: played
                .window
                .playing_bytes
                .zip(idle_bytes)
                .map(|(playing, idle)| (playing.saturating_sub(idle)) as f64 / seats),
        });
    }
    Ok(outcome)
}

/// A segment on the game server, with the memory its process had before anybody connected.
async fn on_server(
    load: &Load,
    plan: &Plan,
    purpose: Purpose,
) -> Result<(play::Played, Option<u64>), LoadError> {
    if let Some(url) = &load.server {
        return Ok((play::segment(url, None, plan).await?, None));
    }
    let folder = disk::folder(load)?;
    let kind = match purpose {
        Purpose::Durability => Kind::OnDisk(folder.path()),
        _ => Kind::InMemory,
    };
    let server = ServerProcess::start(kind, load.place).await?;
    let idle = crate::gauge::resident_bytes(server.pid())
        .map_err(LoadError::io("reading the server's memory"))?;
    let played = play::segment(&server.url(), Some(server.pid()), plan).await?;
    server.stop().await?;
    Ok((played, Some(idle)))
}

async fn on_bare_room(place: Place, plan: &Plan, sizes: Sizes) -> Result<ping::Pinged, LoadError> {
    let server = ServerProcess::start(Kind::Bare, place).await?;
    let pinged = ping::segment(&server.url(), server.pid(), plan, sizes).await?;
    server.stop().await?;
    Ok(pinged)
}
