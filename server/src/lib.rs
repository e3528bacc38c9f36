//! The Chef's Hat game server as a library: tasks of rooms, tournaments and studies, stores, gRPC services
//! and the page. The core of a room is `chefshat-room`, the rules are `chefshat-engine`; the
//! command line is `chefshat`, in `server/cli` and `server/lab`.

pub mod host;
#[cfg(test)]
mod limits_page;
pub mod serve;

pub use chefshat_base::{clock, file_watch, metrics, post, proxies, tasks, threads, tls_files};

pub use chefshat_store as store;
pub use chefshat_store::samples;
pub use chefshat_wire::{convert, encoded as wire, outbox};

pub use chefshat_admission::{access, limits};

pub use chefshat_hosting::{
    cluster, config, journaled, node, participants, record_writer, retention, room, rooms, signing,
    studies, tournaments, webhooks,
};

pub use chefshat_gateway::{connections, forwarded, grpc, handshakes, peers, scrape, tls, web};
