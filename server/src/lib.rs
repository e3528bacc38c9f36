//! The Chef's Hat game server as a library: tasks of rooms, tournaments and studies, stores, gRPC services
//! and the page. The core of a room is `chefshat-room`, the rules are `chefshat-engine`; the
//! command line is `chefshat`, in `server/cli` and `server/lab`.

pub mod cluster;
pub mod config;
pub mod connections;
pub mod forwarded;
pub mod grpc;
pub mod handshakes;
pub mod host;
pub mod journaled;
#[cfg(test)]
mod limits_page;
pub mod participants;
pub mod record_writer;
pub mod retention;
pub mod room;
pub mod rooms;
pub mod scrape;
pub mod serve;
pub mod signing;
pub mod studies;
pub mod tls;
pub mod tournaments;
pub mod web;
pub mod webhooks;

pub use chefshat_base::{clock, file_watch, metrics, post, proxies, tasks, threads};

pub use chefshat_store as store;
pub use chefshat_store::samples;
pub use chefshat_wire::{convert, encoded as wire, outbox};

pub use chefshat_admission::{access, limits};
