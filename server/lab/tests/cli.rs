//! The tests of the command line of `chefshat`, in one binary: each runs the program as a person or
//! a script would. One module per command.

#![allow(
    clippy::unwrap_used,
    reason = "a test fails by it, in its helpers as well"
)]

mod cli {
    mod bench;
    mod branching;
    mod check_agent;
    mod cluster;
    mod compare;
    mod config;
    mod conformance;
    mod connect;
    mod demo;
    mod experiment;
    mod export;
    mod import;
    mod listen;
    mod mcp;
    mod migrate;
    mod participant;
    mod ratings;
    mod records;
    mod render;
    mod room;
    mod run;
    mod simulate;
    mod study;
    mod terminal;
    mod token;
    mod tournament;
    mod tournament_simulate;
    mod verify;
}
