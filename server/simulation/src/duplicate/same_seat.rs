//! Compares two agents that never meet: each plays the same seats against the same others. Measures
//! how much duplicate deals reduce the error of the difference, as in a tournament where replicas
//! of a deal go to different participants. For two agents at one table see [`super::Duplicate`].

use chefshat_engine::{ActionId, Event, MAX_SEATS, Mask, Observation, RuleSet, Seat};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

use super::Contender;
use crate::Progress;
use crate::batch::Silent;
use crate::fold::fold_in_order;
use chefshat_agents::seating_agent_seed;
use chefshat_agents::{BuiltInAgent, Following, game_seed, play_agents};
use chefshat_tournament::statistics::Moments;

/// Deals played by one thread at a time. Part of the result: it decides how figures are grouped for
/// summing.
const CHUNK: u64 = 4;

/// One of the two compared agents.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// The agent.
    pub plays: Contender,
    /// Probability of a random legal action instead, from 0 to 1 and rounded to whole percent.
    /// Makes two agents similar but not identical.
    pub epsilon: f64,
}

/// A comparison of two candidates in the same seats.
#[derive(Debug, Clone)]
pub struct SameSeat {
    /// The rule set.
    pub rules: RuleSet,
    /// The two candidates.
    pub candidates: [Candidate; 2],
    /// The agent on all other seats.
    pub others: Contender,
    /// The seed of all randomness.
    pub seed: u64,
}

/// The result after a number of games of each. A game is worth the rule set's points for the place
/// in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Games of each.
    pub games: u64,
    /// Mean of the first minus that of the second, on the same deals.
    pub difference: f64,
    /// Its standard error; infinite with fewer than two games.
    pub duplicate_error: f64,
    /// The standard error with independent deals, from as many other games of the second.
    pub independent_error: f64,
}

/// Sums over games: scores of the first, scores of the second on other deals, differences on the
/// same deals.
#[derive(Debug, Clone, Copy, Default)]
struct Sums([Moments; 3]);

impl SameSeat {
    /// Plays as many games of each as the last of these ascending numbers, and returns the result
    /// after each of them. Runs on the current rayon pool, which does not affect the result.
    /// `progress` is called from any thread with the number of games finished since its last call.
    pub fn measure(&self, games: &[u64], progress: Progress<'_>) -> Vec<Measured> {
        let all = games.last().copied().unwrap_or(0);
        let mut sums = Sums::default();
        let mut played = 0;
        games
            .iter()
            .map(|&until| {
                let first = played;
                let more = fold_in_order(
                    until.saturating_sub(first),
                    CHUNK,
                    Sums::default,
                    |sums, game| {
                        self.add(sums, first + game, all);
                        progress(3);
                    },
                    |all, more| all.merge(&more),
                );
                sums.merge(&more);
                played = until.max(first);
                sums.measured()
            })
            .collect()
    }

    /// Adds a deal, and another one `apart` further on for the second candidate alone.
    fn add(&self, sums: &mut Sums, deal: u64, apart: u64) {
        let first = self.score(0, deal);
        let second = self.score(1, deal);
        sums.0[0].add(first);
        sums.0[1].add(self.score(1, deal.saturating_add(apart)));
        sums.0[2].add(first - second);
    }

    /// The points of a candidate on a deal, in the seat that follows from the deal's number.
    fn score(&self, who: usize, deal: u64) -> f64 {
        let seed = game_seed(self.seed, deal);
        let players = self.rules.players();
        let own = Seat::new((deal % players as u64) as usize);
        let candidate = &self.candidates[who];
        let mut agents: [BuiltInAgent; MAX_SEATS] = std::array::from_fn(|index| {
            let seat = Seat::new(index);
            let contender = if seat == own {
                &candidate.plays
            } else {
                &self.others
            };
            contender.agent(&self.rules, seating_agent_seed(seed, who, seat))
        });
        let percent = (100.0 * candidate.epsilon).round() as u64;
        if percent > 0 {
            let agent = agents[own.index()].clone();
            // No agent has this seed: agents use the first two seatings.
            let chance = ChaCha8Rng::from_seed(seating_agent_seed(seed, 2 + who, own));
            agents[own.index()] = BuiltInAgent::following(Box::new(Exploring {
                agent,
                percent,
                chance,
            }));
        }
        let standings = play_agents(self.rules, seed, None, &mut agents, &mut Silent);
        let place = standings.iter().find(|(_, seat, _)| *seat == own);
        let (place, _, _) = place.expect("every seat has a place");
        let points = self.rules.spec().points;
        f64::from(points[usize::from(place) - 1])
    }
}

impl Sums {
    fn merge(&mut self, other: &Sums) {
        for (own, others) in self.0.iter_mut().zip(&other.0) {
            own.merge(others);
        }
    }

    fn measured(&self) -> Measured {
        let [first, second, difference] = &self.0;
        Measured {
            games: difference.count(),
            difference: difference.mean(),
            duplicate_error: difference.standard_error(),
            independent_error: first.standard_error().hypot(second.standard_error()),
        }
    }
}

impl Measured {
    /// How many times as many games with independent deals would give the same standard error.
    /// `None` if the standard error is 0 or unknown.
    pub fn gain(&self) -> Option<f64> {
        (self.duplicate_error > 0.0 && self.duplicate_error.is_finite())
            .then(|| (self.independent_error / self.duplicate_error).powi(2))
    }
}

/// An agent that now and then takes a random legal action instead.
#[derive(Debug, Clone)]
struct Exploring {
    agent: BuiltInAgent,
    percent: u64,
    chance: ChaCha8Rng,
}

impl Following for Exploring {
    fn name(&self) -> &'static str {
        self.agent.name()
    }

    fn on_event(&mut self, seat: Seat, event: &Event) {
        self.agent.on_event(seat, event);
    }

    fn decide(&mut self, observation: &Observation, legal: &Mask) -> ActionId {
        let action = self.agent.decide(observation, legal);
        if below(&mut self.chance, 100) < self.percent {
            let index = below(&mut self.chance, legal.len() as u64);
            return legal.nth(index as usize).unwrap_or(action);
        }
        action
    }

    fn boxed_clone(&self) -> Box<dyn Following> {
        Box::new(self.clone())
    }
}

/// A number below a small `end`. The bias of 2^-57 does not matter here.
fn below(generator: &mut ChaCha8Rng, end: u64) -> u64 {
    generator.next_u64() % end
}
