//! Skill ratings with their uncertainty, from the places taken in games. The caller decides which
//! games count.
//!
//! The method is Weng and Lin's (*A Bayesian Approximation Method for Online Ranking*, 2011,
//! Bradley-Terry with full pairs): every pair of a game counts as a match. Since the pairs of one
//! ranking are not independent, they have less weight here; see [`pair_weight`], and
//! `docs/ratings.md` for measurements.
//!
//! ```
//! use chefshat_tournament::ratings::Ratings;
//!
//! let mut ratings = Ratings::default();
//! ratings.fold(&[("Greta", 1), ("Rosa", 2), ("Gustav", 3), ("Rolf", 4)])?;
//! ratings.fold(&[("Greta", 1), ("Rosa", 3), ("Gustav", 2), ("Rolf", 4)])?;
//! let names: Vec<&str> = ratings.leaderboard(|_| true, 0).iter().map(|(who, _)| **who).collect();
//! assert_eq!(names, ["Greta", "Gustav", "Rosa", "Rolf"]);
//! # Ok::<(), chefshat_tournament::ratings::GameProblem>(())
//! ```

use std::collections::{BTreeMap, BTreeSet};

use chefshat_engine::MAX_SEATS;
use skillratings::Outcomes;
use skillratings::weng_lin::{WengLinConfig, WengLinRating, weng_lin};
use thiserror::Error;

/// Mean of an initial rating.
pub const FIRST_MEAN: f64 = 25.0;
/// Deviation of an initial rating.
pub const FIRST_DEVIATION: f64 = 25.0 / 3.0;
/// Deviations subtracted for a cautious estimate.
const CAUTION: f64 = 2.0;

/// An estimate of a skill, as a normal distribution. A player better by d beats the other in a game
/// with probability 1 / (1 + exp(-d / 5.89)); see [`win_chance`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rating {
    /// Mean.
    pub mean: f64,
    /// Standard deviation. Skills have no zero point, so it is relative to other players.
    pub deviation: f64,
}

impl Default for Rating {
    fn default() -> Self {
        Self {
            mean: FIRST_MEAN,
            deviation: FIRST_DEVIATION,
        }
    }
}

impl Rating {
    /// The cautious estimate that leaderboards sort by: the mean minus two deviations.
    pub fn cautious(&self) -> f64 {
        self.mean - CAUTION * self.deviation
    }
}

/// The probability that a player of the first skill is placed before one of the other.
pub fn win_chance(skill: f64, other: f64) -> f64 {
    1.0 / (1.0 + ((other - skill) / (BETA * std::f64::consts::SQRT_2)).exp())
}

/// A participant's rating and the games behind it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Rated {
    /// The rating.
    pub rating: Rating,
    /// Rated games.
    pub games: u32,
    /// Number of games by place; index 0 is the first place. As long as the worst place taken.
    pub places: Vec<u32>,
}

/// How a participant finished a game.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Finish {
    /// With this place from 1.
    Place(u32),
    /// The game was broken off by others. It is compared only with those who forfeited it.
    Unplaced,
    /// It has lost to all others, also to those who forfeited the game, too.
    Forfeited,
}

impl Finish {
    /// What a finish is against another; `None` if the two are not compared.
    fn against(self, other: Self) -> Option<Outcomes> {
        Some(match (self, other) {
            (Self::Forfeited, _) => Outcomes::LOSS,
            (_, Self::Forfeited) => Outcomes::WIN,
            (Self::Place(place), Self::Place(other)) => match place.cmp(&other) {
                std::cmp::Ordering::Less => Outcomes::WIN,
                std::cmp::Ordering::Equal => Outcomes::DRAW,
                std::cmp::Ordering::Greater => Outcomes::LOSS,
            },
            (Self::Unplaced, _) | (_, Self::Unplaced) => return None,
        })
    }
}

