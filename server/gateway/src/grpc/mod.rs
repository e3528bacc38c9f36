//! The gRPC services: they translate and forward. No handler owns state, so a cancelled one loses
//! nothing.

mod access;
mod admin;
mod analysis;
mod deadline;
mod decoding;
mod fanout;
mod fields;
mod follow;
mod forward;
mod heartbeats;
mod info;
mod instruments;
mod limits;
mod lists;
mod lookup;
mod new_room;
mod pace;
mod pages;
mod play;
mod recorded;
mod records;
mod refusals;
mod room_service;
mod spectate;
pub mod status;
mod studies;
mod table;
mod takeover;
mod tournaments;
#[cfg(test)]
mod unit_tests;
mod vector;

pub use access::{AccessLayer, until_closing};
pub use admin::AdminCalls;
pub use analysis::Analyses;
pub use decoding::DecodingLayer;
pub use forward::{ForwardLayer, FromPeer};
pub use heartbeats::HeartbeatLayer;
pub use info::Info;
pub use instruments::Instruments;
pub use limits::LimitsLayer;
pub(crate) use limits::within_share;
pub use lookup::Lookup;
pub use play::{MAX_WAITING_MEMORY, OfNodes, Play};
pub use recorded::Recorded;
pub use records::Records;
pub use refusals::count_refusals;
pub use room_service::RoomCalls;
pub use spectate::Spectate;
pub use studies::StudyCalls;
pub use table::TableCalls;
pub use tournaments::TournamentCalls;
pub use vector::Vectors;
