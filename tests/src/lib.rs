//! Shared by the system tests: a server on a free port, in this process or in its own, rooms on it,
//! seats that a test controls step by step over real sockets, and a ledger of what agents received.
//! Agents that play on their own come from the SDKs.

/// The samples of the book in Rust, compiled.
#[doc = include_str!("../../docs/agents-rust.md")]
#[cfg(doctest)]
pub struct AgentsInRust;

mod busy_rooms;
mod disk;
mod ledger;
mod link;
mod nodes;
mod process;
mod prometheus;
mod scores;
mod seat;
mod server;

pub use busy_rooms::{BusyRooms, RoomKind};
pub use chefshat_postgres::own_address;
pub use disk::{SmallDisk, skip};
pub use ledger::{Ledger, Recorded};
pub use link::{Held, Link, Way};
pub use nodes::{TestNode, TestNodes};
pub use process::{Ended, Launch, Process, set_up};
pub use prometheus::{Prometheus, get, source};
pub use scores::scores;
pub use seat::{StreamSeat, attach_all, first_legal, first_update, is_legal, play_on};
pub use server::{
    TestServer, narrow_spectator, one_shift, play_out, random_agents, room_of_four,
    until_watched_by, watched,
};

use std::time::Duration;

/// How long a test waits for something that must happen. Never a measure of speed.
pub const PATIENCE: Duration = Duration::from_secs(300);

/// Waits for something that must happen.
///
/// # Panics
/// It does not happen.
pub async fn patiently<T>(what: &str, future: impl Future<Output = T>) -> T {
    tokio::time::timeout(PATIENCE, future)
        .await
        .unwrap_or_else(|_| panic!("timed out waiting for {what}"))
}
