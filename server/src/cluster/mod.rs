//! A server as one node of several. `directory` says which node has a room or tournament; a single
//! server has all of them and asks nobody.

mod directory;

pub use directory::{Directory, Location, Peer, SingleServer};