/// Ratings of all participants, updated game by game. The order matters slightly: to reproduce the
/// numbers, fold games by their time of ending, then by game id.
#[derive(Debug, Clone, PartialEq)]
pub struct Ratings<Who> {
    rated: BTreeMap<Who, Rated>,
    games: u64,
}

impl<Who> Default for Ratings<Who> {
    fn default() -> Self {
        Self {
            rated: BTreeMap::new(),
            games: 0,
        }
    }
}

/// Why a game cannot be rated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum GameProblem {
    /// Too few or too many players.
    #[error("a game of {0} players cannot be rated; 2 to {MAX_SEATS} players are needed")]
    Players(usize),
    /// A participant has several seats.
    #[error("a participant had more than one seat")]
    SameParticipant,
    /// A place is not from 1 to the number of players.
    #[error("place {0} does not exist in this game")]
    Place(u32),
}

impl<Who: Ord + Clone> Ratings<Who> {
    /// Adds a game: its participants, each with its place from 1.
    ///
    /// # Errors
    /// If the game cannot be rated. The ratings are then unchanged.
    pub fn fold(&mut self, game: &[(Who, u32)]) -> Result<(), GameProblem> {
        let placed = game.iter().cloned();
        let placed: Vec<_> = placed.map(|(who, it)| (who, Finish::Place(it))).collect();
        self.fold_finishes(&placed)
    }

    /// Adds a game that participants may have forfeited.
    ///
    /// # Errors
    /// If the game cannot be rated. The ratings are then unchanged.
    pub fn fold_finishes(&mut self, game: &[(Who, Finish)]) -> Result<(), GameProblem> {
        let players = game.len();
        if !(2..=MAX_SEATS).contains(&players) {
            return Err(GameProblem::Players(players));
        }
        if game
            .iter()
            .map(|(who, _)| who)
            .collect::<BTreeSet<_>>()
            .len()
            != players
        {
            return Err(GameProblem::SameParticipant);
        }
        let index = |place: u32| usize::try_from(place).ok()?.checked_sub(1);
        let fits = |place| index(place).is_some_and(|index| index < players);
        let mut places = game.iter().filter_map(|(_, finish)| match finish {
            Finish::Place(place) => Some(*place),
            Finish::Unplaced | Finish::Forfeited => None,
        });
        if let Some(place) = places.find(|place| !fits(*place)) {
            return Err(GameProblem::Place(place));
        }
        // Sorted by place, so that the order of the seats does not affect rounding.
        let mut game = game.to_vec();
        game.sort_by_key(|(_, finish)| *finish);
        let before: Vec<(Rating, Finish)> = game
            .iter()
            .map(|(who, finish)| (self.rating(who), *finish))
            .collect();
        for ((who, finish), rating) in game.iter().zip(after_finishes(&before)) {
            let rated = self.rated.entry(who.clone()).or_default();
            rated.rating = rating;
            rated.games = rated.games.saturating_add(1);
            let index = match finish {
                Finish::Place(place) => index(*place).expect("all places were checked"),
                Finish::Forfeited => players - 1,
                Finish::Unplaced => continue,
            };
            if rated.places.len() <= index {
                rated.places.resize(index + 1, 0);
            }
            rated.places[index] = rated.places[index].saturating_add(1);
        }
        self.games += 1;
        Ok(())
    }

    /// The rating of a participant; the initial rating before its first game.
    pub fn rating(&self, who: &Who) -> Rating {
        self.get(who).map(|rated| rated.rating).unwrap_or_default()
    }

    /// The rating and games of a participant; `None` before its first game.
    pub fn get(&self, who: &Who) -> Option<&Rated> {
        self.rated.get(who)
    }

    /// Number of games added.
    pub fn games(&self) -> u64 {
        self.games
    }

