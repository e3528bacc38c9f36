//! What the whole-system tests share: a server on a free port, in this process or in one of its own, rooms on it, seats that do exactly
//! what a test tells them, over real sockets, and a ledger of what agents were told. Agents that play by themselves come from the SDKs.

/// The samples of the README, compiled.
#[doc = include_str!("../../README.md")]
#[cfg(doctest)]
pub struct Readme;

mod disk;
mod ledger;
mod process;
mod regulars;
mod seat;
mod server;

pub use disk::{SmallDisk, skip};
pub use ledger::{Ledger, Noted};
pub use process::{Ended, Launch, Process, set_up};
pub use regulars::{Habit, Regulars};
pub use seat::{StreamSeat, attach_all, first_legal, first_to_hear, is_legal, play_on};
pub use server::{TestServer, narrow_spectator, one_shift, play_out, random_agents, room_of_four};

use std::time::Duration;

/// How long a test waits for something that must happen before it says that it did not. Never a measure of speed.
pub const PATIENCE: Duration = Duration::from_secs(300);

/// Waits for something that must happen.
///
/// # Panics
/// When it does not.
pub async fn patiently<T>(what: &str, future: impl Future<Output = T>) -> T {
    tokio::time::timeout(PATIENCE, future)
        .await
        .unwrap_or_else(|_| panic!("waited in vain for {what}"))
}
