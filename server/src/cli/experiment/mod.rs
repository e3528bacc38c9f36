//! `chefshat experiment`: the paper's experiments that need nothing but the engine, one module for each. What is played is decided in
//! `chefshat-arena`; the experiments with agents that learn are in the Python package.

mod mechanics;

use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::CommandError;

/// Repeat an experiment of the paper and print its table next to ours.
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
}

impl ExperimentCommand {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        match self.experiment {
            Experiment::Mechanics(command) => command.run(),
        }
    }
}
