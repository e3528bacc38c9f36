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
    Event, MAX_SEATS, MetricsRecorder, RuleSet, RuleSetSpec, Seat, Seed, Standings, Stop,
};
use thiserror::Error;

use crate::Progress;
use crate::fold::fold_in_order;
use chefshat_agents::seating_agent_seed;
use chefshat_agents::{
    AgentKind, AgentMaker, BuiltInAgent, Listener, Network, game_seed, play_agents,
};
pub use figures::{Comparison, Figure, Tally};
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

/// The games of a comparison of two agents on duplicate deals.
///
/// Game `d` has the deal of game `d` of a [`crate::Batch`] with the same seed, in every seating.
/// Only deals are duplicated: agents have their own generators for each seating and seat.
#[derive(Debug, Clone)]
pub struct Duplicate {
    rules: RuleSet,
    shifts: NonZeroU32,
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
        "it was trained for {players} players, {faces} faces and hands of {hand_size} cards, and cannot play games of another size"
    )]
    DoesNotFit {
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
    /// If there are fewer than two deals.
    pub fn new(
        rules: RuleSet,
        shifts: NonZeroU32,
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
        Ok(Duplicate {
            rules,
            shifts,
            seatings: plan.seatings(rules.players()),
            deals,
            seed,
        })
    }

    /// The rule set, with the number of Shifts played as its stop rule.
    pub fn rules(&self) -> &RuleSet {
        &self.rules
    }

    /// Number of deals.
    pub fn deals(&self) -> u64 {
        self.deals
    }

    /// The seatings in which every deal is played.
    pub fn seatings(&self) -> &[Seating] {
        &self.seatings
    }

    /// The game seed of a deal, by its index from 0.
    pub fn game_seed(&self, deal: u64) -> Seed {
        game_seed(self.seed, deal)
    }

    /// The agent of a contender on a seat, for one deal in one seating, both by index from 0.
    pub fn agent(
        &self,
        contender: &Contender,
        deal: u64,
        seating: usize,
        seat: Seat,
    ) -> BuiltInAgent {
        let seed = seating_agent_seed(self.game_seed(deal), seating, seat);
        contender.agent(&self.rules, seed)
    }

    /// Refuses a network that does not fit the rules.
    ///
    /// # Errors
    /// It was trained for games of another size.
    pub fn check(&self, contender: &Contender) -> Result<(), DuplicateError> {
        match contender {
            Contender::Network(network) if !network.fits(&self.rules) => {
                let info = network.info();
                Err(DuplicateError::DoesNotFit {
                    players: info.players,
                    faces: info.faces,
                    hand_size: info.hand_size,
                })
            }
            _ => Ok(()),
        }
    }

    /// Plays one deal in one seating, both by index from 0, exactly as within the comparison.
    ///
    /// # Panics
    /// If there is no such seating.
    pub fn play_game(
        &self,
        contenders: &[Contender; 2],
        deal: u64,
        seating: usize,
        listener: &mut impl Listener,
    ) -> Standings {
        let seats = self.seatings[seating];
        // An array, because agents with their generators are not `Copy`.
        let mut agents: [BuiltInAgent; MAX_SEATS] = std::array::from_fn(|index| {
            let seat = Seat::new(index);
            let contender = &contenders[usize::from(!seats.is_a(seat))];
            self.agent(contender, deal, seating, seat)
        });
        play_agents(
            self.rules,
            self.game_seed(deal),
            None,
            &mut agents,
            listener,
        )
    }

    /// Plays all games on the current rayon pool and returns the totals. `progress` is called from
    /// any thread with the number of deals finished since its last call.
    ///
    /// # Errors
    /// If a network does not fit the rules.
    pub fn run(
        &self,
        contenders: &[Contender; 2],
        progress: Progress<'_>,
    ) -> Result<Comparison, DuplicateError> {
        contenders
            .iter()
            .try_for_each(|contender| self.check(contender))?;
        Ok(self.total(|deal| {
            let games = self.seatings.iter().enumerate().map(|(seating, seats)| {
                let mut counter = Counter {
                    recorder: MetricsRecorder::new(self.rules, None),
                    seating: *seats,
                    tally: Tally::default(),
                };
                self.play_game(contenders, deal, seating, &mut counter);
                counter.tally
            });
            let games = games.collect();
            progress(1);
            games
        }))
    }

    /// The totals of games, of which `games` has those of a deal, one for each seating. It is called
    /// from any thread of the current rayon pool.
    pub fn total(&self, games: impl Fn(u64) -> Vec<Tally> + Sync) -> Comparison {
        // Seats times Shifts of a deal, for each agent.
        let a_seats: usize = self.seatings.iter().map(|seating| seating.a_seats()).sum();
        let seats = self.seatings.len() * self.rules.players();
        let shifts = f64::from(self.shifts.get());
        let weights = [a_seats, seats - a_seats].map(|seats| seats as f64 * shifts);
        fold_in_order(
            self.deals,
            CHUNK,
            || Comparison::empty(self.seatings.len()),
            |comparison, deal| comparison.add_deal(&games(deal), self.shifts, weights),
            |comparison, more| comparison.merge(&more),
        )
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
            let is_a = self.seating.is_a(seat);
            self.tally
                .add(is_a, metrics.points.into(), metrics.place.into());
        }
    }
}
