//! `AnalysisService`: estimates of the actions of a decision, on threads of its own so that rooms
//! stay responsive. `chefshat_search` estimates; this file reads positions and writes the answers.
//! Only what the seat knows goes into a position, and games that are running have none.

use std::sync::Arc;
use std::time::{Duration, Instant};

use chefshat_agents::AgentKind;
use chefshat_engine::{ActionId, Event, RuleSet, Seed, Viewer};
use chefshat_proto::v1::{
    self, analysis_service_server::AnalysisService, evaluate_request::Position,
};
use chefshat_record::branch::{Branch, BranchError, branch_of};
use chefshat_record::convert::{
    FieldProblem, decision_kind, rules_from_proto, seat_number, situation_from_proto,
};
use chefshat_search::{
    Allocation, Estimate, Knowledge, KnowledgeError, Method, RolloutPolicy, Sampler, ShiftHistory,
    evaluate_watched, likely_hands,
};
use rayon::ThreadPoolBuildError;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status};

use super::limits::charged;
use super::pool::on_pool;
use super::recorded::Recorded;
use super::status::{Refusal, field, internal, shutting_down};
use crate::access::Caller;
use crate::config::{
    ANALYSIS_TIME, MAX_ANALYSES, MAX_ANALYSIS_ROLLOUTS, MAX_ANALYSIS_STEPS, MAX_ANALYSIS_TIME,
    MIN_ANALYSIS_UPDATE,
};
use crate::limits::{Places, Refused};
use crate::threads::Threads;

/// Most deals from which the likely hands are averaged.
const DEALS_FOR_HANDS: u64 = 500;

/// The service.
#[derive(Debug, Clone)]
pub struct Analyses {
    recorded: Recorded,
    /// Each analysis takes one thread.
    pool: Arc<Threads>,
    places: Arc<Places>,
    closing: CancellationToken,
}

/// How to evaluate a position.
struct Plan {
    method: Method,
    rollouts: u64,
    time: Duration,
    seed: [u8; 32],
    /// Time between answers with estimates so far.
    update: Option<Duration>,
}

impl Analyses {
    /// Creates the service with this number of threads (0: one for each core). `closing` ends its
    /// work.
    ///
    /// # Errors
    /// The operating system cannot start the threads.
    pub fn new(
        recorded: Recorded,
        threads: usize,
        closing: CancellationToken,
    ) -> Result<Self, ThreadPoolBuildError> {
        let places = Places::new(MAX_ANALYSES, recorded.rooms().shares());
        Ok(Self {
            recorded,
            pool: Arc::new(Threads::new("analysis", threads, 0)?),
            places,
            closing,
        })
    }

    /// Reads something of a recorded decision.
    async fn moment<T: Send + 'static>(
        &self,
        caller: &Caller,
        moment: v1::RecordedMoment,
        read: impl FnOnce(Branch) -> Option<T> + Send + 'static,
    ) -> Result<T, Status> {
        let decisions = moment.decisions;
        self.recorded
            .of_game(caller, &moment.game_id, move |lines, _| {
                Ok(read(branch_of(&lines, decisions)?))
            })
            .await?
            .map_err(|error: BranchError| refused("moment", error.to_string()))?
            .ok_or_else(internal)
    }

    /// Runs work on a thread of the pool. `stopped` says whether the client has gone or the server stops.
    async fn run_on_pool<T: Send + 'static>(
        &self,
        work: impl FnOnce(&dyn Fn() -> bool) -> T + Send + 'static,
    ) -> Result<T, Status> {
        let gone = CancellationToken::new();
        let guard = gone.clone().drop_guard();
        let closing = self.closing.clone();
        let work = move || work(&|| gone.is_cancelled() || closing.is_cancelled());
        let value = on_pool(&self.pool, work).await;
        drop(guard);
        match self.closing.is_cancelled() {
            true => Err(shutting_down()),
            false => value,
        }
    }
}

#[tonic::async_trait]
impl AnalysisService for Analyses {
    type EvaluateStream = ReceiverStream<Result<v1::EvaluateResponse, Status>>;

