//! Random choices of a study: one generator from its assignment seed, with a stream for each
//! purpose. No deal depends on them.

use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

/// Blocks use the streams below 2^32, orders of items those from here.
const ITEMS: u64 = 1 << 32;
/// Streams of a participant: more than steps.
const STREAMS_PER_PARTICIPANT: u64 = 256;

/// The random numbers of one purpose.
pub(crate) struct Chance(ChaCha20Rng);

impl Chance {
    /// The numbers of a block of the assignment.
    pub(crate) fn of_block(seed: [u8; 32], block: u32) -> Self {
        Self::stream(seed, u64::from(block))
    }

    /// The numbers of the order of items that a participant meets at a step.
    pub(crate) fn of_items(seed: [u8; 32], participant: u32, step: usize) -> Self {
        let participant = u64::from(participant) * STREAMS_PER_PARTICIPANT;
        Self::stream(seed, ITEMS + participant + step as u64)
    }

    fn stream(seed: [u8; 32], stream: u64) -> Self {
        let mut generator = ChaCha20Rng::from_seed(seed);
        generator.set_stream(stream);
        Self(generator)
    }

    /// Shuffles the items. Implemented here so that no library update changes an assignment.
    pub(crate) fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }

    /// A number below `n`, which must be at least 1 and below 2^32. Its bias is below n / 2^32.
    fn below(&mut self, n: usize) -> usize {
        ((u64::from(self.0.next_u32()) * n as u64) >> 32) as usize
    }
}
