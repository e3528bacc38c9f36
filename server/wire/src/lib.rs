//! Engine and room to and from the protocol, and what is sent most often as bytes.

pub mod convert;
pub mod encoded;
pub mod outbox;
