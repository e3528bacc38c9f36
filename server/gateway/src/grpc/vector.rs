//! `VectorService`: games of a client, stepped in batches on their own thread pool so that rooms
//! stay responsive; small batches are stepped without it. `chefshat_simulation::vector` plays the
//! games; this file reads and writes the streams and splits records into messages.

use std::sync::Arc;
use std::time::Duration;

use chefshat_engine::{RuleSet, Seed};
use chefshat_proto::v1::{
    self, run_request::Request as RequestKind, run_response::Response as ResponseKind,
    vector_service_server::VectorService, vector_setup,
};
use chefshat_record::branch::{BranchError, branch_of};
use chefshat_simulation::vector::{LEAVE_OPEN, Start, VectorGames, VectorSetup};
use chefshat_vector::{
    Limits, Request as VectorRequest, batch_to_proto, record_parts, saved_to_proto,
    seeds_from_setup, setup_from_proto, start_from_proto, started_to_proto,
};
use rayon::ThreadPoolBuildError;
use tokio::sync::mpsc;
use tokio::sync::mpsc::error::SendTimeoutError;
use tokio::time::timeout;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::{Code, Request, Response, Status, Streaming};

use super::forward::Gateway;
use super::limits::charged;
use super::new_room::branch_refused;
use super::recorded::Recorded;
use super::status::{Refusal, internal, invalid, shutting_down, status, vector_refused};
use chefshat_admission::access::Caller;
use chefshat_admission::limits::{FairSemaphore, Key, Permit, Refused};
use chefshat_base::metrics::{Counted, Metrics, StreamKind};
use chefshat_base::tasks::short;
use chefshat_base::threads::{Priority, Threads, caught};
use chefshat_hosting::config::{MAX_VECTOR_SEATS_IN_ALL, MAX_VECTOR_STREAMS, VECTOR_SETUP_TIMEOUT};
use chefshat_room::ids::random_bytes;

/// How long a client may think about a batch.
const VECTOR_IDLE_TIMEOUT: Duration = Duration::from_secs(3_600);
/// How long a client may take to receive one message.
const VECTOR_SEND_TIMEOUT: Duration = Duration::from_secs(60);

/// Messages queued for a slow client. At most one is a batch; the others are parts of records.
const SEND_AHEAD: usize = 4;
/// Most games that are stepped without the thread pool if the client plays all seats.
const MAX_GAMES_IN_PLACE: u32 = 16;
/// Most games that are stepped without the thread pool if fast built-in agents play.
const MAX_GAMES_IN_PLACE_WITH_BUILT_IN: u32 = 2;

/// The service.
#[derive(Debug, Clone)]
pub struct Vectors {
    recorded: Recorded,
    pool: Arc<Threads>,
    streams: Arc<FairSemaphore>,
    /// Permits for games times seats that clients play.
    seats: Arc<FairSemaphore>,
    closing: CancellationToken,
}

impl Vectors {
    /// Creates the service with this number of threads (0: one for each core). `closing` ends its
    /// streams.
    ///
    /// # Errors
    /// The operating system cannot start the threads.
    pub fn new(
        recorded: Recorded,
        threads: usize,
        closing: CancellationToken,
    ) -> Result<Self, ThreadPoolBuildError> {
        let shares = recorded.rooms().shares();
        Ok(Self {
            recorded,
            pool: Arc::new(Threads::new("vector", threads, Priority::Batches)?),
            streams: FairSemaphore::new(MAX_VECTOR_STREAMS, shares),
            seats: FairSemaphore::new(MAX_VECTOR_SEATS_IN_ALL, shares),
            closing,
        })
    }

    fn metrics(&self) -> &Metrics {
        self.recorded.rooms().metrics()
    }
}

impl VectorService for Vectors {
    type RunStream = ReceiverStream<Result<v1::RunResponse, Status>>;

    async fn run(
        &self,
        request: Request<Streaming<v1::RunRequest>>,
    ) -> Result<Response<Self::RunStream>, Status> {
        let key = charged(request.extensions());
        let place = (self.streams.try_take(key))
            .ok_or_else(|| Refusal::from(too_many(self.streams.share_of(key))))?;
        let (responses, stream) = mpsc::channel(SEND_AHEAD);
        let runner = Runner {
            service: self.clone(),
            caller: Caller::of(request.extensions()),
            gateway: request.extensions().get().cloned(),
            responses,
            _place: place,
            _counted: self.metrics().stream(StreamKind::Vector),
        };
        tokio::spawn(short(
            "waits for the client alone, within its time limit",
            runner.run(request.into_inner()),
        ));
        Ok(Response::new(ReceiverStream::new(stream)))
    }
}

