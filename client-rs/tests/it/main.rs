//! The client on a scripted server, over sockets. The whole-system tests use the real server.
#![allow(clippy::unwrap_used, reason = "a test may fail where it stands")]

mod fake;
mod follow;
mod play;
mod tls;
mod watch;
