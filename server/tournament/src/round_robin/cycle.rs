//! A round that generates a round robin by shifting: participant p of one round becomes p + 1 in
//! the next, modulo the number of rounds. Two participants then meet as often as their difference
//! occurs at a table of the first round, so the search is for a round in which every difference
//! occurs equally often. Whist tournaments use the same construction.

use super::super::chance::Chance;

/// Maximum number of swaps tried.
const MAX_TRIES: usize = 1_500_000;
/// The same for fields too large for a perfectly even cycle.
const FEW_TRIES: usize = 200_000;
/// Largest field for which a perfectly even cycle is likely.
const MAX_FIELD: usize = 40;
/// Length of the history of the late-acceptance search.
const MEMORY: usize = 300;

/// The first round: participants by table, then those with a bye.
pub(super) struct Cycle {
    first: Vec<usize>,
    /// Number of participants that shift. Without byes the last one stays in place.
    modulus: usize,
    is_equal: bool,
}

impl Cycle {
    /// Number of rounds until the cycle repeats.
    pub(super) fn rounds(&self) -> usize {
        self.modulus
    }

    /// Whether every two participants meet equally often in a cycle.
    pub(super) fn is_equal(&self) -> bool {
        self.is_equal
    }

    /// A round, from 0; repeats after a cycle.
    pub(super) fn round(&self, round: usize) -> Vec<usize> {
        let moved = |&number: &usize| {
            if number < self.modulus {
                (number + round) % self.modulus
            } else {
                number
            }
        };
        self.first.iter().map(moved).collect()
    }
}

/// Searches for the first round by late acceptance: a swap is kept if the cost is not above the
/// cost some steps before.
pub(super) fn find(participants: usize, seats: usize, chance: &mut Chance) -> Cycle {
    let seated = participants / seats * seats;
    let modulus = participants - usize::from(seated == participants);
    let mut first: Vec<usize> = (0..participants).collect();
    chance.shuffle(&mut first);
    let mut differences = Differences {
        modulus,
        seats,
        seated,
        times: vec![0; modulus / 2 + 1],
        cost: 0,
    };
    for table in first[..seated].chunks(seats) {
        for (index, &a) in table.iter().enumerate() {
            table[index + 1..]
                .iter()
                .for_each(|&b| differences.add(a, b));
        }
    }
    let mut memory = [differences.cost; MEMORY];
    let tries = if participants <= MAX_FIELD {
        MAX_TRIES
    } else {
        FEW_TRIES
    };
    for step in 0..tries {
        if differences.spread() <= 1 {
            break;
        }
        let (a, b) = (chance.below(participants), chance.below(participants));
        if differences.table_of(a) == differences.table_of(b) {
            continue;
        }
        let before = differences.cost;
        differences.exchange(&mut first, a, b);
        let now = differences.cost;
        if now > before && now > memory[step % MEMORY] {
            differences.exchange(&mut first, a, b);
        }
        memory[step % MEMORY] = differences.cost;
    }
    Cycle {
        first,
        modulus,
        is_equal: differences.spread() == 0,
    }
}

/// How often each difference occurs at the tables.
struct Differences {
    modulus: usize,
    seats: usize,
    /// Number of places at tables; the others are byes.
    seated: usize,
    /// By difference, modulo the cycle, in the shorter direction.
    times: Vec<i64>,
    /// Sum of the squares of the meetings of two participants, once for each difference.
    cost: i64,
}

impl Differences {
    /// The table of a place; all byes share one.
    fn table_of(&self, place: usize) -> usize {
        place.min(self.seated) / self.seats
    }

    /// The difference of two participants; `None` if one of them stays, who meets all others
    /// equally often.
    fn between(&self, a: usize, b: usize) -> Option<usize> {
        let moving = a < self.modulus && b < self.modulus;
        let difference = a.abs_diff(b);
        moving.then(|| difference.min(self.modulus - difference))
    }

    /// A difference of half the cycle belongs to half as many pairs, which meet twice as often.
    fn weight(&self, difference: usize) -> i64 {
        1 + i64::from(2 * difference == self.modulus)
    }

    fn add(&mut self, a: usize, b: usize) {
        if let Some(difference) = self.between(a, b) {
            self.cost += self.weight(difference) * (2 * self.times[difference] + 1);
            self.times[difference] += 1;
        }
    }

    fn take(&mut self, a: usize, b: usize) {
        if let Some(difference) = self.between(a, b) {
            self.times[difference] -= 1;
            self.cost -= self.weight(difference) * (2 * self.times[difference] + 1);
        }
    }

    fn exchange(&mut self, first: &mut [usize], a: usize, b: usize) {
        self.leave(first, a);
        self.leave(first, b);
        first.swap(a, b);
        self.sit(first, a);
        self.sit(first, b);
    }

    fn leave(&mut self, first: &[usize], place: usize) {
        for other in self.neighbours(place) {
            self.take(first[place], first[other]);
        }
    }

    fn sit(&mut self, first: &[usize], place: usize) {
        for other in self.neighbours(place) {
            self.add(first[place], first[other]);
        }
    }

    /// The other places of a table; none for a bye.
    fn neighbours(&self, place: usize) -> impl Iterator<Item = usize> + use<> {
        let table = self.table_of(place);
        let places = table * self.seats..((table + 1) * self.seats).min(self.seated);
        places.filter(move |&other| other != place)
    }

    /// Difference between the most and the fewest meetings of two participants in a cycle.
    fn spread(&self) -> i64 {
        let meetings = || (1..self.times.len()).map(|d| self.times[d] * self.weight(d));
        let (least, most) = (meetings().min(), meetings().max());
        most.unwrap_or(0) - least.unwrap_or(0)
    }
}