    async fn evaluate(
        &self,
        request: Request<v1::EvaluateRequest>,
    ) -> Result<Response<Self::EvaluateStream>, Status> {
        let key = charged(request.extensions());
        let place = (self.places.try_take(key))
            .ok_or_else(|| Refusal::from(too_many(self.places.share_of(key))))?;
        let caller = Caller::of(request.extensions());
        let message = request.into_inner();
        let plan = plan(&message)?;
        let knowledge = match message.position {
            None => return Err(refused("position", "set moment or situation")),
            Some(Position::Situation(situation)) => situation_knowledge(&situation)?,
            Some(Position::Moment(moment)) => {
                self.moment(&caller, moment, recorded_knowledge).await?
            }
        };
        let (responses, stream) = mpsc::channel(1);
        let service = self.clone();
        tokio::spawn(async move {
            let updates = responses.clone();
            let work = service.run_on_pool(move |stopped| {
                // Work that was given up keeps its place until it ends.
                let _place = place;
                // A client that reads slowly misses some.
                let update = |so_far| drop(updates.try_send(Ok(so_far)));
                evaluated(knowledge, &plan, stopped, update)
            });
            let answer = tokio::select! {
                answer = work => answer,
                () = responses.closed() => return,
            };
            let answer = answer
                .and_then(|found| found.map_err(|error| refused("position", error.to_string())));
            // It fails only if the client has gone.
            let _ = responses.send(answer).await;
        });
        Ok(Response::new(ReceiverStream::new(stream)))
    }

    async fn legal_actions(
        &self,
        request: Request<v1::LegalActionsRequest>,
    ) -> Result<Response<v1::LegalActionsResponse>, Status> {
        let caller = Caller::of(request.extensions());
        let moment = request.into_inner().moment;
        let moment = moment.ok_or_else(|| refused("moment", "not set"))?;
        let read = |branch: Branch| {
            let game = branch.replayed(Seed([0; 32]), |_| {})?;
            let decision = game.decision()?;
            let size = branch.rules.actions().size();
            Some(v1::LegalActionsResponse {
                seat: seat_number(decision.seat),
                kind: decision_kind(decision.kind).into(),
                action_mask: game.legal_actions().to_bytes(size),
            })
        };
        self.moment(&caller, moment, read).await.map(Response::new)
    }
}

/// Evaluates a position. `update` gets the estimates so far, as often as the plan says.
fn evaluated(
    knowledge: Knowledge,
    plan: &Plan,
    stopped: &dyn Fn() -> bool,
    update: impl Fn(v1::EvaluateResponse),
) -> Result<v1::EvaluateResponse, KnowledgeError> {
    let start = Instant::now();
    let seat = knowledge.seat();
    let sampler = Sampler::new(knowledge, MAX_ANALYSIS_STEPS)?;
    let actions: Vec<ActionId> = sampler.legal_actions().iter().collect();
    let spent = |done: u64, all: u64, time: Duration| {
        let elapsed = start.elapsed().as_secs_f64() / time.as_secs_f64();
        let done = done as f64 / all as f64;
        if stopped() { 1.0 } else { done.max(elapsed) }
    };
    // The hands take at most half of the time.
    let of_hands = |deals: u64| spent(deals, DEALS_FOR_HANDS, plan.time / 2);
    let hands: Vec<v1::ExpectedHand> = likely_hands(&sampler, plan.seed, of_hands)
        .into_iter()
        .map(|cards| v1::ExpectedHand { cards })
        .collect();
    let response = |found: &[Estimate]| v1::EvaluateResponse {
        seat: seat_number(seat),
        rollouts: found.iter().map(|estimate| estimate.rollouts).sum(),
        actions: found.iter().map(estimate_to_proto).collect(),
        hands: hands.clone(),
    };
    let mut updated = start;
    let progress = |rollouts: u64, found: &[Estimate]| {
        let due = |every: Duration| rollouts > 0 && updated.elapsed() >= every;
        if plan.update.is_some_and(due) {
            updated = Instant::now();
            update(response(found));
        }
        spent(rollouts, plan.rollouts, plan.time)
    };
    let (method, seed) = (&plan.method, plan.seed);
    let found = evaluate_watched(&sampler, &actions, method, seed, None, progress);
    Ok(response(&found))
}

