//! The searches of built-in agents in rooms, on threads of their own, those of each caller in turns
//! with those of others. A decision never waits without end: if no thread is free in time, the agent
//! plays as it would without a search.

use std::sync::Arc;
use std::time::{Duration, Instant};

use chefshat_agents::BuiltInAgent;
use chefshat_engine::{ActionId, RuleSet};
use chefshat_proto::v1;
use chefshat_room::{SearchRequest, Searched};
use chefshat_search::{
    Allocation, Chance, Choice, Estimate, ShiftHistory, show_nothing, suggested,
};
use prost::Message as _;
use rayon::ThreadPoolBuildError;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;

use super::{FairSemaphore, Key, Shares};
use chefshat_base::metrics::{Metrics, SearchOutcome};
use chefshat_base::threads::{Priority, Threads};

/// When a search ends, even if its rollouts are not done.
const MAX_SEARCH_TIME: Duration = Duration::from_secs(5);
/// When a search is given up whose thread is not even given the time to notice that.
const GIVEN_UP_AFTER: Duration = Duration::from_secs(7);
/// 1/N of the cores search.
const CORES: usize = 2;

/// Runs the searches.
#[derive(Debug)]
pub struct Searches {
    /// One for each thread.
    turns: Arc<FairSemaphore>,
    threads: Threads,
    metrics: Arc<Metrics>,
}

impl Searches {
    /// Starts the threads.
    ///
    /// # Errors
    /// The operating system cannot start the threads.
    pub fn new(metrics: Arc<Metrics>) -> Result<Self, ThreadPoolBuildError> {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = (cores / CORES).max(1);
        Ok(Self {
            // A caller alone may use all threads: those of others come next.
            turns: FairSemaphore::new(threads, Shares::ALL),
            threads: Threads::new("search", threads, Priority::Searches)?,
            metrics,
        })
    }

    /// Searches for a room that `key` is charged for. Ends when the future is dropped. A decision that
    /// is not searched has a note that says why.
    pub async fn search(
        self: Arc<Self>,
        key: Key,
        rules: RuleSet,
        request: SearchRequest,
    ) -> Searched {
        let patience = request.patience;
        let work = move |stopped: &dyn Fn() -> bool| {
            let estimates = estimated(rules, &request, Allocation::Halving, stopped)?;
            match show_nothing(&estimates) {
                true => Err(SearchOutcome::TooFewDeals),
                false => Ok(suggested(&estimates)),
            }
        };
        let found = self.run(key, patience, work).await;
        Searched {
            action: found.ok(),
            annotations: found.err().map(note),
        }
    }

    /// Estimates the actions of a decision for a hint. Without a thread for it, suggests what is
    /// played without a search.
    pub async fn hint(self: Arc<Self>, key: Key, rules: RuleSet, request: SearchRequest) -> Hint {
        let request = Arc::new(request);
        let searched = Arc::clone(&request);
        let work = move |stopped: &dyn Fn() -> bool| {
            // In the order of the actions.
            let estimates = estimated(rules, &searched, Allocation::Uniform, stopped)?;
            Ok((suggested(&estimates), estimates))
        };
        let found = self.run(key, request.patience, work).await;
        let (suggested, estimates) = found.unwrap_or_else(|_| (prior_of(&request), Vec::new()));
        Hint {
            suggested,
            estimates,
        }
    }

    async fn run<T: Send + 'static>(
        &self,
        key: Key,
        patience: Duration,
        work: impl FnOnce(&dyn Fn() -> bool) -> Result<T, SearchOutcome> + Send + 'static,
    ) -> Result<T, SearchOutcome> {
        let ended = match timeout(patience, self.turns.take(key)).await {
            Err(_) => Err(SearchOutcome::Busy),
            Ok(turn) => {
                let gone = CancellationToken::new();
                let _gone = gone.clone().drop_guard();
                let work = move || {
                    // Work that was given up keeps its turn until it ends.
                    let _turn = turn;
                    let start = Instant::now();
                    work(&|| gone.is_cancelled() || start.elapsed() > MAX_SEARCH_TIME)
                };
                match timeout(GIVEN_UP_AFTER, self.threads.run(work)).await {
                    Err(_) => Err(SearchOutcome::Busy),
                    Ok(None) => Err(SearchOutcome::Failed),
                    Ok(Some(ended)) => ended,
                }
            }
        };
        let outcome = ended.as_ref().err().copied();
        self.metrics
            .searched(outcome.unwrap_or(SearchOutcome::Searched));
        ended
    }
}

/// A hint.
#[derive(Clone, Debug)]
pub struct Hint {
    /// The action that it suggests.
    pub suggested: ActionId,
    /// Estimates of all legal actions, or none.
    pub estimates: Vec<Estimate>,
}

/// Estimates all legal actions on the calling thread.
fn estimated(
    rules: RuleSet,
    request: &SearchRequest,
    allocation: Allocation,
    stopped: &dyn Fn() -> bool,
) -> Result<Vec<Estimate>, SearchOutcome> {
    let history = ShiftHistory::of(request.seat, &request.history);
    let choice = Choice {
        rules,
        observation: &request.observation,
        legal: &request.legal,
        history: &history,
        prior: prior_of(request),
    };
    // Each decision and each hint has its own numbers, so that a game that resumes is repeatable,
    // too.
    let decision = Chance::stream(request.seed, request.decision).seed();
    let seed = Chance::stream(decision, request.hints.into()).seed();
    choice
        .estimates(request.plays, allocation, seed, None, stopped)
        .map_err(|_| SearchOutcome::Impossible)
}

/// The annotations of a decision whose search ended in this way, encoded.
fn note(outcome: SearchOutcome) -> Box<[u8]> {
    let annotations = v1::Annotations {
        extra: [("search".to_owned(), outcome.label().to_owned())].into(),
        ..v1::Annotations::default()
    };
    annotations.encode_to_vec().into()
}

/// What is played without a search.
fn prior_of(request: &SearchRequest) -> ActionId {
    let mut prior = BuiltInAgent::new(request.plays.prior, request.seed);
    prior.decide(&request.observation, &request.legal)
}

#[cfg(test)]
mod tests;