/// One stream.
struct Runner {
    service: Vectors,
    caller: Caller,
    gateway: Option<Gateway>,
    responses: mpsc::Sender<Result<v1::RunResponse, Status>>,
    _place: Permit,
    _counted: Counted,
}

/// The reason why a stream ends.
enum End {
    /// The client ended it or has gone.
    Gone,
    /// The client receives this status.
    Failed(Status),
}

impl From<Status> for End {
    fn from(status: Status) -> End {
        End::Failed(status)
    }
}

/// A request of a client.
enum Command {
    /// Answered by a batch.
    Next(VectorRequest),
    /// Answered by states.
    Save(v1::VectorSave),
}

impl Runner {
    async fn run(self, mut requests: Streaming<v1::RunRequest>) {
        let closing = self.service.closing.clone();
        let end = tokio::select! {
            end = self.play(&mut requests) => end,
            () = closing.cancelled() => Err(End::Failed(shutting_down())),
        };
        if let Err(End::Failed(status)) = end {
            // It fails only if the client has gone or still does not read.
            let _ = self
                .responses
                .send_timeout(Err(status), VECTOR_SEND_TIMEOUT)
                .await;
        }
    }

    async fn play(&self, requests: &mut Streaming<v1::RunRequest>) -> Result<(), End> {
        let first = timeout(VECTOR_SETUP_TIMEOUT, next(requests)).await;
        let message = match first.map_err(|_| setup_too_late())?? {
            None => return Err(End::Gone),
            Some(Some(RequestKind::Setup(message))) => message,
            Some(_) => {
                let words = "the first message must be the setup of the games";
                return Err(invalid("SETUP_MISSING", "setup", words).into());
            }
        };
        let setup = self.setup(*message).await?;
        let _seats = self.reserve(&setup)?;
        let _games = self.service.metrics().vector_games(setup.games());
        self.send(ResponseKind::Started(started_to_proto(&setup)))
            .await?;
        let begun = self.run_on_pool(move || VectorGames::new(setup)).await?;
        let (mut games, mut batch) = begun;
        loop {
            for played in std::mem::take(&mut batch.played) {
                // One at a time: a record is far larger than the game it is made from.
                let made = self.run_on_pool(move || (record_parts(games.setup(), &played), games));
                let parts;
                (parts, games) = made.await?;
                for part in parts {
                    self.send(ResponseKind::Record(part)).await?;
                }
            }
            let statistics = games.setup().statistics();
            let response = ResponseKind::Batch(Box::new(batch_to_proto(batch, statistics)));
            self.send(response).await?;
            let command = loop {
                match self.next_command(requests).await? {
                    None => return Err(End::Gone),
                    Some(Command::Next(request)) => break request,
                    Some(Command::Save(message)) => {
                        let save = move || (saved_to_proto(&message, &games), games);
                        let saved;
                        (saved, games) = self.run_on_pool(save).await?;
                        let states = saved.map_err(vector_refused)?;
                        self.send(ResponseKind::States(states)).await?;
                    }
                }
            };
            if let VectorRequest::Actions(actions) = &command {
                let taken = actions.iter().filter(|action| **action != LEAVE_OPEN);
                let decisions = u64::try_from(taken.count()).unwrap_or(u64::MAX);
                self.service.metrics().vector_decided(decisions);
            }
            let in_place = executes_in_place(&command, games.setup());
            let step = move || (command.execute(&mut games), games);
            let stepped;
            (stepped, games) = match in_place {
                true => caught(step).ok_or_else(internal)?,
                false => self.run_on_pool(step).await?,
            };
            batch = stepped.map_err(vector_refused)?;
        }
    }

