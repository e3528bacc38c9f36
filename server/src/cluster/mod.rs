//! A server as one node of several. `directory` says which node has a room or tournament; a single
//! server has all of them and asks nobody. `peers` connects
//! the nodes.

mod directory;
mod peers;

pub use directory::{Directory, Elsewhere, FoundBy, Location, Peer, SingleServer};
pub use peers::{CONNECTION_WINDOW, PEER_NAME, PeerPort, PeerPortError, Peers, STREAM_WINDOW};
