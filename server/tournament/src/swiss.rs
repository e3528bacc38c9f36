//! The tables of a Swiss round: those who stand alike meet, from the top, with as few repeated meetings as possible. Byes go to the lowest
//! of those who have had the fewest.

use std::cmp::Reverse;

use super::chance::Chance;
use super::course::Course;
use super::draw::Drawing;
use super::standings;

/// Exchanges of two participants that are tried for each table.
const TRIES_PER_TABLE: usize = 10_000;
/// Exchanges in all that are tried at most.
const MAX_TRIES: usize = 500_000;
/// Steps that an exchange is compared back over: it is kept if it is not worse than what stood so many steps before.
const MEMORY: usize = 500;

/// The tables of the next round.
pub(super) fn draw(course: &Course, chance: &mut Chance) -> Drawing {
    let seats = course.settings.players;
    let mut order = standings::order(course);
    let byes = byes(course, &order, order.len() % seats);
    order.retain(|who| !byes.contains(who));
    let tables = Tables::new(course, order, seats).improved(chance);
    Drawing { tables, byes }
}

/// So many byes: to those who have had the fewest, of them to the lowest.
fn byes(course: &Course, order: &[usize], count: usize) -> Vec<usize> {
    let mut candidates: Vec<(usize, usize)> = order.iter().copied().enumerate().collect();
    candidates.sort_by_key(|&(rank, who)| (course.sums[who].byes, Reverse(rank)));
    let chosen = candidates.into_iter().take(count);
    let mut byes: Vec<usize> = chosen.map(|(_, who)| who).collect();
    byes.sort_unstable();
    byes
}

/// Ranks at tables, one after the other, and what it costs that two of them meet.
struct Tables {
    /// Who has each rank.
    order: Vec<usize>,
    /// Ranks: the first table's seats, then the next one's.
    seated: Vec<usize>,
    seats: usize,
    /// How often each two ranks have met.
    met: Vec<u16>,
}

impl Tables {
    fn new(course: &Course, order: Vec<usize>, seats: usize) -> Tables {
        let count = order.len();
        let mut rank = vec![None; course.participants.len()];
        for (index, &who) in order.iter().enumerate() {
            rank[who] = Some(index);
        }
        let mut met = vec![0u16; count * count];
        for pairing in &course.pairings {
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

    /// A repeated meeting costs more than the ranks of all tables could; of meetings alike those of far ranks cost more.
    fn cost(&self, a: usize, b: usize) -> i64 {
        let count = self.order.len();
        let far = a.abs_diff(b) as i64;
        let dear = (count * count * count * self.seats) as i64;
        i64::from(self.met[a * count + b]) * dear + far * far
    }

    /// What those at the table of a place would cost the rank that sits there.
    fn cost_at(&self, place: usize, rank: usize) -> i64 {
        let first = place / self.seats * self.seats;
        (first..first + self.seats)
            .filter(|&other| other != place)
            .map(|other| self.cost(rank, self.seated[other]))
            .sum()
    }

    /// Exchanges participants of different tables while that makes the tables better, and now and then when it does not (late
    /// acceptance: the search leaves poor tables behind that no single exchange betters).
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

    /// The tables, those with the best ranks first.
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
