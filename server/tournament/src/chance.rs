//! Where the draws of a tournament come from: its seed, with a stream for each purpose. No deal depends on them.

use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

/// The streams of the rounds are those below 2^32; the lots of the participants come from those above.
const LOTS: u64 = 1 << 32;

/// Draws for one purpose.
pub(super) struct Chance(ChaCha20Rng);

impl Chance {
    /// The draws of a round; those that concern all rounds are of round 0.
    pub(super) fn of_round(seed: [u8; 32], round: u32) -> Chance {
        Chance::stream(seed, u64::from(round))
    }

    /// The lot of a participant: of those who are level in everything, the lowest comes first. It does not depend on who else takes part.
    pub(super) fn lot(seed: [u8; 32], participant: usize) -> u64 {
        Chance::stream(seed, LOTS + participant as u64).0.next_u64()
    }

    fn stream(seed: [u8; 32], stream: u64) -> Chance {
        let mut generator = ChaCha20Rng::from_seed(seed);
        generator.set_stream(stream);
        Chance(generator)
    }

    /// A number below `n`, which is at least 1 and below 2^32. Spelled out, so that no library's next version changes what a seed
    /// brings about; its bias is below n / 2^32.
    pub(super) fn below(&mut self, n: usize) -> usize {
        ((u64::from(self.0.next_u32()) * n as u64) >> 32) as usize
    }

    /// Puts items into a random order.
    pub(super) fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }
}
