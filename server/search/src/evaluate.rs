//! Estimates what each legal action is worth, by rollouts in deals that are consistent with what the
//! seat knows. Every action is tried in the same deals with the same random choices of the agents,
//! so that luck cancels out of their differences.

use std::ops::{Range, RangeInclusive};

use chefshat_engine::ActionId;
use rayon::ThreadPool;
use rayon::prelude::*;

use crate::rollout::{Worth, rollouts};
use crate::{Belief, Chance, RolloutPolicy, Sampler};

/// Deals that are played before the first look whether to stop, and most of them between two looks.
/// In between it is an eighth of those played so far. Never depends on the number of threads.
const BATCH: RangeInclusive<u64> = 4..=256;
/// Rollouts that one thread plays at a time. More would leave the fast memory of a processor.
const SIDE_BY_SIDE: u64 = 64;

/// What one action is worth.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub struct Estimate {
    /// The action.
    pub action: ActionId,
    /// Rollouts that began with it.
    pub rollouts: u64,
    points: u64,
    /// A rule set may award any 32-bit number of points, so 64 bits hold one square but no sum.
    points_squared: u128,
    places: u64,
    /// Sum of its points minus those of the reference action, and of their squares.
    gain: i64,
    gain_squared: u128,
}

impl Estimate {
    pub(crate) fn new(action: ActionId) -> Estimate {
        Estimate {
            action,
            rollouts: 0,
            points: 0,
            points_squared: 0,
            places: 0,
            gain: 0,
            gain_squared: 0,
        }
    }

    pub(crate) fn add(&mut self, worth: Worth, reference: Worth) {
        let (points, gain) = (
            u64::from(worth.points),
            i64::from(worth.points) - i64::from(reference.points),
        );
        self.rollouts += 1;
        self.points += points;
        self.points_squared += u128::from(points).pow(2);
        self.places += u64::from(worth.place);
        self.gain += gain;
        self.gain_squared += u128::from(gain.unsigned_abs()).pow(2);
    }

    fn merge(&mut self, other: &Estimate) {
        self.rollouts += other.rollouts;
        self.points += other.points;
        self.points_squared += other.points_squared;
        self.places += other.places;
        self.gain += other.gain;
        self.gain_squared += other.gain_squared;
    }

    /// Mean points of the Shift; 0 without rollouts.
    pub fn points(&self) -> f64 {
        self.points as f64 / self.count()
    }

    /// Mean place, from 1; 0 without rollouts.
    pub fn place(&self) -> f64 {
        self.places as f64 / self.count()
    }

    /// Standard error of [`Estimate::points`]; infinite with fewer than two rollouts.
    pub fn standard_error(&self) -> f64 {
        standard_error(self.rollouts, self.points(), self.points_squared as f64)
    }

    /// Mean of the points that the action gained over the first of the actions in the same deals.
    pub fn gain(&self) -> f64 {
        self.gain as f64 / self.count()
    }

    /// Standard error of [`Estimate::gain`]; infinite with fewer than two rollouts.
    pub fn gain_error(&self) -> f64 {
        standard_error(self.rollouts, self.gain(), self.gain_squared as f64)
    }

    fn count(&self) -> f64 {
        self.rollouts.max(1) as f64
    }
}

/// The standard error of a mean of `n` numbers, from the sum of their squares.
fn standard_error(n: u64, mean: f64, squares: f64) -> f64 {
    if n < 2 {
        return f64::INFINITY;
    }
    let n = n as f64;
    ((squares / n - mean * mean).max(0.0) / (n - 1.0)).sqrt()
}

/// How rollouts are shared among the actions.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub enum Allocation {
    /// All actions get as many.
    Uniform,
    /// Sequential halving: the budget is spent in rounds, and after each the worse half of the
    /// actions is dropped. The first action stays.
    Halving,
}

/// How an evaluation works.
#[derive(Clone, Debug)]
pub struct Method {
    /// The agents of the rollouts, on all seats.
    pub policy: RolloutPolicy,
    /// How rollouts are shared among the actions.
    pub allocation: Allocation,
    /// What the decisions of others say about their hands; `None`: nothing, as `docs/search.md` says.
    pub belief: Option<Belief>,
}

/// Estimates what actions are worth at the sampler's decision: first those of `actions[0]`, to which
/// the gains of the others refer. `progress` gets the number of rollouts so far and says which part
/// of the budget is spent; the evaluation ends when it is 1 or more, but each action is tried in 4
/// deals at least. A pool of threads does not change the result.
///
/// # Panics
/// If `actions` is empty, or one of them is not legal.
pub fn evaluate(
    sampler: &Sampler,
    actions: &[ActionId],
    method: &Method,
    seed: [u8; 32],
    pool: Option<&ThreadPool>,
    progress: impl Fn(u64) -> f64,
) -> Vec<Estimate> {
    let mut evaluation = Evaluation::new(actions, method.allocation);
    while !evaluation.step(sampler, method, seed, pool, &progress) {}
    evaluation.estimates
}

