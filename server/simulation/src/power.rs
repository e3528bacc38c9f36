//! The power of a study by simulation: the same study again and again, with a known effect, each
//! analysed by a test for the difference of two means. The share of studies that find the
//! effect is their power; the share that find one where there is none shows that the test keeps its
//! level. Which study, measure and effect they have is up to the caller.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng as _;
use statrs::distribution::{ContinuousCDF as _, StudentsT};

use chefshat_tournament::statistics::{Interval, Moments, wilson95};

use crate::Progress;
use crate::chance::{index, normal};
use crate::fold::fold_in_order;

/// Studies that one thread simulates at a time.
const CHUNK: u64 = 16;

/// Who takes part in a study, and in which conditions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Design {
    /// For each unit of the analysis, the conditions that it meets, each once: conditions with the level
    /// and others (within), or one of both (between), as all other units do.
    pub units: Vec<Vec<usize>>,
    /// Number of participants who are a unit together, at least 1.
    pub members: usize,
    /// By condition, whether it has the level whose effect is looked for.
    pub has_level: Vec<bool>,
}

/// What is measured of each participant in each condition: the mean of some values.
#[derive(Debug, Clone, PartialEq)]
pub enum Measure {
    /// Answers on a scale.
    Answers(Answers),
    /// Values of games that were played before.
    Games {
        /// By condition, what a unit had in each game, at least one.
        values: Vec<Vec<f64>>,
        /// Number of games of a unit in each condition, at least 1.
        count: usize,
    },
}

/// Answers of participants whose opinions are normally distributed: each is the nearest value of the
/// scale.
#[derive(Debug, Clone, PartialEq)]
pub struct Answers {
    /// Lowest value of the scale.
    pub min: f64,
    /// Highest value.
    pub max: f64,
    /// Distance of two values, more than 0.
    pub step: f64,
    /// Number of answers of a participant in each condition, at least 1.
    pub count: usize,
    /// Mean opinion without the level.
    pub mean: f64,
    /// Standard deviation of the opinions that answers express.
    pub sd: f64,
    /// Correlation of two opinions of one participant in one condition, from `correlation` to 1.
    pub item_correlation: f64,
    /// Correlation of two opinions of one participant in two conditions, from `group_correlation`.
    pub correlation: f64,
    /// Correlation of two opinions of different participants of a unit, from 0.
    pub group_correlation: f64,
    /// How much higher opinions are with the level.
    pub effect: f64,
}

/// What simulated studies have found.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Power {
    /// Number of studies.
    pub studies: u64,
    /// Number of those that found the effect: the p-value of the two-sided test is below the level.
    pub found: u64,
    /// Number of studies without any effect that found one.
    pub false_positives: u64,
    /// The measured differences, with the level minus without.
    pub difference: Moments,
    /// The variances of the units within a sample (between), or of their differences (within).
    variance: Moments,
}

impl Power {
    /// The share of studies that found the effect.
    pub fn share(&self) -> f64 {
        self.found as f64 / self.studies.max(1) as f64
    }

    /// Its 95 % interval (Wilson).
    pub fn interval95(&self) -> Interval {
        wilson95(self.found, self.studies)
    }

    /// The 95 % interval of the share of studies without an effect that found one (Wilson).
    pub fn false_positives95(&self) -> Interval {
        wilson95(self.false_positives, self.studies)
    }

    /// The mean difference in standard deviations: of the units within a sample (between), or of their
    /// differences (within). 0 where nothing varies.
    pub fn standardized(&self) -> f64 {
        let variance = self.variance.mean();
        match variance > 0.0 {
            true => self.difference.mean() / variance.sqrt(),
            false => 0.0,
        }
    }

    fn merge(&mut self, other: &Self) {
        self.studies += other.studies;
        self.found += other.found;
        self.false_positives += other.false_positives;
        self.difference.merge(&other.difference);
        self.variance.merge(&other.variance);
    }
}

/// Simulates a number of studies on the current rayon pool, each once with the effect and once without.
/// They are tested at the level `alpha`, between 0 and 1. The result depends on the arguments alone.
/// `progress` is called from any thread with the number of studies that were simulated since its
/// last call.
pub fn power(
    design: &Design,
    measure: &Measure,
    alpha: f64,
    studies: u64,
    seed: u64,
    progress: Progress<'_>,
) -> Power {
    let without = measure.without_effect();
    let is_within = design.is_within();
    let add = |power: &mut Power, study| {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(study);
        let test = design.test(is_within, measure, &mut generator);
        power.studies += 1;
        power.found += u64::from(test.p < alpha);
        power.difference.add(test.difference);
        power.variance.add(test.variance);
        let null = design.test(is_within, &without, &mut generator);
        power.false_positives += u64::from(null.p < alpha);
        progress(1);
    };
    fold_in_order(studies, CHUNK, Power::default, add, |all, part| {
        all.merge(&part);
    })
}

impl Design {
    /// Whether each unit meets conditions with the level and without it.
    pub fn is_within(&self) -> bool {
        let levels = |unit: &Vec<usize>| unit.iter().filter(|it| self.has_level[**it]).count();
        (self.units.iter()).any(|unit| (1..unit.len()).contains(&levels(unit)))
    }

