//! `VectorService`: games of a client's own, stepped in batches on a thread pool of their own, so that rooms keep their clocks. How the games
//! go is decided in `chefshat_arena::vector`; here streams are read and written, and the records of games are cut into messages.

use std::sync::Arc;

use chefshat_arena::AgentKind;
use chefshat_arena::vector::{
    Batch, InvalidActions, PlayedGame, Start, StepError, VectorGames, VectorSetup,
};
use chefshat_engine::{Action, RuleSet, Seed};
use chefshat_proto::v1::{
    self, run_request::Request as Asked, run_response::Response as Said,
    vector_service_server::VectorService, vector_setup,
};
use chefshat_records::branch::branch_of;
use chefshat_records::convert::{FieldProblem, rules_from_proto, script_from_proto};
use prost::Message as _;
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc, oneshot};
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::{Code, Request, Response, Status, Streaming};

use super::new_room::branch_refused;
use super::recorded::Recorded;
use super::status::{field, internal, shutting_down, status};
use crate::config::MAX_VECTOR_STREAMS;
use crate::convert::{self, Played};
use crate::ids::random_bytes;

/// Messages that wait for a client that reads slowly. It has at most one batch to answer, so more are parts of records.
const SEND_AHEAD: usize = 4;
/// Size from which a part of a record is sent, bytes.
const RECORD_PART_BYTES: usize = 512 * 1024;

/// The service.
#[derive(Debug, Clone)]
pub struct Vectors {
    recorded: Recorded,
    pool: Arc<ThreadPool>,
    streams: Arc<Semaphore>,
    closing: CancellationToken,
}

impl Vectors {
    /// The service, with so many threads (0: one for each core), for games that may branch from recorded ones; `closing` ends its streams.
    ///
    /// # Errors
    /// When the operating system has no threads to give.
    pub fn new(
        recorded: Recorded,
        threads: usize,
        closing: CancellationToken,
    ) -> Result<Self, ThreadPoolBuildError> {
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|index| format!("vector-{index}"))
            .build()?;
        Ok(Self {
            recorded,
            pool: Arc::new(pool),
            streams: Arc::new(Semaphore::new(MAX_VECTOR_STREAMS)),
            closing,
        })
    }
}

#[tonic::async_trait]
impl VectorService for Vectors {
    type RunStream = ReceiverStream<Result<v1::RunResponse, Status>>;

    async fn run(
        &self,
        request: Request<Streaming<v1::RunRequest>>,
    ) -> Result<Response<Self::RunStream>, Status> {
        let permit = Arc::clone(&self.streams)
            .try_acquire_owned()
            .map_err(|_| too_many())?;
        let (responses, stream) = mpsc::channel(SEND_AHEAD);
        let runner = Runner {
            service: self.clone(),
            responses,
            _permit: permit,
        };
        tokio::spawn(runner.run(request.into_inner()));
        Ok(Response::new(ReceiverStream::new(stream)))
    }
}

/// One stream.
struct Runner {
    service: Vectors,
    responses: mpsc::Sender<Result<v1::RunResponse, Status>>,
    _permit: OwnedSemaphorePermit,
}

/// Why a stream ends.
enum End {
    /// The client ended it, or is gone.
    Left,
    /// The client is told.
    Told(Status),
}

impl From<Status> for End {
    fn from(status: Status) -> End {
        End::Told(status)
    }
}

/// What a client asked of its games.
enum Move {
    Actions(Vec<Action>),
    Reset(v1::VectorReset),
}

impl Runner {
    async fn run(self, mut requests: Streaming<v1::RunRequest>) {
        let closing = self.service.closing.clone();
        let end = tokio::select! {
            end = self.play(&mut requests) => end,
            () = closing.cancelled() => Err(End::Told(shutting_down())),
        };
        if let Err(End::Told(status)) = end {
            // If the client is gone, nobody is to be told.
            let _ = self.responses.send(Err(status)).await;
        }
    }