/// An evaluation that can pause between two batches of deals.
#[derive(Clone, Debug)]
pub struct Evaluation {
    estimates: Vec<Estimate>,
    /// The actions that are still tried, by their index.
    active: Vec<usize>,
    /// The round of the allocation, from 1, and how many there are.
    round: u32,
    rounds: u32,
    worlds: u64,
    rollouts: u64,
    /// The most rollouts of all actions.
    most: Option<u64>,
}

impl Evaluation {
    /// Begins the evaluation of these actions.
    pub fn new(actions: &[ActionId], allocation: Allocation) -> Evaluation {
        Evaluation {
            estimates: actions.iter().map(|id| Estimate::new(*id)).collect(),
            active: (0..actions.len()).collect(),
            round: 1,
            rounds: match allocation {
                Allocation::Uniform => 1,
                Allocation::Halving => actions.len().next_power_of_two().trailing_zeros().max(1),
            },
            worlds: 0,
            rollouts: 0,
            most: None,
        }
    }

    /// Makes batches of deals smaller where they would exceed this number of rollouts, or a round's
    /// part of it. Each action is still tried in 4 deals.
    pub fn at_most(self, rollouts: u64) -> Evaluation {
        Evaluation {
            most: Some(rollouts),
            ..self
        }
    }

    /// Deals that are left to the round.
    fn deals_left(&self) -> u64 {
        let of_round = |most| {
            let part = u128::from(most) * u128::from(self.round) / u128::from(self.rounds);
            let part = u64::try_from(part).expect("a round has at most all rollouts");
            part.saturating_sub(self.rollouts)
        };
        self.most.map_or(u64::MAX, of_round) / self.active.len() as u64
    }

    /// The estimates so far, in the order of the actions.
    pub fn estimates(&self) -> &[Estimate] {
        &self.estimates
    }

    /// Tries the actions in one more batch of deals, unless the budget is spent; returns whether it
    /// is. All arguments are those of every other step, and as in [`evaluate`].
    ///
    /// # Panics
    /// As [`evaluate`].
    pub fn step(
        &mut self,
        sampler: &Sampler,
        method: &Method,
        seed: [u8; 32],
        pool: Option<&ThreadPool>,
        progress: impl Fn(u64) -> f64,
    ) -> bool {
        while self.worlds > 0 {
            let part = f64::from(self.round) / f64::from(self.rounds);
            if progress(self.rollouts) < part && self.deals_left() > 0 {
                break;
            }
            if self.round >= self.rounds {
                return true;
            }
            halve(&mut self.active, &self.estimates);
            self.round += 1;
        }
        let tried: Vec<ActionId> = (self.active.iter())
            .map(|&index| self.estimates[index].action)
            .collect();
        let deals = match self.worlds {
            0 => *BATCH.start(),
            before => (before / 8)
                .clamp(*BATCH.start(), *BATCH.end())
                .min(self.deals_left()),
        };
        let batch = self.worlds..self.worlds + deals;
        let found = in_parts(batch.clone(), tried.len(), pool, |part| {
            let mut found: Vec<Estimate> = tried.iter().map(|id| Estimate::new(*id)).collect();
            for worths in worths_in(sampler, &tried, method, seed, part) {
                let reference = worths[0];
                for (estimate, worth) in found.iter_mut().zip(worths) {
                    estimate.add(worth, reference);
                }
            }
            found
        });
        let found = found.into_iter().reduce(|mut all, more| {
            all.iter_mut()
                .zip(&more)
                .for_each(|(all, more)| all.merge(more));
            all
        });
        let found = found.expect("a batch has deals");
        for (&index, found) in self.active.iter().zip(&found) {
            self.estimates[index].merge(found);
            self.rollouts += found.rollouts;
        }
        self.worlds = batch.end;
        false
    }
}

/// Drops the worse half of the actions, but not the first.
fn halve(active: &mut Vec<usize>, estimates: &[Estimate]) {
    active.sort_by(|&a, &b| {
        let points = |index: usize| estimates[index].points();
        (a != 0)
            .cmp(&(b != 0))
            .then(points(b).total_cmp(&points(a)))
            .then(a.cmp(&b))
    });
    active.truncate(active.len().div_ceil(2).max(2));
}