    /// Number of units with the level, and without.
    pub fn sizes(&self) -> [usize; 2] {
        let meets = |level| {
            let units = self.units.iter();
            units
                .filter(|unit| unit.iter().any(|it| self.has_level[*it] == level))
                .count()
        };
        [meets(true), meets(false)]
    }

    /// Simulates a study and tests its difference.
    fn test(&self, is_within: bool, measure: &Measure, generator: &mut ChaCha8Rng) -> Test {
        let mut samples = [Moments::default(); 2];
        let mut differences = Moments::default();
        for unit in &self.units {
            let mut own = [Moments::default(); 2];
            measure.of_unit(self, unit, generator, |condition, value| {
                own[usize::from(!self.has_level[condition])].add(value);
            });
            if own.iter().all(|it| it.count() > 0) {
                differences.add(own[0].mean() - own[1].mean());
            }
            for (sample, own) in samples.iter_mut().zip(own) {
                if own.count() > 0 {
                    sample.add(own.mean());
                }
            }
        }
        match is_within {
            true => Test::of_differences(&differences),
            false => Test::of_samples(&samples),
        }
    }
}

impl Measure {
    /// The same where the level changes nothing.
    fn without_effect(&self) -> Self {
        match self {
            Self::Answers(answers) => Self::Answers(Answers {
                effect: 0.0,
                ..answers.clone()
            }),
            Self::Games { values, count } => Self::Games {
                values: vec![values.concat(); values.len()],
                count: *count,
            },
        }
    }

    /// Passes on what a unit has in each of its conditions.
    fn of_unit(
        &self,
        design: &Design,
        conditions: &[usize],
        generator: &mut ChaCha8Rng,
        mut value: impl FnMut(usize, f64),
    ) {
        match self {
            Self::Games { values, count } => {
                for &condition in conditions {
                    let of = &values[condition];
                    let drawn: f64 = (0..*count).map(|_| of[index(generator, of.len())]).sum();
                    value(condition, drawn / *count as f64);
                }
            }
            Self::Answers(answers) => answers.of_unit(design, conditions, generator, value),
        }
    }
}

impl Answers {
    /// Passes on the mean answer of a unit in each of its conditions.
    fn of_unit(
        &self,
        design: &Design,
        conditions: &[usize],
        generator: &mut ChaCha8Rng,
        mut value: impl FnMut(usize, f64),
    ) {
        // What the opinions of a unit, of a participant, of one in a condition, and of one item have in
        // common: each explains the part of the variance that the correlation before it does not.
        let [unit, participant, condition, item] = [
            self.group_correlation,
            self.correlation - self.group_correlation,
            self.item_correlation - self.correlation,
            1.0 - self.item_correlation,
        ]
        .map(|share| share.max(0.0).sqrt());
        let common = unit * normal(generator);
        let mut sums = vec![0.0; conditions.len()];
        for _ in 0..design.members {
            let own = common + participant * normal(generator);
            for (sum, of) in sums.iter_mut().zip(conditions) {
                let there = own + condition * normal(generator);
                for _ in 0..self.count {
                    let deviation = there + item * normal(generator);
                    *sum += self.answer(deviation, design.has_level[*of]);
                }
            }
        }
        let all = (design.members * self.count) as f64;
        for (sum, condition) in sums.into_iter().zip(conditions) {
            value(*condition, sum / all);
        }
    }

    /// The answer of somebody whose opinion deviates from the mean by this many standard deviations.
    fn answer(&self, deviation: f64, with_level: bool) -> f64 {
        let effect = if with_level { self.effect } else { 0.0 };
        let opinion = self.mean + effect + self.sd * deviation;
        let steps = ((opinion - self.min) / self.step).round();
        (self.min + steps * self.step).clamp(self.min, self.max)
    }
}

/// The outcome of a test for a difference of means.
struct Test {
    difference: f64,
    /// Of the units within a sample, or of their differences.
    variance: f64,
    /// The two-sided p-value.
    p: f64,
}

impl Test {
    /// Welch's test of two independent samples.
    fn of_samples([one, other]: &[Moments; 2]) -> Self {
        let difference = one.mean() - other.mean();
        let parts = [one, other].map(|it| it.variance() / it.count() as f64);
        let error = (parts[0] + parts[1]).sqrt();
        let freedom = [one, other].map(|it| it.count().saturating_sub(1) as f64);
        let denominator = parts[0].powi(2) / freedom[0] + parts[1].powi(2) / freedom[1];
        let freedom = (parts[0] + parts[1]).powi(2) / denominator;
        let variance = f64::midpoint(one.variance(), other.variance());
        Self::new(difference, variance, error, freedom)
    }

    /// The test of paired samples.
    fn of_differences(differences: &Moments) -> Self {
        let error = differences.standard_error();
        let freedom = differences.count().saturating_sub(1) as f64;
        Self::new(differences.mean(), differences.variance(), error, freedom)
    }

    /// Where nothing varies, nothing is found.
    fn new(difference: f64, variance: f64, error: f64, freedom: f64) -> Self {
        let distribution = (error > 0.0 && freedom > 0.0)
            .then(|| StudentsT::new(0.0, 1.0, freedom).ok())
            .flatten();
        let p = distribution.map_or(1.0, |it| 2.0 * it.cdf(-(difference / error).abs()));
        Self {
            difference,
            variance,
            p,
        }
    }
}
