//! Restarts: many games are played for a while and the server is killed. Measures the time from
//! starting another server on the same folder until every ticket is attached and every open
//! decision has reached its seat. Then a few more decisions of each game confirm that the games are
//! playable.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use chefshat_proto::v1::{
    self, room_service_client::RoomServiceClient, rule_set::Stop, seat_command::Command,
};
use comfy_table::{Table, presets};
use futures::{StreamExt as _, TryStreamExt as _};
use serde::Serialize;
use tokio::sync::{mpsc, watch};
use tokio::task::JoinSet;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Streaming;
use tonic::transport::{Channel, Endpoint};

use crate::disk;
use crate::error::LoadError;
use crate::options::{Load, SEATS};
use crate::play::{self, Weighed};
use crate::server::{Kind, Launcher, ServerProcess};
use crate::wire::{DecisionRequest, Update};

/// Goal for the time from the start of a server until all games are playable, seconds.
const GOAL_S: f64 = 2.0;
/// Decisions of each game before the first restart; fewer with --smoke.
const DECISIONS: u64 = 300;
const SMOKE_DECISIONS: u64 = 20;
/// Further decisions of each game after each restart.
const MORE: u64 = 2;
/// Connections to spread the seats over.
const STREAMS: usize = 64;
/// Rooms created at a time.
const MADE_AT_ONCE: usize = 32;
/// Time limit for the games of one server to reach a target.
const LIMIT: Duration = Duration::from_secs(600);
/// Decision time: nobody is late.
const DECISION_TIME_MS: u32 = 3_600_000;
/// Shifts per game: no game ends during the run.
const SHIFTS: u32 = 100;

/// The results of restarts.
#[derive(Debug, Serialize)]
struct Report {
    rooms: usize,
    decisions_before: u64,
    database_mib: f64,
    disk_syncs_per_second: f64,
    restarts: Vec<Times>,
    aim_s: f64,
    met: bool,
}

/// Times from the start of a server's process, seconds.
#[derive(Debug, Clone, Copy, Serialize)]
struct Times {
    /// Its database is open.
    open_s: f64,
    /// The first decision has reached its seat.
    first_decision_s: f64,
    /// Every seat is attached, and every open decision has reached its seat.
    playable_s: f64,
    /// Further decisions of every game have been acknowledged.
    played_s: f64,
}

/// Measures restarts and prints the results.
pub(crate) async fn measure(load: &Load, rooms: u64) -> Result<(), LoadError> {
    let rooms = usize::try_from(rooms).expect("bounded by the options");
    let folder = disk::folder(load)?;
    let disk_syncs_per_second = disk::syncs_per_second(load)?;
    let mut enough = if load.smoke {
        SMOKE_DECISIONS
    } else {
        DECISIONS
    };
    let start = || Launcher::new(load).start(Kind::OnDisk(folder.path()));
    let mut server = start().await?;
    eprintln!("{rooms} rooms of {enough} decisions ...");
    let tickets = Arc::new(tickets(&server.url(), rooms).await?);
    let seen = Arc::new((0..tickets.len()).map(|_| AtomicU64::new(0)).collect());
    let mut games = Games {
        tickets,
        seen,
        taken: (0..rooms).map(|_| AtomicU64::new(0)).collect(),
    };
    play_on(&mut games, &server, enough, Instant::now()).await?;
    let mut restarts = Vec::new();
    for _ in 0..if load.smoke { 1 } else { load.rounds } {
        server.kill().await?;
        let begun = Instant::now();
        server = start().await?;
        let open_s = begun.elapsed().as_secs_f64();
        enough += MORE;
        let progress = play_on(&mut games, &server, enough, begun).await?;
        restarts.push(Times { open_s, ..progress });
    }
    server.stop().await?;
    let size = std::fs::metadata(folder.path().join("games.sqlite3"))
        .map_err(LoadError::io("looking at the database"))?
        .len();
    let median = median_playable(&restarts);
    let report = Report {
        rooms,
        decisions_before: rooms as u64 * (enough - MORE * restarts.len() as u64),
        database_mib: size as f64 / f64::from(1 << 20),
        disk_syncs_per_second,
        restarts,
        aim_s: GOAL_S,
        met: median < GOAL_S,
    };
    if load.json {
        let json = serde_json::to_string_pretty(&report).expect("a report is plain data");
        println!("{json}");
    } else {
        print!("{}", report.to_text(median));
    }
    Ok(())
}

