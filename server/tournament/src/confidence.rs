//! How certain it is that, of two participants, the one with the higher mean score is better, and
//! how many more games would settle it.
//!
//! The independent units are not games but *occasions*. For two participants who always met, an
//! occasion is all games with one deal, or a single game if deals do not repeat. For others it is a
//! round, because all games of a round have the same opponents. On one occasion two participants
//! may share a table, where one gains what the other loses, or a deal at different tables, where
//! luck cancels out in the difference. Summing each occasion first covers all these cases: if both
//! played once on every occasion, the result is the paired difference; if they shared none, it is
//! Welch's.
//!
//! The standings themselves decide who is the upper participant, so a test of "the upper one is
//! better" that ignores this finds twice as many differences between equals as it admits. The
//! confidence is therefore two-sided: of equal participants, at most one pair in twenty reaches
//! 95 %. If both played equally often on every occasion, it comes from exchanging their scores,
//! which is exact, else from Student's distribution. It is never higher than a few occasions allow:
//! n tosses of a coin all show the same side with probability 2^(1 - n), so four occasions give at
//! most 87.5 %.

use std::collections::{BTreeMap, BTreeSet};

use statrs::distribution::{ContinuousCDF as _, StudentsT};

use super::Tournament;
use crate::statistics::Moments;

/// The score of a participant in one game.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scored {
    /// Number of the deal if other games have it too, else of the game.
    pub occasion: u64,
    /// The score.
    pub score: f64,
}

/// How certain the order of two participants is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrderConfidence {
    /// Mean score of the upper participant minus that of the lower.
    pub difference: f64,
    /// Standard error of the difference; 0 with fewer than two occasions each, or if all occasions
    /// agree.
    pub standard_error: f64,
    /// Confidence that the order is right, 0..=1. Above 0.5 it is the probability that two equal
    /// participants would differ less, in either direction; 0.5 if hardly anything is known; less
    /// if the scores contradict the order (in a knockout a participant who got further may have
    /// scored less).
    pub confidence: f64,
    /// Further games each needs to reach [`SURE`], if the difference and the share of common
    /// occasions stay the same. `None` if it is reached or cannot be estimated.
    pub more_games: Option<u64>,
}

/// Two neighbours in the standings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbours {
    /// Number of the upper participant.
    pub upper: usize,
    /// Number of the lower participant.
    pub lower: usize,
    /// How certain their order is.
    pub order: OrderConfidence,
}

/// Confidence from which an order counts as settled.
pub const SURE: f64 = 0.95;
/// 95 % of a normal distribution lie within this many deviations of the mean.
const Z_SURE: f64 = 1.959_963_984_540_054;

/// Sum of the absolute differences up to which [`by_exchange`] computes: some hundred occasions.
const MOST_EXACT: i64 = 1000;

/// Scores are whole numbers, so a smaller standard error is a rounding error.
const ROUNDING: f64 = 1e-9;

/// How certain it is that the participant with the scores `upper` is better than the one with the
/// scores `lower`.
pub fn order_confidence(upper: &[Scored], lower: &[Scored]) -> OrderConfidence {
    let (means, games) = ([mean(upper), mean(lower)], [upper.len(), lower.len()]);
    let difference = match means[0] - means[1] {
        level if level.abs() < ROUNDING => 0.0,
        difference => difference,
    };
    let few = occasions(upper).min(occasions(lower));
    if few < 2 {
        return OrderConfidence {
            difference: if few == 0 { 0.0 } else { difference },
            standard_error: 0.0,
            confidence: 0.5,
            more_games: None,
        };
    }
    let standard_error = standard_error(upper, lower, means);
    let by_chance = by_exchange(upper, lower).unwrap_or_else(|| match standard_error > 0.0 {
        true => 2.0 * below(-difference.abs() / standard_error, few - 1),
        // All occasions agree.
        false => 0.0,
    });
    let by_chance = by_chance.max(all_the_same(few));
    let confidence = match difference.total_cmp(&0.0) {
        std::cmp::Ordering::Greater => (1.0 - by_chance).max(0.5),
        std::cmp::Ordering::Less => by_chance.min(0.5),
        std::cmp::Ordering::Equal => 0.5,
    };
    OrderConfidence {
        difference,
        standard_error,
        confidence,
        more_games: (difference > 0.0 && confidence < SURE).then(|| {
            let games = games[0].max(games[1]) as f64;
            let by_error = games * (Z_SURE * standard_error / difference).powi(2) - games;
            let missing = (few..).take_while(|&occasions| all_the_same(occasions) > 1.0 - SURE);
            let by_occasions = missing.count() as f64 * games / few as f64;
            // The cast saturates.
            by_error.max(by_occasions).ceil().max(1.0) as u64
        }),
    }
}

