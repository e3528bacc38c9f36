//! Tests of the crate's public interface: one binary.

mod enumeration;
mod sampler;
mod scenario;
