//! Seeds of offline games: one number for a batch, from it a seed for each game, from that a seed
//! for each agent. The engine deals from a game's seed.

use chefshat_engine::{MAX_SEATS, Seat, Seed};
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

/// Separates the keys of batches from those of games.
const BATCH: &[u8; 24] = b"chefshat offline batch 1";
/// Deals use the streams 1, 2, … of a game's seed, in 32 bits; agents' seeds use the streams above.
const AGENT_STREAMS: u64 = 1 << 32;

/// The seed of a game of a batch: the first 32 bytes of stream `index` of ChaCha20, keyed with
/// `batch` (8 bytes, little-endian) and 24 fixed bytes.
pub fn game_seed(batch: u64, index: u64) -> Seed {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&batch.to_le_bytes());
    key[8..].copy_from_slice(BATCH);
    Seed(first_bytes(key, index))
}

/// The seed of the agent on a seat: the first 32 bytes of stream 2^32 + seat of ChaCha20, keyed
/// with the game's seed. No deal uses these streams.
pub fn agent_seed(game: Seed, seat: Seat) -> [u8; 32] {
    seating_agent_seed(game, 0, seat)
}

/// The seed of the agent on a seat of a game played in several seatings: stream 2^32 + 6 * seating
/// + seat, so that random choices differ between seatings.
pub fn seating_agent_seed(game: Seed, seating: usize, seat: Seat) -> [u8; 32] {
    let number = seating * MAX_SEATS + seat.index();
    first_bytes(game.0, AGENT_STREAMS + number as u64)
}

fn first_bytes(key: [u8; 32], stream: u64) -> [u8; 32] {
    let mut generator = ChaCha20Rng::from_seed(key);
    generator.set_stream(stream);
    let mut bytes = [0; 32];
    generator.fill_bytes(&mut bytes);
    bytes
}
