//! The agent `monte_carlo`: starts from what a policy would do and deviates where rollouts in
//! possible deals show that another action gains points.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use chefshat_agents::{AgentKind, AgentMaker, BuiltInAgent, Following};
use chefshat_engine::{ActionId, Event, Mask, Observation, RuleSet, Seat};
use rayon::ThreadPool;
use thiserror::Error;

use crate::{
    Allocation, Chance, Estimate, Knowledge, KnowledgeError, Method, RolloutPolicy, Sampler,
    ShiftHistory, evaluate,
};

/// Steps of counting deals that the agent spends on a decision at most.
const MAX_STEPS: u64 = 200_000;
/// The most rollouts of a decision.
const MAX_ROLLOUTS: u64 = 1_000_000;
/// The most milliseconds of a decision.
const MAX_MS: u64 = 60_000;

/// Fewest deals that can show a gain: a few are often equal by chance, and their standard error 0.
const MIN_DEALS: u64 = 16;

/// What a decision may cost. Every legal action is tried in 4 deals at least, even if that costs
/// more.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub enum Budget {
    /// About this many rollouts: the same seed plays the same game.
    Rollouts(u64),
    /// About this much time, counting the possible deals included.
    Time(Duration),
}

/// How the agent `monte_carlo` plays. As text: `monte_carlo`, then optionally `:` and the budget of a
/// decision (`50ms` or a number of rollouts), then optionally `:` and the agent of the rollouts.
#[derive(Copy, Clone, PartialEq, Debug)]
pub struct MonteCarlo {
    /// What a decision may cost.
    pub budget: Budget,
    /// The agents of the rollouts.
    pub rollouts: AgentKind,
    /// The agent whose action is taken unless another gains points.
    pub prior: AgentKind,
    /// How many standard errors the gain must exceed 0.
    pub margin: f64,
}

impl MonteCarlo {
    /// The name in messages and commands.
    pub const NAME: &str = "monte_carlo";
}

impl Default for MonteCarlo {
    fn default() -> MonteCarlo {
        MonteCarlo {
            budget: Budget::Time(Duration::from_millis(50)),
            rollouts: AgentKind::Trained,
            prior: AgentKind::Trained,
            margin: 3.0,
        }
    }
}

/// Why a text names no agent that searches.
#[derive(Clone, Eq, PartialEq, Debug, Error)]
#[error(
    "{0}: write monte_carlo, monte_carlo:50ms, monte_carlo:64 (rollouts) or monte_carlo:50ms:greedy (the agent of the rollouts: random, greedy or trained)"
)]
pub struct MonteCarloError(String);

impl FromStr for MonteCarlo {
    type Err = MonteCarloError;

    fn from_str(text: &str) -> Result<MonteCarlo, MonteCarloError> {
        let mut agent = MonteCarlo::default();
        let mut parts = text.split(':');
        let named = parts.next() == Some(MonteCarlo::NAME);
        let budget = parts.next().map(|budget| match budget.strip_suffix("ms") {
            Some(ms) => (ms.parse().ok())
                .filter(|ms| (1..=MAX_MS).contains(ms))
                .map(|ms| Budget::Time(Duration::from_millis(ms))),
            None => (budget.parse().ok())
                .filter(|rollouts| (1..=MAX_ROLLOUTS).contains(rollouts))
                .map(Budget::Rollouts),
        });
        let policy = parts.next().map(|policy| {
            AgentKind::from_name(policy).filter(|kind| *kind != AgentKind::RandomUnmasked)
        });
        if let (true, Some(budget), Some(policy), None) = (
            named,
            budget.unwrap_or(Some(agent.budget)),
            policy.unwrap_or(Some(agent.rollouts)),
            parts.next(),
        ) {
            (agent.budget, agent.rollouts) = (budget, policy);
            return Ok(agent);
        }
        Err(MonteCarloError(text.to_owned()))
    }
}