/// The probability of at least this difference, in either direction, if the two exchanged their
/// scores on each occasion with a toss of a coin: exact for equal participants (Fisher's
/// randomisation test). `None` if the two did not play equally often on every occasion for whole
/// numbers, or if the differences sum to more than [`MOST_EXACT`], where Student's distribution is
/// close enough.
fn by_exchange(upper: &[Scored], lower: &[Scored]) -> Option<f64> {
    let mut by_occasion: BTreeMap<u64, (i64, i64)> = BTreeMap::new();
    for (scores, sign) in [(upper, 1), (lower, -1)] {
        for scored in scores {
            let (games, difference) = by_occasion.entry(scored.occasion).or_default();
            let whole = (scored.score.fract() == 0.0).then_some(scored.score as i64)?;
            (*games, *difference) = (*games + sign, *difference + sign * whole);
        }
    }
    let differences: Vec<i64> = (by_occasion.values())
        .map(|&(games, difference)| (games == 0).then_some(difference))
        .collect::<Option<_>>()?;
    let most: i64 = differences.iter().map(|difference| difference.abs()).sum();
    if most > MOST_EXACT {
        return None;
    }
    Some(as_large_by_chance(&differences))
}

/// The probability that the sum of these differences, each with either sign by a toss of a coin, is
/// at least as far from 0 as with the signs that they have. A tournament of a thousand asks for a
/// thousand of these, so the sums are numbered: for each difference, the work is that of adding
/// two lists of at most [`MOST_EXACT`] numbers.
fn as_large_by_chance(differences: &[i64]) -> f64 {
    let most: i64 = differences.iter().map(|difference| difference.abs()).sum();
    // Sums differ by twice a difference, so the one at `index` is `2 * index - most`.
    let mut sums = vec![1.0];
    for difference in differences {
        let shift = usize::try_from(difference.abs()).expect("it is not negative");
        let mut next = vec![0.0; sums.len() + shift];
        for (index, probability) in sums.iter().enumerate() {
            next[index] += 0.5 * probability;
            next[index + shift] += 0.5 * probability;
        }
        sums = next;
    }
    let found = differences.iter().sum::<i64>().abs();
    let sums = (0..).map(|index| 2 * index - most).zip(&sums);
    let as_large = sums.filter(|(sum, _)| sum.abs() >= found);
    as_large.map(|(_, probability)| probability).sum()
}

/// The probability that this many tosses of a coin all show the same side: no difference found on
/// so few occasions is less likely by chance.
fn all_the_same(occasions: usize) -> f64 {
    0.5f64.powi(i32::try_from(occasions - 1).unwrap_or(i32::MAX))
}

impl Tournament {
    /// How certain the order of each two neighbours in the standings is, from the top; empty before
    /// a game has counted. For two participants who always met, each deal or game is an occasion;
    /// for others, each round.
    pub fn order_confidence(&self) -> Vec<Neighbours> {
        let mut played: Vec<Vec<Played>> = vec![Vec::new(); self.participants().len()];
        for (number, game) in (0u64..).zip(self.games()) {
            for seat in game.result().iter().flat_map(|result| &result.seats) {
                played[seat.participant].push(Played {
                    game: number,
                    // Even numbers are deals, odd ones games.
                    deal: game.deal.map_or(2 * number + 1, |deal| 2 * u64::from(deal)),
                    round: game.round,
                    score: f64::from(seat.score),
                });
            }
        }
        // Before a game has counted there is no order to judge.
        let ordered = (self.has_counted()).then(|| self.standings());
        let standings = ordered.unwrap_or_default();
        standings
            .windows(2)
            .map(|two| {
                let (upper, lower) = (two[0].participant, two[1].participant);
                let order = confidence_of(&played[upper], &played[lower]);
                Neighbours {
                    upper,
                    lower,
                    order,
                }
            })
            .collect()
    }
}

/// A game as one participant played it.
#[derive(Debug, Clone, Copy)]
struct Played {
    game: u64,
    deal: u64,
    round: u32,
    score: f64,
}

fn confidence_of(upper: &[Played], lower: &[Played]) -> OrderConfidence {
    let games = |played: &[Played]| played.iter().map(|it| it.game).collect::<Vec<u64>>();
    let always_met = games(upper) == games(lower);
    let scored = |played: &[Played]| -> Vec<Scored> {
        let scores = played.iter().map(|it| Scored {
            occasion: if always_met { it.deal } else { it.round.into() },
            score: it.score,
        });
        scores.collect()
    };
    order_confidence(&scored(upper), &scored(lower))
}

