//! Built-in agents by name, as messages, commands, records and databases write them. `chefshat-search`
//! plays `monte_carlo`; only its name and settings are here.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use thiserror::Error;

use crate::AgentKind;
use crate::text::shortened;

/// The most rollouts of a decision.
const MAX_ROLLOUTS: u64 = 1_000_000;
/// The most milliseconds of a decision.
const MAX_MS: u64 = 60_000;

/// A built-in agent that needs nothing but a seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NamedAgent {
    /// One that answers at once.
    Kind(AgentKind),
    /// One that searches.
    MonteCarlo(MonteCarlo),
}

impl NamedAgent {
    /// All names, without settings.
    pub const NAMES: [&str; 5] = [
        AgentKind::Random.name(),
        AgentKind::RandomUnmasked.name(),
        AgentKind::Greedy.name(),
        AgentKind::Trained.name(),
        MonteCarlo::NAME,
    ];

    /// How the agent searches, if it does.
    pub fn search(self) -> Option<MonteCarlo> {
        match self {
            Self::Kind(_) => None,
            Self::MonteCarlo(plays) => Some(plays),
        }
    }

    /// The agent itself, or what an agent that searches plays if it does not search.
    pub fn without_search(self) -> AgentKind {
        match self {
            Self::Kind(kind) => kind,
            Self::MonteCarlo(plays) => plays.prior,
        }
    }

    /// The name with its settings.
    pub fn name(self) -> String {
        self.to_string()
    }
}

impl Default for NamedAgent {
    fn default() -> Self {
        Self::Kind(AgentKind::default())
    }
}

impl From<AgentKind> for NamedAgent {
    fn from(kind: AgentKind) -> Self {
        Self::Kind(kind)
    }
}

impl fmt::Display for NamedAgent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Kind(kind) => f.write_str(kind.name()),
            Self::MonteCarlo(plays) => plays.fmt(f),
        }
    }
}

/// Why a text names no built-in agent.
#[derive(Clone, Eq, PartialEq, Debug, Error)]
pub enum AgentNameError {
    /// No such agent.
    #[error("{0:?} is not a built-in agent; use one of {names}", names = NamedAgent::NAMES.join(", "))]
    Unknown(String),
    /// The settings of `monte_carlo` are invalid.
    #[error(transparent)]
    MonteCarlo(#[from] MonteCarloError),
}

impl FromStr for NamedAgent {
    type Err = AgentNameError;

    fn from_str(text: &str) -> Result<Self, AgentNameError> {
        if text.split(':').next() == Some(MonteCarlo::NAME) {
            return Ok(Self::MonteCarlo(text.parse()?));
        }
        AgentKind::from_name(text)
            .map(Self::Kind)
            .ok_or_else(|| AgentNameError::Unknown(shortened(text)))
    }
}

/// What a decision may cost. Every legal action is tried in 4 deals at least, even if that costs
/// more.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub enum Budget {
    /// About this many rollouts: the same seed plays the same game.
    Rollouts(u64),
    /// About this much time, counting the possible deals included.
    Time(Duration),
}

/// How the agent `monte_carlo` plays. As text: `monte_carlo`, then optionally `:` and the budget of a
/// decision (`50ms` or a number of rollouts), then optionally `:` and the agent of the rollouts, then
/// optionally `:belief`.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub struct MonteCarlo {
    /// What a decision may cost.
    pub budget: Budget,
    /// The agents of the rollouts.
    pub rollouts: AgentKind,
    /// Whether deals are likelier in which `trained` would have decided as the others did.
    pub belief: bool,
    /// The agent whose action is taken unless another gains points. The text does not set it.
    pub prior: AgentKind,
}

impl MonteCarlo {
    /// The name in messages and commands.
    pub const NAME: &str = "monte_carlo";
    /// The word for [`MonteCarlo::belief`].
    const BELIEF: &str = "belief";
}

impl Default for MonteCarlo {
    fn default() -> Self {
        Self {
            budget: Budget::Time(Duration::from_millis(50)),
            rollouts: AgentKind::Trained,
            belief: false,
            prior: AgentKind::Trained,
        }
    }
}

/// Why a text names no agent that searches.
#[derive(Clone, Eq, PartialEq, Debug, Error)]
#[error(
    "{0}: write monte_carlo, monte_carlo:50ms, monte_carlo:64 (rollouts) or monte_carlo:50ms:greedy (the agent of the rollouts: random, greedy or trained), and :belief after any of them"
)]
pub struct MonteCarloError(String);

impl FromStr for MonteCarlo {
    type Err = MonteCarloError;

    fn from_str(text: &str) -> Result<Self, MonteCarloError> {
        let mut agent = Self::default();
        let believes = text
            .strip_suffix(Self::BELIEF)
            .and_then(|rest| rest.strip_suffix(':'));
        agent.belief = believes.is_some();
        let mut parts = believes.unwrap_or(text).split(':');
        let named = parts.next() == Some(Self::NAME);
        let budget = parts.next().map(|budget| match budget.strip_suffix("ms") {
            Some(ms) => (ms.parse().ok())
                .filter(|ms| (1..=MAX_MS).contains(ms))
                .map(|ms| Budget::Time(Duration::from_millis(ms))),
            None => (budget.parse().ok())
                .filter(|rollouts| (1..=MAX_ROLLOUTS).contains(rollouts))
                .map(Budget::Rollouts),
        });
        let policy = parts.next().map(AgentKind::of_rollouts);
        if let (true, Some(budget), Some(policy), None) = (
            named,
            budget.unwrap_or(Some(agent.budget)),
            policy.unwrap_or(Some(agent.rollouts)),
            parts.next(),
        ) {
            (agent.budget, agent.rollouts) = (budget, policy);
            return Ok(agent);
        }
        Err(MonteCarloError(shortened(text)))
    }
}

/// The default agent of the rollouts is left out.
impl fmt::Display for MonteCarlo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.budget {
            Budget::Rollouts(rollouts) => write!(f, "{}:{rollouts}", Self::NAME)?,
            Budget::Time(time) => write!(f, "{}:{}ms", Self::NAME, time.as_millis())?,
        }
        if self.rollouts != Self::default().rollouts {
            write!(f, ":{}", self.rollouts.name())?;
        }
        if self.belief {
            write!(f, ":{}", Self::BELIEF)?;
        }
        Ok(())
    }
}
