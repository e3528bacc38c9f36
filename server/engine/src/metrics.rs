//! Metrics of each Shift (`docs/rules.md` §8.7), collected from events. Averaging over games and
//! printing are left to others.

use crate::{
    BySeat, Event, Game, RewardScheme, RuleSet, Seat, SeatOrder, ShiftEnd, SpecialAction,
    StateError, Viewer,
};

/// Metrics of one seat in one Shift.
#[derive(Copy, Clone, PartialEq, Debug, Default)]
pub struct SeatMetrics {
    /// Its place, from 1.
    pub place: u8,
    /// Its points in the Shift.
    pub points: u32,
    /// Valid actions at turns: plays and passes.
    pub valid: u32,
    /// Wrong actions: invalid attempts at turns.
    pub wrong: u32,
    /// Passes.
    pub passes: u32,
    /// Plays.
    pub plays: u32,
    /// Sum of its rewards, including those at the end of the Shift; 0 without a scheme.
    pub reward_sum: f64,
    /// Number of rewarded decisions: valid and wrong actions; 0 without a scheme.
    pub reward_count: u32,
    /// Performance score: the running mean over the Shifts so far of 10 * points / pizzas.
    pub performance: f64,
}

impl SeatMetrics {
    /// Mean reward of the rewarded decisions, or `None` if there were none.
    pub fn mean_reward(&self) -> Option<f64> {
        (self.reward_count > 0).then(|| self.reward_sum / f64::from(self.reward_count))
    }
}

/// Counts whose decisions those of a participant are that had a choice: its own, or those of another
/// agent, its fallback, which decided when it could not.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct OwnChoices {
    choices: u32,
    fallbacks: u32,
}

impl OwnChoices {
    /// The fallback may take one decision in this number.
    pub const ONE_IN: u32 = 10;

    /// Counts a decision with a choice.
    pub fn add(&mut self, by_fallback: bool) {
        self.choices = self.choices.saturating_add(1);
        self.fallbacks = self.fallbacks.saturating_add(u32::from(by_fallback));
    }

    /// Whether the participant played by itself: the fallback decided at most a tenth.
    pub fn are_own(&self) -> bool {
        self.fallbacks <= self.choices / Self::ONE_IN
    }
}

/// The result of one seat in a game, and statistics of how it played.
#[derive(Copy, Clone, PartialEq, Debug, Default)]
pub struct SeatStatistics {
    /// Place in the game, from 1.
    pub place: usize,
    /// Points in the game.
    pub points: u64,
    /// Whether a substitute ever played for the seat.
    pub substituted: bool,
    /// Whether the seat was given a hint.
    pub hinted: bool,
    /// Decisions of the participant, including timeouts and invalid attempts; excludes those of a
    /// substitute or taken over from another record.
    pub decisions: u64,
    /// Invalid attempts at those decisions.
    pub wrong_actions: u64,
    /// Those decisions that timed out, connected or not.
    pub timeouts: u64,
    /// Total measured time of the participant's own decisions, microseconds.
    pub decision_time_us: u64,
    /// Number of measured decisions; those of built-in agents are not measured.
    pub timed_decisions: u64,
    /// Performance score: the mean over the game's Shifts of 10 * points / pizzas.
    pub performance_score: f64,
}

/// Metrics of one Shift.
#[derive(Copy, Clone, PartialEq, Debug)]
pub struct ShiftMetrics {
    /// Number of the Shift, from 1.
    pub shift: u32,
    /// Seats by place.
    pub order: SeatOrder,
    /// Pizzas, the one in progress at the end included.
    pub pizzas: u32,
    /// Laps, the one in progress at the end included.
    pub laps: u32,
    /// Turns: plays and passes.
    pub turns: u32,
    /// Seat that took the first turn.
    pub starter: Seat,
    /// Whether the starter took the first place.
    pub starter_won: bool,
    /// The special action declared, if any.
    pub special: Option<SpecialAction>,
    /// Whether the Shift reached its limit of turns.
    pub adjudicated: bool,
    /// Metrics of each seat.
    pub seats: BySeat<SeatMetrics>,
}

/// What a [`MetricsRecorder`] has counted of one seat in the current Shift.
#[derive(Copy, Clone, PartialEq, Debug, Default)]
pub struct SeatCounts {
    /// Plays.
    pub plays: u32,
    /// Passes.
    pub passes: u32,
    /// Invalid attempts at turns.
    pub wrong: u32,
    /// Sum of the rewards; 0 without a scheme.
    pub reward_sum: f64,
    /// Sum of 10 * points / pizzas over the Shifts that ended.
    pub performance_sum: f64,
}

/// The complete state of a [`MetricsRecorder`], beside its game's.
#[derive(Copy, Clone, PartialEq, Debug)]
pub struct RecorderState {
    /// Shifts that ended.
    pub shifts: u32,
    /// Counts of each seat.
    pub seats: BySeat<SeatCounts>,
}

/// Collects metrics from a game's events, and from wrong actions, which are not events.
#[derive(Copy, Clone, Debug)]
pub struct MetricsRecorder {
    rules: RuleSet,
    scheme: Option<RewardScheme>,
    seats: BySeat<SeatMetrics>,
    finished: u8,
    shifts: u32,
    performance_sum: BySeat<f64>,
}

impl MetricsRecorder {
    /// A recorder for one game from its start. Sums rewards if there is a scheme.
    pub fn new(rules: RuleSet, scheme: Option<RewardScheme>) -> MetricsRecorder {
        let players = rules.players();
        MetricsRecorder {
            rules,
            scheme,
            seats: BySeat::filled(players, SeatMetrics::default()),
            finished: 0,
            shifts: 0,
            performance_sum: BySeat::filled(players, 0.0),
        }
    }

