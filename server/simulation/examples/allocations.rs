//! Which way of sharing rollouts among the actions plays best? Compares sequential halving, as
//! `monte_carlo` has it, with PUCT on duplicate deals. docs/search.md shows the result.

use std::num::NonZeroU32;
use std::sync::Arc;

use chefshat_agents::{
    AgentKind, AgentMaker, Budget, BuiltInAgent, Following, MonteCarlo, Network,
};
use chefshat_engine::{ActionId, Event, Mask, Observation, RuleSet, RuleSetSpec, Seat};
use chefshat_search::{
    Chance, Knowledge, MARGIN, RolloutPolicy, Sampler, Searchers, ShiftHistory, rollouts,
};
use chefshat_simulation::{Comparison, Contender, Duplicate, SeatPlan};
use clap::{Parser, ValueEnum};
use serde_json::json;

/// Steps of counting deals that a decision takes at most, as in `monte_carlo`.
const MAX_STEPS: u64 = 200_000;
/// Fewest deals that can show a gain, as in `monte_carlo`.
const MIN_DEALS: usize = 16;
/// Weight of the prior against the values, which are shares of the highest points. Between those
/// usual for values from 0 to 1.
const EXPLORATION: f64 = 1.25;

/// Measure how well an agent plays that shares its rollouts in one of three ways, one seat against
/// three `trained` on duplicate deals.
///
/// `halving` is monte_carlo. `puct` shares rollouts by PUCT, with the probabilities of `trained` as
/// prior, and takes the most tried action; `puct-margin` takes an action other than that of `trained`
/// only if it gains by more than three standard errors in the deals in which both were tried, as
/// monte_carlo does. Each has the same deals, rollouts by `trained`, and number of rollouts.
#[derive(Debug, Parser)]
#[command(
    after_help = "Example:\n  cargo run --release -p chefshat-simulation --example allocations -- puct --deals 200"
)]
struct Arguments {
    /// How rollouts are shared.
    share: Share,
    /// Rollouts of a decision.
    #[arg(long, default_value_t = 400, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    rollouts: u64,
    /// Number of deals, each played in all four seatings.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u64).range(2..))]
    deals: u64,
    /// Number of Shifts in each game.
    #[arg(long, default_value = "4")]
    shifts: NonZeroU32,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Share {
    Halving,
    Puct,
    PuctMargin,
}

fn main() {
    let arguments = Arguments::parse();
    let comparison = compared(&arguments);
    let points = &comparison.points;
    let report = json!({
        "experiment": "allocations",
        "share": arguments.share.to_possible_value().expect("no value is hidden").get_name(),
        "rollouts": arguments.rollouts,
        "deals": comparison.deals,
        "seed": arguments.seed,
        "shifts": comparison.shifts,
        "points": points.a(),
        "trained": points.b(),
        "difference": points.difference(),
        "standard_error": points.standard_error(),
    });
    println!("{report}");
}

fn compared(arguments: &Arguments) -> Comparison {
    let rules = RuleSetSpec::default()
        .validate()
        .expect("the default rules");
    let agent: Arc<dyn AgentMaker> = match arguments.share {
        Share::Halving => Arc::new(Searchers::new(MonteCarlo {
            budget: Budget::Rollouts(arguments.rollouts),
            ..MonteCarlo::default()
        })),
        share => Arc::new(Puct {
            rollouts: arguments.rollouts,
            needs_margin: share == Share::PuctMargin,
        }),
    };
    let contenders = [Contender::Made(agent), Contender::Kind(AgentKind::Trained)];
    let (plan, deals) = (SeatPlan::One, arguments.deals);
    Duplicate::new(rules, arguments.shifts, plan, deals, arguments.seed)
        .and_then(|duplicate| duplicate.run(&contenders, &|_| {}))
        .expect("valid contenders")
}

/// Agents that share rollouts by PUCT.
#[derive(Debug, Clone, Copy)]
struct Puct {
    rollouts: u64,
    needs_margin: bool,
}

impl AgentMaker for Puct {
    fn agent(&self, rules: &RuleSet, seed: [u8; 32]) -> BuiltInAgent {
        BuiltInAgent::following(Box::new(Player {
            plays: *self,
            rules: *rules,
            chance: Chance::stream(seed, 1),
            history: None,
        }))
    }
}

/// The agent of one seat.
#[derive(Debug, Clone)]
struct Player {
    plays: Puct,
    rules: RuleSet,
    chance: Chance,
    history: Option<ShiftHistory>,
}

/// An action and what it was worth in the first deals, one for each of its rollouts.
struct Arm {
    action: ActionId,
    prior: f64,
    worths: Vec<f64>,
    sum: f64,
}

impl Following for Player {
    fn name(&self) -> &'static str {
        "puct"
    }

    fn on_event(&mut self, seat: Seat, event: &Event) {
        self.history
            .get_or_insert_with(|| ShiftHistory::new(seat))
            .on_event(event);
    }

