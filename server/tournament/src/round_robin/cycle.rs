//! A round that becomes a round robin by moving its participants on, one number at a time: whoever is p in one round is p + 1 in the
//! next, modulo the number of rounds. Two participants then meet as often as their difference occurs at a table of the first round, so the
//! search is for one round in which every difference occurs equally often. (Whist tournaments have been made so for long.)

use super::super::chance::Chance;

/// Exchanges that are tried at most to find the first round.
const MAX_TRIES: usize = 1_500_000;
/// The same for fields so large that an equal cycle is hardly ever found.
const FEW_TRIES: usize = 200_000;
/// Participants of the largest field for which it is.
const MAX_FIELD: usize = 40;
/// Steps that an exchange is compared back over.
const MEMORY: usize = 300;

/// A first round, by table, those who sit out last.
pub(super) struct Cycle {
    first: Vec<usize>,
    /// Participants that move on; if everybody has a table the last one stays, which makes their number one less.
    modulus: usize,
    is_equal: bool,
}

impl Cycle {
    /// Rounds until all is as it was.
    pub(super) fn rounds(&self) -> usize {
        self.modulus
    }

    /// Whether every two participants meet equally often in a cycle.
    pub(super) fn is_equal(&self) -> bool {
        self.is_equal
    }

    /// A round, from 0; after a cycle they begin again.
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

/// Searches for the first round (by late acceptance: an exchange is kept if it is not worse than what stood some steps before).
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
    /// Places at tables; those behind them sit out.
    seated: usize,
    /// By difference, the shorter way round.
    times: Vec<i64>,
    /// Sum of the squares of how often each two meet in a cycle, for each difference once.
    cost: i64,
}

impl Differences {
    /// The table of a place; all who sit out are of one.
    fn table_of(&self, place: usize) -> usize {
        place.min(self.seated) / self.seats
    }

    /// The difference of two, unless one of them stays, who meets all others equally often.
    fn between(&self, a: usize, b: usize) -> Option<usize> {
        let moving = a < self.modulus && b < self.modulus;
        let difference = a.abs_diff(b);
        moving.then(|| difference.min(self.modulus - difference))
    }

    /// A difference of half the way round belongs to half as many pairs, which meet twice as often for it.
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

    /// The other places of a table; none for those who sit out.
    fn neighbours(&self, place: usize) -> impl Iterator<Item = usize> + use<> {
        let table = self.table_of(place);
        let places = table * self.seats..((table + 1) * self.seats).min(self.seated);
        places.filter(move |&other| other != place)
    }

    /// How much more often some two meet in a cycle than some other two.
    fn spread(&self) -> i64 {
        let meetings = || (1..self.times.len()).map(|d| self.times[d] * self.weight(d));
        let (least, most) = (meetings().min(), meetings().max());
        most.unwrap_or(0) - least.unwrap_or(0)
    }
}
