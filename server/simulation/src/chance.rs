//! Random numbers of the statistics: uniform and normal ones from a seeded generator.

use std::f64::consts::TAU;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng as _;

/// A uniform number above 0 and below 1.
pub(crate) fn uniform(generator: &mut ChaCha8Rng) -> f64 {
    ((generator.next_u64() >> 12) as f64 + 0.5) / (1u64 << 52) as f64
}

/// A normal number with mean 0 and deviation 1, by Box and Muller's formula.
pub(crate) fn normal(generator: &mut ChaCha8Rng) -> f64 {
    let length = (-2.0 * uniform(generator).ln()).sqrt();
    length * (TAU * uniform(generator)).cos()
}

/// A uniform index below `n`, which must be at least 1.
pub(crate) fn index(generator: &mut ChaCha8Rng, n: usize) -> usize {
    ((uniform(generator) * n as f64) as usize).min(n - 1)
}
