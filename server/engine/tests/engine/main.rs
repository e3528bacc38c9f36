//! The tests of the rule engine, one binary. Each module below is a subject; what several of them need is in `support`, and `model` is a
//! second, plain reading of the rules to hold the engine against.

mod actions;
mod cards;
mod end;
mod errors;
mod mask;
mod metrics;
mod model;
mod observation;
mod properties;
mod rewards;
mod rules;
mod scripts;
mod secrecy;
mod start;
mod support;
mod vectors;
