//! Scenarios that are no attacks: many idle connections, spectators that do not read, and rooms
//! that start and end for a long time. Each has a server of its own.

use std::collections::BTreeMap;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use chefshat_proto::v1::{
    self, room_service_client::RoomServiceClient, server_service_client::ServerServiceClient,
};
use chefshat_tests::{Launch, Process};
use clap::{Args, Subcommand};
use futures::{StreamExt as _, stream};
use tempfile::TempDir;
use tokio::time::Instant;
use tonic::transport::Channel;

use crate::error::HostileError;
use crate::gauge;
use crate::honest::{self, Access, HonestRoom, LONG, Noticed, SHORT};
use crate::raw;
use crate::report::{MIB, round};
use crate::tally::{Counts, Tally};

/// Clients that connect at a time.
const AT_A_TIME: usize = 64;
/// Addresses of the clients, so that none has more than its share.
const ADDRESSES: u32 = 100;
/// Connections of the server besides the idle ones.
const OTHERS: u32 = 100;
/// How long the rooms may take until all of them play, and until their last games have ended.
const PATIENCE: Duration = Duration::from_secs(300);
/// Number of memory samples of a soak.
const SAMPLES: u32 = 360;
/// Number of lines about the progress of a soak.
const REPORTS: u32 = 20;

/// Maximum length of a phase, seconds.
const MAX_SECONDS: f64 = 600.0;

/// What is measured instead of the attacks.
#[derive(Debug, Clone, Copy, Subcommand)]
pub(crate) enum Scenario {
    /// Measure the memory of idle connections: clients that have made one call and stay connected.
    Idle(Idle),
    /// Measure what spectators that do not read cost the players they watch.
    Spectators(Spectators),
    /// Play games, each in a new room, for a long time, and fit a line to the server's memory.
    Soak(Soak),
}

impl Scenario {
    /// Runs it. Returns its report, a JSON object.
    pub(crate) async fn run(self, server: &Path) -> Result<serde_json::Value, HostileError> {
        match self {
            Self::Idle(idle) => Ok(json(&idle.run(server).await?)),
            Self::Spectators(spectators) => Ok(json(&spectators.run(server).await?)),
            Self::Soak(soak) => Ok(json(&soak.run(server).await?)),
        }
    }
}

fn json(report: &impl serde::Serialize) -> serde_json::Value {
    serde_json::to_value(report).expect("a report is plain data")
}

/// A server and its folder.
struct Running {
    process: Process,
    url: String,
    folder: TempDir,
}

impl Running {
    async fn start(server: &Path, options: &[(&str, u32)]) -> Result<Self, HostileError> {
        let folder = tempfile::tempdir().map_err(HostileError::io("making a temporary folder"))?;
        let mut launch = Launch::new(folder.path()).binary(server);
        for (name, value) in options {
            launch = launch.with(name, value);
        }
        let process = launch.start().await;
        Ok(Self {
            process: process.map_err(|ended| HostileError::Start(ended.said))?,
            url: launch.url(),
            folder,
        })
    }

    /// Resident memory, MiB.
    fn memory_mib(&self) -> Result<f64, HostileError> {
        let memory = gauge::memory(self.process.id())
            .map_err(HostileError::io("reading the server's memory"))?;
        Ok(memory.resident as f64 / MIB)
    }

    fn address(&self) -> SocketAddr {
        (self.url["http://".len()..].parse()).expect("the server printed it")
    }
}

/// The address of a client.
fn address_of(client: u32) -> IpAddr {
    let number = u8::try_from(client % ADDRESSES).expect("fewer than 256");
    Ipv4Addr::new(127, 0, 1, number).into()
}

/// Idle connections.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Idle {
    /// Number of connections.
    #[arg(long, default_value_t = 10_000, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    connections: u32,
    /// Seconds for which they stay idle.
    #[arg(long, default_value = "10", value_parser = seconds)]
    seconds: Duration,
}

