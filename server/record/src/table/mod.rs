//! Games of real tables: played with real cards, watched and written down. Nobody dealt from a seed, and of the hands only what was seen is
//! known. The parts: `transcript` (the form in which a person writes a game down), `import`, `head`, `shifts` and `checks` (a transcript becomes a
//! record), `facts` (what is told of a Shift), `complete` (a Shift that fits it; found by `puzzle`, `offers`, `gifts`, `golden`, `plain` and
//! `known`), `play` (the engine plays that Shift and so judges what is told). The rules are applied by the engine alone.

mod checks;
mod complete;
mod facts;
mod gifts;
mod golden;
mod head;
mod import;
mod known;
mod offers;
mod plain;
mod play;
mod puzzle;
mod shifts;
mod transcript;

pub use import::import;
pub use transcript::{MAX_TRANSCRIPT_BYTES, TranscriptError};

pub(crate) use facts::facts_of_record;
pub(crate) use play::{Beginning, Table};
