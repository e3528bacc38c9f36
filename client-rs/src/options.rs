//! Options of playing. The calls of `Client` say which seats are played, and by which agents.

use crate::{Backoff, v1};

/// Maximum size of a seat's contribution to the game seed, bytes.
pub const ENTROPY_BYTES: usize = 32;

/// A seat's contribution to the game seed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Entropy {
    /// Random bytes for each seat, so that no single party chooses the deals.
    #[default]
    Fresh,
    /// These bytes for every seat of the call, at most [`ENTROPY_BYTES`].
    Fixed(Vec<u8>),
    /// None.
    None,
}

impl Entropy {
    /// The bytes for one seat.
    pub(crate) fn draw(&self) -> Vec<u8> {
        match self {
            Self::Fresh => rand::random::<[u8; ENTROPY_BYTES]>().to_vec(),
            Self::Fixed(bytes) => bytes.clone(),
            Self::None => Vec::new(),
        }
    }
}

/// How to play seats.
#[derive(Clone, Debug, Default)]
pub struct PlayOptions {
    /// How events reach the agents; default: with their decisions.
    pub delivery: v1::EventDelivery,
    /// Omits the mask of legal actions from requests.
    pub no_mask: bool,
    /// The seats' contribution to the game seed; it counts in games that start after the seat is
    /// first attached.
    pub entropy: Entropy,
    /// Handling of lost connections.
    pub backoff: Backoff,
}
