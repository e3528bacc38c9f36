//! Rooms that are played all the time by agents of the SDK over real connections, which reconnect
//! on their own: after each game the next room is created. A `Ledger` records what they receive.

use std::sync::Arc;
use std::time::Duration;

use chefshat_client::{
    ActionId, Agent, Backoff, Client, Ending, Error, Outcome, PlayError, PlayOptions, RandomAgent,
};
use chefshat_proto::v1::{self, seat_config::FilledBy};
use futures::FutureExt as _;
use rand::rngs::SmallRng;
use rand::{RngExt as _, SeedableRng as _};
use tokio::sync::watch;
use tokio::task::JoinSet;
use tonic::Code;

use crate::{Ledger, PATIENCE, patiently};

/// Most decisions of the games that run when no others are begun, in all rooms.
const MOST_LEFT: u64 = 100_000;
/// Pause before repeating a call that did not reach the server.
const AGAIN_AFTER: Duration = Duration::from_millis(10);
/// How agents reconnect unless a test says otherwise: fast, and as long as a test waits.
const BACKOFF: Backoff = Backoff {
    first: Duration::from_millis(5),
    max: Duration::from_millis(40),
    give_up_after: PATIENCE,
    jitter: true,
};

/// The games of a regular room.
#[derive(Debug, Clone)]
pub struct RoomKind {
    /// The rules.
    pub rules: v1::RuleSet,
    /// The policy.
    pub policy: v1::RoomPolicy,
    /// Seats filled by built-in agents, the last ones; the others are played over connections.
    pub built_in: usize,
    /// Whether the seats share a stream.
    pub one_stream: bool,
    /// How events are delivered to the seats.
    pub delivery: v1::EventDelivery,
    /// Longest thinking time of an agent.
    pub pace: Duration,
    /// How the agents reconnect.
    pub backoff: Backoff,
}

impl Default for RoomKind {
    fn default() -> Self {
        Self {
            rules: v1::RuleSet::default(),
            // Generous, so that no agent times out.
            policy: v1::RoomPolicy {
                decision_time_ms: Some(3_600_000),
                ..v1::RoomPolicy::default()
            },
            built_in: 0,
            one_stream: false,
            delivery: v1::EventDelivery::AtOnce,
            pace: Duration::from_millis(2),
            backoff: BACKOFF,
        }
    }
}

/// Rooms that are played all the time.
#[derive(Debug)]
pub struct BusyRooms {
    /// What they received.
    pub ledger: Arc<Ledger>,
    /// How many decisions of each room have been acknowledged, over all its games.
    progress: Arc<watch::Sender<Vec<u64>>>,
    leaving: watch::Sender<bool>,
    rooms: JoinSet<Vec<String>>,
}

impl BusyRooms {
    /// Starts a room for each habit, on the server with this URL, which may be down at times.
    pub fn start(url: &str, kinds: Vec<RoomKind>) -> Self {
        Self::start_apart(url, url, kinds)
    }

    /// Starts a room for each habit, which is opened at one URL and played at another.
    pub fn start_apart(opened_at: &str, played_at: &str, kinds: Vec<RoomKind>) -> Self {
        let ledger = Arc::new(Ledger::default());
        let progress = Arc::new(watch::Sender::new(vec![0; kinds.len()]));
        let leaving = watch::Sender::new(false);
        let mut rooms = JoinSet::new();
        for (number, kind) in kinds.into_iter().enumerate() {
            let room = Room {
                opened_at: opened_at.to_owned(),
                played_at: played_at.to_owned(),
                kind,
                ledger: Arc::clone(&ledger),
                number,
                progress: Arc::clone(&progress),
                random: SmallRng::seed_from_u64(number as u64),
            };
            rooms.spawn(room.always_play(leaving.subscribe()));
        }
        Self {
            ledger,
            progress,
            leaving,
            rooms,
        }
    }

    /// How many decisions of each room have been acknowledged so far, over all its games.
    pub fn progress(&self) -> watch::Receiver<Vec<u64>> {
        self.progress.subscribe()
    }

    /// Waits until at least one more decision of every room has been acknowledged.
    pub async fn all_go_on(&self) {
        let mut progress = self.progress();
        let before = progress.borrow_and_update().clone();
        let went_on = |now: &Vec<u64>| now.iter().zip(&before).all(|(now, before)| now > before);
        if tokio::time::timeout(PATIENCE, progress.wait_for(went_on))
            .await
            .is_err()
        {
            let now = self.progress.borrow().clone();
            let unexpected = self.ledger.all_unexpected();
            panic!("rooms stand still: {before:?} decisions became {now:?}; {unexpected:#?}");
        }
    }

    /// Lets the running games end and stops. Returns the ids of all their games, each of which
    /// ended with a result.
    pub async fn finish(mut self) -> Vec<String> {
        self.leaving.send_replace(true);
        let (mut progress, mut games) = (self.progress(), Vec::new());
        let most: u64 = progress.borrow().iter().sum::<u64>() + MOST_LEFT;
        loop {
            // On a busy machine long games take longer than the patience: it counts from each decision.
            let next = async {
                tokio::select! {
                    ended = self.rooms.join_next() => Some(ended),
                    _ = progress.changed() => None,
                }
            };
            match patiently("the last games to go on, or to end", next).await {
                Some(Some(played)) => games.extend(played.expect("no panic")),
                Some(None) => break,
                None => {
                    let decided = progress.borrow_and_update().iter().sum::<u64>();
                    assert!(decided < most, "the games do not end");
                }
            }
        }
        self.ledger.assert_nothing_unexpected();
        games
    }
}

