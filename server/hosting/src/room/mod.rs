//! Rooms. Each is a task that owns one game. `chefshat-room` decides; `task` commits and publishes;
//! `subscriber` sends to the streams of seats and spectators; `handle` is the interface to a room,
//! which sends it the messages in `message`, or handles an answer in place through `shared`;
//! `clients` are those that took seats; `telemetry` counts and traces; `table_view` is what those who
//! attend to a physical table see, `markers` what the owner follows, `hints` the latest hint.

mod clients;
mod handle;
mod hints;
#[cfg(test)]
mod label_tests;
mod markers;
mod message;
mod shared;
pub mod subscriber;
mod table_view;
mod task;
mod telemetry;
#[cfg(test)]
mod tests;

pub use handle::{Handle, spawn_room};
pub use markers::MarkerFollower;
pub use message::{
    AttachRequest, AttachedSeat, JoinRequest, Joined, Loss, MarkRequest, NotAttached,
    ReportRefusal, RoomError, RoomGone, SeatAction, SpectateError, SpectateRequest, Supersedes,
};
pub use subscriber::{MAX_SPECTATOR_LAG, MAX_SPECTATORS};
pub use table_view::SentState;
pub use task::{GameEnd, RoomWatcher, TaskContext};
