//! How seats are played. What is played, and by whom, is said in the calls of `Client`.

use crate::{Backoff, v1};

/// The most bytes a seat may add to the game seed.
pub const ENTROPY_BYTES: usize = 32;

/// A seat's own part of the game seed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Entropy {
    /// Fresh random bytes for each seat, so that nobody alone chose the deals.
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

/// How seats are played.
#[derive(Clone, Debug, Default)]
pub struct PlayOptions {
    /// How events reach the agents; standard: with their decisions.
    pub delivery: v1::EventDelivery,
    /// Leave the mask of legal actions out of the requests.
    pub no_mask: bool,
    /// The seats' own part of the game seed; counts in games that have not begun when the seat is first attached.
    pub entropy: Entropy,
    /// What to do about lost connections.
    pub backoff: Backoff,
}
