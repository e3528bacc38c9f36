//! The agent `monte_carlo`: starts from what a policy would do and deviates where rollouts in
//! possible deals show that another action gains points.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use chefshat_agents::{
    AgentMaker, Budget, BuiltInAgent, Following, MonteCarlo, NamedAgent, Network,
};
use chefshat_engine::{ActionId, Event, Mask, Observation, RuleSet, Seat};
use rayon::ThreadPool;

use crate::{
    Allocation, Belief, Chance, Estimate, Knowledge, KnowledgeError, Method, OwnTime,
    RolloutPolicy, Sampler, ShiftHistory, evaluate,
};

/// Steps of counting deals that the agent spends on a decision at most.
const MAX_STEPS: u64 = 200_000;
/// How many standard errors the gain of an action must exceed 0 for `monte_carlo` to take it.
pub const MARGIN: f64 = 3.0;
/// Fewest deals that can show a gain: a few are often equal by chance, and their standard error 0.
const MIN_DEALS: u64 = 16;

/// Creates the agent of a name for a seat of a game under these rules. One that searches does so on
/// the caller's thread. `seed` determines its random choices.
pub fn named_agent(named: NamedAgent, rules: &RuleSet, seed: [u8; 32]) -> BuiltInAgent {
    match named {
        NamedAgent::Kind(kind) => BuiltInAgent::new(kind, seed),
        NamedAgent::MonteCarlo(plays) => Searchers::new(plays).agent(rules, seed),
    }
}

/// Creates agents that search, and counts how they take their decisions.
#[derive(Clone, Debug)]
pub struct Searchers {
    /// How they play.
    pub plays: MonteCarlo,
    /// The threads on which they search; `None`: the caller's alone.
    pub pool: Option<Arc<ThreadPool>>,
    /// The decisions of all of them.
    pub decisions: Arc<Decisions>,
}

impl Searchers {
    /// Agents that search on their caller's thread.
    pub fn new(plays: MonteCarlo) -> Searchers {
        Searchers {
            plays,
            pool: None,
            decisions: Arc::default(),
        }
    }
}

impl AgentMaker for Searchers {
    fn agent(&self, rules: &RuleSet, seed: [u8; 32]) -> BuiltInAgent {
        BuiltInAgent::following(Box::new(Player {
            plays: self.clone(),
            rules: *rules,
            prior: BuiltInAgent::new(self.plays.prior, seed),
            chance: Chance::stream(seed, 1),
            history: None,
        }))
    }
}

/// Numbers of decisions with more than one legal action, by how they were taken.
#[derive(Debug, Default)]
pub struct Decisions {
    searched: AtomicU64,
    rollouts: AtomicU64,
    too_many_deals: AtomicU64,
    history_unknown: AtomicU64,
}

impl Decisions {
    /// Those that were searched.
    pub fn searched(&self) -> u64 {
        self.searched.load(Ordering::Relaxed)
    }

