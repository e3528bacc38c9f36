//! Rooms, tournaments and studies that live, what happens when their games end, and the node of a
//! cluster that has them.

pub mod cluster;
pub mod config;
mod confirmed_time;
pub mod journaled;
pub mod node;
pub mod participants;
pub mod record_writer;
pub mod retention;
pub mod room;
pub mod rooms;
pub mod signing;
pub mod studies;
pub mod tournaments;
pub mod webhooks;