    /// A recorder that joins a game in progress. Does not count what happened in the Shift before.
    pub fn joining(game: &Game, scheme: Option<RewardScheme>) -> MetricsRecorder {
        let places = game.observe(Viewer::Spectator).places;
        let finished = places.values().filter(|place| **place > 0).count();
        MetricsRecorder {
            finished: finished as u8,
            ..MetricsRecorder::new(*game.rules(), scheme)
        }
    }

    /// The complete state, to continue with [`MetricsRecorder::resuming`].
    pub fn state(&self) -> RecorderState {
        RecorderState {
            shifts: self.shifts,
            seats: BySeat::from_fn(self.seats.len(), |seat| {
                let metrics = &self.seats[seat];
                SeatCounts {
                    plays: metrics.plays,
                    passes: metrics.passes,
                    wrong: metrics.wrong,
                    reward_sum: metrics.reward_sum,
                    performance_sum: self.performance_sum[seat],
                }
            }),
        }
    }

    /// A recorder that continues one of the same scheme, whose game is this one.
    ///
    /// # Errors
    /// If no recorder of this game can have this state.
    pub fn resuming(
        game: &Game,
        scheme: Option<RewardScheme>,
        state: &RecorderState,
    ) -> Result<MetricsRecorder, StateError> {
        let joining = MetricsRecorder::joining(game, scheme);
        let ended = game.shift() - u32::from(!game.is_over());
        let turns = if game.is_over() {
            0
        } else {
            game.shift_turns()
        };
        let counted = |counts: &SeatCounts| u64::from(counts.plays) + u64::from(counts.passes);
        let counts: u64 = state.seats.values().map(counted).sum();
        let sound = |counts: &SeatCounts| {
            counts.reward_sum.is_finite()
                && counts.performance_sum.is_finite()
                && (scheme.is_some() || counts.reward_sum == 0.0)
        };
        if state.seats.len() != game.rules().players()
            || state.shifts > ended
            || counts > u64::from(turns)
            || !state.seats.values().all(sound)
        {
            return Err(StateError("the metrics do not fit the game"));
        }
        Ok(MetricsRecorder {
            seats: state.seats.map(|counts| {
                let valid = counts.plays + counts.passes;
                SeatMetrics {
                    valid,
                    plays: counts.plays,
                    passes: counts.passes,
                    wrong: counts.wrong,
                    reward_sum: counts.reward_sum,
                    reward_count: match scheme {
                        Some(_) => valid.saturating_add(counts.wrong),
                        None => 0,
                    },
                    ..SeatMetrics::default()
                }
            }),
            finished: if game.is_over() { 0 } else { joining.finished },
            shifts: state.shifts,
            performance_sum: state.seats.map(|counts| counts.performance_sum),
            ..joining
        })
    }

    /// Counts an invalid attempt of a seat at a turn. Attempts at other decisions are not counted.
    pub fn wrong(&mut self, seat: Seat) {
        let wrong = &mut self.seats[seat].wrong;
        *wrong = wrong.saturating_add(1);
        if let Some(scheme) = self.scheme {
            self.reward(seat, scheme.invalid(), 1);
        }
    }

    /// Counts an event, seen by any viewer. Returns the metrics of the Shift when it ends.
    pub fn on_event(&mut self, event: &Event) -> Option<ShiftMetrics> {
        match *event {
            Event::Played {
                seat, cards_left, ..
            } => {
                self.seats[seat].plays += 1;
                self.finished += u8::from(cards_left == 0);
                self.valid(seat, cards_left, (cards_left == 0).then_some(self.finished));
                None
            }
            Event::Passed { seat, cards_left } => {
                self.seats[seat].passes += 1;
                self.valid(seat, cards_left, None);
                None
            }
            Event::ShiftEnded(ref end) => {
                let ShiftEnd {
                    shift,
                    order,
                    points,
                    starter,
                    pizzas,
                    laps,
                    turns,
                    special,
                    adjudicated,
                    finished,
                    ..
                } = **end;
                self.end_shift(&order, &points, finished, pizzas);
                let seats = self.seats;
                self.seats = BySeat::filled(seats.len(), SeatMetrics::default());
                self.finished = 0;
                let starter_won = order.as_slice().first() == Some(&starter);
                Some(ShiftMetrics {
                    shift,
                    order,
                    pizzas,
                    laps,
                    turns,
                    starter,
                    starter_won,
                    special,
                    adjudicated,
                    seats,
                })
            }
            _ => None,
        }
    }

    fn valid(&mut self, seat: Seat, cards_left: u8, place: Option<u8>) {
        self.seats[seat].valid += 1;
        if let Some(scheme) = self.scheme {
            self.reward(seat, scheme.turn(&self.rules, cards_left, place), 1);
        }
    }

    fn end_shift(&mut self, order: &SeatOrder, points: &BySeat<u32>, finished: u8, pizzas: u32) {
        self.shifts += 1;
        for (&seat, place) in order.as_slice().iter().zip(1u8..) {
            if let Some(reward) = self
                .scheme
                .and_then(|scheme| scheme.shift_end(place, points[seat], place <= finished))
            {
                self.reward(seat, reward, 0);
            }
            self.performance_sum[seat] += 10.0 * f64::from(points[seat]) / f64::from(pizzas);
            let metrics = &mut self.seats[seat];
            metrics.place = place;
            metrics.points = points[seat];
            metrics.performance = self.performance_sum[seat] / f64::from(self.shifts);
        }
    }

    fn reward(&mut self, seat: Seat, reward: f32, count: u32) {
        self.seats[seat].reward_sum += f64::from(reward);
        let rewarded = &mut self.seats[seat].reward_count;
        *rewarded = rewarded.saturating_add(count);
    }
}
