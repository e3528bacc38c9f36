//! The results of a comparison: means of each figure, their difference, and its uncertainty.

use std::num::NonZeroU32;

use chefshat_tournament::statistics::{Interval, Moments};

/// The result of a comparison. Means are per seat and Shift.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Deals played, each in every seating.
    pub deals: u64,
    /// Games played.
    pub games: u64,
    /// Shifts played.
    pub shifts: u64,
    /// Points.
    pub points: Figure,
    /// Places, from 1; lower is better.
    pub places: Figure,
    /// Shifts won, as a share from 0 to 1.
    pub wins: Figure,
}

impl Comparison {
    /// A comparison without deals.
    pub(super) fn empty(seatings: usize) -> Comparison {
        Comparison {
            deals: 0,
            games: 0,
            shifts: 0,
            points: Figure::empty(seatings),
            places: Figure::empty(seatings),
            wins: Figure::empty(seatings),
        }
    }

    /// Adds the games of a deal, one for each seating, of `shifts` Shifts each. `weights` are the
    /// seats times Shifts of A and of B.
    pub(super) fn add_deal(&mut self, games: &[Tally], shifts: NonZeroU32, weights: [f64; 2]) {
        self.deals += 1;
        self.games += games.len() as u64;
        self.shifts += games.len() as u64 * u64::from(shifts.get());
        self.points.add_deal(games, |tally| tally.points, weights);
        self.places.add_deal(games, |tally| tally.places, weights);
        self.wins.add_deal(games, |tally| tally.wins, weights);
    }

    /// Adds the deals of another comparison of the same seatings.
    pub(super) fn merge(&mut self, other: &Comparison) {
        self.deals += other.deals;
        self.games += other.games;
        self.shifts += other.shifts;
        self.points.merge(&other.points);
        self.places.merge(&other.places);
        self.wins.merge(&other.wins);
    }
}

/// One figure of a comparison. Deals are the independent units: the games of a deal are summed
/// first.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// By deal: mean of A per seat and Shift.
    a: Moments,
    /// By deal: mean of B per seat and Shift.
    b: Moments,
    /// By deal: the difference of the two.
    difference: Moments,
    /// By seating and deal: the game's part of the difference.
    by_seating: Vec<Moments>,
}

impl Figure {
    fn empty(seatings: usize) -> Figure {
        Figure {
            a: Moments::default(),
            b: Moments::default(),
            difference: Moments::default(),
            by_seating: vec![Moments::default(); seatings],
        }
    }

    /// Mean of A, per seat and Shift.
    pub fn a(&self) -> f64 {
        self.a.mean()
    }

    /// Mean of B, per seat and Shift.
    pub fn b(&self) -> f64 {
        self.b.mean()
    }

    /// A's mean minus B's.
    pub fn difference(&self) -> f64 {
        self.difference.mean()
    }

    /// The 95 % interval of the difference: 1.96 standard errors to either side
    /// ([`Moments::interval95`]).
    pub fn interval95(&self) -> Interval {
        self.difference.interval95()
    }

    /// The standard error of the difference.
    pub fn standard_error(&self) -> f64 {
        self.difference.standard_error()
    }

    /// The standard error of the difference if every game had its own deal: the same games, taken
    /// as independent.
    pub fn independent_standard_error(&self) -> f64 {
        let squares = self.by_seating.iter().map(Moments::standard_error);
        squares.map(|error| error * error).sum::<f64>().sqrt()
    }

    /// How many times as many Shifts with independent deals would give the same standard error.
    /// `None` if the standard error is 0 or unknown.
    pub fn gain(&self) -> Option<f64> {
        let error = self.standard_error();
        (error > 0.0 && error.is_finite())
            .then(|| (self.independent_standard_error() / error).powi(2))
    }

    fn add_deal(&mut self, games: &[Tally], sums: fn(&Tally) -> [u64; 2], weights: [f64; 2]) {
        let share = |[a, b]: [u64; 2]| [a as f64 / weights[0], b as f64 / weights[1]];
        let mut total = [0; 2];
        for (game, moments) in games.iter().zip(&mut self.by_seating) {
            let sums = sums(game);
            total = [total[0] + sums[0], total[1] + sums[1]];
            let [a, b] = share(sums);
            moments.add(a - b);
        }
        // Summed as integers, so that two identical agents have a difference of exactly 0.
        let [a, b] = share(total);
        self.a.add(a);
        self.b.add(b);
        self.difference.add(a - b);
    }

    fn merge(&mut self, other: &Figure) {
        self.a.merge(&other.a);
        self.b.merge(&other.b);
        self.difference.merge(&other.difference);
        for (own, others) in self.by_seating.iter_mut().zip(&other.by_seating) {
            own.merge(others);
        }
    }
}

/// Sums of one game over the Shifts, for the seats of A and of B.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    points: [u64; 2],
    places: [u64; 2],
    wins: [u64; 2],
}

impl Tally {
    /// Adds a seat's Shift: its points, and its place, from 1.
    pub fn add(&mut self, is_a: bool, points: u64, place: u64) {
        let whose = usize::from(!is_a);
        self.points[whose] += points;
        self.places[whose] += place;
        self.wins[whose] += u64::from(place == 1);
    }
}