    /// The participants accepted by `shown` with at least `min_games` games, best cautious estimate
    /// first, so that a few lucky games do not lead. Ties are in the order of `Who`.
    pub fn leaderboard(&self, shown: impl Fn(&Who) -> bool, min_games: u32) -> Vec<(&Who, &Rated)> {
        let mut lines: Vec<(&Who, &Rated)> = self
            .rated
            .iter()
            .filter(|(who, rated)| rated.games >= min_games && shown(who))
            .collect();
        lines.sort_by(|(_, left), (_, right)| {
            let (left, right) = (left.rating.cautious(), right.rating.cautious());
            right.total_cmp(&left)
        });
        lines
    }
}

/// Randomness of a game on the skill scale: as Weng and Lin propose, half the initial deviation.
pub const BETA: f64 = 25.0 / 6.0;

/// The ratings of at least two players after a game, in the same order. Equal places are a draw.
///
/// The library updates each pair as a match of two. Two things differ from its update of several
/// teams: pairs have the weight [`pair_weight`], and the deviation shrinks by the full information
/// of a pair (the paper's γ is 1). The library's γ, deviation / c, slows that down more the more
/// certain a rating is: after hundreds of games it would state half of what is known.
pub fn after_game(players: &[(Rating, u32)]) -> Vec<Rating> {
    let placed = players.iter();
    let placed: Vec<_> = (placed.map(|(rating, place)| (*rating, Finish::Place(*place)))).collect();
    after_finishes(&placed)
}

fn after_finishes(players: &[(Rating, Finish)]) -> Vec<Rating> {
    let config = WengLinConfig {
        beta: BETA,
        // Too small to have an effect.
        uncertainty_tolerance: 1e-9,
    };
    let weight = pair_weight(players.len());
    let library: Vec<WengLinRating> = players.iter().map(|(rating, _)| rating.into()).collect();
    let mut after = Vec::with_capacity(players.len());
    for (index, (rating, finish)) in players.iter().enumerate() {
        let variance = rating.deviation * rating.deviation;
        // Change of the mean, and the share of the variance that is removed.
        let (mut moved, mut shed) = (0.0, 0.0);
        for (other_index, (other, other_finish)) in players.iter().enumerate() {
            if other_index == index {
                continue;
            }
            let Some(outcome) = finish.against(*other_finish) else {
                continue;
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

/// The weight of one pair in a game of `players`, where an independent match has 1: 3 / (players +
/// 2).
///
/// A ranking of k players has k (k - 1) / 2 pairs, but their outcomes are related. Under the model
/// of Plackett and Luce, the number of others that a player beats varies (k + 1) / 3 times as much
/// among equals as if the pairs were independent, and k / 2 times for a much weaker player. The
/// errors of players who met often are related too, which the update ignores. With this weight the
/// stated uncertainty covers the truth equally often for 2 to 6 players; `experiment ratings`
/// measures it.
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
    use super::*;

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
        // Γ is 1: computed by hand from the paper's formula.
        let c2 = 2.0 * BETA * BETA + 2.5 * 2.5 + 36.0;
        let p = 1.0 / (1.0 + (-7.0 / c2.sqrt()).exp());
        let variance = 6.25 * (1.0 - 0.75 * 6.25 / c2 * p * (1.0 - p));
        assert!((new[0].deviation - variance.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn a_game_of_four_moves_the_means_half_as_far_as_its_pairs() {
        let players: Vec<(Rating, u32)> = (1..=4).map(|place| (Rating::default(), place)).collect();
        let new = after_game(&players);
        // From the initial rating each pair moves the means by variance / (2 c).
        let variance = FIRST_DEVIATION.powi(2);
        let pair = variance / (2.0 * (2.0 * BETA * BETA + 2.0 * variance).sqrt());
        for (rating, moved) in new.iter().zip([1.5, 0.5, -0.5, -1.5]) {
            assert!((rating.mean - FIRST_MEAN - moved * pair).abs() < 1e-9);
            assert!(rating.deviation < FIRST_DEVIATION);
        }
    }
}
