//! Standings of a tournament, and the order within one pairing.

use std::cmp::{Ordering, Reverse};

use super::Tournament;
use super::chance::Chance;
use super::settings::Format;
use super::state::{Pairing, State, Sums, TournamentState};
use crate::ratings::Ratings;

/// The standing of a participant. Forfeited games count with a score of 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Standing {
    /// Place, from 1; 0 for all before a game has counted, in the order of joining. Those who have
    /// played a game come first. Sorted by mean score of a game, then mean points, then head-to-head
    /// results among equals, then a random tie break. In a knockout the round reached comes first,
    /// then the place at the last table once its round is over.
    pub place: u32,
    /// The participant's number.
    pub participant: usize,
    /// In a knockout the last round it played, from 1; else 0.
    pub last_round: u32,
    /// Number of games that counted.
    pub games: u32,
    /// Number of byes.
    pub byes: u32,
    /// Sum of scores.
    pub score: u64,
    /// Sum of points in the games.
    pub points: u64,
    /// Number of games by place; index 0 is the first place.
    pub places: Vec<u32>,
    /// Number of forfeited games.
    pub forfeited: u32,
    /// Number of games in which a substitute took decisions.
    pub substituted: u32,
    /// Invalid actions.
    pub wrong_actions: u64,
    /// Decisions lost to the clock.
    pub timeouts: u64,
    /// Mean measured time of a decision, microseconds; 0 if none was measured.
    pub mean_decision_time_us: f64,
    /// Mean performance score of the games it played; 0 without a game.
    pub performance_score: f64,
}

impl Standing {
    fn new(participant: usize, sums: &Sums, format: Format) -> Standing {
        let played = sums.games - sums.forfeited;
        Standing {
            place: 0,
            participant,
            last_round: if format == Format::Knockout {
                sums.last_round
            } else {
                0
            },
            games: sums.games,
            byes: sums.byes,
            score: sums.score,
            points: sums.points,
            places: sums.places.clone(),
            forfeited: sums.forfeited,
            substituted: sums.substituted,
            wrong_actions: sums.wrong_actions,
            timeouts: sums.timeouts,
            mean_decision_time_us: ratio(sums.decision_time_us as f64, sums.timed_decisions),
            performance_score: ratio(sums.performance, u64::from(played)),
        }
    }

    /// Mean score of a game; 0 without a game.
    pub fn mean_score(&self) -> f64 {
        ratio(self.score as f64, u64::from(self.games))
    }
}

fn ratio(sum: f64, count: u64) -> f64 {
    if count == 0 {
        return 0.0;
    }
    sum / count as f64
}

impl Tournament {
    /// Whether a game has counted. Before that all are equal.
    pub fn has_counted(&self) -> bool {
        self.state.sums.iter().any(|sums| sums.games > 0)
    }

    /// Ratings by participant number, from the rated games of this tournament in order.
    pub fn ratings(&self) -> Ratings<usize> {
        let mut ratings = Ratings::default();
        for game in self.games().iter().filter(|game| game.is_rated()) {
            let Some(result) = game.result() else {
                continue;
            };
            let places: Vec<(usize, u32)> = result
                .seats
                .iter()
                .map(|seat| {
                    (
                        seat.participant,
                        u32::try_from(seat.statistics.place).unwrap_or(u32::MAX),
                    )
                })
                .collect();
            // A game that cannot be rated is skipped.
            let _ = ratings.fold(&places);
        }
        ratings
    }

    /// The standings, best first, with fillers.
    pub fn standings(&self) -> Vec<Standing> {
        let state = &self.state;
        let format = state.settings.format;
        let standing = |who: usize| Standing::new(who, &state.sums[who], format);
        if !self.has_counted() {
            return state.everybody().into_iter().map(standing).collect();
        }
        let ordered = order(state).into_iter().zip(1..);
        let placed = |(who, place)| Standing {
            place,
            ..standing(who)
        };
        ordered.map(placed).collect()
    }
}

