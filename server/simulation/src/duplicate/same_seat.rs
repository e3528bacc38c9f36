//! Two agents that never meet: each sits in the same seats among the same others. How much surer is it which of them is better if they are dealt
//! the same cards? This is what duplicate deals are to a tournament, where replicas of a deal go to different participants; for two who sit at
//! one table see the comparison beside this file.

use chefshat_engine::{MAX_SEATS, RuleSet, Seat};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

use super::Contender;
use crate::fold::fold_in_order;
use chefshat_agents::seating_agent_seed;
use chefshat_agents::{BuiltInAgent, Listener, game_seed, play};
use chefshat_tournament::statistics::Moments;

/// Deals that one thread plays at a time. Part of the result: it decides in which groups figures are summed.
const CHUNK: u64 = 4;

/// One of the two.
#[derive(Debug, Clone)]
pub struct Newcomer {
    /// How it plays.
    pub plays: Contender,
    /// How often, of 100 decisions, it takes any legal action instead: makes two agents alike but not the same. At most 100.
    pub slips_percent: u8,
}

/// What is to be measured.
#[derive(Debug, Clone)]
pub struct SameSeat {
    /// The rule set.
    pub rules: RuleSet,
    /// The two.
    pub newcomers: [Newcomer; 2],
    /// Who has all other seats.
    pub others: Contender,
    /// What all chance is drawn from.
    pub seed: u64,
}

/// What came of a number of games of each. A game is worth the rule set's points for the place in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Games of each.
    pub games: u64,
    /// Mean of the first less that of the second, over the same deals.
    pub difference: f64,
    /// The standard error of it.
    pub duplicate_error: f64,
    /// The standard error with deals of their own for each game, from as many other games of the second.
    pub independent_error: f64,
}

/// Sums over games: the first's scores, the second's over other deals, the differences over the same.
#[derive(Debug, Clone, Copy, Default)]
struct Sums([Moments; 3]);

impl SameSeat {
    /// Plays as many games of each as the last of these numbers, which ascend, and tells what is known after each of them. On the threads of
    /// the rayon pool it is called in; the result does not depend on them. `progress` is called from any of those threads, with the number
    /// of games that have been finished since it was last called.
    pub fn measure(&self, games: &[u64], progress: impl Fn(u64) + Sync) -> Vec<Measured> {
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

    /// Adds a deal, and one that lies `apart` behind it, where the second plays alone.
    fn add(&self, sums: &mut Sums, deal: u64, apart: u64) {
        let first = self.score(0, deal);
        let second = self.score(1, deal);
        sums.0[0].add(first);
        sums.0[1].add(self.score(1, deal.saturating_add(apart)));
        sums.0[2].add(first - second);
    }

    /// What a deal is worth to one of the two, in the seat that the deal's number says.
    fn score(&self, who: usize, deal: u64) -> f64 {
        let seed = game_seed(self.seed, deal);
        let players = self.rules.players();
        let own = Seat::new((deal % players as u64) as usize);
        let newcomer = &self.newcomers[who];
        let mut agents: [BuiltInAgent; MAX_SEATS] = std::array::from_fn(|index| {
            let seat = Seat::new(index);
            let contender = if seat == own {
                &newcomer.plays
            } else {
                &self.others
            };
            contender.agent(seating_agent_seed(seed, who, seat))
        });
        // No agent has this seed: there are no more than six seats, and two seatings.
        let mut slips = ChaCha8Rng::from_seed(seating_agent_seed(seed, 2 + who, own));
        let standings = play(
            self.rules,
            seed,
            None,
            |seat, observation, legal| {
                let action = agents[seat.index()].decide(observation, legal);
                if seat == own && below(&mut slips, 100) < u64::from(newcomer.slips_percent) {
                    let any = below(&mut slips, legal.len() as u64);
                    return legal.nth(any as usize).unwrap_or(action);
                }
                action
            },
            &mut Silent,
        );
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
    /// How many times as many games with deals of their own would be needed to be as sure. `None` if chance decided nothing.
    pub fn gain(&self) -> Option<f64> {
        (self.duplicate_error > 0.0)
            .then(|| (self.independent_error / self.duplicate_error).powi(2))
    }
}

/// A number below another one, which is small: that some are likelier by 2^-57 does not matter here.
fn below(generator: &mut ChaCha8Rng, end: u64) -> u64 {
    generator.next_u64() % end
}

struct Silent;

impl Listener for Silent {}