/// What idle connections cost.
#[derive(Debug, serde::Serialize)]
struct IdleReport {
    /// Connections that made a call.
    connections: usize,
    /// Connections on which a second call was served, after the idle time.
    served_again: usize,
    memory_before_mib: f64,
    memory_idle_mib: f64,
    /// Memory of each connection.
    kib_each: f64,
    /// Memory after all have been closed.
    memory_closed_mib: f64,
}

impl Idle {
    async fn run(self, server: &Path) -> Result<IdleReport, HostileError> {
        let most = self.connections + OTHERS;
        let server = Running::start(server, &[("--max-connections", most)]).await?;
        // The first calls make the server allocate what it keeps.
        called(honest::channel(&server.url, None).await.ok()).await;
        let before = server.memory_mib()?;
        let clients: Vec<Channel> =
            stream::iter(0..self.connections)
                .map(|client| {
                    let url = &server.url;
                    async move {
                        called(honest::channel(url, Some(address_of(client))).await.ok()).await
                    }
                })
                .buffer_unordered(AT_A_TIME)
                .filter_map(async |channel| channel)
                .collect()
                .await;
        tokio::time::sleep(self.seconds).await;
        let idle = server.memory_mib()?;
        let connections = clients.len();
        let served_again = stream::iter(clients)
            .map(|channel| called(Some(channel)))
            .buffer_unordered(AT_A_TIME)
            .filter_map(async |channel| channel)
            .collect::<Vec<_>>()
            .await
            .len();
        tokio::time::sleep(self.seconds).await;
        Ok(IdleReport {
            connections,
            served_again,
            memory_before_mib: round(before),
            memory_idle_mib: round(idle),
            kib_each: round((idle - before) * 1_024.0 / connections.max(1) as f64),
            memory_closed_mib: round(server.memory_mib()?),
        })
    }
}

/// A connection on which a call was served.
async fn called(channel: Option<Channel>) -> Option<Channel> {
    let channel = channel?;
    let request = v1::GetServerInfoRequest::default();
    let mut service = ServerServiceClient::new(channel.clone());
    service.get_server_info(request).await.ok()?;
    Some(channel)
}

/// Spectators that do not read.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Spectators {
    /// Number of spectators, each on a connection of its own.
    #[arg(long, default_value_t = 1_000, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    spectators: u32,
    /// Rooms that play, whose spectators these are.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    rooms: u32,
    /// Phases without spectators and phases with them, which take turns.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=100))]
    rounds: u32,
    /// Seconds of a phase. A room drops spectators that are far behind, so a phase must be short.
    #[arg(long, default_value = "10", value_parser = seconds)]
    seconds: Duration,
}

/// What spectators cost.
#[derive(Debug, serde::Serialize)]
struct SpectatorsReport {
    /// Spectators in all phases.
    #[serde(flatten)]
    counts: Counts,
    rooms: u32,
    rounds: u32,
    quiet_p50_ms: f64,
    quiet_p99_ms: f64,
    watched_p50_ms: f64,
    watched_p99_ms: f64,
    /// The 99th percentile with spectators by that without.
    p99_ratio: f64,
    missed: u64,
    memory_quiet_mib: f64,
    memory_watched_mib: f64,
}

