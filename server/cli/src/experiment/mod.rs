//! `chefshat experiment`: the paper's experiments that need nothing but the engine, and what stands behind docs/ratings.md; one module for
//! each. What is played is decided in `chefshat-arena`; the experiments with agents that learn are in the Python package.

mod duplicates;
mod mechanics;
mod ratings;

use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::CommandError;

/// Repeat an experiment of the paper, or one that says how far results can be trusted.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat experiment mechanics --large\n\nThe paper's experiments with agents that learn: \
                  python -m chefshat.experiments --help"
)]
pub(super) struct ExperimentCommand {
    #[command(subcommand)]
    experiment: Experiment,
}

#[derive(Debug, Subcommand)]
enum Experiment {
    /// Experiment 1: what jokers, exchange and special actions do to the game.
    Mechanics(mechanics::Mechanics),
    /// How often do ratings claim what is true?
    Ratings(ratings::Calibrate),
    /// How much fewer games tell two agents apart on duplicate deals?
    Duplicates(duplicates::Duplicates),
}

impl ExperimentCommand {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        match self.experiment {
            Experiment::Mechanics(command) => command.run(),
            Experiment::Ratings(command) => command.run(),
            Experiment::Duplicates(command) => command.run(),
        }
    }
}
