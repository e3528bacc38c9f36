//! `cargo xtask`: sets up what the tests of all languages need, runs them, runs the linters, and builds the page for people.
//!
//! The command line lives here. What is run lives in [`lint`], [`test`] and [`web`], what must be there first in [`setup`]. Nothing here
//! knows a crate of the project: this program only starts others and must build when they do not.

mod arrows;
mod circles;
mod command;
mod failure;
mod lint;
mod places;
mod setup;
mod steps;
mod test;
mod web;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::places::Places;
use crate::steps::Steps;
use crate::test::Language;

/// Set up, test and lint everything in every language.
#[derive(Parser)]
#[command(
    name = "cargo xtask",
    after_help = "Example: cargo xtask test --only python"
)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Run all tests; sets up by itself what they need, inside the build folder.
    Test {
        /// Run the tests of one language alone.
        #[arg(long, value_enum)]
        only: Option<Language>,
    },
    /// Check format, lints, protocol, licences and images.
    Lint,
    /// Build the page for people, which the server gives out on its port.
    Web,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let mut steps = Steps::default();
    let outcome = Places::find().and_then(|places| match cli.task {
        Task::Test { only } => test::run(&places, &mut steps, only),
        Task::Lint => lint::run(&places, &mut steps),
        Task::Web => web::run(&places, &mut steps),
    });
    print!("{}", steps.summary());
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("\nxtask: {failure}");
            ExitCode::FAILURE
        }
    }
}
