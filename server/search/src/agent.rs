//! The agent `monte_carlo`: starts from what a policy would do and deviates where rollouts in
//! possible deals show that another action gains points.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use chefshat_agents::{AgentKind, AgentMaker, BuiltInAgent, Following};
use chefshat_engine::{ActionId, Event, Mask, Observation, RuleSet, Seat};
use rayon::ThreadPool;
use thiserror::Error;

use crate::{Allocation, Chance, Knowledge, Method, Sampler, ShiftHistory, evaluate};

/// Steps of counting deals that the agent spends on a decision at most.
const MAX_STEPS: u64 = 200_000;
/// The most rollouts of a decision.
const MAX_ROLLOUTS: u64 = 1_000_000;
/// The most milliseconds of a decision.
const MAX_MS: u64 = 60_000;

/// What a decision may cost.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub enum Budget {
    /// This many rollouts: the same seed plays the same game.
    Rollouts(u64),
    /// This much time.
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
        BuiltInAgent::following(Box::new(Player {
            plays: self,
            rules: *rules,
            prior: BuiltInAgent::new(self.prior, seed),
            chance: Chance::stream(seed, 1),
            history: None,
            pool,
        }))
    }
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
        let Some(sampler) = self.sampler(observation) else {
            return prior;
        };
        let others = legal.iter().filter(|action| *action != prior);
        let actions: Vec<ActionId> = std::iter::once(prior).chain(others).collect();
        let method = Method {
            policy: self.plays.rollouts,
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
            method,
            seed,
            self.pool.as_deref(),
            progress,
        );
        // Gains below the margin may be luck.
        let sure = |gain: f64, error: f64| gain - self.plays.margin * error;
        estimates[1..]
            .iter()
            .map(|found| (sure(found.gain(), found.gain_error()), found.action))
            .filter(|(gain, _)| *gain > 0.0)
            .max_by(|(a, _), (b, _)| a.total_cmp(b))
            .map_or(prior, |(_, action)| action)
    }

    fn boxed_clone(&self) -> Box<dyn Following> {
        Box::new(self.clone())
    }
}

impl Player {
    /// The deals that are possible; `None` if there are too many to count, or the history of the
    /// Shift is not known from its start.
    fn sampler(&self, observation: &Observation) -> Option<Sampler> {
        let history = self.history.as_ref()?;
        let knowledge = Knowledge::new(self.rules, observation, history).ok()?;
        Sampler::new(knowledge, MAX_STEPS).ok()
    }
}
