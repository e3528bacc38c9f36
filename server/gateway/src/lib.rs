//! The services, requests to other nodes, the page, and the connections that they come on.

pub mod connections;
pub mod forwarded;
pub mod front;
pub mod grpc;
pub mod handshakes;
pub mod peers;
pub mod scrape;
pub mod tls;
pub mod web;
