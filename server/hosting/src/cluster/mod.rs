//! A server as one node of several. `directory` says which node has a room or tournament; a single
//! server has all of them and asks nobody, and `located` asks the database. `peers` connects
//! the nodes. `node` is the task that beats and takes over, `units` resumes and stops what it owns,
//! `turns` keeps their order, and `lease` tells those when they may publish.

mod directory;
mod lease;
mod located;
mod node;
#[cfg(test)]
mod tests;
mod turns;
mod units;

pub use chefshat_cluster::LeaseTimes;
pub use directory::{Directory, Elsewhere, FoundBy, Location, Peer, SingleServer};
pub use lease::{News, NodeLease};
pub use located::StoreDirectory;
pub use node::ClusterNode;
pub use units::Hosted;
