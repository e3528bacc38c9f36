//! How full the nodes are: which of them a new room is for, and what a node hands over so that all are equally full. Each node
//! decides for itself, by what the others have said last.

use std::cmp::{Ordering, Reverse};

/// Rooms that a node has too many or lacks, from which some are handed over: each of them stands still for a moment.
const MIN_DIFFERENCE: u64 = 4;
/// Rooms are handed over if a node has more than one in this number of its share too many, or lacks them.
const DIFFERENCE_DIVISOR: u64 = 10;

/// How full a node is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Load {
    /// Rooms that wait or play.
    pub rooms: u64,
    /// Most rooms that it has at a time.
    pub capacity: u64,
}

impl Load {
    fn is_full(self) -> bool {
        self.rooms >= self.capacity
    }

    /// Compares the parts of their capacities that two nodes use.
    fn compare(self, other: Self) -> Ordering {
        let part = |of: Self, to: Self| u128::from(of.rooms) * u128::from(to.capacity);
        part(self, other).cmp(&part(other, self))
    }
}

/// The numbers of rooms that a node hands over to others, so that all use the same part of their capacity. Empty if it has at
/// most a tenth or a few rooms more than that, and no other lacks more.
pub fn surplus<N: Copy>(own: Load, others: &[(N, Load)]) -> Vec<(N, u64)> {
    let all = || others.iter().map(|(_, load)| *load).chain([own]);
    let rooms: u128 = all().map(|load| u128::from(load.rooms)).sum();
    let capacity: u128 = all().map(|load| u128::from(load.capacity)).sum();
    let share = |load: Load| {
        let share = (rooms * u128::from(load.capacity)).div_ceil(capacity.max(1));
        u64::try_from(share).unwrap_or(u64::MAX)
    };
    let surplus = own.rooms.saturating_sub(share(own));
    let lacking = |load: Load| share(load).saturating_sub(load.rooms);
    let is_large = |difference: u64, load: Load| {
        difference >= MIN_DIFFERENCE && difference > share(load) / DIFFERENCE_DIVISOR
    };
    let is_any_empty = others.iter().any(|(_, it)| is_large(lacking(*it), *it));
    if surplus == 0 || !is_large(surplus, own) && !is_any_empty {
        return Vec::new();
    }
    let all_lacking: u128 = others.iter().map(|(_, it)| u128::from(lacking(*it))).sum();
    // Other nodes may have a surplus as well: each fills the same part of what is lacking, and what rounding leaves goes to those
    // that lack most.
    let mut given: Vec<(N, u64, u64)> = (others.iter())
        .map(|(node, load)| {
            let lacks = lacking(*load);
            let part = u128::from(surplus) * u128::from(lacks) / all_lacking.max(1);
            (
                *node,
                lacks,
                u64::try_from(part).unwrap_or(u64::MAX).min(lacks),
            )
        })
        .collect();
    given.sort_by_key(|(_, lacks, _)| Reverse(*lacks));
    let mut left = surplus - given.iter().map(|(.., rooms)| rooms).sum::<u64>();
    for (_, lacks, rooms) in &mut given {
        let more = u64::from(left > 0 && *rooms < *lacks);
        (*rooms, left) = (*rooms + more, left - more);
    }
    let given = given.into_iter().filter(|(.., rooms)| *rooms > 0);
    given.map(|(node, _, rooms)| (node, rooms)).collect()
}

/// The node that a new room is for; `None` if it is this one. A full node has it created by the one that is least full, and one
/// that would hand rooms over by the one that would get most of them.
pub fn place<N: Copy>(own: Load, others: &[(N, Load)]) -> Option<N> {
    if own.is_full() {
        let free = others.iter().filter(|(_, load)| !load.is_full());
        let emptiest = free.min_by(|(_, one), (_, other)| one.compare(*other));
        return emptiest.map(|(node, _)| *node);
    }
    let most = surplus(own, others).into_iter().max_by_key(|(_, it)| *it);
    most.map(|(node, _)| node)
}
