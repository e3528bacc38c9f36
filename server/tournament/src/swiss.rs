//! Tables of a Swiss round: participants with similar standings meet, from the top, with as few
//! repeated meetings as possible. Byes go to those who have left, then to the lowest of the participants
//! with the fewest byes.

use std::cmp::Reverse;

use super::chance::Chance;
use super::standings;
use super::state::{Pairings, TournamentState};

/// Swaps of two participants tried for each table.
const TRIES_PER_TABLE: usize = 10_000;
/// Maximum number of swaps tried.
const MAX_TRIES: usize = 500_000;
/// Length of the history of the late-acceptance search.
const MEMORY: usize = 500;

/// Pairs the next round.
pub(super) fn draw(state: &TournamentState, chance: &mut Chance) -> Pairings {
    let seats = state.settings.players;
    let mut order = standings::order(state);
    // Those who have left fill the last table, and are at no others.
    let stay = order.iter().filter(|&&who| !state.withdrawn[who]).count();
    let tables = (order.len() / seats).min(stay.div_ceil(seats).max(1));
    let byes = byes(state, &order, order.len() - tables * seats);
    order.retain(|who| !byes.contains(who));
    let tables = Tables::new(state, order, seats).improved(chance);
    Pairings { tables, byes }
}

/// Selects byes: those who have left, then participants with the fewest so far, the lowest ranks first.
fn byes(state: &TournamentState, order: &[usize], count: usize) -> Vec<usize> {
    let mut candidates: Vec<(usize, usize)> = order.iter().copied().enumerate().collect();
    candidates
        .sort_by_key(|&(rank, who)| (!state.withdrawn[who], state.sums[who].byes, Reverse(rank)));
    let chosen = candidates.into_iter().take(count);
    let mut byes: Vec<usize> = chosen.map(|(_, who)| who).collect();
    byes.sort_unstable();
    byes
}

/// Ranks assigned to tables, and the cost of meetings.
struct Tables {
    /// Participant by rank.
    order: Vec<usize>,
    /// Ranks by place: the seats of the first table, then the next.
    seated: Vec<usize>,
    seats: usize,
    /// How often every two ranks have met.
    met: Vec<u16>,
}

impl Tables {
    fn new(state: &TournamentState, order: Vec<usize>, seats: usize) -> Tables {
        let count = order.len();
        let mut rank = vec![None; state.participants.len()];
        for (index, &who) in order.iter().enumerate() {
            rank[who] = Some(index);
        }
        let mut met = vec![0u16; count * count];
        for pairing in &state.pairings {
            let ranks = pairing.table.iter().filter_map(|&who| rank[who]);
            for a in ranks.clone() {
                for b in ranks.clone().filter(|&b| b != a) {
                    met[a * count + b] += 1;
                }
            }
        }
        Tables {
            seated: (0..count).collect(),
            order,
            seats,
            met,
        }
    }

    /// The cost of a meeting. A repeated one costs more than all distances in rank together.
    fn cost(&self, a: usize, b: usize) -> i64 {
        let count = self.order.len();
        let far = a.abs_diff(b) as i64;
        let dear = (count * count * count * self.seats) as i64;
        i64::from(self.met[a * count + b]) * dear + far * far
    }

    /// The cost of a rank at a place, with the others of that table.
    fn cost_at(&self, place: usize, rank: usize) -> i64 {
        let first = place / self.seats * self.seats;
        (first..first + self.seats)
            .filter(|&other| other != place)
            .map(|other| self.cost(rank, self.seated[other]))
            .sum()
    }

    /// Improves the tables by late acceptance: a swap is kept if the cost is not above the cost
    /// some steps before. This leaves local optima that no single swap improves.
    fn improved(mut self, chance: &mut Chance) -> Vec<Vec<usize>> {
        let count = self.seated.len();
        let tables = count / self.seats;
        if tables > 1 {
            let tries = (tables * TRIES_PER_TABLE).min(MAX_TRIES);
            let mut total = 0;
            let mut best = (0, self.seated.clone());
            let mut memory = [0; MEMORY];
            for step in 0..tries {
                let (a, b) = (chance.below(count), chance.below(count));
                if a / self.seats == b / self.seats {
                    continue;
                }
                let (here, there) = (self.seated[a], self.seated[b]);
                let gain = self.cost_at(a, there) + self.cost_at(b, here)
                    - self.cost_at(a, here)
                    - self.cost_at(b, there);
                let remembered = &mut memory[step % MEMORY];
                if gain <= 0 || total + gain <= *remembered {
                    self.seated.swap(a, b);
                    total += gain;
                    if total < best.0 {
                        best = (total, self.seated.clone());
                    }
                }
                *remembered = total;
            }
            self.seated = best.1;
        }
        self.named()
    }

    /// The tables by participant, best ranks first.
    fn named(self) -> Vec<Vec<usize>> {
        let mut tables: Vec<Vec<usize>> = self
            .seated
            .chunks(self.seats)
            .map(<[usize]>::to_vec)
            .collect();
        tables.sort_by_key(|ranks| ranks.iter().sum::<usize>());
        let name = |rank: usize| self.order[rank];
        let named = |ranks: Vec<usize>| ranks.into_iter().map(name).collect();
        tables.into_iter().map(named).collect()
    }
}
