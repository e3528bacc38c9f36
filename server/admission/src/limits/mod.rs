//! What one caller may take of the server, so that its load neither refuses nor delays others: who
//! is charged ([`Key`]), permits that are shared fairly ([`FairSemaphore`]), rates ([`Rate`]), long
//! computations with deadlines ([`WorkQueue`]), and the games and searches of built-in agents, on
//! threads of their own ([`Background`], [`Searches`]).

pub mod background;
pub mod calls;
pub mod decoding;
pub mod fair_semaphore;
pub mod frames;
mod key;
mod log_pace;
mod rate;
mod searches;
mod stored;
mod work_queue;

use std::time::Duration;

pub use background::{Background, TimeSlice};
pub use calls::{
    Admitted, BYTES_PER_CALL, COST_OF_BUILT_IN_GAME, COST_OF_ROOM, COST_OF_TOURNAMENT, CallLimits,
    DECODED_BYTES_PER_CALL, Executing, HISTORY_STEP, MAX_FREE_DECODED,
};
pub use decoding::{Decoding, MAX_DECODED, MESSAGE_TIMEOUT, SMALL_DECODED, SMALL_MESSAGE};
pub use fair_semaphore::{FairSemaphore, Permit};
pub use frames::Metered;
pub use key::{Key, Payer, Shares};
pub use log_pace::LogPace;
pub use rate::Rate;
pub use searches::{Hint, Searches};
pub use stored::{NotStored, StoredBytes};
pub use work_queue::{Queued, SLICE, Slice, WorkQueue};

/// Why something is refused although the caller may do it: it or others use too much of it now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{what}: at most {limit}; try again in {} s", retry_after.as_secs())]
pub struct Refused {
    /// In UPPER_SNAKE, such as `TOO_MANY_ROOMS`.
    pub reason: &'static str,
    /// What there is too much of, and what to do, for people.
    pub what: &'static str,
    /// The limit of this caller.
    pub limit: u64,
    /// When it is worth trying again.
    pub retry_after: Duration,
}
