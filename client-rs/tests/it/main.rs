//! The client against a small server of the test's own, over sockets. What the real server does is tested with the whole system.
#![allow(clippy::unwrap_used, reason = "a test may fail where it stands")]

mod fake;
mod play;
mod watch;
