//! Rooms. Each is a task that owns one game. `chefshat-room` decides; `task` commits and publishes;
//! `subscriber` sends to the streams of seats and spectators; `handle` is the interface to a room,
//! which sends it the messages in `message`.

mod handle;
mod message;
pub mod subscriber;
mod task;
#[cfg(test)]
mod tests;

pub use handle::{Handle, RoomGone, spawn_room};
pub use message::{
    Acted, AttachRequest, JoinRequest, Joined, SeatAction, SpectateError, SpectateRequest,
};
pub use subscriber::{MAX_SPECTATOR_LAG, MAX_SPECTATORS};
pub use task::{RoomWatcher, TaskContext};
