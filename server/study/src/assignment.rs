//! The assignment of slots to sequences of conditions, by permuted blocks. Who has a slot is part
//! of the state of a study.

use crate::chance::Chance;

/// How conditions are assigned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Each participant meets one condition.
    Between,
    /// Each participant meets all conditions, in an order from a balanced Latin square.
    Within,
}

impl Order {
    /// All orders.
    pub const ALL: [Self; 2] = [Self::Between, Self::Within];

    /// The sequences that participants have, as indices of conditions.
    pub fn sequences(self, conditions: usize) -> Vec<Vec<usize>> {
        match self {
            Self::Between => (0..conditions).map(|condition| vec![condition]).collect(),
            Self::Within => balanced_square(conditions),
        }
    }
}

/// A Latin square in which every condition follows each other one equally often (Williams,
/// Australian Journal of Scientific Research A 2, 1949): the first row is 0, 1, n-1, 2, n-2, …
/// and each further row adds 1. If n is odd, it takes the mirrored rows as well.
fn balanced_square(n: usize) -> Vec<Vec<usize>> {
    let first = (0..n).map(|index| match index % 2 {
        1 => index.div_ceil(2),
        _ => (n - index / 2) % n,
    });
    let rows = (0..n).map(|row| first.clone().map(|entry| (entry + row) % n).collect());
    let mut square: Vec<Vec<usize>> = rows.collect();
    if n % 2 == 1 && n > 1 {
        let mirrored = |row: &Vec<usize>| row.iter().rev().copied().collect();
        square.extend(square.iter().map(mirrored).collect::<Vec<_>>());
    }
    square
}

/// The sequence of each slot. In each block of slots every sequence occurs equally often, at random
/// positions that follow from the seed.
#[derive(Debug, Clone)]
pub(crate) struct Assignment {
    sequences: Vec<Vec<usize>>,
    block_size: usize,
    seed: [u8; 32],
}

impl Assignment {
    /// `block_size` must be a multiple of the number of sequences.
    pub(crate) fn new(sequences: Vec<Vec<usize>>, block_size: usize, seed: [u8; 32]) -> Self {
        Self {
            sequences,
            block_size,
            seed,
        }
    }

    /// The sequence of a slot, from 0.
    pub(crate) fn sequence(&self, slot: u32) -> &[usize] {
        let size = self.block_size as u32;
        let count = self.sequences.len();
        let mut block: Vec<usize> = (0..self.block_size).map(|place| place % count).collect();
        Chance::of_block(self.seed, slot / size).shuffle(&mut block);
        &self.sequences[block[(slot % size) as usize]]
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn every_condition_has_each_position_and_each_predecessor_equally_often() {
        for conditions in 1..=12 {
            let square = Order::Within.sequences(conditions);
            let squares = if conditions % 2 == 1 && conditions > 1 {
                2
            } else {
                1
            };
            assert_eq!(square.len(), squares * conditions);
            let mut positions = BTreeMap::new();
            let mut pairs = BTreeMap::new();
            for row in &square {
                let mut sorted = row.clone();
                sorted.sort_unstable();
                assert_eq!(sorted, (0..conditions).collect::<Vec<_>>());
                for (position, condition) in row.iter().enumerate() {
                    *positions.entry((position, *condition)).or_insert(0) += 1;
                }
                for pair in row.windows(2) {
                    *pairs.entry((pair[0], pair[1])).or_insert(0) += 1;
                }
            }
            assert_eq!(positions.len(), conditions * conditions);
            assert!(positions.values().all(|&times| times == squares));
            assert_eq!(pairs.len(), conditions * (conditions - 1));
            assert!(pairs.values().all(|&times| times == squares));
        }
    }

    #[test]
    fn the_assignment_of_a_seed_never_changes() {
        let of = |seed, block_size| {
            let assignment = Assignment::new(Order::Between.sequences(3), block_size, [seed; 32]);
            let slots = 0..12;
            slots
                .map(|slot| assignment.sequence(slot)[0])
                .collect::<Vec<_>>()
        };
        // Written down, so that an update of a library cannot change a preregistered assignment.
        assert_eq!(of(7, 3), [2, 0, 1, 2, 1, 0, 0, 2, 1, 0, 1, 2]);
        assert_eq!(of(7, 6), [0, 0, 1, 2, 1, 2, 0, 2, 1, 2, 1, 0]);
        assert_ne!(of(7, 3), of(8, 3));
    }
}