impl Report {
    fn to_text(&self, median: f64) -> String {
        let mut table = Table::new();
        table.load_style(presets::UTF8_BORDERS_ONLY);
        table.set_header([
            "restart",
            "open s",
            "first decision s",
            "playable s",
            "played s",
        ]);
        for (number, times) in (1..).zip(&self.restarts) {
            let seconds = |value: f64| format!("{value:.3}");
            table.add_row([
                format!("{number}"),
                seconds(times.open_s),
                seconds(times.first_decision_s),
                seconds(times.playable_s),
                seconds(times.played_s),
            ]);
        }
        format!(
            "{} unfinished games, {} decisions, a database of {:.1} MiB; the disk takes {:.0} small synced writes a second\n{table}\n\
             from start to playable: median {median:.3} s, aim < {:.1} s, {}\n",
            self.rooms,
            self.decisions_before,
            self.database_mib,
            self.disk_syncs_per_second,
            self.aim_s,
            if self.met { "met" } else { "missed" },
        )
    }
}

fn median_playable(restarts: &[Times]) -> f64 {
    let mut times: Vec<f64> = restarts.iter().map(|times| times.playable_s).collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Creates rooms and takes their seats. Returns the tickets by room.
async fn tickets(url: &str, rooms: usize) -> Result<Vec<String>, LoadError> {
    let channel = Endpoint::from_shared(url.to_owned())?.connect().await?;
    let made: Vec<Vec<String>> = futures::stream::iter(0..rooms)
        .map(|_| make_room(channel.clone()))
        .buffered(MADE_AT_ONCE)
        .try_collect()
        .await?;
    Ok(made.concat())
}

async fn make_room(channel: Channel) -> Result<Vec<String>, LoadError> {
    let mut service = RoomServiceClient::new(channel);
    let request = v1::CreateRoomRequest {
        name: "restart".into(),
        rules: Some(v1::RuleSet {
            stop: Some(Stop::TargetShifts(SHIFTS)),
            ..v1::RuleSet::default()
        }),
        policy: Some(v1::RoomPolicy {
            decision_time_ms: Some(DECISION_TIME_MS),
            ..v1::RoomPolicy::default()
        }),
        ..v1::CreateRoomRequest::default()
    };
    let created = service.create_room(request).await?.into_inner();
    let mut tickets = Vec::new();
    for _ in 0..SEATS {
        let request = v1::JoinRoomRequest {
            join_code: created.join_code.clone(),
            name: "restart".into(),
            ..v1::JoinRoomRequest::default()
        };
        tickets.push(service.join_room(request).await?.into_inner().ticket);
    }
    Ok(tickets)
}

/// The games, across servers.
struct Games {
    /// Tickets of all seats, by room.
    tickets: Arc<Vec<String>>,
    /// Events received by each seat.
    seen: Arc<Vec<AtomicU64>>,
    /// Acknowledged decisions of each room.
    taken: Vec<AtomicU64>,
}

/// The games on one server.
struct Run {
    tickets: Arc<Vec<String>>,
    seen: Arc<Vec<AtomicU64>>,
    taken: Vec<AtomicU64>,
    /// Decisions after which a room comes to rest.
    enough: u64,
    begun: Instant,
    /// Whether a decision of each room has reached its seat.
    asked: Vec<AtomicU64>,
    counts: watch::Sender<Counts>,
}

/// Counts, and the times at which they were complete.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    attached: usize,
    asked: usize,
    resting: usize,
    first_decision_s: f64,
    playable_s: f64,
    played_s: f64,
}

/// Attaches every seat and plays every room until it has enough decisions.
async fn play_on(
    games: &mut Games,
    server: &ServerProcess,
    enough: u64,
    begun: Instant,
) -> Result<Times, LoadError> {
    let rooms = games.taken.len();
    let run = Arc::new(Run {
        tickets: Arc::clone(&games.tickets),
        seen: Arc::clone(&games.seen),
        taken: std::mem::take(&mut games.taken),
        enough,
        begun,
        asked: (0..rooms).map(|_| AtomicU64::new(0)).collect(),
        counts: watch::Sender::default(),
    });
    let endpoint = Endpoint::from_shared(server.url())?.tcp_nodelay(true);
    let mut streams = JoinSet::new();
    for number in 0..STREAMS.min(run.tickets.len()) {
        streams.spawn(Arc::clone(&run).stream(endpoint.clone(), number));
    }
    let mut counts = run.counts.subscribe();
    // A seat without decisions may be attached again after all games have continued.
    let all_rest = counts.wait_for(|counts| counts.resting == rooms && counts.playable_s > 0.0);
    let counts = tokio::select! {
        counts = tokio::time::timeout(LIMIT, all_rest) => {
            *counts.map_err(|_| LoadError::Stuck("playing"))?.expect("the run holds the sender")
        }
        early = streams.join_next() => {
            let early = early.expect("there are streams").expect("a stream's task does not panic");
            return Err(early.err().unwrap_or(LoadError::Stuck("a stream that ended")));
        }
    };
    streams.shutdown().await;
    let run = Arc::into_inner(run).expect("the streams are gone");
    games.taken = run.taken;
    Ok(Times {
        open_s: 0.0,
        first_decision_s: counts.first_decision_s,
        playable_s: counts.playable_s,
        played_s: counts.played_s,
    })
}