    async fn play(&self, requests: &mut Streaming<v1::RunRequest>) -> Result<(), End> {
        let Some(Asked::Setup(message)) = next(requests).await? else {
            let words = "the first message is the setup of the games";
            return Err(field("SETUP_MISSING", &FieldProblem::new("setup", words)).into());
        };
        let setup = self.setup(&message).await?;
        self.say(Said::Started(convert::started_to_proto(&setup)))
            .await?;
        let mut games = self
            .stepped(move || {
                let (games, batch) = VectorGames::new(setup);
                let parts = parts(&games, batch);
                (games, parts)
            })
            .await
            .map(|(games, parts)| (games, Ok(parts)))?;
        loop {
            for part in games.1? {
                self.say(part).await?;
            }
            let asked = match next(requests).await? {
                None => return Err(End::Left),
                Some(Asked::Actions(message)) => Move::Actions(actions(&message)?),
                Some(Asked::Reset(message)) => Move::Reset(message),
                Some(Asked::Setup(_)) => {
                    let words = "the games are set up already; open another stream for others";
                    return Err(field("SETUP_REFUSED", &FieldProblem::new("setup", words)).into());
                }
            };
            let mut owned = games.0;
            games = self
                .stepped(move || {
                    let batch = moved(&mut owned, &asked).map(|batch| parts(&owned, batch));
                    (owned, batch)
                })
                .await?;
        }
    }

    /// Does work on games on the pool's threads. Given up, it is done all the same, and what it gives is dropped.
    async fn stepped<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Status> {
        let (done, result) = oneshot::channel();
        self.service.pool.spawn(move || {
            let _ = done.send(work());
        });
        result.await.map_err(|_| internal())
    }

    async fn say(&self, said: Said) -> Result<(), End> {
        let response = v1::RunResponse {
            response: Some(said),
        };
        self.responses
            .send(Ok(response))
            .await
            .map_err(|_| End::Left)
    }

    /// What a setup asks for, with the recorded game that it names looked up.
    async fn setup(&self, message: &v1::VectorSetup) -> Result<VectorSetup, Status> {
        let seeds = convert::setup_seeds(message, || u64::from_le_bytes(random_bytes()))
            .map_err(|problem| field("SEED_REFUSED", &problem))?;
        let (rules, start) = self.start(message).await?;
        convert::setup_from_proto(message, rules, start, seeds)
            .map_err(|problem| field("SETUP_REFUSED", &problem))
    }

    async fn start(&self, message: &v1::VectorSetup) -> Result<(RuleSet, Start), Status> {
        let rules = || {
            rules_from_proto(&message.rules.clone().unwrap_or_default())
                .map_err(|problem| field("RULE_SET_REFUSED", &problem))
        };
        match &message.start {
            None => Ok((rules()?, Start::Deal)),
            Some(vector_setup::Start::Scripted(script)) => {
                let rules = rules()?;
                let script = script_from_proto(script, &rules)
                    .map_err(|problem| field("SCRIPT_REFUSED", &problem))?;
                Ok((rules, Start::Script(Box::new(script))))
            }
            Some(vector_setup::Start::Branch(point)) => {
                self.point(point, message.rules.as_ref()).await
            }
        }
    }

    /// A recorded game as it stood at a point.
    async fn point(
        &self,
        point: &v1::BranchPoint,
        rules: Option<&v1::RuleSet>,
    ) -> Result<(RuleSet, Start), Status> {
        let refused = |name, words: &str| field("BRANCH_REFUSED", &FieldProblem::new(name, words));
        if rules.is_some_and(|rules| *rules != v1::RuleSet::default()) {
            let words = "leave it unset: the rules are those of the recorded game";
            return Err(refused("rules", words));
        }
        let decisions = point.decisions;
        let branch = self
            .service
            .recorded
            .of_game(&point.game_id, move |lines| branch_of(&lines, decisions))
            .await?
            .map_err(|error| branch_refused(&error))?;
        if point.same_deals && branch.later_deals.is_none() {
            let words = "the later Shifts of this game were not dealt from one seed";
            return Err(refused("same_deals", words));
        }
        let game = branch
            .played(branch.later_deals.unwrap_or(Seed([0; 32])))
            .ok_or_else(internal)?;
        let start = Start::Point {
            game: Box::new(game),
            same_deals: point.same_deals,
        };
        Ok((branch.rules, start))
    }
}