impl Spectators {
    async fn run(self, server: &Path) -> Result<SpectatorsReport, HostileError> {
        let most = self.spectators + OTHERS;
        let server = Running::start(server, &[("--max-connections", most)]).await?;
        let rooms: Vec<_> = (0..self.rooms)
            .map(|_| HonestRoom::start(Access::open(server.url.clone()), LONG))
            .collect();
        all_play(&rooms).await?;
        let noticed = |rooms: &[HonestRoom]| {
            let mut all = Noticed::new();
            rooms.iter().for_each(|room| all.add(&room.take()));
            all
        };
        let tally = Arc::new(Tally::default());
        let (mut quiet, mut watched) = (Noticed::new(), Noticed::new());
        let (mut memory_quiet, mut memory_watched) = (0.0, 0.0);
        for _ in 0..self.rounds {
            noticed(&rooms);
            tokio::time::sleep(self.seconds).await;
            quiet.add(&noticed(&rooms));
            memory_quiet = server.memory_mib()?;
            let spectating = stream::iter(0..self.spectators).map(|number| {
                let room = &rooms[usize::try_from(number % self.rooms).expect("few rooms")];
                let request = v1::SpectatorServiceWatchRequest {
                    room_id: room.room_id(),
                    snapshot: true,
                    ..v1::SpectatorServiceWatchRequest::default()
                };
                let (address, tally) = (server.address(), &tally);
                async move {
                    let window = 0;
                    let sender = raw::http2(address, address_of(number), window).await.ok()?;
                    let body = raw::framed(&request);
                    let watch = "SpectatorService/Watch";
                    let stream = raw::open(&sender, watch, Some(body), tally).await?;
                    Some((sender, stream))
                }
            });
            let held: Vec<_> = spectating.buffer_unordered(AT_A_TIME).collect().await;
            noticed(&rooms);
            tokio::time::sleep(self.seconds).await;
            watched.add(&noticed(&rooms));
            memory_watched = server.memory_mib()?;
            drop(held);
        }
        let (quiet_p99, watched_p99) = (quiet.percentile_ms(99.0), watched.percentile_ms(99.0));
        Ok(SpectatorsReport {
            counts: tally.counts(),
            rooms: self.rooms,
            rounds: self.rounds,
            quiet_p50_ms: round(quiet.percentile_ms(50.0)),
            quiet_p99_ms: round(quiet_p99),
            watched_p50_ms: round(watched.percentile_ms(50.0)),
            watched_p99_ms: round(watched_p99),
            p99_ratio: round(watched_p99 / quiet_p99),
            missed: quiet.missed + watched.missed,
            memory_quiet_mib: round(memory_quiet),
            memory_watched_mib: round(memory_watched),
        })
    }
}

