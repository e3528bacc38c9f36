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
    decision_kind, rules_from_proto, seat_number, situation_from_proto,
};
use chefshat_search::{
    Allocation, Estimate, Evaluation, Knowledge, KnowledgeError, LikelyHands, Method, OwnTime,
    RolloutPolicy, Sampler, ShiftHistory,
};
use rayon::ThreadPoolBuildError;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status};

use super::deadline::deadline;
use super::limits::make_way;
use super::recorded::Recorded;
use super::status::{Refusal, field, internal, invalid, shutting_down};
use crate::connections::STALLED_LIMIT;
use chefshat_admission::access::Caller;
use chefshat_admission::limits::{FairSemaphore, Payer, Queued, Refused, SLICE, WorkQueue};
use chefshat_base::tasks::short;
use chefshat_base::threads::{Priority, Threads};
use chefshat_hosting::config::{MAX_ANALYSES, MAX_ANALYSIS_ROLLOUTS, MAX_ANALYSIS_TIME};

/// Most steps of counting the deals of an analysis; a step takes 8 bytes at most.
const MAX_ANALYSIS_STEPS: u64 = 500_000;
/// Time of an analysis that names none.
const ANALYSIS_TIME: Duration = Duration::from_secs(1);
/// How many times its time the slices of an analysis may take before it ends with what it has: other
/// programs on the machine may leave it hardly any processor time.
const ANALYSIS_PATIENCE: u32 = 10;
/// The least such time.
const MIN_ANALYSIS_PATIENCE: Duration = Duration::from_secs(30);
/// Least time between estimates so far of an analysis.
const MIN_ANALYSIS_UPDATE: Duration = Duration::from_millis(50);

/// Most deals from which the likely hands are averaged.
const DEALS_FOR_HANDS: u64 = 500;
/// Deals for them between two looks at the clock.
const DEALS_AT_A_TIME: u64 = 10;
/// How long before the client's deadline an analysis ends with what it has, so that the answer
/// arrives.
const BEFORE_DEADLINE: Duration = Duration::from_millis(100);

