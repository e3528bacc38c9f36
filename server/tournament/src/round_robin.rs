//! The rounds of a round robin: participants meet, take each seat and sit out equally often, as far
//! as the numbers allow.
//!
//! With n participants and s seats, n a multiple of s or one more, the rounds follow from a
//! *cycle*: one round such that shifting all its participants by one, repeatedly, makes every two
//! meet equally often. It is found by search (`cycle`). Rounds beyond full cycles, and fields of
//! other sizes, are improved by a search over all rounds ([`Meetings`]). Byes are spread evenly
//! from the start and stay so. Finally `seats` balances the seats, which always succeeds.
//!
//! For tables of four and one round fewer than participants: with 4, 8, …, 32 participants every
//! two meet three times; with one participant more, two or three times; with other numbers below 16
//! except 6, numbers of meetings differ by at most one; above, nearly all do, and few differ by
//! two. Byes and seats differ by at most one.

mod cycle;

use std::cmp::Reverse;

use super::chance::Chance;
use super::seats;
use super::state::Pairings;

/// Swaps tried for each participant of each round, and the maximum in total.
const TRIES_PER_PLACE: usize = 10_000;
const MAX_TRIES: usize = 2_000_000;
/// Swaps without an improvement after which the search restarts from perturbed rounds.
const MAX_IDLE: usize = 100_000;
/// To perturb the rounds, one swap for this many places.
const SHAKEN: usize = 4;
/// Length of the history of the late-acceptance search.
const MEMORY: usize = 100;

/// All rounds, for at least as many participants as seats.
pub(super) fn plan(
    participants: usize,
    seats: usize,
    rounds: u32,
    chance: &mut Chance,
) -> Vec<Pairings> {
    let rounds = rounds as usize;
    let mut plan = Vec::with_capacity(rounds);
    let cycle = cycle::find(participants, seats, chance);
    let length = cycle.rounds();
    // A cycle without its last round is as even as possible.
    let cycles = (rounds + 1) / length;
    plan.extend((0..rounds.min(cycles * length)).map(|round| cycle.round(round)));
    let searched = if cycle.is_equal() { plan.len() } else { 0 };
    add_rounds(&mut plan, participants, seats, rounds, chance);
    let mut meetings = Meetings::new(participants, seats, plan);
    meetings.even_out(searched, chance);
    let rounds = meetings.into_rounds();
    let mut names: Vec<usize> = (0..participants).collect();
    chance.shuffle(&mut names);
    let tables = participants / seats;
    let mut rounds: Vec<Pairings> = rounds
        .into_iter()
        .map(|round| {
            let named: Vec<usize> = round.into_iter().map(|number| names[number]).collect();
            let (seated, byes) = named.split_at(tables * seats);
            let mut byes = byes.to_vec();
            byes.sort_unstable();
            Pairings {
                tables: seated.chunks(seats).map(<[usize]>::to_vec).collect(),
                byes,
            }
        })
        .collect();
    let all = rounds.iter_mut().flat_map(|round| &mut round.tables);
    seats::spread_plan(all.collect(), participants, seats);
    rounds
}

/// Adds random rounds up to `rounds`, with byes for the participants that have had the fewest.
fn add_rounds(
    plan: &mut Vec<Vec<usize>>,
    participants: usize,
    seats: usize,
    rounds: usize,
    chance: &mut Chance,
) {
    let seated = participants / seats * seats;
    let mut byes = vec![0; participants];
    for round in plan.iter() {
        round[seated..].iter().for_each(|&who| byes[who] += 1);
    }
    while plan.len() < rounds {
        let mut round: Vec<usize> = (0..participants).collect();
        chance.shuffle(&mut round);
        // Participants with the fewest byes go last: they sit out.
        round.sort_by_key(|&who| Reverse(byes[who]));
        round[seated..].iter().for_each(|&who| byes[who] += 1);
        chance.shuffle(&mut round[..seated]);
        plan.push(round);
    }
}

/// Rounds, and how often every two participants meet in them.
struct Meetings {
    participants: usize,
    seats: usize,
    seated: usize,
    /// By round, the participants of each table in turn, then those with a bye.
    rounds: Vec<Vec<usize>>,
    /// By round, the place of each participant.
    places: Vec<Vec<usize>>,
    met: Vec<i32>,
    /// Sum of the squares of `met` over all pairs. The sum of `met` is constant, so a lower cost is
    /// more even.
    cost: i64,
}

impl Meetings {
    fn new(participants: usize, seats: usize, rounds: Vec<Vec<usize>>) -> Meetings {
        let mut meetings = Meetings {
            participants,
            seats,
            seated: participants / seats * seats,
            places: vec![vec![0; participants]; rounds.len()],
            rounds,
            met: vec![0; participants * participants],
            cost: 0,
        };
        for round in 0..meetings.rounds.len() {
            for place in 0..participants {
                let who = meetings.rounds[round][place];
                meetings.places[round][who] = place;
                let first = place.min(meetings.seated) / seats * seats;
                if place < meetings.seated {
                    for other in first..place {
                        meetings.meet(who, meetings.rounds[round][other], 1);
                    }
                }
            }
        }
        meetings
    }

