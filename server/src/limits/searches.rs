//! The searches of built-in agents in rooms, on threads of their own. A decision never waits long: if
//! too many searches wait or run, the agent plays as it would without a search.

use std::sync::Arc;
use std::time::{Duration, Instant};

use chefshat_agents::BuiltInAgent;
use chefshat_engine::{ActionId, RuleSet};
use chefshat_room::SearchRequest;
use chefshat_search::{Chance, Choice, ShiftHistory};
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
                    searched(rules, &request, || gone.is_cancelled())
                };
                let ended = self.threads.run(work).await;
                ended.unwrap_or(Err(SearchOutcome::Failed))
            }
        };
        let outcome = ended.err().unwrap_or(SearchOutcome::Searched);
        self.metrics.searched(outcome);
        ended.ok()
    }
}

/// Searches on the calling thread.
fn searched(
    rules: RuleSet,
    request: &SearchRequest,
    stopped: impl Fn() -> bool,
) -> Result<ActionId, SearchOutcome> {
    let start = Instant::now();
    let mut history = ShiftHistory::new(request.seat);
    (request.history.iter()).for_each(|event| history.on_event(event));
    let mut prior = BuiltInAgent::new(request.plays.prior, request.seed);
    let choice = Choice {
        rules,
        observation: &request.observation,
        legal: &request.legal,
        history: &history,
        prior: prior.decide(&request.observation, &request.legal),
    };
    // Each decision has its own numbers, so that a game that resumes is repeatable, too.
    let seed = Chance::stream(request.seed, request.decision).seed();
    let stopped = || stopped() || start.elapsed() > MAX_SEARCH_TIME;
    choice
        .search(request.plays, seed, None, stopped)
        .map_err(|_| SearchOutcome::Impossible)
}
