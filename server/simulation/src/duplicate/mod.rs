//! Compares two agents on duplicate deals: every deal is played in all ways of seating the two, so
//! that the cards favour neither.
//!
//! The benefit depends on the agents, so every figure also has the standard error that independent
//! deals would give. The more alike two agents play and the less they randomize, the larger the
//! benefit; for two identical deterministic agents the error is 0. If one always wins, or
//! randomness decides, duplicate deals are no better than others. They are worse if some deals suit
//! one of the two in any seat, because all games of such a deal say the same.

mod figures;
mod same_seat;

use std::num::NonZeroU32;
use std::sync::Arc;

use chefshat_engine::{
    Event, MAX_SEATS, MetricsRecorder, RuleSet, RuleSetSpec, Seat, Standings, Stop,
};
use thiserror::Error;

use crate::Progress;
use crate::fold::fold_in_order;
use chefshat_agents::seating_agent_seed;
use chefshat_agents::{
    AgentKind, AgentMaker, BuiltInAgent, Listener, Network, game_seed, play_agents,
};
use figures::Tally;
pub use figures::{Comparison, Figure};
pub use same_seat::{Candidate, Measured, SameSeat};

/// Deals played by one thread at a time. Part of the result: it decides how figures are grouped for
/// summing.
const CHUNK: u64 = 4;

/// An agent in a comparison.
#[derive(Debug, Clone)]
pub enum Contender {
    /// A built-in agent.
    Kind(AgentKind),
    /// A network.
    Network(Arc<Network>),
    /// An agent of another crate, such as one that searches.
    Made(Arc<dyn AgentMaker>),
}

impl Contender {
    /// Creates the agent for one game.
    pub fn agent(&self, rules: &RuleSet, seed: [u8; 32]) -> BuiltInAgent {
        match self {
            Contender::Kind(kind) => BuiltInAgent::new(*kind, seed),
            Contender::Network(network) => BuiltInAgent::network(Arc::clone(network)),
            Contender::Made(maker) => maker.agent(rules, seed),
        }
    }
}

/// How the two agents share the seats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SeatPlan {
    /// Half of the seats each, in all ways: 6 for four players. With an odd number of players each
    /// has the extra seat equally often.
    #[default]
    Half,
    /// One seat for A and the others for B, in all ways. The paper's tables are of this kind.
    One,
}

/// Which seats are A's in a game; the others are B's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Seating(u8);

impl Seating {
    /// Whether a seat is A's.
    pub fn is_a(self, seat: Seat) -> bool {
        self.0 >> seat.index() & 1 == 1
    }

    /// Number of A's seats.
    pub fn a_seats(self) -> usize {
        self.0.count_ones() as usize
    }
}

impl SeatPlan {
    /// All seatings of this number of players.
    pub fn seatings(self, players: usize) -> Vec<Seating> {
        let fits = |seats: usize| match self {
            SeatPlan::Half => seats == players / 2 || seats == players.div_ceil(2),
            SeatPlan::One => seats == 1,
        };
        (0..1u8 << players)
            .map(Seating)
            .filter(|seating| fits(seating.a_seats()))
            .collect()
    }
}

/// A comparison of two agents on duplicate deals.
///
/// Game `d` has the deal of game `d` of a [`crate::Batch`] with the same seed, in every seating.
/// Only deals are duplicated: agents have their own generators for each seating and seat.
#[derive(Debug, Clone)]
pub struct Duplicate {
    rules: RuleSet,
    shifts: NonZeroU32,
    contenders: [Contender; 2],
    seatings: Vec<Seating>,
    deals: u64,
    seed: u64,
}

/// Why a comparison is invalid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum DuplicateError {
    /// A single deal says nothing about the spread.
    #[error("{0} deals: play at least 2, so that there is a standard error")]
    Deals(u64),
    /// A network does not fit the rules, so that it would play as `greedy`.
    #[error(
        "{who} was trained for {players} players, {faces} faces and hands of {hand_size} cards, and cannot play games of another size"
    )]
    DoesNotFit {
        /// `A` or `B`.
        who: &'static str,
        /// Players it was trained for.
        players: u8,
        /// Faces it was trained for.
        faces: u8,
        /// Cards dealt to a hand in games it was trained for.
        hand_size: u8,
    },
}