fn occasions(scores: &[Scored]) -> usize {
    let occasions: BTreeSet<u64> = scores.iter().map(|scored| scored.occasion).collect();
    occasions.len()
}

fn mean(scores: &[Scored]) -> f64 {
    let mut moments = Moments::default();
    scores.iter().for_each(|scored| moments.add(scored.score));
    moments.mean()
}

/// The standard error of the difference of the means: deviations from the mean, summed by occasion,
/// squared and summed. Each participant's part is scaled by n / (n - 1) for its n occasions,
/// because its mean comes from the same games. Both need at least two occasions.
fn standard_error(upper: &[Scored], lower: &[Scored], means: [f64; 2]) -> f64 {
    let mut by_occasion: BTreeMap<u64, f64> = BTreeMap::new();
    for ((scores, mean), sign) in [upper, lower].into_iter().zip(means).zip([1.0, -1.0]) {
        let mut own: BTreeMap<u64, f64> = BTreeMap::new();
        for scored in scores {
            *own.entry(scored.occasion).or_default() += scored.score - mean;
        }
        let occasions = own.len() as f64;
        let widened = (occasions / (occasions - 1.0)).sqrt();
        for (occasion, sum) in own {
            let part = by_occasion.entry(occasion).or_default();
            *part += sign * widened * sum / scores.len() as f64;
        }
    }
    let squares = by_occasion.values().map(|part| part * part);
    let error = squares.sum::<f64>().sqrt();
    if error < ROUNDING { 0.0 } else { error }
}

/// Student's cumulative distribution with at least one degree of freedom.
fn below(errors: f64, freedom: usize) -> f64 {
    let distribution = StudentsT::new(0.0, 1.0, freedom as f64);
    distribution
        .expect("there is at least one degree of freedom")
        .cdf(errors)
}

#[cfg(test)]
mod tests {
    use crate::confidence::*;

    fn scores(first: u64, scores: &[f64]) -> Vec<Scored> {
        (first..)
            .zip(scores)
            .map(|(occasion, &score)| Scored { occasion, score })
            .collect()
    }

    const UPPER: [f64; 5] = [5.0, 3.0, 5.0, 1.0, 5.0];
    const LOWER: [f64; 5] = [3.0, 1.0, 3.0, 0.0, 5.0];

    fn close(left: f64, right: f64) {
        assert!((left - right).abs() < 1e-9, "{left} is not {right}");
    }

    #[test]
    fn common_occasions_are_paired() {
        let sure = order_confidence(&scores(0, &UPPER), &scores(0, &LOWER));
        // The differences are 2, 2, 2, 1, 0: mean 1.4, variance 0.8.
        close(sure.difference, 1.4);
        close(sure.standard_error, (0.8f64 / 5.0).sqrt());
        // Of the 16 ways to exchange four of them, two are as extreme.
        assert_eq!((sure.confidence, sure.more_games), (0.875, Some(1)));
        let longer = |score: f64| [UPPER.map(|_| 3.0), UPPER.map(|_| score)].concat();
        let with =
            |score: f64| order_confidence(&scores(0, &longer(score)), &scores(0, &[1.0; 10]));
        assert_eq!(
            (with(3.0).confidence, with(3.0).more_games),
            (1.0 - 1.0 / 512.0, None)
        );
        assert_eq!(with(1.0).confidence, 0.9375);
        assert_eq!((with(-1.0).difference, with(-1.0).confidence), (0.0, 0.5));
    }

    #[test]
    fn the_exact_probability_is_that_of_all_tosses() {
        // As for each sum that there is, which are few.
        let by_sums = |differences: &[i64]| -> f64 {
            let mut sums = BTreeMap::from([(0, 1.0)]);
            for difference in differences {
                let mut next: BTreeMap<i64, f64> = BTreeMap::new();
                for (sum, probability) in sums {
                    *next.entry(sum + difference).or_default() += 0.5 * probability;
                    *next.entry(sum - difference).or_default() += 0.5 * probability;
                }
                sums = next;
            }
            let found = differences.iter().sum::<i64>().abs();
            let as_large = sums.iter().filter(|(sum, _)| sum.abs() >= found);
            as_large.map(|(_, probability)| probability).sum()
        };
        assert_eq!(as_large_by_chance(&[]), 1.0);
        let mut seed = 1_u64;
        for occasions in 1..=200 {
            let mut differences = Vec::new();
            for _ in 0..occasions {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                differences.push((seed >> 33) as i64 % 11 - 5);
            }
            let (found, expected) = (as_large_by_chance(&differences), by_sums(&differences));
            assert_eq!(found.to_bits(), expected.to_bits(), "{differences:?}");
        }
    }

