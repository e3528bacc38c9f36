//! The Chef's Hat game server: rooms that run the rule engine, seats filled by remote agents, clocks, storage, gRPC, and the command
//! line of the binary `chefshat`. The game itself lives in `chefshat-engine`, what is played offline in `chefshat-arena`, the form of
//! records in `chefshat-records`.

pub mod clock;
pub mod config;
pub mod connections;
pub mod convert;
pub mod filing;
pub mod grpc;
pub mod host;
pub mod outbox;
pub mod room;
pub mod rooms;
pub mod serve;
pub mod store;
pub mod tournaments;
pub mod web;
pub mod wire;
