//! How the participants of a tournament stand, and how those of one pairing do. Ratings, and how sure an order is, are worked out
//! elsewhere.

use std::cmp::{Ordering, Reverse};

use super::Tournament;
use super::chance::Chance;
use super::course::{Course, Pairing, State, Sums};
use super::settings::Format;

/// How a participant stands. Games it forfeited count, with a score of 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Standing {
    /// Place in the tournament, from 1; 0 for all as long as no game has counted: they stand in the order of joining then. The mean score of a
    /// game decides, then the mean of points, then, among those who are level, who was more often placed better when they met, then the draw.
    /// In a knockout those who got further come first: in later rounds, then in a better place at their last table, once its round is over.
    pub place: u32,
    /// Who.
    pub participant: usize,
    /// Knockout: the round it was last in, from 1; else 0.
    pub last_round: u32,
    /// Games that counted for it.
    pub games: u32,
    /// Byes it had.
    pub byes: u32,
    /// Sum of scores.
    pub score: u64,
    /// Sum of points in the games.
    pub points: u64,
    /// Games by place; index 0 is the first.
    pub places: Vec<u32>,
    /// Games it forfeited.
    pub forfeited: u32,
    /// Games in which a substitute took decisions for it.
    pub substituted: u32,
    /// Invalid actions.
    pub wrong_actions: u64,
    /// Decisions lost to the clock.
    pub timeouts: u64,
    /// Mean measured time of a decision, microseconds; 0 if none was measured.
    pub mean_decision_time_us: f64,
    /// Mean performance score of a game that it played; 0 if it played none.
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

    /// Mean score of a game; 0 if none counted.
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
    /// Whether a game has counted: before, nobody is better than anybody else.
    pub fn has_counted(&self) -> bool {
        self.course.sums.iter().any(|sums| sums.games > 0)
    }

    /// How all stand, best first; fillers are among them.
    pub fn standings(&self) -> Vec<Standing> {
        let course = &self.course;
        let format = course.settings.format;
        let standing = |who: usize| Standing::new(who, &course.sums[who], format);
        if !self.has_counted() {
            return (0..course.participants.len()).map(standing).collect();
        }
        let ordered = order(course).into_iter().zip(1..);
        let placed = |(who, place)| Standing {
            place,
            ..standing(who)
        };
        ordered.map(placed).collect()
    }
}

/// All participants, best first.
pub(super) fn order(course: &Course) -> Vec<usize> {
    let tables = last_tables(course);
    let level = |&a: &usize, &b: &usize| {
        let (left, right) = (&course.sums[a], &course.sums[b]);
        let further = if course.settings.format == Format::Knockout {
            (right.last_round, tables[a]).cmp(&(left.last_round, tables[b]))
        } else {
            Ordering::Equal
        };
        further
            .then_with(|| by_mean(left.score, left.games, right.score, right.games))
            .then_with(|| by_mean(left.points, left.games, right.points, right.games))
    };
    let mut order: Vec<usize> = (0..course.participants.len()).collect();
    order.sort_by(level);
    let mut group = vec![0; order.len()];
    for pair in order.windows(2) {
        let apart = level(&pair[0], &pair[1]) != Ordering::Equal;
        group[pair[1]] = group[pair[0]] + usize::from(apart);
    }
    let balance = balances(course, &group);
    let lots = lots(course);
    order.sort_by_key(|&who| (group[who], Reverse(balance[who]), lots[who]));
    order
}

/// The participants of a pairing, best first: by the sum of their scores in its games, by their points, by their places (which says who was
/// placed better, as they met in all of them), by the draw.
pub(super) fn order_of_pairing(course: &Course, pairing: &Pairing) -> Vec<usize> {
    let key = |who: &usize| {
        let (mut score, mut points, mut places) = (0, 0, 0);
        let results = course.games[pairing.games.clone()]
            .iter()
            .filter_map(|game| game.result());
        for seat in results.flat_map(|result| &result.seats) {
            if seat.participant == *who {
                score += u64::from(seat.score);
                points += seat.did.points;
                places += seat.did.place;
            }
        }
        let lot = Chance::lot(course.settings.draw_seed, *who);
        (Reverse(score), Reverse(points), places, lot)
    };
    let mut order = pairing.table.clone();
    order.sort_by_cached_key(key);
    order
}

/// Place of each participant in the pairing of its last round, 0 while the round is being played. Empty but in a knockout.
fn last_tables(course: &Course) -> Vec<usize> {
    if course.settings.format != Format::Knockout {
        return Vec::new();
    }
    let mut places = vec![0; course.participants.len()];
    for pairing in &course.pairings {
        // A tournament that was closed has given games up that nobody lost.
        let is_over =
            pairing.round < course.drawn || course.is_round_over() && course.state != State::Closed;
        for (index, who) in order_of_pairing(course, pairing).into_iter().enumerate() {
            places[who] = if is_over { index + 1 } else { 0 };
        }
    }
    places
}

/// The larger mean first, without a rounding; nothing of no games is 0.
fn by_mean(left: u64, left_games: u32, right: u64, right_games: u32) -> Ordering {
    let cross = |sum: u64, games: u32| u128::from(sum) * u128::from(games.max(1));
    cross(right, left_games).cmp(&cross(left, right_games))
}

/// How often each participant was placed better, less how often worse, where it met others of its group.
fn balances(course: &Course, group: &[usize]) -> Vec<i64> {
    let mut balance = vec![0; group.len()];
    for result in course.games.iter().filter_map(|game| game.result()) {
        for one in &result.seats {
            for other in &result.seats {
                if group[one.participant] == group[other.participant] {
                    balance[one.participant] += match one.did.place.cmp(&other.did.place) {
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

fn lots(course: &Course) -> Vec<u64> {
    let everybody = 0..course.participants.len();
    everybody
        .map(|who| Chance::lot(course.settings.draw_seed, who))
        .collect()
}