/// What the client sends next; `None` when it has ended the stream.
async fn next(requests: &mut Streaming<v1::RunRequest>) -> Result<Option<Asked>, End> {
    match requests.message().await {
        Ok(None) => Ok(None),
        Ok(Some(v1::RunRequest {
            request: Some(asked),
        })) => Ok(Some(asked)),
        Ok(Some(v1::RunRequest { request: None })) => {
            let words = "say what is to be done: actions or reset";
            Err(field("ACTIONS_REFUSED", &FieldProblem::new("request", words)).into())
        }
        // A message that is too large or no message is the client's to know; a broken connection finds nobody to tell.
        Err(status) => Err(End::Told(status)),
    }
}

/// Moves the games as asked.
fn moved(games: &mut VectorGames, asked: &Move) -> Result<Batch, Status> {
    match asked {
        Move::Actions(actions) => games.step(actions).map_err(|error| step_refused(&error)),
        Move::Reset(message) => {
            let refused = |problem| field("RESET_REFUSED", &problem);
            let (some, seeds) = convert::reset_from_proto(message).map_err(refused)?;
            if some.is_empty() {
                return Ok(games.reset(seeds));
            }
            games
                .reset_some(&some)
                .map_err(|error| step_refused(&error))
        }
    }
}

/// A batch as messages, after the records of the games that ended.
fn parts(games: &VectorGames, mut batch: Batch) -> Vec<Said> {
    let setup = games.setup();
    let mut parts = Vec::new();
    for played in std::mem::take(&mut batch.played) {
        put_record(setup, &played, &mut parts);
    }
    let batch = convert::batch_to_proto(batch, setup.statistics());
    parts.push(Said::Batch(Box::new(batch)));
    parts
}

fn put_record(setup: &VectorSetup, played: &PlayedGame, parts: &mut Vec<Said>) {
    let record = Played {
        by: "vector",
        rules: setup.rules(),
        agents: &setup.agents().map(|agent| agent.map(AgentKind::name)),
        seed: played.seed,
        scheme: setup.scheme(),
        max_invalid_attempts: match setup.invalid_actions() {
            InvalidActions::AskAgain { limit } => limit.map(|limit| limit.get()),
            InvalidActions::Error => None,
        },
        decisions: &played.decisions,
    };
    let mut part = v1::VectorRecord {
        game: played.game,
        index: played.index,
        ..v1::VectorRecord::default()
    };
    let mut size = 0;
    for line in record.record() {
        if size > RECORD_PART_BYTES {
            let lines = std::mem::take(&mut part.lines);
            parts.push(Said::Record(v1::VectorRecord {
                lines,
                ..part.clone()
            }));
            size = 0;
        }
        size += line.encoded_len();
        part.lines.push(line);
    }
    part.last = true;
    parts.push(Said::Record(part));
}

fn actions(message: &v1::VectorActions) -> Result<Vec<Action>, Status> {
    let (actions, rest) = message.actions.as_chunks::<2>();
    if !rest.is_empty() {
        let words = "the column is not whole: 2 bytes for each action";
        return Err(field(
            "ACTIONS_REFUSED",
            &FieldProblem::new("actions", words),
        ));
    }
    let actions = actions.iter();
    Ok(actions
        .map(|bytes| Action::new(u16::from_le_bytes(*bytes)))
        .collect())
}

fn step_refused(error: &StepError) -> Status {
    let words = error.to_string();
    match error {
        StepError::Actions { rows, .. } => status(
            Code::InvalidArgument,
            "ACTIONS_REFUSED",
            words,
            [("field", "actions"), ("rows", &rows.to_string())],
        ),
        StepError::Illegal {
            row, game, seat, ..
        } => status(
            Code::InvalidArgument,
            "ILLEGAL_ACTION",
            words,
            [
                ("field", "actions"),
                ("row", &row.to_string()),
                ("game", &game.to_string()),
                ("seat", &seat.index().to_string()),
            ],
        ),
        StepError::Game { .. } => field("RESET_REFUSED", &FieldProblem::new("games", words)),
    }
}

fn too_many() -> Status {
    status(
        Code::ResourceExhausted,
        "TOO_MANY_VECTOR_STREAMS",
        format!(
            "this server steps the games of {MAX_VECTOR_STREAMS} streams at a time; end one, or play more games on each"
        ),
        [
            ("limit", "max_vector_streams"),
            ("max_vector_streams", &MAX_VECTOR_STREAMS.to_string()),
        ],
    )
}