impl fmt::Display for MonteCarlo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.budget {
            Budget::Rollouts(rollouts) => write!(f, "{}:{rollouts}", MonteCarlo::NAME)?,
            Budget::Time(time) => write!(f, "{}:{}ms", MonteCarlo::NAME, time.as_millis())?,
        }
        write!(f, ":{}", self.rollouts.name())
    }
}

impl AgentMaker for MonteCarlo {
    fn agent(&self, rules: &RuleSet, seed: [u8; 32]) -> BuiltInAgent {
        self.agent_on(rules, seed, None)
    }
}

impl MonteCarlo {
    /// The agent for a seat of a game under these rules, on the threads of a pool or on the caller's
    /// alone. `seed` determines its random choices.
    pub fn agent_on(
        self,
        rules: &RuleSet,
        seed: [u8; 32],
        pool: Option<Arc<ThreadPool>>,
    ) -> BuiltInAgent {
        self.counted(rules, seed, pool, Arc::default())
    }

    fn counted(
        self,
        rules: &RuleSet,
        seed: [u8; 32],
        pool: Option<Arc<ThreadPool>>,
        decisions: Arc<Decisions>,
    ) -> BuiltInAgent {
        BuiltInAgent::following(Box::new(Player {
            plays: self,
            rules: *rules,
            prior: BuiltInAgent::new(self.prior, seed),
            chance: Chance::stream(seed, 1),
            history: None,
            pool,
            decisions,
        }))
    }
}

/// Agents that count how they take their decisions.
#[derive(Clone, Debug)]
pub struct CountedMonteCarlo {
    /// How they play.
    pub plays: MonteCarlo,
    /// The decisions of all of them.
    pub decisions: Arc<Decisions>,
}

impl AgentMaker for CountedMonteCarlo {
    fn agent(&self, rules: &RuleSet, seed: [u8; 32]) -> BuiltInAgent {
        (self.plays).counted(rules, seed, None, Arc::clone(&self.decisions))
    }
}

/// Numbers of decisions with more than one legal action, by how they were taken.
#[derive(Debug, Default)]
pub struct Decisions {
    searched: AtomicU64,
    too_many_deals: AtomicU64,
    history_unknown: AtomicU64,
}

impl Decisions {
    /// Those that were searched.
    pub fn searched(&self) -> u64 {
        self.searched.load(Ordering::Relaxed)
    }

    /// Those played as the prior does because there were too many possible deals to count.
    pub fn too_many_deals(&self) -> u64 {
        self.too_many_deals.load(Ordering::Relaxed)
    }

    /// Those played as the prior does because the agent did not see the Shift from its start. 0 if it
    /// sees all events of its games.
    pub fn history_unknown(&self) -> u64 {
        self.history_unknown.load(Ordering::Relaxed)
    }

    fn count(&self, sampler: Result<&Sampler, &KnowledgeError>) {
        let number = match sampler {
            Ok(_) => &self.searched,
            Err(KnowledgeError::TooManySteps(_)) => &self.too_many_deals,
            Err(_) => &self.history_unknown,
        };
        number.fetch_add(1, Ordering::Relaxed);
    }
}

/// The action with the surest gain over the first: one that was tried to the end and gains more than
/// `margin` standard errors. What was dropped before has few deals, in which it may have been lucky.
fn surely_better(estimates: &[Estimate], margin: f64) -> Option<ActionId> {
    let deals = estimates[0].rollouts.max(MIN_DEALS);
    estimates[1..]
        .iter()
        .filter(|found| found.rollouts >= deals)
        .map(|found| (found.gain() - margin * found.gain_error(), found.action))
        .filter(|(gain, _)| *gain > 0.0)
        .max_by(|(a, _), (b, _)| a.total_cmp(b))
        .map(|(_, action)| action)
}

