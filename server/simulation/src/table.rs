//! Totals of a batch of games, overall and for each seat. Counts are integers; methods compute
//! means.

use chefshat_engine::{BySeat, Seat, ShiftMetrics, SpecialAction, Standings};

/// Totals over the games of a batch.
#[derive(Copy, Clone, PartialEq, Debug)]
pub struct BatchTable {
    /// Finished games.
    pub games: u64,
    /// Shifts.
    pub shifts: u64,
    /// Decisions: turns, gifts of the exchange, special actions declared or declined. Invalid
    /// attempts do not count.
    pub decisions: u64,
    /// Pizzas, including those in progress at the end of a Shift.
    pub pizzas: u64,
    /// Laps, including those in progress at the end of a Shift.
    pub laps: u64,
    /// Turns: plays and passes.
    pub turns: u64,
    /// Shifts that their starter won.
    pub starter_won: u64,
    /// Shifts that reached their limit of turns.
    pub adjudicated: u64,
    /// Shifts in which a Food Fight was declared.
    pub food_fights: u64,
    /// Shifts in which Dinner is Served was declared.
    pub dinners_served: u64,
    /// Totals of each seat.
    pub seats: BySeat<SeatTable>,
}

/// Totals of one seat.
#[derive(Copy, Clone, PartialEq, Debug, Default)]
pub struct SeatTable {
    /// Games it won.
    pub games_won: u64,
    /// Shifts in which it took the first place.
    pub shifts_won: u64,
    /// Sum of its places, from 1, over the Shifts.
    pub place_sum: u64,
    /// Points over all games.
    pub points: u64,
    /// Valid actions at turns: plays and passes.
    pub valid: u64,
    /// Wrong actions: invalid attempts at turns.
    pub wrong: u64,
    /// Plays.
    pub plays: u64,
    /// Passes.
    pub passes: u64,
    /// Sum of its rewards; 0 without a scheme.
    pub reward_sum: f64,
    /// Number of rewarded decisions, valid and wrong actions; 0 without a scheme.
    pub reward_count: u64,
    /// Sum over the games of its performance score at the game's end.
    pub performance_sum: f64,
}

impl BatchTable {
    /// A table without games.
    pub fn empty(players: usize) -> BatchTable {
        BatchTable {
            games: 0,
            shifts: 0,
            decisions: 0,
            pizzas: 0,
            laps: 0,
            turns: 0,
            starter_won: 0,
            adjudicated: 0,
            food_fights: 0,
            dinners_served: 0,
            seats: BySeat::filled(players, SeatTable::default()),
        }
    }

    /// Adds a Shift of a game.
    pub fn add_shift(&mut self, shift: &ShiftMetrics) {
        self.shifts += 1;
        self.pizzas += u64::from(shift.pizzas);
        self.laps += u64::from(shift.laps);
        self.turns += u64::from(shift.turns);
        self.starter_won += u64::from(shift.starter_won);
        self.adjudicated += u64::from(shift.adjudicated);
        match shift.special {
            Some(SpecialAction::FoodFight) => self.food_fights += 1,
            Some(SpecialAction::DinnerIsServed) => self.dinners_served += 1,
            None => {}
        }
        for (seat, metrics) in shift.seats.iter() {
            let sums = &mut self.seats[seat];
            sums.shifts_won += u64::from(metrics.place == 1);
            sums.place_sum += u64::from(metrics.place);
            sums.points += u64::from(metrics.points);
            sums.valid += u64::from(metrics.valid);
            sums.wrong += u64::from(metrics.wrong);
            sums.plays += u64::from(metrics.plays);
            sums.passes += u64::from(metrics.passes);
            sums.reward_sum += metrics.reward_sum;
            sums.reward_count += u64::from(metrics.reward_count);
        }
    }

    /// Adds the end of a game whose Shifts have been added; `last` is its last Shift.
    pub fn add_game_end(&mut self, standings: &Standings, last: &ShiftMetrics) {
        self.games += 1;
        self.seats[standings.winner()].games_won += 1;
        for (seat, metrics) in last.seats.iter() {
            self.seats[seat].performance_sum += metrics.performance;
        }
    }

    /// Adds another table with as many seats. Rounding of rewards and scores depends on the order
    /// of merging, so merge in the order of the games.
    pub fn merge(&mut self, other: &BatchTable) {
        self.games += other.games;
        self.shifts += other.shifts;
        self.decisions += other.decisions;
        self.pizzas += other.pizzas;
        self.laps += other.laps;
        self.turns += other.turns;
        self.starter_won += other.starter_won;
        self.adjudicated += other.adjudicated;
        self.food_fights += other.food_fights;
        self.dinners_served += other.dinners_served;
        for (seat, more) in other.seats.iter() {
            let sums = &mut self.seats[seat];
            sums.games_won += more.games_won;
            sums.shifts_won += more.shifts_won;
            sums.place_sum += more.place_sum;
            sums.points += more.points;
            sums.valid += more.valid;
            sums.wrong += more.wrong;
            sums.plays += more.plays;
            sums.passes += more.passes;
            sums.reward_sum += more.reward_sum;
            sums.reward_count += more.reward_count;
            sums.performance_sum += more.performance_sum;
        }
    }

    /// A count per Shift; 0 without Shifts.
    pub fn per_shift(&self, count: u64) -> f64 {
        ratio(count, self.shifts)
    }

    /// A count per game; 0 without games.
    pub fn per_game(&self, count: u64) -> f64 {
        ratio(count, self.games)
    }

    /// Mean place of a seat over the Shifts, from 1.
    pub fn mean_place(&self, seat: Seat) -> f64 {
        self.per_shift(self.seats[seat].place_sum)
    }

    /// Mean points of a seat per Shift.
    pub fn points_per_shift(&self, seat: Seat) -> f64 {
        self.per_shift(self.seats[seat].points)
    }

    /// Mean reward of a seat's rewarded decisions; `None` without a scheme.
    pub fn mean_reward(&self, seat: Seat) -> Option<f64> {
        let sums = &self.seats[seat];
        (sums.reward_count > 0).then(|| sums.reward_sum / sums.reward_count as f64)
    }

    /// A seat's performance score (10 * points / pizzas, running mean over a game's Shifts) at the
    /// end of a game, averaged over games.
    pub fn performance(&self, seat: Seat) -> f64 {
        if self.games == 0 {
            return 0.0;
        }
        self.seats[seat].performance_sum / self.games as f64
    }
}

fn ratio(count: u64, of: u64) -> f64 {
    if of == 0 {
        return 0.0;
    }
    count as f64 / of as f64
}