pub(super) fn estimate_to_proto(estimate: &Estimate) -> v1::ActionEstimate {
    v1::ActionEstimate {
        action: estimate.action.index().into(),
        points: estimate.points(),
        standard_error: estimate.standard_error(),
        place: estimate.place(),
        rollouts: estimate.rollouts,
    }
}

/// The plan of a request.
fn plan(message: &v1::EvaluateRequest) -> Result<Plan, Status> {
    let policy = match message.agent.as_str() {
        "" => Some(RolloutPolicy::Kind(AgentKind::Greedy)),
        name => RolloutPolicy::from_name(name),
    };
    let policy = policy.ok_or_else(|| refused("agent", "choose random, greedy or trained"))?;
    if message.rollouts > MAX_ANALYSIS_ROLLOUTS {
        let words = format!("choose at most {MAX_ANALYSIS_ROLLOUTS}");
        return Err(refused("rollouts", words));
    }
    let time = match message.time_ms {
        0 => ANALYSIS_TIME,
        ms => Duration::from_millis(ms.into()),
    };
    if time > MAX_ANALYSIS_TIME {
        let words = format!("choose at most {}", MAX_ANALYSIS_TIME.as_millis());
        return Err(refused("time_ms", words));
    }
    let update = Duration::from_millis(message.update_ms.into());
    if !update.is_zero() && !(MIN_ANALYSIS_UPDATE..=MAX_ANALYSIS_TIME).contains(&update) {
        let (least, most) = (MIN_ANALYSIS_UPDATE, MAX_ANALYSIS_TIME);
        let words = format!("choose 0, or {} to {}", least.as_millis(), most.as_millis());
        return Err(refused("update_ms", words));
    }
    let mut seed = [0; 32];
    seed[..8].copy_from_slice(&message.seed.to_le_bytes());
    Ok(Plan {
        method: Method {
            policy,
            allocation: Allocation::Uniform,
        },
        rollouts: match message.rollouts {
            0 => MAX_ANALYSIS_ROLLOUTS,
            rollouts => rollouts,
        },
        time,
        seed,
        update: Some(update).filter(|update| !update.is_zero()),
    })
}

/// What the seat of a recorded decision knows there.
fn recorded_knowledge(branch: Branch) -> Option<Knowledge> {
    let mut shift = Vec::new();
    let game = branch.replayed(Seed([0; 32]), |event| {
        if matches!(event, Event::ShiftStarted { .. }) {
            shift.clear();
        }
        shift.push(event);
    })?;
    let seat = game.decision()?.seat;
    let history = ShiftHistory::of(seat, &shift);
    Knowledge::new(branch.rules, &game.observe(Viewer::Seat(seat)), &history).ok()
}

/// What the seat of a situation knows.
fn situation_knowledge(situation: &v1::Situation) -> Result<Knowledge, Status> {
    let rules: RuleSet =
        rules_from_proto(situation.rules.as_ref().unwrap_or(&v1::RuleSet::default()))
            .map_err(|problem| field("RULE_SET_REFUSED", &problem))?;
    let (observation, events) = situation_from_proto(situation, &rules)
        .map_err(|problem| field("ANALYSIS_REFUSED", &problem))?;
    let history = ShiftHistory::of(observation.seat.ok_or_else(internal)?, &events);
    Knowledge::new(rules, &observation, &history)
        .map_err(|error| refused("situation", error.to_string()))
}

fn refused(name: &'static str, words: impl Into<String>) -> Status {
    field("ANALYSIS_REFUSED", &FieldProblem::new(name, words))
}

fn too_many(limit: usize) -> Refused {
    Refused {
        reason: "TOO_MANY_ANALYSES",
        what: "too many analyses at a time; wait until one ends",
        limit: limit as u64,
        retry_after: MAX_ANALYSIS_TIME,
    }
}
