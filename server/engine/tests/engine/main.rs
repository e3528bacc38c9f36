//! The tests of the rule engine, one binary. Each module below is a subject; what several of them
//! need is in `support`, and `model` is a second, plain reading of the rules to hold the engine
//! against.

#![allow(
    clippy::unwrap_used,
    reason = "a test fails by it, in its helpers as well"
)]

mod actions;
mod cards;
mod end;
mod errors;
mod exchange;
mod mask;
mod metrics;
mod model;
mod observation;
mod properties;
mod requirement;
mod rewards;
mod rules;
mod rules_page;
mod scripts;
mod secrecy;
mod start;
mod support;
mod twins;
mod vectors;