/// The agent of one seat.
#[derive(Clone, Debug)]
struct Player {
    plays: MonteCarlo,
    rules: RuleSet,
    prior: BuiltInAgent,
    chance: Chance,
    history: Option<ShiftHistory>,
    pool: Option<Arc<ThreadPool>>,
    decisions: Arc<Decisions>,
}

impl Following for Player {
    fn name(&self) -> &'static str {
        MonteCarlo::NAME
    }

    fn on_event(&mut self, seat: Seat, event: &Event) {
        self.history
            .get_or_insert_with(|| ShiftHistory::new(seat))
            .on_event(event);
    }

    fn decide(&mut self, observation: &Observation, legal: &Mask) -> ActionId {
        let start = Instant::now();
        let prior = self.prior.decide(observation, legal);
        if legal.len() <= 1 {
            return prior;
        }
        let sampler = self.sampler(observation);
        self.decisions.count(sampler.as_ref());
        let Ok(sampler) = sampler else {
            return prior;
        };
        let others = legal.iter().filter(|action| *action != prior);
        let actions: Vec<ActionId> = std::iter::once(prior).chain(others).collect();
        let method = Method {
            policy: RolloutPolicy::Kind(self.plays.rollouts),
            allocation: Allocation::Halving,
        };
        let budget = self.plays.budget;
        let progress = |rollouts: u64| match budget {
            Budget::Rollouts(all) => rollouts as f64 / all as f64,
            Budget::Time(time) => start.elapsed().as_secs_f64() / time.as_secs_f64(),
        };
        let seed = self.chance.seed();
        let estimates = evaluate(
            &sampler,
            &actions,
            &method,
            seed,
            self.pool.as_deref(),
            progress,
        );
        surely_better(&estimates, self.plays.margin).unwrap_or(prior)
    }

    fn boxed_clone(&self) -> Box<dyn Following> {
        Box::new(self.clone())
    }
}

impl Player {
    /// The deals that are possible. An error if there are too many to count, or the history of the
    /// Shift is not known from its start.
    fn sampler(&self, observation: &Observation) -> Result<Sampler, KnowledgeError> {
        let history = self.history.as_ref().ok_or(KnowledgeError::History)?;
        let knowledge = Knowledge::new(self.rules, observation, history)?;
        Sampler::new(knowledge, MAX_STEPS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rollout::Worth;

    /// An estimate of an action with these points, where the first action has 1.
    fn estimate(action: u16, points: &[u32]) -> Estimate {
        let worth = |points| Worth { points, place: 1 };
        let mut estimate = Estimate::new(ActionId::new(action));
        (points.iter()).for_each(|&points| estimate.add(worth(points), worth(1)));
        estimate
    }

    #[test]
    fn only_actions_tried_to_the_end_are_taken() {
        let first = estimate(0, &[1; 40]);
        let good = estimate(1, &[3, 2].repeat(20));
        // Four lucky deals have no error.
        let dropped = estimate(2, &[5; 4]);
        assert_eq!((dropped.gain(), dropped.gain_error()), (4.0, 0.0));
        let check = |others: &[Estimate], expected: Option<u16>| {
            let estimates = [&[first], others].concat();
            let found = surely_better(&estimates, 3.0);
            assert_eq!(found, expected.map(ActionId::new), "{others:?}");
        };
        check(&[good, dropped], Some(1));
        check(&[dropped, good], Some(1));
        check(&[dropped], None);
        // Within the margin, and a loss.
        check(&[estimate(3, &[0, 0, 5, 0].repeat(10))], None);
        check(&[estimate(4, &[0; 40])], None);
    }

    #[test]
    fn few_deals_show_no_gain() {
        let check = |deals: usize, expected: Option<u16>| {
            let estimates =
                [0, 1].map(|action| estimate(action, &[1 + u32::from(action); 40][..deals]));
            let found = surely_better(&estimates, 3.0);
            assert_eq!(found, expected.map(ActionId::new), "{deals}");
        };
        check(4, None);
        check(15, None);
        check(16, Some(1));
    }
}