    /// The next request of the client; `None` when it has ended the stream.
    async fn next_command(
        &self,
        requests: &mut Streaming<v1::RunRequest>,
    ) -> Result<Option<Command>, End> {
        let message = timeout(VECTOR_IDLE_TIMEOUT, next(requests)).await;
        let request = match message.map_err(|_| client_idle())?? {
            None => return Ok(None),
            Some(Some(RequestKind::Save(message))) => return Ok(Some(Command::Save(message))),
            Some(Some(RequestKind::Actions(message))) => VectorRequest::actions(&message),
            Some(Some(RequestKind::Reset(message))) => {
                VectorRequest::reset(&message, &Limits::OF_SERVER)
            }
            Some(Some(RequestKind::Restore(message))) => Ok(VectorRequest::Restore(message)),
            Some(Some(RequestKind::Setup(_))) => {
                let words = "the games are already set up; open another stream for others";
                return Err(invalid("SETUP_REFUSED", "setup", words).into());
            }
            Some(None) => {
                let words = "set a request: actions, reset, save or restore";
                return Err(invalid("ACTIONS_REFUSED", "request", words).into());
            }
        };
        Ok(Some(Command::Next(request.map_err(vector_refused)?)))
    }

    /// Runs work on the pool's threads.
    async fn run_on_pool<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Status> {
        self.service.pool.run(work).await.ok_or_else(internal)
    }

    async fn send(&self, response: ResponseKind) -> Result<(), End> {
        let response = v1::RunResponse {
            response: Some(response),
        };
        self.responses
            .send_timeout(Ok(response), VECTOR_SEND_TIMEOUT)
            .await
            .map_err(|error| match error {
                SendTimeoutError::Timeout(_) => End::Failed(client_too_slow()),
                SendTimeoutError::Closed(_) => End::Gone,
            })
    }

    /// Reserves the seats of these games among those of all streams, until they are dropped.
    fn reserve(&self, setup: &VectorSetup) -> Result<Permit, Status> {
        let key = Key::of_caller(&self.caller);
        let games = usize::try_from(setup.games()).unwrap_or(usize::MAX);
        let seats = &self.service.seats;
        let reserved = seats.try_take_many(key, games * setup.client_seats().count());
        Ok(reserved.ok_or_else(|| Refusal::from(too_many_seats(seats.share_of(key))))?)
    }

    /// Checks a setup message and reads the recorded game it names.
    async fn setup(&self, message: v1::VectorSetup) -> Result<VectorSetup, Status> {
        let drawn = || u64::from_le_bytes(random_bytes());
        let seeds =
            seeds_from_setup(&message, &Limits::OF_SERVER, drawn).map_err(vector_refused)?;
        let branch = match &message.start {
            Some(vector_setup::Start::Branch(point)) => {
                Some(self.point(point, message.rules.as_ref()).await?)
            }
            _ => None,
        };
        // On the pool, because there may be many saved games or long lists of actions.
        let read = move || {
            let start = match branch {
                None => start_from_proto(&message).map_err(vector_refused)?,
                branch => branch,
            };
            let (rules, start) = start.ok_or_else(internal)?;
            setup_from_proto(&message, rules, start, seeds, &Limits::OF_SERVER)
                .map_err(vector_refused)
        };
        self.run_on_pool(read).await?
    }

    /// The state of a recorded game at a point.
    async fn point(
        &self,
        point: &v1::BranchPoint,
        rules: Option<&v1::RuleSet>,
    ) -> Result<(RuleSet, Start), Status> {
        let refused = |name, words: &str| invalid("BRANCH_REFUSED", name, words);
        if rules.is_some_and(|rules| *rules != v1::RuleSet::default()) {
            let words = "leave it unset: the rules are those of the recorded game";
            return Err(refused("rules", words));
        }
        let decisions = point.decisions;
        let recorded = &self.service.recorded;
        let (caller, gateway) = (&self.caller, self.gateway.as_ref());
        let lines = recorded.lines(caller, gateway, &point.game_id, |lines, _| lines);
        let lines = lines.await?;
        let (branch, game) = recorded
            .with_place(Key::of_caller(caller), move || {
                let branch = branch_of(&lines, decisions)?;
                let game = branch.played(branch.later_deals.unwrap_or(Seed([0; 32])));
                Ok((branch, game))
            })
            .await?
            .map_err(|error: BranchError| branch_refused(&error))?;
        if point.same_deals && branch.later_deals.is_none() {
            let words = "the later Shifts of this game were not dealt from one seed";
            return Err(refused("same_deals", words));
        }
        let start = Start::Point {
            game: Box::new(game.ok_or_else(internal)?),
            same_deals: point.same_deals,
        };
        Ok((branch.rules, start))
    }
}

