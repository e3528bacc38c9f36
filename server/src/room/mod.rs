//! A room: a place with seats that owns one game. `core` is the synchronous heart that decides everything; `task` is the thin shell around
//! it that receives, keeps, and only then tells; `delivery` is how what happened reaches streams.

mod clock;
pub mod delivery;
mod handle;
mod spectators;
mod task;
#[cfg(test)]
mod tests;

pub use clock::{RoomClock, since_epoch_ms};
pub use handle::{
    Acted, AttachRequest, Handle, JoinRequest, Joined, RoomGone, SeatAction, SpectateError,
    SpectateRequest,
};
pub use spectators::{MAX_SPECTATOR_LAG, MAX_SPECTATORS};
pub use task::{RoomWatcher, TaskContext, go_on};
