//! The Chef's Hat game server as a library: wires its parts together, starts and stops it. Programs and
//! tests reach the parts through it. The core of a room is `chefshat-room`, the rules are
//! `chefshat-engine`; the command line is `chefshat`, in `server/cli` and `server/lab`.

pub mod host;
#[cfg(test)]
mod limits_page;
pub mod serve;

pub use chefshat_admission::{access, limits};
pub use chefshat_base::{clock, post, proxies};
pub use chefshat_gateway::{connections, peers, scrape, tls, web};
pub use chefshat_hosting::{
    cluster, config, participants, rooms, signing, studies, tournaments, webhooks,
};
pub use chefshat_store as store;
pub use chefshat_wire::{convert, outbox};

use chefshat_base::{metrics, tasks};
use chefshat_gateway::{forwarded, front, grpc, handshakes};
#[cfg(test)]
use chefshat_hosting::room;
use chefshat_hosting::{node, retention};
use chefshat_wire::encoded as wire;