/// What each action brings in each of these deals, which are those of an evaluation with this method
/// and seed: for each deal a row by action. A pool of threads does not change the result.
///
/// # Panics
/// If an action is not legal.
pub fn outcomes(
    sampler: &Sampler,
    actions: &[ActionId],
    method: &Method,
    seed: [u8; 32],
    deals: Range<u64>,
    pool: Option<&ThreadPool>,
) -> Vec<Vec<Worth>> {
    let parts = in_parts(deals, actions.len(), pool, |part| {
        worths_in(sampler, actions, method, seed, part).collect::<Vec<_>>()
    });
    parts.into_iter().flatten().collect()
}

/// Calls `of_part` with parts of these deals, in each of which these many actions are tried side by
/// side, and returns what it does in their order.
fn in_parts<T: Send>(
    deals: Range<u64>,
    actions: usize,
    pool: Option<&ThreadPool>,
    of_part: impl Fn(Range<u64>) -> T + Send + Sync,
) -> Vec<T> {
    let threads = pool.map_or(1, ThreadPool::current_num_threads) as u64;
    let number = (deals.end - deals.start).div_ceil(threads);
    let size = number.clamp(1, (SIDE_BY_SIDE / actions as u64).max(1));
    let parts: Vec<Range<u64>> = (deals.start..deals.end)
        .step_by(size as usize)
        .map(|first| first..deals.end.min(first + size))
        .collect();
    match pool {
        Some(pool) => pool.install(|| parts.into_par_iter().map(of_part).collect()),
        None => parts.into_iter().map(of_part).collect(),
    }
}

/// What each action brings in each of these deals, a row by action.
fn worths_in(
    sampler: &Sampler,
    actions: &[ActionId],
    method: &Method,
    seed: [u8; 32],
    deals: Range<u64>,
) -> impl Iterator<Item = Vec<Worth>> {
    let starts = deals.flat_map(|deal| {
        let mut chance = Chance::stream(seed, deal);
        let game = match &method.belief {
            Some(belief) => belief.game(sampler, &mut chance),
            None => sampler.game(&mut chance),
        };
        let (game, agents) = (game.closing_copy(), chance.seed());
        (actions.iter()).map(move |&action| (game.clone(), action, agents))
    });
    let mut worths = rollouts(starts, sampler.knowledge().seat(), &method.policy).into_iter();
    std::iter::from_fn(move || {
        let row: Vec<Worth> = worths.by_ref().take(actions.len()).collect();
        (!row.is_empty()).then_some(row)
    })
}

/// Expected cards in each hand, by seat and kind (faces ascending, then jokers), over deals of the
/// sampler. `progress` gets the number of deals so far and says which part of the budget is spent;
/// the last deal is that after which it is 1 or more.
pub fn likely_hands(
    sampler: &Sampler,
    seed: [u8; 32],
    progress: impl Fn(u64) -> f64,
) -> Vec<Vec<f64>> {
    let mut hands = LikelyHands::new(sampler);
    while hands.deals == 0 || progress(hands.deals) < 1.0 {
        hands.step(sampler, seed);
    }
    hands.mean()
}

/// The likely hands of a sampler, which can pause between two deals.
#[derive(Clone, Debug)]
pub struct LikelyHands {
    sums: Vec<Vec<u64>>,
    deals: u64,
}

impl LikelyHands {
    /// Begins with no deal.
    pub fn new(sampler: &Sampler) -> LikelyHands {
        let rules = sampler.knowledge().rules();
        LikelyHands {
            sums: vec![vec![0; usize::from(rules.faces()) + 1]; rules.players()],
            deals: 0,
        }
    }

    /// The number of deals so far.
    pub fn deals(&self) -> u64 {
        self.deals
    }

    /// Counts one more deal. The arguments are those of every other step.
    pub fn step(&mut self, sampler: &Sampler, seed: [u8; 32]) {
        let faces = sampler.knowledge().rules().faces();
        let game = sampler.game(&mut Chance::stream(seed, self.deals));
        self.deals += 1;
        for (sums, hand) in self.sums.iter_mut().zip(game.hands().values()) {
            for (sum, count) in sums.iter_mut().zip(hand.counts(faces)) {
                *sum += u64::from(count);
            }
        }
    }

    /// The mean number of cards, as [`likely_hands`] returns it; 0 without deals.
    pub fn mean(&self) -> Vec<Vec<f64>> {
        let mean = |sum: &u64| *sum as f64 / self.deals.max(1) as f64;
        let means = |sums: &Vec<u64>| sums.iter().map(mean).collect();
        self.sums.iter().map(means).collect()
    }
}
