//! `chefshat-lab`: what needs datasets, pictures, simulations or examinations, beside all commands of
//! `chefshat`, which starts it for these.

mod agent_host;
mod bench;
mod check_agent;
mod compare;
mod conformance;
#[cfg(test)]
mod documents;
mod experiment;
mod export;
mod mcp;
mod open_room;
mod ratings;
mod render;
mod simulate;

use std::process::ExitCode;

use chefshat_cli::ServerCommand;
use chefshat_cli::error::CommandError;
use chefshat_cli::program::{self, Commands, Invocation, in_runtime, in_runtime_with_input};
use clap::Subcommand;

/// As in `chefshat`.
#[cfg(all(target_os = "linux", feature = "dist"))]
#[global_allocator]
static ALLOCATOR: tikv_jemallocator::Jemalloc = tikv_jemallocator::Jemalloc;

#[derive(Debug, Subcommand)]
enum Command {
    #[command(flatten)]
    Server(Box<ServerCommand>),
    /// Export records as a dataset: Parquet, CSV or JSON Lines, with a dataset card.
    Export(export::Export),
    /// Draw a record: a picture, an animation, or the action table of a decision.
    Render(render::Render),
    /// Play many games offline and print statistics.
    Simulate(simulate::Simulate),
    /// Compare two agents on duplicate deals: the same deals for both, in all seats.
    Compare(compare::Compare),
    /// Play the benchmark ChefsHat-v1, check submissions, print tables of results.
    Bench(bench::BenchCommand),
    /// Recompute the leaderboard from records.
    Ratings(ratings::RatingsCommand),
    /// Run an experiment of the paper.
    Experiment(experiment::ExperimentCommand),
    /// Test whether an agent, in any language, plays correctly.
    CheckAgent(check_agent::CheckAgent),
    /// Check the rule engine against test vectors.
    Conformance(conformance::Conformance),
    /// Let language models play: a Model Context Protocol server.
    Mcp(mcp::Mcp),
}

impl Commands for Command {
    fn run(self, invocation: &Invocation) -> Result<ExitCode, CommandError> {
        match self {
            Self::Server(command) => command.run(invocation),
            Self::Export(command) => command.run(),
            Self::Render(command) => command.run(),
            Self::Simulate(command) => command.run(),
            Self::Compare(command) => command.run(),
            Self::Bench(command) => command.run(),
            Self::Ratings(command) => command.run(),
            Self::Experiment(command) => command.run(),
            Self::CheckAgent(command) => in_runtime(command.run()),
            Self::Conformance(command) => command.run(),
            Self::Mcp(command) => in_runtime_with_input(command.run()),
        }
    }

    fn draws(&self) -> bool {
        matches!(self, Self::Server(command) if command.draws())
    }

    fn otlp_endpoint(&self) -> Option<&str> {
        match self {
            Self::Server(command) => command.otlp_endpoint(),
            _ => None,
        }
    }
}

fn main() -> ExitCode {
    program::run::<Command>()
}

#[cfg(test)]
mod tests {
    use chefshat_cli::lab;
    use chefshat_cli::program::CommandLine;
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn chefshat_lists_the_commands_of_this_program() {
        let whole = CommandLine::<Command>::command();
        let here: Vec<_> = (whole.get_subcommands())
            .filter(|command| !ServerCommand::has_subcommand(command.get_name()))
            .map(|command| {
                let about = command.get_about().map(ToString::to_string);
                (command.get_name().to_owned(), about.unwrap_or_default())
            })
            .collect();
        let listed = lab::COMMANDS.map(|(name, about)| (name.to_owned(), about.to_owned()));
        assert_eq!(here, listed);
    }
}
