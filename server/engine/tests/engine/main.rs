//! Tests of the rule engine, a module for each subject. `support` has shared helpers, `model` a
//! second, plain implementation of the rules.

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
mod states;
mod support;
mod twins;
mod vectors;
