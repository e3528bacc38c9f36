//! A finished game as a file: its form (JSON Lines of `chefshat.v1.RecordLine`), writing, reading and replaying it, and the translation
//! between the engine's values and the protocol's messages that all of this rests on. Hosting games lives in the server.

pub mod atomic_file;
pub mod branch;
pub mod convert;
pub mod files;
pub mod jsonl;
pub mod outcome;
pub mod players;
pub mod pseudonym;
pub mod replay;
pub mod summary;
pub mod table;
#[cfg(feature = "testing")]
pub mod testing;