    /// The rollouts of all of them.
    pub fn rollouts(&self) -> u64 {
        self.rollouts.load(Ordering::Relaxed)
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

    fn count(&self, found: Result<&[Estimate], &KnowledgeError>) {
        let number = match found {
            Ok(estimates) => {
                let rollouts = estimates.iter().map(|it| it.rollouts).sum();
                self.rollouts.fetch_add(rollouts, Ordering::Relaxed);
                &self.searched
            }
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

/// Whether every action was tried in too few deals to show a gain.
pub fn show_nothing(estimates: &[Estimate]) -> bool {
    estimates.iter().all(|it| it.rollouts < MIN_DEALS)
}

/// A decision of a seat, and what the seat saw of the Shift.
#[derive(Clone, Debug)]
pub struct Choice<'a> {
    /// The rules.
    pub rules: RuleSet,
    /// What the seat sees.
    pub observation: &'a Observation,
    /// The legal actions.
    pub legal: &'a Mask,
    /// The events of the Shift.
    pub history: &'a ShiftHistory,
    /// The action of the prior.
    pub prior: ActionId,
}

impl Choice<'_> {
    /// Searches as `monte_carlo` does. `stopped` ends the search early.
    ///
    /// # Errors
    /// Nothing can be searched: there are too many possible deals to count, or the history of the
    /// Shift is not known from its start.
    pub fn search(
        &self,
        plays: MonteCarlo,
        seed: [u8; 32],
        pool: Option<&ThreadPool>,
        stopped: impl Fn() -> bool,
    ) -> Result<ActionId, KnowledgeError> {
        let estimates = self.estimates(plays, Allocation::Halving, seed, pool, stopped)?;
        Ok(suggested(&estimates))
    }

    /// Estimates of all legal actions within the budget, first that of the prior. `stopped` ends the
    /// search early. A budget in time counts what this thread computes, not what it waits for; with a
    /// pool, the time that passes.
    ///
    /// # Errors
    /// As [`Choice::search`].
    pub fn estimates(
        &self,
        plays: MonteCarlo,
        allocation: Allocation,
        seed: [u8; 32],
        pool: Option<&ThreadPool>,
        stopped: impl Fn() -> bool,
    ) -> Result<Vec<Estimate>, KnowledgeError> {
        let time_used = OwnTime::of_search(pool);
        let knowledge = Knowledge::new(self.rules, self.observation, self.history)?;
        let sampler = Sampler::new(knowledge, MAX_STEPS)?;
        let others = self.legal.iter().filter(|action| *action != self.prior);
        let actions: Vec<ActionId> = std::iter::once(self.prior).chain(others).collect();
        let belief = (plays.belief).then(|| Belief::of(Network::trained(), &self.rules));
        let method = Method {
            policy: RolloutPolicy::Kind(plays.rollouts),
            allocation,
            belief: belief.flatten(),
        };
        let progress = |rollouts: u64| match plays.budget {
            _ if stopped() => 1.0,
            Budget::Rollouts(all) => rollouts as f64 / all as f64,
            Budget::Time(time) => time_used.used().as_secs_f64() / time.as_secs_f64(),
        };
        Ok(evaluate(&sampler, &actions, &method, seed, pool, progress))
    }
}

/// The action that `monte_carlo` takes by these estimates: the first, unless another surely gains
/// points.
///
/// # Panics
/// If there are none.
pub fn suggested(estimates: &[Estimate]) -> ActionId {
    surely_better(estimates, MARGIN).unwrap_or(estimates[0].action)
}

/// The agent of one seat.
#[derive(Clone, Debug)]
struct Player {
    plays: Searchers,
    rules: RuleSet,
    prior: BuiltInAgent,
    chance: Chance,
    history: Option<ShiftHistory>,
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
        let prior = self.prior.decide(observation, legal);
        if legal.len() <= 1 {
            return prior;
        }
        let found = self.search(observation, legal, prior);
        self.plays.decisions.count(found.as_deref());
        found.map_or(prior, |estimates| suggested(&estimates))
    }

    fn boxed_clone(&self) -> Box<dyn Following> {
        Box::new(self.clone())
    }
}

impl Player {
    fn search(
        &mut self,
        observation: &Observation,
        legal: &Mask,
        prior: ActionId,
    ) -> Result<Vec<Estimate>, KnowledgeError> {
        let choice = Choice {
            rules: self.rules,
            observation,
            legal,
            history: self.history.as_ref().ok_or(KnowledgeError::History)?,
            prior,
        };
        let Searchers { plays, pool, .. } = &self.plays;
        let seed = self.chance.seed();
        choice.estimates(*plays, Allocation::Halving, seed, pool.as_deref(), || false)
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
            assert_eq!(show_nothing(&estimates), expected.is_none(), "{deals}");
        };
        check(4, None);
        check(15, None);
        check(16, Some(1));
    }
}
