//! What a server knows of the cluster that it may be a node of. `directory` says which node has a room
//! or tournament; a single server has all of them and asks nobody, and `located` asks the database.
//! `lease` tells rooms, tournaments and studies until when they may publish. The node itself is in
//! `node/`.

mod directory;
mod lease;
mod located;

pub use chefshat_cluster::LeaseTimes;
pub use directory::{Directory, Elsewhere, FoundBy, Location, Peer, SingleServer};
pub use lease::{NodeLease, UnitEvent};
#[cfg(test)]
pub(crate) use located::LOOK_LIMIT;
pub use located::{AVOIDED_FOR, StoreDirectory};
