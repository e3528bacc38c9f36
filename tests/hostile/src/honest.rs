//! The honest room: four agents of the SDK, each on a connection of its own, that play one game
//! after another with a deadline. They answer at once, so a decision that is late is late by the
//! server's fault, and the time from an answer to the room's next decision is the server's.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use chefshat_client::{
    ActionId, Agent, Backoff, Client, ConnectOptions, Ending, Error, PlayOptions, RandomAgent, v1,
};
use hdrhistogram::Histogram;
use tokio::task::{JoinHandle, JoinSet};
use tonic::transport::{Channel, Endpoint};
use v1::{DecisionSource, game_event::Kind, rule_set::Stop};

/// Seats of the room.
const SEATS: u32 = 4;
/// Time for a decision, without a bank.
const DECISION_TIME_MS: u32 = 1_500;
/// How long an agent thinks.
const THINKING: Duration = Duration::from_millis(5);
/// Shifts of a short game, so that new rooms are part of what is measured.
pub(crate) const SHORT: u32 = 2;
/// Shifts of a game that outlasts a measurement.
pub(crate) const LONG: u32 = 1_000;
/// Most Shifts that agents who think this long play in a second.
const SHIFTS_PER_SECOND: u64 = 3;
/// How long a call or a new connection may take before the room counts it as not served.
const CALL_LIMIT: Duration = Duration::from_secs(5);
/// How often somebody who waits for a decision looks.
const LOOK_AGAIN: Duration = Duration::from_millis(20);
/// The reason of what took longer.
const TOO_SLOW: &str = "TOO_SLOW";
/// Pause after a call that was not served.
const AGAIN_AFTER: Duration = Duration::from_millis(100);
/// Longest latency that is distinguished, microseconds.
const LONGEST_US: u64 = 600_000_000;

/// How a client reaches a server.
#[derive(Debug, Clone, Default)]
pub(crate) struct Access {
    /// The server's URL.
    pub(crate) url: String,
    /// The client's token, if the server requires one.
    pub(crate) token: Option<String>,
    /// The authority that certifies the server, if connections are encrypted.
    pub(crate) ca: Option<PathBuf>,
}

impl Access {
    /// Without a token and encryption.
    pub(crate) fn open(url: String) -> Self {
        Self {
            url,
            ..Self::default()
        }
    }

    /// A client on a new connection.
    pub(crate) async fn connect(&self) -> Result<Client, Error> {
        let options = ConnectOptions {
            token: self.token.clone(),
            ca: self.ca.clone(),
        };
        Client::connect_with(&self.url, &options).await
    }
}

/// What the honest room noticed in one phase.
#[derive(Debug, Clone)]
pub(crate) struct Noticed {
    /// From an answer to the room's next decision, microseconds.
    pub(crate) latencies: Histogram<u64>,
    /// Decisions and substitutions by the server, although the agents answer at once.
    pub(crate) missed: u64,
    /// Games that ended with a result.
    pub(crate) games: u64,
    /// Games that ended without one.
    pub(crate) lost_games: u64,
    /// Calls and connections that were refused or took too long, by reason.
    pub(crate) not_served: BTreeMap<String, u64>,
}

impl Noticed {
    /// Nothing yet.
    pub(crate) fn new() -> Self {
        Self {
            latencies: Histogram::new_with_bounds(1, LONGEST_US, 2)
                .expect("the bounds are in order"),
            missed: 0,
            games: 0,
            lost_games: 0,
            not_served: BTreeMap::new(),
        }
    }

    /// Adds what was noticed in another phase, or by another room.
    pub(crate) fn add(&mut self, other: &Self) {
        (self.latencies.add(&other.latencies)).expect("all histograms have the same bounds");
        self.missed += other.missed;
        self.games += other.games;
        self.lost_games += other.lost_games;
        for (problem, count) in &other.not_served {
            *self.not_served.entry(problem.clone()).or_default() += count;
        }
    }

    /// A percentile of the latencies, milliseconds.
    pub(crate) fn percentile_ms(&self, percentile: f64) -> f64 {
        self.latencies.value_at_percentile(percentile) as f64 / 1e3
    }
}

