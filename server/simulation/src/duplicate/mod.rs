//! Comparing two agents on duplicate deals: every deal is played in all ways of seating the two, so that neither is favoured by the cards.
//! What is made of the games is in `figures`; how a comparison is printed is not decided here.
//!
//! What that is worth depends on the two, so every figure says what its standard error would be with a deal of its own for each game. The
//! more alike two agents play and the less they leave to draws, the more: between agents that do the same nothing is left to chance. Where one
//! always wins, or draws decide, duplicate deals are worth no more than others; and less where some deals suit one of the two in any
//! seat, since all games of such a deal tell the same.

mod figures;
mod same_seat;

use std::num::NonZeroU32;
use std::sync::Arc;

use chefshat_engine::{
    Event, MAX_SEATS, MetricsRecorder, RuleSet, RuleSetSpec, Seat, Standings, Stop,
};
use thiserror::Error;

use crate::fold::fold_in_order;
use chefshat_agents::seating_agent_seed;
use chefshat_agents::{AgentKind, BuiltInAgent, Listener, Network, game_seed, play};
use figures::Tally;
pub use figures::{Comparison, Figure};
pub use same_seat::{Measured, Newcomer, SameSeat};

/// Deals that one thread plays at a time. Part of the result: it decides in which groups figures are summed.
const CHUNK: u64 = 4;

/// An agent that takes part in a comparison.
#[derive(Debug, Clone)]
pub enum Contender {
    /// One of the built-in agents.
    Kind(AgentKind),
    /// One that plays from a network file.
    Network(Arc<Network>),
}

impl Contender {
    /// The agent for one game.
    fn agent(&self, seed: [u8; 32]) -> BuiltInAgent {
        match self {
            Contender::Kind(kind) => BuiltInAgent::new(*kind, seed),
            Contender::Network(network) => BuiltInAgent::network(Arc::clone(network)),
        }
    }
}

/// How the two agents share the seats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SeatPlan {
    /// Half of the seats each, in all ways there are: 6 for four players. With an odd number of players each of them has the seat more
    /// equally often.
    #[default]
    Half,
    /// One seat for A, the others for B, in all ways there are: as many as there are players. The paper's tables are of this kind.
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
    /// All seatings of so many players.
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

/// A comparison of two agents that is to be played.
///
/// Game `d` of a comparison is dealt from the seed of game `d` of a [`crate::Batch`] of the same number, whatever the seating. Only the
/// deals are duplicated: agents that draw have generators of their own for each seating and seat.
#[derive(Debug, Clone)]
pub struct Duplicate {
    rules: RuleSet,
    shifts: NonZeroU32,
    contenders: [Contender; 2],
    seatings: Vec<Seating>,
    deals: u64,
    seed: u64,
}

/// Why a comparison cannot be played.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum DuplicateError {
    /// Nothing is known of the spread of a single deal.
    #[error("{0} deals: play at least 2, so that there is a standard error")]
    Deals(u64),
    /// A network would play as `greedy`.
    #[error(
        "{who} was trained for {players} players, {faces} faces and hands of {hand_size} cards, and does not know games of another size"
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
    /// A comparison of A and B over `deals` games of `shifts` Shifts each, in every seating of `plan`; when the games of `rules` end is not
    /// looked at. All chance is drawn from `seed`.
    ///
    /// # Errors
    /// If there are fewer than two deals, or a network was not trained for games of this size.
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
            .expect("a rule set makes sense with any number of Shifts");
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

    /// The rule set, its games of the number of Shifts played.
    pub fn rules(&self) -> &RuleSet {
        &self.rules
    }

    /// The seatings in which every deal is played.
    pub fn seatings(&self) -> &[Seating] {
        &self.seatings
    }

    /// Plays a deal, by its index from 0, in a seating, by its index, exactly as it is played within the comparison.
    ///
    /// # Panics
    /// If there is no such seating.
    pub fn play_game(&self, deal: u64, seating: usize, listener: &mut impl Listener) -> Standings {
        let seed = game_seed(self.seed, deal);
        let seats = self.seatings[seating];
        // An array, because agents with their generators are no values to copy by seat.
        let mut agents: [BuiltInAgent; MAX_SEATS] = std::array::from_fn(|index| {
            let seat = Seat::new(index);
            let contender = &self.contenders[usize::from(!seats.is_a(seat))];
            contender.agent(seating_agent_seed(seed, seating, seat))
        });
        play(
            self.rules,
            seed,
            None,
            |seat, observation, legal| agents[seat.index()].decide(observation, legal),
            listener,
        )
    }

    /// Plays all games, on the threads of the rayon pool it is called in, and adds them up. `progress` is called from any of those threads,
    /// with the number of deals that have been finished since it was last called.
    pub fn run(&self, progress: impl Fn(u64) + Sync) -> Comparison {
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
        // Over how many seats and Shifts of this deal an agent's sums are taken.
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