    fn decide(&mut self, observation: &Observation, legal: &Mask) -> ActionId {
        let mut arms = arms(observation, legal);
        if let [only] = &*arms {
            return only.action;
        }
        let history = self.history.as_ref().expect("it sees all events");
        let knowledge = Knowledge::new(self.rules, observation, history).expect("a whole Shift");
        let seed = self.chance.seed();
        // Too many deals to count: plays as `trained`.
        if let Ok(sampler) = Sampler::new(knowledge, MAX_STEPS) {
            for done in 0..self.plays.rollouts {
                let next = most_promising(&arms, done);
                try_once(&mut arms[next], &sampler, seed);
            }
        }
        match self.plays.needs_margin {
            true => surely_better(&arms),
            false => (arms.iter().rev())
                .max_by_key(|arm| arm.worths.len())
                .map_or(arms[0].action, |arm| arm.action),
        }
    }

    fn boxed_clone(&self) -> Box<dyn Following> {
        Box::new(self.clone())
    }
}

/// The legal actions with the probabilities of `trained`, the most likely one first.
fn arms(observation: &Observation, legal: &Mask) -> Vec<Arm> {
    let network = Network::trained();
    let outputs = network.outputs(&network.features(observation, legal));
    let output = |action: ActionId| f64::from(outputs[usize::from(action.index())]);
    let highest = legal.iter().map(output).fold(f64::NEG_INFINITY, f64::max);
    let weight = |action| (output(action) - highest).exp();
    let all: f64 = legal.iter().map(weight).sum();
    let mut arms: Vec<Arm> = (legal.iter())
        .map(|action| Arm {
            action,
            prior: weight(action) / all,
            worths: Vec::new(),
            sum: 0.0,
        })
        .collect();
    arms.sort_by(|a, b| b.prior.total_cmp(&a.prior));
    arms
}

/// The arm that PUCT tries next. One that has not been tried has the mean of all rollouts.
fn most_promising(arms: &[Arm], done: u64) -> usize {
    let mean = arms.iter().map(|arm| arm.sum).sum::<f64>() / (done.max(1) as f64);
    let score = |arm: &Arm| {
        let tried = arm.worths.len() as f64;
        let value = if tried > 0.0 { arm.sum / tried } else { mean };
        value + EXPLORATION * arm.prior * (done as f64).sqrt() / (1.0 + tried)
    };
    let scores = arms.iter().map(score).enumerate();
    let best = scores.rev().max_by(|(_, a), (_, b)| a.total_cmp(b));
    best.expect("there are legal actions").0
}

/// Tries an action in the next of the deals, which are the same for all actions.
fn try_once(arm: &mut Arm, sampler: &Sampler, seed: [u8; 32]) {
    let mut chance = Chance::stream(seed, arm.worths.len() as u64);
    let game = sampler.game(&mut chance).closing_copy();
    let seat = sampler.knowledge().seat();
    let most = (game.rules().points(1)).max(1);
    let policy = RolloutPolicy::Kind(AgentKind::Trained);
    let start = (game, arm.action, chance.seed());
    let worth = rollouts([start], seat, &policy)[0];
    let worth = f64::from(worth.points) / f64::from(most);
    arm.sum += worth;
    arm.worths.push(worth);
}

/// The action with the surest gain over the first, in the deals in which both were tried.
fn surely_better(arms: &[Arm]) -> ActionId {
    let gain = |arm: &Arm| {
        let pairs = arm.worths.iter().zip(&arms[0].worths);
        let gains: Vec<f64> = pairs.map(|(worth, first)| worth - first).collect();
        let count = gains.len() as f64;
        let mean = gains.iter().sum::<f64>() / count;
        let squares: f64 = gains.iter().map(|gain| (gain - mean).powi(2)).sum();
        let error = (squares / (count * (count - 1.0))).sqrt();
        (gains.len() >= MIN_DEALS).then_some(mean - MARGIN * error)
    };
    (arms[1..].iter())
        .filter_map(|arm| Some((gain(arm)?, arm.action)))
        .filter(|(gain, _)| *gain > 0.0)
        .max_by(|(a, _), (b, _)| a.total_cmp(b))
        .map_or(arms[0].action, |(_, action)| action)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_ways_play_and_repeat() {
        let run = |share| {
            let comparison = compared(&Arguments {
                share,
                rollouts: 20,
                deals: 2,
                shifts: NonZeroU32::MIN,
                seed: 1,
            });
            assert_eq!(comparison.shifts, 8);
            comparison.points.a()
        };
        for share in [Share::Halving, Share::Puct, Share::PuctMargin] {
            assert!((run(share) - run(share)).abs() < f64::EPSILON);
        }
    }

    #[test]
    fn puct_tries_likely_and_good_actions_most() {
        let arm = |prior, worths: &[f64]| Arm {
            action: ActionId::new(0),
            prior,
            worths: worths.to_vec(),
            sum: worths.iter().sum(),
        };
        assert_eq!(most_promising(&[arm(0.6, &[]), arm(0.4, &[])], 0), 0);
        let tried = [arm(0.6, &[0.0; 8]), arm(0.4, &[])];
        assert_eq!(most_promising(&tried, 8), 1);
        let good = [arm(0.6, &[0.0; 100]), arm(0.4, &[1.0; 100])];
        assert_eq!(most_promising(&good, 200), 1);
    }
}