/// Whether a request takes less time than waking a thread of the pool: only a step does, in few
/// games. Saved games take long to read, and starts may have long lists of actions.
fn executes_in_place(request: &VectorRequest, setup: &VectorSetup) -> bool {
    if !matches!(request, VectorRequest::Actions(_)) {
        return false;
    }
    let most = if setup.has_slow_agents() {
        0
    } else if setup.built_in().next().is_none() {
        MAX_GAMES_IN_PLACE
    } else {
        MAX_GAMES_IN_PLACE_WITH_BUILT_IN
    };
    setup.games() <= most
}

/// The content of the next message, if set; `None` when the client has ended the stream.
async fn next(
    requests: &mut Streaming<v1::RunRequest>,
) -> Result<Option<Option<RequestKind>>, End> {
    // A message that is too large or malformed is reported to the client; a broken connection has no
    // reader.
    let message = requests.message().await.map_err(End::Failed)?;
    Ok(message.map(|message| message.request))
}

fn too_many(limit: usize) -> Refused {
    Refused {
        reason: "TOO_MANY_VECTOR_STREAMS",
        what: "too many vector streams; end one, or play more games on each",
        limit: limit as u64,
        retry_after: VECTOR_SETUP_TIMEOUT,
    }
}

fn too_many_seats(limit: usize) -> Refused {
    Refused {
        reason: "TOO_MANY_VECTOR_GAMES",
        what: "too many vector games (counted times the seats that their client plays); play fewer, or end others",
        limit: limit as u64,
        retry_after: VECTOR_SETUP_TIMEOUT,
    }
}

fn setup_too_late() -> Status {
    too_late(
        "SETUP_TOO_LATE",
        "no setup arrived",
        VECTOR_SETUP_TIMEOUT,
        "open the stream when the setup is known",
    )
}

fn client_idle() -> Status {
    too_late(
        "CLIENT_IDLE",
        "no answer arrived",
        VECTOR_IDLE_TIMEOUT,
        "open another stream; games can start with the same seeds",
    )
}

fn client_too_slow() -> Status {
    too_late(
        "CLIENT_TOO_SLOW",
        "a message was not received",
        VECTOR_SEND_TIMEOUT,
        "read the stream continuously",
    )
}

fn too_late(reason: &str, what: &str, limit: Duration, advice: &str) -> Status {
    let seconds = limit.as_secs().to_string();
    let words = format!("{what} within {seconds} s; {advice}");
    status(
        Code::DeadlineExceeded,
        reason,
        words,
        [("limit_seconds", &seconds)],
    )
}

#[cfg(test)]
mod tests {
    use chefshat_agents::AgentKind;
    use chefshat_simulation::vector::{Decisions, Seeds};
    use chefshat_vector::Reset;

    use crate::grpc::vector::*;

    #[test]
    fn only_short_steps_are_made_in_place() {
        let step = VectorRequest::Actions(Vec::new());
        let others = [
            VectorRequest::Restore(v1::VectorRestore::default()),
            VectorRequest::Reset(Reset::All(None)),
        ];
        let spec = chefshat_engine::RuleSetSpec::default();
        let rules = spec.validate().expect("a valid rule set");
        let random = Some(AgentKind::Random);
        let trained = Some(AgentKind::Trained);
        let unmasked = Some(AgentKind::RandomUnmasked);
        let turns = |others| Decisions::Turns { others };
        let cases = [
            (16, [None; 4], Decisions::All, true),
            (17, [None; 4], Decisions::All, false),
            (16, [None; 4], turns(None), true),
            (2, [None; 4], turns(random), true),
            (3, [None; 4], turns(random), false),
            (1, [None; 4], turns(trained), false),
            (2, [None, random, random, random], Decisions::All, true),
            (3, [None, random, random, random], Decisions::All, false),
            (1, [None, random, trained, random], Decisions::All, false),
            (1, [None, random, unmasked, random], Decisions::All, false),
        ];
        for (games, agents, decisions, expected) in cases {
            let setup = VectorSetup::new(rules, games, &agents, Seeds::Base(1))
                .expect("a valid setup")
                .with_decisions(decisions);
            let in_place = executes_in_place(&step, &setup);
            assert_eq!(in_place, expected, "{games} {agents:?}");
            for other in &others {
                assert!(!executes_in_place(other, &setup), "{other:?}");
            }
        }
    }
}
