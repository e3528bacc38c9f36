//! What all parts of the server use: clocks, threads, named tasks, watched files, proxies, posting, and
//! metrics, which name the states of rooms. Nothing here runs a room or knows the protocol.

pub mod clock;
pub mod file_watch;
pub mod lock;
pub mod metrics;
pub mod post;
pub mod proxies;
pub mod tasks;
pub mod threads;
pub mod tls_files;

/// Version of this server, as its records and webhooks name it.
pub const SERVER_VERSION: &str = env!("CARGO_PKG_VERSION");
