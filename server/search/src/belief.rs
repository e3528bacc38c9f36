//! What the decisions of others say about their hands: deals are likelier in which a network would
//! have decided as they did.

use std::ops::Range;
use std::sync::Arc;

use chefshat_agents::{Network, NetworkBatch};
use chefshat_engine::{ActionId, Game, RuleSet, Seed, Viewer};

use crate::{Chance, Sampler};

/// Of how many deals one is drawn by its likelihood. Each costs about as much as a rollout. More gain
/// little against players like the network, and lose against others.
const CANDIDATES: usize = 8;
/// The power of a likelihood: 1 takes the others for players who draw their actions by the network's
/// probabilities, 0 believes nothing.
const TEMPER: f64 = 0.5;
/// The least probability of an action: nobody is sure to decide as the network does.
const LEAST: f64 = 0.01;
/// The highest output that counts, so that sums of exponentials are finite.
const HIGHEST: f64 = 500.0;

/// A belief about hidden hands that follows from a model of how others decide.
#[derive(Clone, Debug)]
pub struct Belief {
    network: Arc<Network>,
}

impl Belief {
    /// That the others decide about as `network` does; `None` if it was not trained for such games.
    pub fn of(network: &Arc<Network>, rules: &RuleSet) -> Option<Belief> {
        network.fits(rules).then(|| Belief {
            network: Arc::clone(network),
        })
    }

    /// Draws some deals as [`Sampler::game`] does, chooses one by the likelihood of what the others
    /// did, and plays it up to the seat's decision.
    ///
    /// # Panics
    /// As [`Sampler::game`].
    pub fn game(&self, sampler: &Sampler, chance: &mut Chance) -> Game {
        let mut decisions = Decisions::default();
        let mut games: Vec<Game> = (0..CANDIDATES)
            .map(|deal| decisions.game(deal, sampler, &self.network, chance))
            .collect();
        let logs = decisions.log_likelihoods(CANDIDATES, &self.network);
        let highest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights = logs.iter().map(|log| (TEMPER * (log - highest)).exp());
        games.swap_remove(chance.weighted(&weights.collect::<Vec<f64>>()))
    }

    /// The natural logarithm of the likelihood of what the others did in this Shift, for each of these
    /// deals of an evaluation with this seed.
    ///
    /// # Panics
    /// As [`Sampler::game`].
    pub fn log_likelihoods(
        &self,
        sampler: &Sampler,
        seed: [u8; 32],
        deals: Range<u64>,
    ) -> Vec<f64> {
        let mut decisions = Decisions::default();
        let number = deals.clone().count();
        for (place, deal) in deals.enumerate() {
            let mut chance = Chance::stream(seed, deal);
            decisions.game(place, sampler, &self.network, &mut chance);
        }
        decisions.log_likelihoods(number, &self.network)
    }
}

/// The decisions that others took among several actions, in some possible deals.
#[derive(Default)]
struct Decisions {
    waiting: NetworkBatch,
    /// For each that waits the place of its deal, and the action.
    taken: Vec<(usize, ActionId)>,
}

impl Decisions {
    /// Draws a deal, plays it up to the seat's decision, and adds what the others decided before.
    fn game(
        &mut self,
        place: usize,
        sampler: &Sampler,
        network: &Network,
        chance: &mut Chance,
    ) -> Game {
        let knowledge = sampler.knowledge();
        let world = sampler.world(chance);
        let later = Seed(chance.seed());
        let game = knowledge.replay(&world, later, |game, action| {
            let decider = game.decision().expect("a decision is open").seat;
            if decider != knowledge.seat() {
                let observation = game.observe(Viewer::Seat(decider));
                let legal = game.legal_actions();
                let known = network.decide_or_wait(&observation, &legal, &mut self.waiting);
                if known.is_none() {
                    self.taken.push((place, action));
                }
            }
        });
        game.expect("a sampled deal leads to what the seat sees")
    }

    /// The logarithm of the likelihood of each of this number of deals.
    fn log_likelihoods(&mut self, deals: usize, network: &Network) -> Vec<f64> {
        // The exponentials of outputs: for each decision that of its action, and the sum of all.
        let mut outputs = vec![(0.0, 0.0); self.taken.len()];
        network.outputs_of_all(&mut self.waiting, |waited, action, output| {
            let (of_taken, all) = &mut outputs[waited];
            let output = match f64::from(output) {
                it if it.is_nan() => 0.0,
                it => it.clamp(-HIGHEST, HIGHEST).exp(),
            };
            if action == self.taken[waited].1 {
                *of_taken = output;
            }
            *all += output;
        });
        let mut logs = vec![0.0; deals];
        for ((place, _), (of_taken, all)) in self.taken.iter().zip(outputs) {
            let probability = if all > 0.0 { of_taken / all } else { 1.0 };
            logs[*place] += (LEAST + (1.0 - LEAST) * probability).ln();
        }
        logs
    }
}
