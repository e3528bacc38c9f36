//! Where a game's seed comes from. A server commits to its part before the seats add theirs, so
//! that anyone can check afterwards that neither side alone chose the deals.

use crate::Seed;
use sha2::{Digest as _, Sha256};

/// The most bytes that a seat may add to the game seed.
pub const MAX_ENTROPY: usize = 32;

/// Where a game's seed comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SeedPlan {
    /// The server committed to its part; the seats may add theirs.
    Committed {
        /// The server's part.
        server_seed: [u8; 32],
        /// Keeps the commitment from being guessed.
        nonce: [u8; 32],
    },
    /// The room's creator fixed the game seed.
    Fixed {
        /// The game seed.
        game_seed: [u8; 32],
    },
}

impl SeedPlan {
    /// SHA-256("chefshat.v1 seed" ‖ game id ‖ nonce ‖ server seed); `None` if the seed is fixed.
    pub fn commitment(&self, game_id: &[u8; 16]) -> Option<[u8; 32]> {
        match self {
            Self::Committed { server_seed, nonce } => Some(
                Sha256::new()
                    .chain_update(b"chefshat.v1 seed")
                    .chain_update(game_id)
                    .chain_update(nonce)
                    .chain_update(server_seed)
                    .finalize()
                    .into(),
            ),
            Self::Fixed { .. } => None,
        }
    }

    /// The game seed: SHA-256("chefshat.v1 game" ‖ server seed ‖ for each seat in order the length
    /// of its bytes in one byte, and the bytes).
    ///
    /// # Panics
    /// If a seat adds more than [`MAX_ENTROPY`] bytes.
    pub fn game_seed<B: AsRef<[u8]>>(&self, entropy: &[B]) -> Seed {
        match self {
            Self::Committed { server_seed, .. } => {
                let mut hash = Sha256::new()
                    .chain_update(b"chefshat.v1 game")
                    .chain_update(server_seed);
                for bytes in entropy {
                    let bytes = bytes.as_ref();
                    assert!(
                        bytes.len() <= MAX_ENTROPY,
                        "entropy is bounded where it enters"
                    );
                    hash.update([u8::try_from(bytes.len()).expect("at most 32")]);
                    hash.update(bytes);
                }
                Seed(hash.finalize().into())
            }
            Self::Fixed { game_seed } => Seed(*game_seed),
        }
    }

    /// The seed of a built-in agent's own generator: SHA-256("chefshat.v1 agent" ‖ server or game
    /// seed ‖ seat in one byte).
    pub fn agent_seed(&self, seat: usize) -> [u8; 32] {
        let (Self::Committed {
            server_seed: secret,
            ..
        }
        | Self::Fixed { game_seed: secret }) = self;
        Sha256::new()
            .chain_update(b"chefshat.v1 agent")
            .chain_update(secret)
            .chain_update([u8::try_from(seat).expect("a seat is below six")])
            .finalize()
            .into()
    }
}
