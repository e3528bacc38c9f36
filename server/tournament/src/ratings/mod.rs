//! Ratings: how good participants are, told from the places they took in games, each with its uncertainty. Which games count, and who
//! somebody is, is decided by the caller; how one game changes its players is in `update`.
//!
//! The method is Weng and Lin's (*A Bayesian Approximation Method for Online Ranking*, 2011, Bradley-Terry with full pairs): every pair of a
//! game counts as a small match. Since the pairs of one ranking are not independent, they count less here than independent ones would; see
//! [`pair_weight`] and, for what was measured, `docs/ratings.md`.
//!
//! ```
//! use chefshat_arena::ratings::Ratings;
//!
//! let mut ratings = Ratings::default();
//! ratings.fold(&[("Greta", 1), ("Rosa", 2), ("Gustav", 3), ("Rolf", 4)])?;
//! ratings.fold(&[("Greta", 1), ("Rosa", 3), ("Gustav", 2), ("Rolf", 4)])?;
//! let names: Vec<&str> = ratings.leaderboard(|_| true, 0).iter().map(|(who, _)| **who).collect();
//! assert_eq!(names, ["Greta", "Gustav", "Rosa", "Rolf"]);
//! # Ok::<(), chefshat_arena::ratings::GameProblem>(())
//! ```

mod update;

use std::collections::{BTreeMap, BTreeSet};

use chefshat_engine::MAX_SEATS;
use thiserror::Error;

pub use update::{BETA, after_game, pair_weight};

/// Mean that a rating begins with.
pub const FIRST_MEAN: f64 = 25.0;
/// Deviation that a rating begins with.
pub const FIRST_DEVIATION: f64 = 25.0 / 3.0;
/// Deviations by which a leaderboard is cautious.
const CAUTION: f64 = 2.0;

/// What is believed of a skill: a normal distribution. Who is better by d beats the other in a game with the probability
/// 1 / (1 + exp(-d / 5.89)); see [`win_chance`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rating {
    /// Mean of what is believed.
    pub mean: f64,
    /// Standard deviation of it. Skills have no zero, so that it is meant relative to the others.
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
    /// By what leaderboards go: what the skill is at least, almost certainly.
    pub fn cautious(&self) -> f64 {
        self.mean - CAUTION * self.deviation
    }
}

/// The probability that somebody of the one skill is placed before somebody of the other.
pub fn win_chance(skill: f64, other: f64) -> f64 {
    1.0 / (1.0 + ((other - skill) / (update::BETA * std::f64::consts::SQRT_2)).exp())
}

/// A participant's rating and what it came from.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Rated {
    /// The rating.
    pub rating: Rating,
    /// Rated games.
    pub games: u32,
    /// Games by place; index 0 is the first. As long as the worst place taken.
    pub places: Vec<u32>,
}

/// The ratings of all who took part in some games, folded game by game. The order of the games matters a little: fold them in the order
/// in which they ended, and those that ended together by their game ids, to come to the same numbers again.
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
    /// Nobody was better than anybody.
    #[error("a game of {0} players tells nothing; rated are games of 2 to {MAX_SEATS}")]
    Players(usize),
    /// Nobody is better than oneself.
    #[error("a participant had more than one seat")]
    SameParticipant,
    /// Places count from 1 to the number of players.
    #[error("there is no place {0} in the game")]
    Place(u32),
}

impl<Who: Ord + Clone> Ratings<Who> {
    /// Takes in a game: who played, and the place of each, from 1.
    ///
    /// # Errors
    /// If the game cannot be rated; the ratings are then as they were.
    pub fn fold(&mut self, game: &[(Who, u32)]) -> Result<(), GameProblem> {
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
        if let Some((_, place)) = game.iter().find(|(_, place)| !fits(*place)) {
            return Err(GameProblem::Place(*place));
        }
        // By place, so that the same games give the same numbers to the last digit, in whatever order their seats are told.
        let mut game = game.to_vec();
        game.sort_by_key(|(_, place)| *place);
        let before: Vec<(Rating, u32)> = game
            .iter()
            .map(|(who, place)| (self.rating(who), *place))
            .collect();
        for ((who, place), rating) in game.iter().zip(after_game(&before)) {
            let rated = self.rated.entry(who.clone()).or_default();
            rated.rating = rating;
            rated.games = rated.games.saturating_add(1);
            let index = index(*place).expect("all places were looked at");
            if rated.places.len() <= index {
                rated.places.resize(index + 1, 0);
            }
            rated.places[index] = rated.places[index].saturating_add(1);
        }
        self.games += 1;
        Ok(())
    }

    /// The rating of a participant; that of somebody who has not played is where all begin.
    pub fn rating(&self, who: &Who) -> Rating {
        self.get(who).map(|rated| rated.rating).unwrap_or_default()
    }

    /// What is known of a participant, once it has played.
    pub fn get(&self, who: &Who) -> Option<&Rated> {
        self.rated.get(who)
    }

    /// Games taken in.
    pub fn games(&self) -> u64 {
        self.games
    }

    /// Those of whom `shown` says so and who have played at least so many games, best first: by the mean less two deviations, so that nobody
    /// is at the top for a few lucky games; of the same rating by their own order.
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
