//! The searches of built-in agents in rooms, on threads of their own. A decision never waits long: if
//! too many searches wait or run, the agent plays as it would without a search.

use std::sync::Arc;
use std::time::{Duration, Instant};

use chefshat_agents::BuiltInAgent;
use chefshat_engine::{ActionId, RuleSet};
use chefshat_room::SearchRequest;
use chefshat_search::{
    Allocation, Chance, Choice, Estimate, KnowledgeError, ShiftHistory, suggested,
};
use rayon::ThreadPoolBuildError;
use tokio_util::sync::CancellationToken;

use super::threads::Threads;
use super::{Key, Places, Shares};
use crate::metrics::{Metrics, SearchOutcome};

/// Most searches of built-in agents in rooms at a time, those waiting for a thread included.
pub(super) const MAX_SEARCHES: usize = 64;
/// How long a search may wait for a thread.
pub(super) const MAX_SEARCH_WAIT: Duration = Duration::from_secs(1);
/// When a search ends, even if its rollouts are not done.
const MAX_SEARCH_TIME: Duration = Duration::from_secs(5);
/// 1/N of the cores search.
const CORES: usize = 2;

/// Runs the searches.
#[derive(Debug)]
pub struct Searches {
    places: Arc<Places>,
    threads: Threads,
    metrics: Arc<Metrics>,
}

impl Searches {
    /// Starts the threads.
    ///
    /// # Errors
    /// The operating system cannot start the threads.
    pub fn new(shares: Shares, metrics: Arc<Metrics>) -> Result<Self, ThreadPoolBuildError> {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Ok(Self {
            places: Places::new(MAX_SEARCHES, shares),
            threads: Threads::new("search", (cores / CORES).max(1))?,
            metrics,
        })
    }

    /// Searches for a room that `key` is charged for; `None` if there was no time or place for it, or if
    /// the possible deals are too many. Ends when the future is dropped.
    pub async fn search(
        self: Arc<Self>,
        key: Key,
        rules: RuleSet,
        request: SearchRequest,
    ) -> Option<ActionId> {
        self.run(key, move |stopped| searched(rules, &request, stopped))
            .await
    }

    /// Estimates the actions of a decision for a hint. Without a place or time for it, suggests what is
    /// played without a search.
    pub async fn hint(self: Arc<Self>, key: Key, rules: RuleSet, request: SearchRequest) -> Hint {
        let prior = prior_of(&request);
        let estimates = self.run(key, move |stopped| estimated(rules, &request, stopped));
        let estimates = estimates.await.unwrap_or_default();
        Hint {
            suggested: match estimates.is_empty() {
                true => prior,
                false => suggested(&estimates),
            },
            estimates,
        }
    }

    async fn run<T: Send + 'static>(
        &self,
        key: Key,
        work: impl FnOnce(&dyn Fn() -> bool) -> Result<T, SearchOutcome> + Send + 'static,
    ) -> Option<T> {
        let asked = Instant::now();
        let ended = match self.places.try_take(key) {
            None => Err(SearchOutcome::Busy),
            Some(place) => {
                let gone = CancellationToken::new();
                let _gone = gone.clone().drop_guard();
                let work = move || {
                    // Work that was given up keeps its place until it ends.
                    let _place = place;
                    if gone.is_cancelled() || asked.elapsed() > MAX_SEARCH_WAIT {
                        return Err(SearchOutcome::Busy);
                    }
                    let start = Instant::now();
                    work(&|| gone.is_cancelled() || start.elapsed() > MAX_SEARCH_TIME)
                };
                let ended = self.threads.run(work).await;
                ended.unwrap_or(Err(SearchOutcome::Failed))
            }
        };
        let outcome = ended.as_ref().err().copied();
        self.metrics
            .searched(outcome.unwrap_or(SearchOutcome::Searched));
        ended.ok()
    }
}

/// A hint.
#[derive(Debug)]
pub struct Hint {
    /// The action that it suggests.
    pub suggested: ActionId,
    /// Estimates of all legal actions, or none.
    pub estimates: Vec<Estimate>,
}

/// Searches on the calling thread.
fn searched(
    rules: RuleSet,
    request: &SearchRequest,
    stopped: &dyn Fn() -> bool,
) -> Result<ActionId, SearchOutcome> {
    choosing(rules, request, |choice, seed| {
        choice.search(request.plays, seed, None, stopped)
    })
}

/// Estimates all legal actions on the calling thread, in their order.
fn estimated(
    rules: RuleSet,
    request: &SearchRequest,
    stopped: &dyn Fn() -> bool,
) -> Result<Vec<Estimate>, SearchOutcome> {
    choosing(rules, request, |choice, seed| {
        choice.estimates(request.plays, Allocation::Uniform, seed, None, stopped)
    })
}

fn choosing<T>(
    rules: RuleSet,
    request: &SearchRequest,
    work: impl FnOnce(&Choice<'_>, [u8; 32]) -> Result<T, KnowledgeError>,
) -> Result<T, SearchOutcome> {
    let mut history = ShiftHistory::new(request.seat);
    (request.history.iter()).for_each(|event| history.on_event(event));
    let choice = Choice {
        rules,
        observation: &request.observation,
        legal: &request.legal,
        history: &history,
        prior: prior_of(request),
    };
    // Each decision has its own numbers, so that a game that resumes is repeatable, too.
    let seed = Chance::stream(request.seed, request.decision).seed();
    work(&choice, seed).map_err(|_| SearchOutcome::Impossible)
}

/// What is played without a search.
fn prior_of(request: &SearchRequest) -> ActionId {
    let mut prior = BuiltInAgent::new(request.plays.prior, request.seed);
    prior.decide(&request.observation, &request.legal)
}