    #[test]
    fn many_common_occasions_are_paired_by_their_error() {
        let many = |values: &[f64]| scores(0, &values.repeat(400));
        let sure = order_confidence(&many(&[3.0, 1.0]), &many(&[1.0, 2.9]));
        // Differences of 2 and -1.9: mean 0.05, variance 3.80; 800 occasions.
        close(sure.difference, 0.05);
        assert!((sure.confidence - 0.532).abs() < 1e-3, "{sure:?}");
    }

    #[test]
    fn without_common_occasions_it_is_welchs_test() {
        let sure = order_confidence(&scores(0, &UPPER), &scores(10, &LOWER[..4]));
        // Variances 3.2 of five and 2.25 of four; means 3.8 and 1.75.
        close(sure.difference, 2.05);
        close(sure.standard_error, (3.2f64 / 5.0 + 2.25 / 4.0).sqrt());
    }

    #[test]
    fn opposed_scores_increase_the_error() {
        let upper = [5.0, 3.0, 5.0, 3.0, 5.0, 3.0, 3.0];
        let lower = upper.map(|score| 8.0 - score);
        let apart = order_confidence(&scores(0, &upper), &scores(10, &lower));
        let together = order_confidence(&scores(0, &upper), &scores(0, &lower));
        let ratio = together.standard_error / apart.standard_error;
        close(ratio, std::f64::consts::SQRT_2);
    }

    #[test]
    fn games_of_one_deal_are_one_occasion() {
        // Every deal is played twice with the same outcome: the second game adds no information.
        let once = order_confidence(&scores(0, &UPPER), &scores(0, &LOWER));
        let twice = |values: &[f64]| [scores(0, values), scores(0, values)].concat();
        let both = order_confidence(&twice(&UPPER), &twice(&LOWER));
        close(both.standard_error, once.standard_error);
        close(both.confidence, once.confidence);
    }

    #[test]
    fn the_stated_number_of_games_settles_it() {
        let upper = [5.0, 3.0, 0.0, 5.0, 1.0, 3.0, 5.0, 0.0];
        let lower = [3.0, 5.0, 1.0, 0.0, 3.0, 1.0, 3.0, 5.0];
        let now = order_confidence(&scores(0, &upper), &scores(20, &lower));
        let more = now.more_games.expect("it is not sure yet");
        assert!((0.5..SURE).contains(&now.confidence), "{now:?}");
        // Repeating the same games reaches the stated confidence.
        let repeated = |values: &[f64], times: usize| values.repeat(times);
        let after = |times| {
            let (upper, lower) = (repeated(&upper, times), repeated(&lower, times));
            order_confidence(&scores(0, &upper), &scores(1_000_000, &lower))
        };
        let enough = (8 + more).div_ceil(8);
        let enough = usize::try_from(enough).expect("a small number");
        assert!(after(enough + 1).confidence > SURE);
        assert!(after(enough / 2).confidence < SURE);
    }

    #[test]
    fn too_few_occasions_leave_the_order_open() {
        let none = order_confidence(&[], &scores(0, &LOWER));
        let one = order_confidence(&scores(0, &[5.0]), &scores(0, &LOWER));
        for unknown in [none, one] {
            assert_eq!((unknown.standard_error, unknown.confidence), (0.0, 0.5));
            assert_eq!(unknown.more_games, None);
        }
        let one_deal: Vec<Scored> = [5.0, 5.0].map(|score| Scored { occasion: 7, score }).into();
        let unsure = order_confidence(&one_deal, &scores(0, &LOWER));
        assert_eq!((unsure.confidence, unsure.more_games), (0.5, None));
        let same = order_confidence(&scores(0, &UPPER), &scores(0, &UPPER));
        assert_eq!((same.difference, same.confidence), (0.0, 0.5));
        assert_eq!(same.more_games, None);
    }

    #[test]
    fn a_few_unanimous_games_are_not_certain() {
        let always = |games: usize| {
            let first = scores(0, &vec![5.0; games]);
            order_confidence(&first, &scores(0, &vec![3.0; games]))
        };
        let shifted = UPPER.map(|score| score - 0.9);
        let by_rounding = order_confidence(&scores(0, &UPPER), &scores(0, &shifted));
        assert_eq!(
            (by_rounding.standard_error, by_rounding.confidence),
            (0.0, 0.9375)
        );
        assert_eq!(always(2).confidence, 0.5);
        assert_eq!(always(3).confidence, 0.75);
        assert_eq!(always(4).confidence, 0.875);
        assert_eq!(always(3).more_games, Some(3));
        assert!(always(6).confidence > SURE);
        let against = order_confidence(&scores(0, &[3.0; 3]), &scores(0, &[5.0; 3]));
        assert_eq!((against.confidence, against.more_games), (0.25, None));
    }
}
