//! How often participants meet over all rounds, and exchanging them until that is as even as a bounded search gets it. Byes stay as they
//! are given out: whoever gets one leaves one elsewhere.

use super::super::chance::Chance;

/// Exchanges tried for each participant of each round, and in all at most.
const TRIES_PER_PLACE: usize = 10_000;
const MAX_TRIES: usize = 2_000_000;
/// Exchanges without a success after which the search begins again from rounds that are shaken up.
const MAX_IDLE: usize = 100_000;
/// One place in so many is exchanged to shake the rounds up.
const SHAKEN: usize = 4;
/// Steps that an exchange is compared back over.
const MEMORY: usize = 100;

/// Rounds, and how often every two participants meet in them.
pub(super) struct Meetings {
    participants: usize,
    seats: usize,
    seated: usize,
    /// By round the participants of the first table, then those of the next, those who sit out last.
    rounds: Vec<Vec<usize>>,
    /// By round the place of each participant.
    places: Vec<Vec<usize>>,
    met: Vec<i32>,
    /// Sum of the squares of `met` over all pairs: the smaller the more even, since their sum is always the same.
    cost: i64,
}

impl Meetings {
    pub(super) fn new(participants: usize, seats: usize, rounds: Vec<Vec<usize>>) -> Meetings {
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

    pub(super) fn into_rounds(self) -> Vec<Vec<usize>> {
        self.rounds
    }

    /// Searches the rounds from this one on, again and again as long as tries are left, and keeps the most even ones.
    pub(super) fn even_out(&mut self, first: usize, chance: &mut Chance) {
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

    /// One search, by late acceptance: an exchange is kept if it is not worse than what stood some steps before. Gives the tries it took.
    fn search(&mut self, first: usize, least: i64, tries: usize, chance: &mut Chance) -> usize {
        let mut memory = [self.cost; MEMORY];
        let (mut best, mut best_at) = (self.cost, 0);
        for step in 0..tries {
            if self.cost < best {
                (best, best_at) = (self.cost, step);
            }
            // It ends with the best it has seen, or as good.
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

    /// Does an exchange at random, if the places drawn allow one.
    fn try_exchange(&mut self, first: usize, chance: &mut Chance) -> Option<Exchange> {
        let round = first + chance.below(self.rounds.len() - first);
        let places = [(); 2].map(|()| chance.below(self.participants));
        let exchange = self.exchange(round, places, first, chance)?;
        self.apply(exchange);
        Some(exchange)
    }

    /// What the sum of squares would be if all met equally often, or nearly so.
    fn least_cost(&self) -> i64 {
        let pairs = (self.participants * (self.participants - 1) / 2) as i64;
        let meetings = (self.rounds.len() * self.seated * (self.seats - 1) / 2) as i64;
        let (each, more) = (meetings / pairs, meetings % pairs);
        pairs * each * each + more * (2 * each + 1)
    }

    /// The exchange of the participants of two places of a round; if one of them sits out, another who sits out elsewhere takes its turn.
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
        // Whoever sits out plays, and sits out in a round in which the other one does, who plays there.
        let (player, sitter) = (self.rounds[round][a], self.rounds[round][b]);
        let other = first + chance.below(self.rounds.len() - first);
        let (plays, sits) = (self.places[other][sitter], self.places[other][player]);
        let fits = plays < self.seated && sits >= self.seated;
        fits.then_some(Exchange {
            one: (round, a, b),
            two: Some((other, plays, sits)),
        })
    }

    /// Does an exchange; done once more it is undone.
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

    /// Counts the meetings of whoever has a place with the others at its table.
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

/// Two places of a round, and perhaps two of another round, that change their participants.
#[derive(Clone, Copy)]
struct Exchange {
    one: (usize, usize, usize),
    two: Option<(usize, usize, usize)>,
}