/// The service.
#[derive(Debug, Clone)]
pub struct Analyses {
    recorded: Recorded,
    /// Each analysis takes one thread at a time.
    pool: Arc<Threads>,
    queue: Arc<WorkQueue>,
    places: Arc<FairSemaphore>,
    /// Those of the tokens of an address together.
    of_addresses: Arc<FairSemaphore>,
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
        let shares = recorded.rooms().shares();
        let places = FairSemaphore::new(MAX_ANALYSES, shares);
        let of_addresses = FairSemaphore::new(MAX_ANALYSES, shares.of_addresses());
        let pool = Threads::new("analysis", threads, Priority::Batches)?;
        Ok(Self {
            recorded,
            queue: WorkQueue::new(pool.number()),
            pool: Arc::new(pool),
            places,
            of_addresses,
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

    /// Computes an analysis, a slice at a time in turns with those of others. `update` gets the
    /// estimates so far.
    async fn run(
        &self,
        mut analysis: Analysis,
        queued: Queued,
        update: impl Fn(v1::EvaluateResponse) + Clone + Send + 'static,
    ) -> Result<v1::EvaluateResponse, Status> {
        let mut ended = None;
        loop {
            let slice = queued.slice(ended.take()).await;
            let (closing, update) = (self.closing.clone(), update.clone());
            let work = move || {
                let (own, begun) = (OwnTime::start(), Instant::now());
                let advanced = analysis.advance(own, &|| closing.is_cancelled(), update);
                (analysis, advanced, own.used(), begun.elapsed(), slice)
            };
            let (advanced, own, passed, slice);
            (analysis, advanced, own, passed, slice) =
                self.pool.run(work).await.ok_or_else(internal)?;
            if self.closing.is_cancelled() {
                return Err(shutting_down());
            }
            match advanced.map_err(|error| refused("position", error.to_string()))? {
                Some(answer) => return Ok(answer),
                None => {
                    analysis.patience = analysis.patience.saturating_sub(passed);
                    queued.computed(own, passed);
                }
            }
            ended = Some(slice);
        }
    }
}

impl AnalysisService for Analyses {
    type EvaluateStream = ReceiverStream<Result<v1::EvaluateResponse, Status>>;

    async fn evaluate(
        &self,
        request: Request<v1::EvaluateRequest>,
    ) -> Result<Response<Self::EvaluateStream>, Status> {
        let caller = Caller::of(request.extensions());
        let payer = Payer::of_caller(&caller);
        let place = |places: &Arc<FairSemaphore>, key| {
            let refused = || Refusal::from(too_many(places.share_of(key)));
            places.try_take(key).ok_or_else(refused)
        };
        let held = [
            place(&self.of_addresses, payer.address)?,
            place(&self.places, payer.key)?,
        ];
        let due = deadline(request.metadata().as_ref()).map(tokio::time::Instant::into_std);
        let message = request.into_inner();
        let plan = plan(&message)?;
        let queued = (self.queue)
            .admit(payer, plan.time, due.map(Into::into))
            .map_err(|wait| Refusal::from(too_late(wait)))?;
        let knowledge = match message.position {
            None => return Err(refused("position", "set moment or situation")),
            Some(Position::Situation(situation)) => situation_knowledge(&situation)?,
            Some(Position::Moment(moment)) => {
                self.moment(&caller, moment, recorded_knowledge).await?
            }
        };
        let analysis = Analysis::new(knowledge, plan, due);
        let (responses, stream) = mpsc::channel(1);
        let service = self.clone();
        tokio::spawn(short("one call", async move {
            let updates = responses.clone();
            // A client that reads slowly misses some.
            let update = move |so_far| drop(updates.try_send(Ok(so_far)));
            let answer = tokio::select! {
                answer = service.run(analysis, queued, update) => answer,
                () = responses.closed() => return,
            };
            // A client that does not read the answer holds up no other analysis.
            drop(held);
            let _ = responses.send_timeout(answer, STALLED_LIMIT).await;
        }));
        Ok(Response::new(ReceiverStream::new(stream)))
    }

    async fn legal_actions(
        &self,
        request: Request<v1::LegalActionsRequest>,
    ) -> Result<Response<v1::LegalActionsResponse>, Status> {
        let caller = Caller::of(request.extensions());
        // Few records are read at a time.
        make_way(request.extensions());
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

/// An analysis that pauses between its slices.
struct Analysis {
    plan: Plan,
    /// When its client stops waiting.
    due: Option<Instant>,
    /// Time that its further slices may take on threads that others leave little processor time.
    patience: Duration,
    /// Processor time of the slices that have ended.
    used: Duration,
    updated: Instant,
    stage: Stage,
}

/// What an analysis is at.
enum Stage {
    /// The possible deals are still to be counted.
    Begun(Box<Knowledge>),
    Counted(Box<Evaluating>),
}

/// The parts of an analysis whose possible deals are counted.
struct Evaluating {
    sampler: Sampler,
    likely: LikelyHands,
    /// Once they are complete.
    hands: Option<Vec<v1::ExpectedHand>>,
    evaluation: Evaluation,
}

impl Analysis {
    fn new(knowledge: Knowledge, plan: Plan, due: Option<Instant>) -> Self {
        Self {
            patience: (plan.time * ANALYSIS_PATIENCE).max(MIN_ANALYSIS_PATIENCE),
            plan,
            due: due.and_then(|due| due.checked_sub(BEFORE_DEADLINE)),
            used: Duration::ZERO,
            updated: Instant::now(),
            stage: Stage::Begun(Box::new(knowledge)),
        }
    }

    /// Continues for a slice, measured by `own`. Returns the answer at the end.
    fn advance(
        &mut self,
        own: OwnTime,
        stopped: &dyn Fn() -> bool,
        update: impl Fn(v1::EvaluateResponse),
    ) -> Result<Option<v1::EvaluateResponse>, KnowledgeError> {
        if let Stage::Begun(knowledge) = &self.stage {
            let sampler = Sampler::new(knowledge.as_ref().clone(), MAX_ANALYSIS_STEPS)?;
            let actions: Vec<ActionId> = sampler.legal_actions().iter().collect();
            self.stage = Stage::Counted(Box::new(Evaluating {
                likely: LikelyHands::new(&sampler),
                hands: None,
                evaluation: Evaluation::new(&actions, self.plan.method.allocation)
                    .at_most(self.plan.rollouts),
                sampler,
            }));
        }
        let Stage::Counted(evaluating) = &mut self.stage else {
            return Ok(None);
        };
        let Evaluating {
            sampler,
            likely,
            hands,
            evaluation,
        } = evaluating.as_mut();
        let (plan, used) = (&self.plan, self.used);
        let (due, patience, begun) = (self.due, self.patience, Instant::now());
        let spent = |done: u64, all: u64, time: Duration| {
            let elapsed = (used + own.used()).as_secs_f64() / time.as_secs_f64();
            let now = Instant::now();
            let is_over = stopped() || now - begun >= patience || due.is_some_and(|due| now >= due);
            let done = done as f64 / all as f64;
            if is_over { 1.0 } else { done.max(elapsed) }
        };
        let hands = loop {
            if let Some(hands) = hands {
                break hands;
            }
            // They take at most half of the time.
            let deals = likely.deals();
            if deals > 0 && spent(deals, DEALS_FOR_HANDS, plan.time / 2) >= 1.0 {
                let means = likely.mean().into_iter();
                *hands = Some(means.map(|cards| v1::ExpectedHand { cards }).collect());
                continue;
            }
            if own.used() >= SLICE {
                self.used += own.used();
                return Ok(None);
            }
            (0..DEALS_AT_A_TIME).for_each(|_| likely.step(sampler, plan.seed));
        };
        let seat = seat_number(sampler.knowledge().seat());
        let response = |found: &[Estimate]| v1::EvaluateResponse {
            seat,
            rollouts: found.iter().map(|estimate| estimate.rollouts).sum(),
            actions: found.iter().map(estimate_to_proto).collect(),
            hands: hands.clone(),
        };
        let progress = |rollouts: u64| spent(rollouts, plan.rollouts, plan.time);
        loop {
            if evaluation.step(sampler, &plan.method, plan.seed, None, progress) {
                return Ok(Some(response(evaluation.estimates())));
            }
            let due = |every: Duration| self.updated.elapsed() >= every;
            if plan.update.is_some_and(due) {
                self.updated = Instant::now();
                update(response(evaluation.estimates()));
            }
            if own.used() >= SLICE {
                self.used += own.used();
                return Ok(None);
            }
        }
    }
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
            belief: None,
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
    invalid("ANALYSIS_REFUSED", name, words)
}

/// The refusal of an analysis that could not end by the deadline of its client.
fn too_late(wait: Duration) -> Refused {
    Refused {
        reason: "TOO_MANY_ANALYSES",
        what: "too many analyses run or wait: this one would end after its deadline; choose a later deadline or a shorter time_ms, or try again later",
        limit: MAX_ANALYSES as u64,
        retry_after: wait,
    }
}

fn too_many(limit: usize) -> Refused {
    Refused {
        reason: "TOO_MANY_ANALYSES",
        what: "too many analyses at a time; wait until one ends",
        limit: limit as u64,
        retry_after: MAX_ANALYSIS_TIME,
    }
}

#[cfg(test)]
mod tests {
    use chefshat_agents::BuiltInAgent;
    use chefshat_engine::{Game, RuleSetSpec};

    use super::*;

    /// What the seat of the first decision of a game knows.
    fn knowledge() -> Knowledge {
        let rules = RuleSetSpec::default().validate().expect("the standard");
        let mut events = Vec::new();
        let mut game = Game::new(rules, Seed([3; 32]), |event| events.push(event));
        let mut agent = BuiltInAgent::new(AgentKind::Greedy, [1; 32]);
        // Some cards are laid, so that there are not too many possible deals.
        for _ in 0..30 {
            let decision = game.decision().expect("the first Shift goes on");
            let observation = game.observe(Viewer::Seat(decision.seat));
            let action = agent.decide(&observation, &game.legal_actions());
            game.apply(action, |event| events.push(event))
                .expect("legal");
        }
        let seat = game.decision().expect("the first Shift goes on").seat;
        let history = ShiftHistory::of(seat, &events);
        Knowledge::new(rules, &game.observe(Viewer::Seat(seat)), &history).expect("known")
    }

    fn analysis() -> Analysis {
        let message = v1::EvaluateRequest {
            rollouts: 1_000_000,
            time_ms: 10_000,
            ..v1::EvaluateRequest::default()
        };
        Analysis::new(knowledge(), plan(&message).expect("allowed"), None)
    }

    #[test]
    fn an_analysis_pauses_after_its_slice_and_ends_with_what_it_has_at_its_deadline() {
        let advance = |analysis: &mut Analysis, stopped: bool| {
            let advanced = analysis.advance(OwnTime::start(), &|| stopped, |_| {});
            advanced.expect("possible deals")
        };
        let mut analysis = analysis();
        assert!(advance(&mut analysis, false).is_none(), "much is left");
        assert!(analysis.used >= SLICE);
        assert_eq!(analysis.patience, Duration::from_secs(100));
        let late = |analysis: &mut Analysis| analysis.due = Some(Instant::now());
        let starved = |analysis: &mut Analysis| {
            analysis.due = None;
            analysis.patience = Duration::ZERO;
        };
        for end in [&late as &dyn Fn(&mut Analysis), &starved] {
            end(&mut analysis);
            // The hands and each action take a few deals even then.
            let answer = std::iter::from_fn(|| Some(advance(&mut analysis, false))).take(100);
            let answer = answer.flatten().next().expect("an answer");
            assert!(answer.rollouts < 1_000_000);
            assert!(answer.actions.iter().all(|action| action.rollouts >= 4));
            assert_eq!(answer.hands.len(), 4);
        }
    }
}
