//! Tests the stated uncertainty of ratings: simulated participants with known skills play games,
//! and the resulting ratings are compared with the skills. No cards are played here; only places
//! are drawn.
//!
//! In a game everyone has a random performance around its skill, and places follow the performances
//! (Plackett and Luce's model, with Gumbel noise), so that of any two participants one beats the
//! other with the probability [`win_chance`](chefshat_tournament::ratings::win_chance).

use std::f64::consts::SQRT_2;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng as _;

use crate::chance::{index, normal, uniform};
use crate::fold::fold_in_order;
use chefshat_tournament::ratings::BETA;
use chefshat_tournament::ratings::{FIRST_MEAN, Rating};
use chefshat_tournament::statistics::Moments;

/// 95 % of a normal distribution lie within this many deviations of the mean.
const Z95: f64 = 1.959_963_984_540_054;

/// The fields to simulate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fields {
    /// Number of fields.
    pub fields: u64,
    /// Participants of each field.
    pub participants: usize,
    /// Standard deviation of their skills, which are normally distributed.
    pub spread: f64,
    /// Players of a game, at most as many as there are participants.
    pub players: usize,
    /// Seed of all random choices.
    pub seed: u64,
}

/// Ratings compared with skills after a number of rounds. Both are taken relative to the mean of
/// their field.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Calibration {
    /// For each participant 1 if its skill is within 1.96 deviations of its rating's mean, else 0.
    pub covered: Moments,
    /// The same for the difference of each pair.
    pub pairs_covered: Moments,
    /// For each pair 1 if the one with the higher skill has the higher mean, else 0.
    pub in_order: Moments,
    /// Distance of the rating's mean from the skill.
    pub error: Moments,
    /// The rating's deviation.
    pub deviation: Moments,
}

impl Calibration {
    fn merge(&mut self, other: &Calibration) {
        self.covered.merge(&other.covered);
        self.pairs_covered.merge(&other.pairs_covered);
        self.in_order.merge(&other.in_order);
        self.error.merge(&other.error);
        self.deviation.merge(&other.deviation);
    }

    fn add(&mut self, skills: &[f64], ratings: &[Rating]) {
        let mean = |numbers: &mut dyn Iterator<Item = f64>| -> f64 {
            numbers.sum::<f64>() / skills.len() as f64
        };
        let skill = mean(&mut skills.iter().copied());
        let rating = mean(&mut ratings.iter().map(|rating| rating.mean));
        let share = |holds: bool| f64::from(u8::from(holds));
        let known: Vec<(f64, &Rating)> = skills.iter().copied().zip(ratings).collect();
        for (number, (one, rated)) in known.iter().enumerate() {
            let error = ((rated.mean - rating) - (one - skill)).abs();
            self.covered.add(share(error <= Z95 * rated.deviation));
            self.error.add(error);
            self.deviation.add(rated.deviation);
            for (other, other_rated) in &known[..number] {
                let difference = rated.mean - other_rated.mean;
                let error = (difference - (one - other)).abs();
                let deviation = rated.deviation.hypot(other_rated.deviation);
                self.pairs_covered.add(share(error <= Z95 * deviation));
                self.in_order
                    .add(share((difference > 0.0) == (one > other)));
            }
        }
    }
}

/// Computes the ratings after a game from those before it, each with a place from 1.
pub type Update<'a> = &'a (dyn Fn(&[(Rating, u32)]) -> Vec<Rating> + Sync);

/// Plays the fields and compares after each of these numbers of rounds, which ascend. In a round
/// everyone plays one game, except for those left over. `update` may be
/// [`after_game`](chefshat_tournament::ratings::after_game). Runs on the current rayon pool, which
/// does not affect the result.
pub fn calibration(fields: &Fields, rounds: &[u32], update: Update<'_>) -> Vec<Calibration> {
    fold_in_order(
        fields.fields,
        1,
        || vec![Calibration::default(); rounds.len()],
        |sums, field| add_field(fields, field, rounds, update, sums),
        |all, more| {
            for (sums, more) in all.iter_mut().zip(more) {
                sums.merge(&more);
            }
        },
    )
}

fn add_field(
    fields: &Fields,
    field: u64,
    rounds: &[u32],
    update: Update<'_>,
    sums: &mut [Calibration],
) {
    let mut generator = ChaCha8Rng::seed_from_u64(fields.seed);
    generator.set_stream(field);
    let skills: Vec<f64> = (0..fields.participants)
        .map(|_| FIRST_MEAN + fields.spread * normal(&mut generator))
        .collect();
    let mut ratings = vec![Rating::default(); fields.participants];
    let mut order: Vec<usize> = (0..fields.participants).collect();
    let mut played = 0;
    for (rounds, sums) in rounds.iter().zip(sums) {
        while played < *rounds {
            played += 1;
            shuffle(&mut order, &mut generator);
            for table in order.chunks_exact(fields.players) {
                let places = places(table, &skills, &mut generator);
                let players: Vec<(Rating, u32)> = (table.iter().zip(places))
                    .map(|(participant, place)| (ratings[*participant], place))
                    .collect();
                for (participant, rating) in table.iter().zip(update(&players)) {
                    ratings[*participant] = rating;
                }
            }
        }
        sums.add(&skills, &ratings);
    }
}

/// Draws the places of a game, from 1, in the order of the table.
fn places(table: &[usize], skills: &[f64], generator: &mut ChaCha8Rng) -> Vec<u32> {
    let performances: Vec<f64> = table
        .iter()
        .map(|participant| skills[*participant] / (BETA * SQRT_2) - (-uniform(generator).ln()).ln())
        .collect();
    performances
        .iter()
        .map(|own| {
            let better = performances.iter().filter(|other| *other > own).count();
            u32::try_from(better).unwrap_or(u32::MAX).saturating_add(1)
        })
        .collect()
}

fn shuffle(order: &mut [usize], generator: &mut ChaCha8Rng) {
    for last in (1..order.len()).rev() {
        order.swap(last, index(generator, last + 1));
    }
}