/// Shifts of a game that lasts this long and ends soon after.
pub(crate) fn shifts_within(time: Duration) -> u32 {
    let shifts = time.as_secs().max(1) * SHIFTS_PER_SECOND;
    u32::try_from(shifts).map_or(LONG, |shifts| shifts.min(LONG))
}

/// The room while it plays.
pub(crate) struct HonestRoom {
    shared: Arc<Shared>,
    playing: JoinHandle<()>,
}

struct Shared {
    access: Access,
    /// Shifts of a game.
    shifts: u32,
    /// The id of the current room, empty before the first.
    room_id: Mutex<String>,
    leaving: AtomicBool,
    noticed: Mutex<Noticed>,
    /// When the last answer was given that no decision has followed yet.
    answered: Mutex<Option<Instant>>,
    seed: AtomicU64,
    last_problem: Mutex<String>,
}

impl HonestRoom {
    /// Starts to play games of this length.
    pub(crate) fn start(access: Access, shifts: u32) -> Self {
        let shared = Arc::new(Shared {
            access,
            shifts,
            room_id: Mutex::default(),
            leaving: AtomicBool::new(false),
            noticed: Mutex::new(Noticed::new()),
            answered: Mutex::default(),
            seed: AtomicU64::new(0),
            last_problem: Mutex::default(),
        });
        let playing = tokio::spawn(Arc::clone(&shared).play_all());
        Self { shared, playing }
    }

    /// Waits until the room has played in this phase, for `limit` at most: a busy machine may need
    /// longer than the phase.
    pub(crate) async fn until_played(&self, limit: Duration) {
        let playing = async {
            while lock(&self.shared.noticed).latencies.is_empty() {
                tokio::time::sleep(LOOK_AGAIN).await;
            }
        };
        // If nothing was played in time, `take` shows that.
        let _ = tokio::time::timeout(limit, playing).await;
    }

    /// Ends a phase and returns what was noticed in it.
    pub(crate) fn take(&self) -> Noticed {
        // A decision that has not come yet counts with the time it has taken so far.
        let open = *lock(&self.shared.answered);
        let mut noticed = lock(&self.shared.noticed);
        if let Some(waiting) = open {
            record(&mut noticed.latencies, waiting.elapsed());
        }
        std::mem::replace(&mut noticed, Noticed::new())
    }

    /// The id of the current room, empty before the first.
    pub(crate) fn room_id(&self) -> String {
        lock(&self.shared.room_id).clone()
    }

    /// The last problem of a call, for an error message.
    pub(crate) fn last_problem(&self) -> String {
        lock(&self.shared.last_problem).clone()
    }

    /// Plays the current game to its end. Returns what was noticed since the last phase, or `None`
    /// if the game does not end.
    pub(crate) async fn finish(self, limit: Duration) -> Option<Noticed> {
        self.shared.leaving.store(true, Relaxed);
        tokio::time::timeout(limit, self.playing).await.ok()?.ok()?;
        let noticed = lock(&self.shared.noticed).clone();
        Some(noticed)
    }
}

impl Shared {
    async fn play_all(self: Arc<Self>) {
        while !self.leaving.load(Relaxed) {
            match self.open().await {
                Ok(tickets) => self.play(tickets).await,
                Err(Problem { reason, words }) => {
                    *lock(&self.last_problem) = words;
                    *(lock(&self.noticed).not_served.entry(reason)).or_default() += 1;
                    tokio::time::sleep(AGAIN_AFTER).await;
                }
            }
        }
    }

    /// Creates a room and takes its seats, each over a new connection.
    async fn open(&self) -> Result<Vec<(Client, String)>, Problem> {
        let host = self.connect().await?;
        let request = v1::CreateRoomRequest {
            name: "honest".into(),
            rules: Some(v1::RuleSet {
                stop: Some(Stop::TargetShifts(self.shifts)),
                ..v1::RuleSet::default()
            }),
            policy: Some(v1::RoomPolicy {
                decision_time_ms: Some(DECISION_TIME_MS),
                bank_ms: Some(0),
                max_timeouts: Some(1_000),
                ..v1::RoomPolicy::default()
            }),
            ..v1::CreateRoomRequest::default()
        };
        let created = served(host.create_room(request)).await?;
        let mut tickets = Vec::new();
        for seat in 0..SEATS {
            let client = self.connect().await?;
            let request = v1::JoinRoomRequest {
                join_code: created.join_code.clone(),
                name: format!("honest {seat}"),
                seat: Some(seat),
                ..v1::JoinRoomRequest::default()
            };
            let joined = served(client.join(request)).await?;
            tickets.push((client, joined.ticket));
        }
        *lock(&self.room_id) = created.room.unwrap_or_default().room_id;
        Ok(tickets)
    }