    fn into_rounds(self) -> Vec<Vec<usize>> {
        self.rounds
    }

    /// Improves the rounds from `first` on until no tries are left, and keeps the most even result.
    fn even_out(&mut self, first: usize, chance: &mut Chance) {
        let free = self.rounds.len() - first;
        if free == 0 || self.seats == self.participants {
            return;
        }
        let least = self.least_cost();
        let mut tries = (free * self.participants * TRIES_PER_PLACE).min(MAX_TRIES);
        let mut best = (self.cost, self.rounds.clone());
        while tries > 0 && best.0 > least {
            tries -= self.search(first, least, tries, chance);
            if self.cost < best.0 {
                best = (self.cost, self.rounds.clone());
            }
            for _ in 0..free * self.participants / SHAKEN {
                self.try_exchange(first, chance);
            }
        }
        *self = Meetings::new(self.participants, self.seats, best.1);
    }

    /// One late-acceptance search: a swap is kept if the cost is not above the cost some steps
    /// before. Returns the number of tries.
    fn search(&mut self, first: usize, least: i64, tries: usize, chance: &mut Chance) -> usize {
        let mut memory = [self.cost; MEMORY];
        let (mut best, mut best_at) = (self.cost, 0);
        for step in 0..tries {
            if self.cost < best {
                (best, best_at) = (self.cost, step);
            }
            // Stop at the best cost seen.
            let is_idle = step - best_at > MAX_IDLE || step + MEMORY > tries;
            if self.cost == least || is_idle && self.cost == best {
                return step + 1;
            }
            let before = self.cost;
            if let Some(exchange) = self.try_exchange(first, chance)
                && self.cost > before
                && self.cost > memory[step % MEMORY]
            {
                self.apply(exchange);
            }
            memory[step % MEMORY] = self.cost;
        }
        tries
    }

    /// Applies a random swap, if the drawn places allow one.
    fn try_exchange(&mut self, first: usize, chance: &mut Chance) -> Option<Exchange> {
        let round = first + chance.below(self.rounds.len() - first);
        let places = [(); 2].map(|()| chance.below(self.participants));
        let exchange = self.exchange(round, places, first, chance)?;
        self.apply(exchange);
        Some(exchange)
    }

    /// The cost if all meet equally often, or within one of it.
    fn least_cost(&self) -> i64 {
        let pairs = (self.participants * (self.participants - 1) / 2) as i64;
        let meetings = (self.rounds.len() * self.seated * (self.seats - 1) / 2) as i64;
        let (each, more) = (meetings / pairs, meetings % pairs);
        pairs * each * each + more * (2 * each + 1)
    }

    /// The swap of two places of a round. If one of them is a bye, the byes are swapped back in
    /// another round.
    fn exchange(
        &self,
        round: usize,
        [a, b]: [usize; 2],
        first: usize,
        chance: &mut Chance,
    ) -> Option<Exchange> {
        let (a, b) = (a.min(b), a.max(b));
        if a >= self.seated || a / self.seats == b / self.seats && b < self.seated {
            return None;
        }
        if b < self.seated {
            return Some(Exchange {
                one: (round, a, b),
                two: None,
            });
        }
        // The participant with the bye plays here instead, and gets the bye in a round where the
        // other has one.
        let (player, sitter) = (self.rounds[round][a], self.rounds[round][b]);
        let other = first + chance.below(self.rounds.len() - first);
        let (plays, sits) = (self.places[other][sitter], self.places[other][player]);
        let fits = plays < self.seated && sits >= self.seated;
        fits.then_some(Exchange {
            one: (round, a, b),
            two: Some((other, plays, sits)),
        })
    }

    /// Applies a swap; applying it again undoes it.
    fn apply(&mut self, exchange: Exchange) {
        self.swap(exchange.one);
        if let Some(two) = exchange.two {
            self.swap(two);
        }
    }

    fn swap(&mut self, (round, a, b): (usize, usize, usize)) {
        self.meet_table(round, a, -1);
        self.meet_table(round, b, -1);
        self.rounds[round].swap(a, b);
        self.meet_table(round, a, 1);
        self.meet_table(round, b, 1);
        for place in [a, b] {
            let who = self.rounds[round][place];
            self.places[round][who] = place;
        }
    }

    /// Adds to the meetings of the participant at a place with the others at its table.
    fn meet_table(&mut self, round: usize, place: usize, times: i32) {
        if place >= self.seated {
            return;
        }
        let first = place / self.seats * self.seats;
        for other in (first..first + self.seats).filter(|&other| other != place) {
            self.meet(self.rounds[round][place], self.rounds[round][other], times);
        }
    }

    fn meet(&mut self, a: usize, b: usize, times: i32) {
        let met = &mut self.met[a.min(b) * self.participants + a.max(b)];
        self.cost -= i64::from(*met) * i64::from(*met);
        *met += times;
        self.cost += i64::from(*met) * i64::from(*met);
    }
}

/// Two places of a round to swap, and possibly two of another round.
#[derive(Clone, Copy)]
struct Exchange {
    one: (usize, usize, usize),
    two: Option<(usize, usize, usize)>,
}
