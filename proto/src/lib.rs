//! The `chefshat.v1` protocol: messages, with the canonical JSON form of every message (serde), and
//! with the feature `services` the service traits and clients, generated from the `.proto` files
//! beside this crate. The documentation of each item is the comment in its `.proto` file.

#[cfg(feature = "services")]
pub mod codec;
pub mod cost;
mod timestamp;

/// Everything of package `chefshat.v1`.
#[allow(
    missing_docs,
    unreachable_pub,
    clippy::all,
    clippy::unwrap_used,
    reason = "generated code"
)]
pub mod v1 {
    include!("../generated/chefshat.v1.rs");
    include!("../generated/chefshat.v1.serde.rs");
}

pub use timestamp::Timestamp;

/// The encoded `FileDescriptorSet` of the protocol, for the reflection service.
pub const DESCRIPTORS: &[u8] = include_bytes!("../generated/descriptors.bin");
