//! Tests of the crate's public interface: one binary.

mod enumeration;
mod evaluation;
mod sampler;
mod scenario;