struct Room {
    opened_at: String,
    played_at: String,
    kind: RoomKind,
    ledger: Arc<Ledger>,
    number: usize,
    progress: Arc<watch::Sender<Vec<u64>>>,
    random: SmallRng,
}

impl Room {
    async fn always_play(mut self, leaving: watch::Receiver<bool>) -> Vec<String> {
        let connect = async |url: &str| again("connecting", || Client::connect(url)).await;
        let host = connect(&self.opened_at).await;
        let client = connect(&self.played_at).await;
        let mut games = Vec::new();
        while !*leaving.borrow() {
            let Some((game, tickets)) = self.open(&host).await else {
                continue;
            };
            self.play(&client, &game, tickets).await;
            games.push(game);
        }
        games
    }

    /// Creates a room and takes its seats. `None` if a ticket was lost with the connection.
    async fn open(&self, client: &Client) -> Option<(String, Vec<String>)> {
        let open = 4 - self.kind.built_in;
        let request = v1::CreateRoomRequest {
            rules: Some(self.kind.rules.clone()),
            policy: Some(self.kind.policy.clone()),
            seats: (0..4)
                .map(|seat| v1::SeatConfig {
                    filled_by: (seat >= open).then(|| FilledBy::BuiltInAgent("random".to_owned())),
                    ..v1::SeatConfig::default()
                })
                .collect(),
            ..v1::CreateRoomRequest::default()
        };
        let created = again("creating a room", || client.create_room(request.clone())).await;
        let room = created.room.expect("a room");
        let mut tickets = Vec::new();
        for seat in 0..open {
            let request = v1::JoinRoomRequest {
                join_code: created.join_code.clone(),
                name: format!("agent {seat}"),
                seat: u32::try_from(seat).ok(),
                ..v1::JoinRoomRequest::default()
            };
            // A room that was acknowledged exists, whatever has happened since.
            let joined = again("joining", || {
                client.join(request.clone()).map(|joined| match joined {
                    Err(error) if error.reason() == Some("SEAT_TAKEN") => Ok(None),
                    joined => joined.map(Some),
                })
            })
            .await;
            let Some(joined) = joined else {
                let (room, token) = (&room.room_id, &created.owner_token);
                again("closing", || client.close_room(room.clone(), token.clone())).await;
                return None;
            };
            tickets.push(joined.ticket);
        }
        Some((room.game_id, tickets))
    }

    async fn play(&mut self, client: &Client, game: &str, tickets: Vec<String>) {
        let options = PlayOptions {
            delivery: self.kind.delivery,
            backoff: self.kind.backoff.clone(),
            ..PlayOptions::default()
        };
        let mut seats = Vec::new();
        for ticket in tickets {
            let agent = Paced {
                agent: RandomAgent::new(self.random.random()),
                pace: self.kind.pace,
                room: self.number,
                progress: Arc::clone(&self.progress),
                random: SmallRng::seed_from_u64(self.random.random()),
            };
            seats.push((ticket, self.ledger.wrap(agent)));
        }
        let mut playing = JoinSet::new();
        let streams = match self.kind.one_stream {
            true => vec![seats],
            false => seats.into_iter().map(|seat| vec![seat]).collect(),
        };
        for seats in streams {
            let (client, options) = (client.clone(), options.clone());
            playing.spawn(async move { client.play_many_with(seats, &options).await });
        }
        // The others wait for a seat that nobody plays any more.
        while let Some(outcomes) = playing.join_next().await {
            for outcome in outcomes.expect("playing does not panic") {
                self.note(game, outcome);
            }
        }
    }

    fn note(&self, game: &str, outcome: Result<Outcome, PlayError>) {
        match outcome.map(|outcome| outcome.ending) {
            Ok(Ending::Finished(_)) => {}
            other => self
                .ledger
                .unexpected(format!("{game} ended with {other:?}")),
        }
    }
}

/// Repeats a call until it reaches the server.
async fn again<T, F>(what: &str, call: impl Fn() -> F) -> T
where
    F: Future<Output = Result<T, Error>>,
{
    let reaching = async {
        loop {
            match call().await {
                Ok(done) => return done,
                // A broken connection has no reason; UNAVAILABLE has one and may be repeated.
                Err(error)
                    if error.reason().is_none()
                        || error.code() == Code::Unavailable
                        || error.reason() == Some("DISK_NEARLY_FULL") =>
                {
                    tokio::time::sleep(AGAIN_AFTER).await;
                }
                Err(error) => panic!("{what} was refused: {error}"),
            }
        }
    };
    patiently(what, reaching).await
}

/// An agent that takes some time to decide, and whose decisions are counted.
struct Paced<A> {
    agent: A,
    pace: Duration,
    room: usize,
    progress: Arc<watch::Sender<Vec<u64>>>,
    random: SmallRng,
}

impl<A: Agent> Agent for Paced<A> {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        let thinking = self.pace.mul_f64(self.random.random());
        tokio::task::block_in_place(|| std::thread::sleep(thinking));
        self.agent.decide(request)
    }

    fn on_event(&mut self, event: &v1::GameEvent) {
        self.agent.on_event(event);
    }

    fn on_snapshot(&mut self, snapshot: &v1::Snapshot) {
        self.agent.on_snapshot(snapshot);
    }

    fn on_result(&mut self, result: &v1::AnswerResult) {
        self.agent.on_result(result);
        self.progress.send_modify(|rooms| rooms[self.room] += 1);
    }
}