    async fn connect(&self) -> Result<Client, Problem> {
        served(self.access.connect()).await
    }

    async fn play(self: &Arc<Self>, tickets: Vec<(Client, String)>) {
        *lock(&self.answered) = None;
        let mut playing = JoinSet::new();
        for (client, ticket) in tickets {
            let seed = self.seed.fetch_add(1, Relaxed);
            let agent = Prompt {
                agent: RandomAgent::new(seed),
                counts_events: seed.is_multiple_of(u64::from(SEATS)),
                shared: Arc::clone(self),
            };
            let options = PlayOptions {
                backoff: Backoff::default(),
                ..PlayOptions::default()
            };
            playing.spawn(async move { client.play_with(ticket, agent, &options).await });
        }
        let outcomes = playing.join_all().await;
        *lock(&self.answered) = None;
        let finished = |outcome: &Result<chefshat_client::Outcome, _>| matches!(outcome, Ok(outcome) if matches!(outcome.ending, Ending::Finished(_)));
        let mut noticed = lock(&self.noticed);
        match outcomes.iter().all(finished) {
            true => noticed.games += 1,
            false => noticed.lost_games += 1,
        }
    }
}

/// A connection, from one of this machine's addresses if given.
pub(crate) async fn channel(
    url: &str,
    from: Option<IpAddr>,
) -> Result<Channel, tonic::transport::Error> {
    Endpoint::from_shared(url.to_owned())?
        .tcp_nodelay(true)
        .local_address(from)
        .connect()
        .await
}

/// The result of a call, unless it takes too long.
async fn served<T>(call: impl Future<Output = Result<T, Error>>) -> Result<T, Problem> {
    match tokio::time::timeout(CALL_LIMIT, call).await {
        Ok(result) => result.map_err(|error| Problem {
            reason: (error.reason()).map_or_else(|| error.code().to_string(), str::to_owned),
            words: error.to_string(),
        }),
        Err(_) => Err(Problem {
            reason: TOO_SLOW.to_owned(),
            words: "a call or connection took too long".to_owned(),
        }),
    }
}

/// Why a call or connection was not served.
struct Problem {
    /// The reason of the server, or what the client calls it.
    reason: String,
    words: String,
}

/// An agent that answers after a short while and measures how fast the server is.
struct Prompt {
    agent: RandomAgent,
    /// One of the four counts the events, which all of them receive.
    counts_events: bool,
    shared: Arc<Shared>,
}

impl Agent for Prompt {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        if let Some(answered) = lock(&self.shared.answered).take() {
            record(
                &mut lock(&self.shared.noticed).latencies,
                answered.elapsed(),
            );
        }
        let action = self.agent.decide(request);
        tokio::task::block_in_place(|| std::thread::sleep(THINKING));
        *lock(&self.shared.answered) = Some(Instant::now());
        action
    }

    fn on_event(&mut self, event: &v1::GameEvent) {
        let source = match &event.kind {
            Some(Kind::Play(play)) => play.source(),
            Some(Kind::Pass(pass)) => pass.source(),
            Some(Kind::Substituted(_)) => DecisionSource::Substitute,
            _ => return,
        };
        if self.counts_events && source != DecisionSource::Agent {
            lock(&self.shared.noticed).missed += 1;
        }
    }
}

fn record(latencies: &mut Histogram<u64>, latency: Duration) {
    latencies.saturating_record(u64::try_from(latency.as_micros()).unwrap_or(u64::MAX));
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex
        .lock()
        .expect("no code that holds this lock can panic")
}
