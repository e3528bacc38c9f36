//! What one game does to the ratings of its players.

use skillratings::Outcomes;
use skillratings::weng_lin::{WengLinConfig, WengLinRating, weng_lin};

use super::Rating;

/// How much chance there is in a game, on the scale of skills: what Weng and Lin propose, half of the deviation that ratings begin with.
pub const BETA: f64 = 25.0 / 6.0;

/// The ratings after a game of these players with their places, in the same order. At least two players; equal places are a draw.
///
/// Each pair is updated as a match of two by the library. Two things are done otherwise than in its update of several teams. The pairs
/// count by [`pair_weight`]. And the deviation shrinks by all that a pair tells (the paper's γ is 1): the library's γ, deviation / c, slows that
/// down, the more the surer a rating is, so that after hundreds of games it would claim to know half of what it does.
pub fn after_game(players: &[(Rating, u32)]) -> Vec<Rating> {
    let config = WengLinConfig {
        beta: BETA,
        // So small that it never limits anything.
        uncertainty_tolerance: 1e-9,
    };
    let weight = pair_weight(players.len());
    let library: Vec<WengLinRating> = players.iter().map(|(rating, _)| rating.into()).collect();
    let mut after = Vec::with_capacity(players.len());
    for (index, (rating, place)) in players.iter().enumerate() {
        let variance = rating.deviation * rating.deviation;
        // By how much the mean moves, and the share of the variance that goes.
        let (mut moved, mut shed) = (0.0, 0.0);
        for (other_index, (other, other_place)) in players.iter().enumerate() {
            if other_index == index {
                continue;
            }
            let outcome = match place.cmp(other_place) {
                std::cmp::Ordering::Less => Outcomes::WIN,
                std::cmp::Ordering::Equal => Outcomes::DRAW,
                std::cmp::Ordering::Greater => Outcomes::LOSS,
            };
            let (new, _) = weng_lin(&library[index], &library[other_index], &outcome, &config);
            let c = (2.0 * BETA * BETA + variance + other.deviation * other.deviation).sqrt();
            let gamma = rating.deviation / c;
            moved += new.rating - rating.mean;
            shed += (1.0 - new.uncertainty * new.uncertainty / variance) / gamma;
        }
        after.push(Rating {
            mean: rating.mean + weight * moved,
            deviation: (variance * (1.0 - weight * shed)).sqrt(),
        });
    }
    after
}

/// What a pair of a game of so many players counts, beside 1 for a match that is independent of all else: 3 / (players + 2).
///
/// A ranking of k players has k (k - 1) / 2 pairs, but who won one says something of the others. If skills decide as in the model of
/// Plackett and Luce, the number of others that a player beats varies (k + 1) / 3 times as much among equals as if the pairs were independent,
/// and k / 2 times for one that is much weaker than the others. Moreover the errors of those who met often are not independent, as the update
/// takes them to be. With this weight the stated uncertainty covers the truth equally often for 2 to 6 players
/// ([`chefshat_simulation::calibration`] measures it).
pub fn pair_weight(players: usize) -> f64 {
    3.0 / (players as f64 + 2.0)
}

impl From<&Rating> for WengLinRating {
    fn from(rating: &Rating) -> Self {
        Self {
            rating: rating.mean,
            uncertainty: rating.deviation,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::ratings::update::*;

    #[test]
    fn a_match_of_two_moves_the_means_as_the_library_does_but_less() {
        let [one, two] =
            [(31.0, 2.5), (24.0, 6.0)].map(|(mean, deviation)| Rating { mean, deviation });
        let new = after_game(&[(one, 2), (two, 1)]);
        let config = WengLinConfig::new();
        let (first, second) = weng_lin(&(&one).into(), &(&two).into(), &Outcomes::LOSS, &config);
        for (new, old, library) in [(new[0], one, first), (new[1], two, second)] {
            let moved = 0.75 * (library.rating - old.mean);
            assert!((new.mean - old.mean - moved).abs() < 1e-12);
        }
        // Γ is 1: worked out by hand from the paper's formula.
        let c2 = 2.0 * BETA * BETA + 2.5 * 2.5 + 36.0;
        let p = 1.0 / (1.0 + (-7.0 / c2.sqrt()).exp());
        let variance = 6.25 * (1.0 - 0.75 * 6.25 / c2 * p * (1.0 - p));
        assert!((new[0].deviation - variance.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn a_game_of_four_moves_the_means_half_as_far_as_its_pairs() {
        let players: Vec<(Rating, u32)> = (1..=4).map(|place| (Rating::default(), place)).collect();
        let new = after_game(&players);
        // From nothing each pair moves them by variance / (2 c).
        let variance = crate::ratings::FIRST_DEVIATION.powi(2);
        let pair = variance / (2.0 * (2.0 * BETA * BETA + 2.0 * variance).sqrt());
        for (rating, moved) in new.iter().zip([1.5, 0.5, -0.5, -1.5]) {
            assert!((rating.mean - crate::ratings::FIRST_MEAN - moved * pair).abs() < 1e-9);
            assert!(rating.deviation < crate::ratings::FIRST_DEVIATION);
        }
    }
}
