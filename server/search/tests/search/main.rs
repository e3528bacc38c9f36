//! Tests of the crate's public interface: one binary.

mod belief;
mod enumeration;
mod evaluation;
mod sampler;
mod scenario;