/// Waits until every room plays.
async fn all_play(rooms: &[HonestRoom]) -> Result<(), HostileError> {
    let playing = async {
        while rooms.iter().any(|room| room.room_id().is_empty()) {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    let problem = |_| HostileError::Quiet(rooms[0].last_problem());
    tokio::time::timeout(PATIENCE, playing)
        .await
        .map_err(problem)
}

/// Rooms that start and end.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Soak {
    /// Seconds of the soak.
    #[arg(long, default_value_t = 3_600, value_parser = clap::value_parser!(u32).range(1..=604_800))]
    seconds: u32,
    /// Seconds before the line begins. Ended rooms stay listed for ten minutes, so the memory grows
    /// at least for that long.
    #[arg(long, default_value_t = 900)]
    settle: u32,
    /// Rooms at a time.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    rooms: u32,
}

/// What a soak showed.
#[derive(Debug, serde::Serialize)]
struct SoakReport {
    seconds: u32,
    settle: u32,
    rooms: u32,
    games: u64,
    lost_games: u64,
    missed: u64,
    not_served: BTreeMap<String, u64>,
    /// Rooms that the server lists at the end.
    listed_rooms: usize,
    /// The line through the memory after the server has settled.
    mib_per_hour: f64,
    /// The standard error of that slope, if the samples are independent.
    mib_per_hour_error: f64,
    memory_start_mib: f64,
    /// The mean after the server has settled, and the extremes.
    memory_mean_mib: f64,
    memory_least_mib: f64,
    memory_most_mib: f64,
    disk_mib: f64,
    /// Seconds and memory in MiB.
    samples: Vec<(f64, f64)>,
}

impl Soak {
    async fn run(self, server: &Path) -> Result<SoakReport, HostileError> {
        let server = Running::start(server, &[]).await?;
        let memory_start = server.memory_mib()?;
        let rooms: Vec<_> = (0..self.rooms)
            .map(|_| HonestRoom::start(Access::open(server.url.clone()), SHORT))
            .collect();
        all_play(&rooms).await?;
        let begun = Instant::now();
        let time = Duration::from_secs(self.seconds.into());
        let mut samples = Vec::new();
        for number in 1..=SAMPLES {
            tokio::time::sleep_until(begun + time * number / SAMPLES).await;
            let memory = server.memory_mib()?;
            samples.push((begun.elapsed().as_secs_f64(), memory));
            if number.is_multiple_of(SAMPLES / REPORTS) {
                let percent = 100 * number / SAMPLES;
                eprintln!("{percent} % of {} s: {memory:.0} MiB", self.seconds);
            }
        }
        let listed_rooms = listed(&server.url).await;
        let mut noticed = Noticed::new();
        for room in rooms {
            match room.finish(PATIENCE).await {
                Some(last) => noticed.add(&last),
                None => noticed.lost_games += 1,
            }
        }
        let settled = samples.partition_point(|(seconds, _)| *seconds < f64::from(self.settle));
        let line = Line::through(&samples[settled..]);
        let memory = || samples[settled..].iter().map(|(_, memory)| *memory);
        Ok(SoakReport {
            seconds: self.seconds,
            settle: self.settle,
            rooms: self.rooms,
            games: noticed.games,
            lost_games: noticed.lost_games,
            missed: noticed.missed,
            not_served: noticed.not_served,
            listed_rooms,
            mib_per_hour: round(line.slope * 3_600.0),
            mib_per_hour_error: round(line.slope_error * 3_600.0),
            memory_start_mib: round(memory_start),
            memory_mean_mib: round(line.mean),
            memory_least_mib: round(memory().fold(f64::INFINITY, f64::min)),
            memory_most_mib: round(memory().fold(0.0, f64::max)),
            disk_mib: round(gauge::folder_bytes(server.folder.path()) as f64 / MIB),
            samples: (samples.into_iter())
                .map(|(seconds, memory)| (round(seconds), round(memory)))
                .collect(),
        })
    }
}

/// Number of rooms that a server lists.
async fn listed(url: &str) -> usize {
    let Ok(channel) = honest::channel(url, None).await else {
        return 0;
    };
    let mut service = RoomServiceClient::new(channel);
    let (mut rooms, mut page_token) = (0, String::new());
    loop {
        let request = v1::ListRoomsRequest {
            page_size: 100,
            page_token,
            ..v1::ListRoomsRequest::default()
        };
        let Ok(page) = service.list_rooms(request).await else {
            return rooms;
        };
        let page = page.into_inner();
        rooms += page.rooms.len();
        page_token = page.next_page_token;
        if page_token.is_empty() {
            return rooms;
        }
    }
}

/// A straight line through points, by least squares.
#[derive(Debug, PartialEq)]
struct Line {
    mean: f64,
    slope: f64,
    slope_error: f64,
}

impl Line {
    fn through(points: &[(f64, f64)]) -> Self {
        let count = points.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
        let (mean_x, mean_y) = (mean(|point| point.0), mean(|point| point.1));
        let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
            (points.iter())
                .map(|(x, y)| of(x - mean_x, y - mean_y))
                .sum()
        };
        let squares = sum(&|x, _| x * x);
        let slope = sum(&|x, y| x * y) / squares;
        let residuals = sum(&|x, y| (y - slope * x).powi(2));
        Self {
            mean: mean_y,
            slope,
            slope_error: (residuals / (count - 2.0) / squares).sqrt(),
        }
    }
}

/// A length of time in seconds.
pub(crate) fn seconds(text: &str) -> Result<Duration, String> {
    text.parse()
        .ok()
        .filter(|seconds| (0.0..=MAX_SECONDS).contains(seconds))
        .map(Duration::from_secs_f64)
        .ok_or_else(|| format!("{text:?} is not a number of seconds from 0 to {MAX_SECONDS}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_goes_through_its_points() {
        let points = [(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)];
        let line = Line {
            mean: 3.0,
            slope: 2.0,
            slope_error: 0.0,
        };
        assert_eq!(Line::through(&points), line);
        let scattered = Line::through(&[(0.0, 0.0), (1.0, 3.0), (2.0, 0.0)]);
        assert_eq!(scattered.slope, 0.0);
        assert_eq!(scattered.slope_error, 3.0_f64.sqrt());
    }
}
