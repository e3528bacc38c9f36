//! Random numbers of a tournament: one generator from its seed, with a stream for each purpose. No
//! deal depends on them.

use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

/// Rounds use the streams below 2^32, tie breaks of participants those from here.
const TIE_BREAKS: u64 = 1 << 32;

/// The random numbers of one purpose.
pub(super) struct Chance(ChaCha20Rng);

impl Chance {
    /// The numbers of a round. Round 0 is for what concerns all rounds.
    pub(super) fn of_round(seed: [u8; 32], round: u32) -> Chance {
        Chance::stream(seed, u64::from(round))
    }

    /// The tie break of a participant: of participants who are otherwise equal, the lowest comes
    /// first. Independent of the other participants.
    pub(super) fn tie_break(seed: [u8; 32], participant: usize) -> u64 {
        Chance::stream(seed, TIE_BREAKS + participant as u64)
            .0
            .next_u64()
    }

    fn stream(seed: [u8; 32], stream: u64) -> Chance {
        let mut generator = ChaCha20Rng::from_seed(seed);
        generator.set_stream(stream);
        Chance(generator)
    }

    /// A number below `n`, which must be at least 1 and below 2^32. Implemented here so that no
    /// library update changes seeded results. Its bias is below n / 2^32.
    pub(super) fn below(&mut self, n: usize) -> usize {
        ((u64::from(self.0.next_u32()) * n as u64) >> 32) as usize
    }

    /// Shuffles the items.
    pub(super) fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }
}