impl Duplicate {
    /// A comparison of A and B over `deals` games of `shifts` Shifts each, in every seating of
    /// `plan`. The stop rule of `rules` is ignored. `seed` determines all randomness.
    ///
    /// # Errors
    /// If there are fewer than two deals, or a network does not fit the rules.
    pub fn new(
        rules: RuleSet,
        shifts: NonZeroU32,
        contenders: [Contender; 2],
        plan: SeatPlan,
        deals: u64,
        seed: u64,
    ) -> Result<Duplicate, DuplicateError> {
        if deals < 2 {
            return Err(DuplicateError::Deals(deals));
        }
        let spec = RuleSetSpec {
            stop: Stop::Shifts(shifts.get()),
            ..rules.spec()
        };
        let rules = spec
            .validate()
            .expect("a rule set is valid with any number of Shifts");
        for (who, contender) in ["A", "B"].into_iter().zip(&contenders) {
            if let Contender::Network(network) = contender
                && !network.fits(&rules)
            {
                let info = network.info();
                return Err(DuplicateError::DoesNotFit {
                    who,
                    players: info.players,
                    faces: info.faces,
                    hand_size: info.hand_size,
                });
            }
        }
        Ok(Duplicate {
            rules,
            shifts,
            contenders,
            seatings: plan.seatings(rules.players()),
            deals,
            seed,
        })
    }

    /// The rule set, with the number of Shifts played as its stop rule.
    pub fn rules(&self) -> &RuleSet {
        &self.rules
    }

    /// The seatings in which every deal is played.
    pub fn seatings(&self) -> &[Seating] {
        &self.seatings
    }

    /// Plays one deal in one seating, both by index from 0, exactly as within the comparison.
    ///
    /// # Panics
    /// If there is no such seating.
    pub fn play_game(&self, deal: u64, seating: usize, listener: &mut impl Listener) -> Standings {
        let seed = game_seed(self.seed, deal);
        let seats = self.seatings[seating];
        // An array, because agents with their generators are not `Copy`.
        let mut agents: [BuiltInAgent; MAX_SEATS] = std::array::from_fn(|index| {
            let seat = Seat::new(index);
            let contender = &self.contenders[usize::from(!seats.is_a(seat))];
            contender.agent(&self.rules, seating_agent_seed(seed, seating, seat))
        });
        play_agents(self.rules, seed, None, &mut agents, listener)
    }

    /// Plays all games on the current rayon pool and returns the totals. `progress` is called from
    /// any thread with the number of deals finished since its last call.
    pub fn run(&self, progress: Progress<'_>) -> Comparison {
        let empty = || Comparison::empty(self.seatings.len());
        fold_in_order(
            self.deals,
            CHUNK,
            empty,
            |comparison, deal| {
                self.add_deal(comparison, deal);
                progress(1);
            },
            |comparison, more| comparison.merge(&more),
        )
    }

    fn add_deal(&self, comparison: &mut Comparison, deal: u64) {
        let games: Vec<Tally> = (0..self.seatings.len())
            .map(|seating| {
                let mut counter = Counter {
                    recorder: MetricsRecorder::new(self.rules, None),
                    seating: self.seatings[seating],
                    tally: Tally::default(),
                };
                self.play_game(deal, seating, &mut counter);
                counter.tally
            })
            .collect();
        // Seats times Shifts of this deal, for each agent.
        let a_seats: usize = self.seatings.iter().map(|seating| seating.a_seats()).sum();
        let seats = self.seatings.len() * self.rules.players();
        let shifts = f64::from(self.shifts.get());
        let weights = [a_seats, seats - a_seats].map(|seats| seats as f64 * shifts);
        comparison.add_deal(&games, self.shifts, weights);
    }
}

/// Adds up a game while it is played.
struct Counter {
    recorder: MetricsRecorder,
    seating: Seating,
    tally: Tally,
}

impl Listener for Counter {
    fn on_event(&mut self, event: &Event) {
        let Some(shift) = self.recorder.on_event(event) else {
            return;
        };
        for (seat, metrics) in shift.seats.iter() {
            let whose = usize::from(!self.seating.is_a(seat));
            self.tally.points[whose] += u64::from(metrics.points);
            self.tally.places[whose] += u64::from(metrics.place);
            self.tally.wins[whose] += u64::from(metrics.place == 1);
        }
    }
}
