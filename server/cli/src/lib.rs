//! The command line of `chefshat`: one module per command, and what `chefshat-lab` shares with it.
//! `program.rs` runs a command line; `main.rs` and the main of `chefshat-lab` say which commands it
//! has.

mod admin;
mod agent;
mod backup;
pub mod board;
mod choice;
mod cluster;
mod commands;
mod config;
pub mod connect;
pub mod data_dir;
mod demo;
pub mod error;
mod generate;
mod health;
mod help;
mod import;
mod key;
pub mod key_file;
pub mod kind;
pub mod lab;
mod lan;
pub mod language;
mod leaderboard;
mod listen;
mod llm;
mod migrate;
pub mod name_key;
pub mod narration;
mod new_folder;
pub mod numbers;
pub mod output;
mod pages;
mod participant;
mod player;
mod policy_args;
pub mod program;
pub mod progress;
mod records;
pub mod remote;
mod room;
pub mod rules_args;
mod secret_file;
mod serve;
pub mod stops;
mod study;
mod table;
pub mod threads;
mod ticket_file;
mod token;
pub mod toml_file;
mod tournament;
#[cfg(feature = "otlp")]
mod traces;
mod tui;
mod verify;
mod with_lab;

pub use commands::ServerCommand;
use error::{CommandError, say};
pub use with_lab::WithLab;
