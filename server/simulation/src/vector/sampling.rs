//! Uniformly random legal actions. The draws are a sequence that is determined by a seed, so a
//! program in another language can compute the same ones.

use chefshat_engine::{ActionId, Mask};

/// Increment of the state of SplitMix64.
const GAMMA: u64 = 0x9E37_79B9_7F4A_7C15;

/// A draw of the sequence of a seed (SplitMix64), by its number.
fn draw(seed: u64, number: u64) -> u64 {
    let mut state = seed.wrapping_add(number.wrapping_add(1).wrapping_mul(GAMMA));
    state = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    state = (state ^ (state >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    state ^ (state >> 31)
}

/// The legal action that a draw chooses: its upper 32 bits, scaled to the number of actions.
///
/// # Panics
/// If no action is legal.
pub(super) fn sample(legal: &Mask, seed: u64, number: u64) -> ActionId {
    let chosen = ((draw(seed, number) >> 32) * legal.len() as u64) >> 32;
    legal
        .nth(chosen as usize)
        .expect("an open decision has a legal action")
}
