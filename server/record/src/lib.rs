//! Records of finished games: reading, writing and verifying JSON Lines of
//! `chefshat.v1.RecordLine`, branching, import of games played with real cards, and conversion
//! between the engine's values and the protocol's messages.

pub mod atomic_file;
pub mod branch;
pub mod convert;
pub mod files;
pub mod import;
pub mod jsonl;
pub mod language_model;
pub mod outcome;
pub mod players;
pub mod private;
pub mod pseudonym;
pub mod rated;
pub mod replay;
pub mod samples;
pub mod sheet;
pub mod signature;
mod stated;
pub mod summary;
#[cfg(feature = "testing")]
pub mod testing;
pub mod words;

/// Most Shifts, or points to play for, of a game on a server of which a record is assembled as a whole.
pub const MAX_RECORDED_SHIFTS: u32 = 1_000;