/// All participants, best first.
pub(super) fn order(state: &TournamentState) -> Vec<usize> {
    let tables = last_tables(state);
    let level = |&a: &usize, &b: &usize| {
        let (left, right) = (&state.sums[a], &state.sums[b]);
        let further = if state.settings.format == Format::Knockout {
            (right.last_round, tables[a]).cmp(&(left.last_round, tables[b]))
        } else {
            Ordering::Equal
        };
        (right.has_played().cmp(&left.has_played()))
            .then(further)
            .then_with(|| by_mean(left.score, left.games, right.score, right.games))
            .then_with(|| by_mean(left.points, left.games, right.points, right.games))
    };
    let mut order = state.everybody();
    order.sort_by(level);
    let mut group = vec![0; state.participants.len()];
    for pair in order.windows(2) {
        let apart = level(&pair[0], &pair[1]) != Ordering::Equal;
        group[pair[1]] = group[pair[0]] + usize::from(apart);
    }
    let balance = balances(state, &group);
    let tie_breaks = tie_breaks(state);
    order.sort_by_key(|&who| (group[who], Reverse(balance[who]), tie_breaks[who]));
    order
}

/// The participants of a pairing, best first: by total score, total points, places, tie break.
pub(super) fn order_of_pairing(state: &TournamentState, pairing: &Pairing) -> Vec<usize> {
    let key = |who: &usize| {
        let (mut score, mut points, mut places) = (0, 0, 0);
        let results = state.games[pairing.games.clone()]
            .iter()
            .filter_map(|game| game.result());
        for seat in results.flat_map(|result| &result.seats) {
            if seat.participant == *who {
                score += u64::from(seat.score);
                points += seat.statistics.points;
                places += seat.statistics.place;
            }
        }
        let tie_break = Chance::tie_break(state.settings.draw_seed, *who);
        (Reverse(score), Reverse(points), places, tie_break)
    };
    let mut order = pairing.table.clone();
    order.sort_by_cached_key(key);
    order
}

/// Place of each participant in the pairing of its last round; 0 while that round is being played.
/// Empty except in a knockout.
fn last_tables(state: &TournamentState) -> Vec<usize> {
    if state.settings.format != Format::Knockout {
        return Vec::new();
    }
    let mut places = vec![0; state.participants.len()];
    for pairing in &state.pairings {
        // Closing a tournament voids games that nobody lost.
        let is_over =
            pairing.round < state.drawn || state.is_round_over() && state.phase != State::Closed;
        for (index, who) in order_of_pairing(state, pairing).into_iter().enumerate() {
            places[who] = if is_over { index + 1 } else { 0 };
        }
    }
    places
}

/// Orders the larger mean first, without rounding. The mean of no games is 0.
fn by_mean(left: u64, left_games: u32, right: u64, right_games: u32) -> Ordering {
    let cross = |sum: u64, games: u32| u128::from(sum) * u128::from(games.max(1));
    cross(right, left_games).cmp(&cross(left, right_games))
}

/// For each participant, how often it was placed better minus how often worse in games with others
/// of its group.
fn balances(state: &TournamentState, group: &[usize]) -> Vec<i64> {
    let mut balance = vec![0; group.len()];
    for result in state.games.iter().filter_map(|game| game.result()) {
        for one in &result.seats {
            for other in &result.seats {
                if group[one.participant] == group[other.participant] {
                    balance[one.participant] +=
                        match one.statistics.place.cmp(&other.statistics.place) {
                            Ordering::Less => 1,
                            Ordering::Equal => 0,
                            Ordering::Greater => -1,
                        };
                }
            }
        }
    }
    balance
}

fn tie_breaks(state: &TournamentState) -> Vec<u64> {
    let everybody = 0..state.participants.len();
    everybody
        .map(|who| Chance::tie_break(state.settings.draw_seed, who))
        .collect()
}