impl Run {
    /// One connection, with every n-th seat.
    async fn stream(self: Arc<Self>, endpoint: Endpoint, number: usize) -> Result<(), LoadError> {
        let attach: Vec<v1::SeatCommand> = (number..self.tickets.len())
            .step_by(STREAMS)
            .map(|seat| v1::SeatCommand {
                handle: 0,
                command: Some(Command::Attach(v1::Attach {
                    ticket: self.tickets[seat].clone(),
                    request_id: u32::try_from(seat + 1).expect("rooms are bounded"),
                    from_sequence: self.seen[seat].load(Relaxed) + 1,
                    ..v1::Attach::default()
                })),
            })
            .collect();
        let (requests, waiting) = mpsc::channel(attach.len().max(1));
        let mut inbound =
            play::open(endpoint.connect().await?, ReceiverStream::new(waiting)).await?;
        self.send(&requests, attach).await;
        let mut seats = Vec::new();
        while let Some(commands) = self.next(&mut inbound, &mut seats).await? {
            if !commands.is_empty() {
                self.send(&requests, commands).await;
            }
        }
        Ok(())
    }

    async fn send(&self, requests: &mpsc::Sender<v1::PlayRequest>, commands: Vec<v1::SeatCommand>) {
        // A stream that has ended reports its own error.
        let _ = requests.send(v1::PlayRequest { commands }).await;
    }

    /// Processes a response; returns the commands to send. `seats` has the seat of each handle.
    async fn next(
        &self,
        inbound: &mut Streaming<Weighed>,
        seats: &mut Vec<usize>,
    ) -> Result<Option<Vec<v1::SeatCommand>>, LoadError> {
        let Some((_, response)) = inbound.message().await? else {
            return Ok(None);
        };
        let mut commands = Vec::new();
        for update in response.updates {
            let handle = update.handle;
            match update.update {
                Some(Update::Attached(attached)) => {
                    let seat = attached.request_id as usize - 1;
                    let index = handle as usize;
                    seats.resize(seats.len().max(index + 1), usize::MAX);
                    seats[index] = seat;
                    self.count(|counts| counts.attached += 1);
                }
                Some(Update::Events(batch)) => {
                    let seat = seats[handle as usize];
                    self.seen[seat].fetch_add(batch.events.len() as u64, Relaxed);
                }
                Some(Update::Decision(decision)) => {
                    let room = seats[handle as usize] / SEATS;
                    if let Some(answer) = self.decide(room, &decision)? {
                        commands.push(v1::SeatCommand {
                            handle,
                            command: Some(Command::Answer(answer)),
                        });
                    }
                }
                Some(Update::Result(result)) => {
                    if result.status() != v1::AnswerStatus::Accepted {
                        let problem = format!("a legal answer met {result:?}");
                        return Err(LoadError::Protocol(problem));
                    }
                }
                other => {
                    return Err(LoadError::Protocol(format!("nobody expects {other:?}")));
                }
            }
        }
        Ok(Some(commands))
    }

    /// Answers a decision unless its room has enough.
    fn decide(
        &self,
        room: usize,
        decision: &DecisionRequest,
    ) -> Result<Option<v1::Answer>, LoadError> {
        if self.asked[room].swap(1, Relaxed) == 0 {
            self.count(|counts| counts.asked += 1);
        }
        let taken = self.taken[room].load(Relaxed);
        if taken >= self.enough {
            self.count(|counts| counts.resting += 1);
            return Ok(None);
        }
        self.taken[room].store(taken + 1, Relaxed);
        let first = (0u32..)
            .zip(&decision.action_mask)
            .find(|(_, byte)| **byte != 0);
        let (index, byte) = first.ok_or_else(|| LoadError::Protocol("no legal action".into()))?;
        Ok(Some(v1::Answer {
            decision_id: decision.decision_id,
            action: 8 * index + byte.trailing_zeros(),
            annotations: None,
        }))
    }

    /// Counts one item; records the time when all are complete.
    fn count(&self, what: impl FnOnce(&mut Counts)) {
        let (seats, rooms) = (self.tickets.len(), self.asked.len());
        self.counts.send_modify(|counts| {
            let now = self.begun.elapsed().as_secs_f64();
            let before = *counts;
            what(counts);
            if before.asked == 0 && counts.asked > 0 {
                counts.first_decision_s = now;
            }
            if counts.asked == rooms && counts.attached == seats && before.playable_s == 0.0 {
                counts.playable_s = now;
            }
            if counts.resting == rooms {
                counts.played_s = now;
            }
        });
    }
}
