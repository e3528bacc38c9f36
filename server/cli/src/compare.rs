//! `chefshat compare A B`: compares two agents on duplicate deals. `chefshat-simulation` plays the games, `report` prints the result.

mod report;

use std::io::Write as _;
use std::num::NonZeroU32;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use chefshat_agents::{AgentKind, Network};
use chefshat_simulation::{Contender, Duplicate, DuplicateError, SeatPlan};
use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};

use super::rules_args::RulesArgs;
use super::{CommandError, threads};

const HELP: &str = "\
A and B are built-in agents (random, greedy and so on) or network files, as chefshat.learn writes them. Every deal is played \
in all seatings of the two, so that neither is favoured by the cards. How much that is worth depends on the two: last of all the output \
says how many Shifts of independent deals would make the result as sure. A network plays the legal action with the highest output.

Figures are per seat and Shift: what a seat of A gets, and a seat of B. The 95 % interval is 1.96 standard errors to either side of the \
difference; independent of each other are the deals. Roles and exchange begin with the second Shift of a game. Only the deals are the \
same in all seatings: agents that draw do so anew.

Examples:
  chefshat compare greedy random
  chefshat compare trained.safetensors greedy --deals 500 --seed 7
  chefshat compare deep_q.safetensors random --seats one --preset original2020 --json

The same seed gives the same output, on any number of threads.";

/// Compare two agents on duplicate deals: the same deals for both, in all seats.
#[derive(Debug, Args)]
#[command(
    after_help = HELP,
    mut_arg("target_points", |arg| arg.hide(true)),
    mut_arg("target_shifts", |arg| arg.hide(true))
)]
pub(super) struct Compare {
    /// A built-in agent or a network file.
    a: String,
    /// The agent to compare it with.
    b: String,
    /// Number of deals, each played in all seatings.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u64).range(2..))]
    deals: u64,
    /// Number of Shifts in each game.
    #[arg(long, default_value = "4")]
    shifts: NonZeroU32,
    /// How the two agents share the seats.
    #[arg(long, default_value = "half")]
    seats: SeatsFlag,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Number of threads, at most 256 and one per deal; 0 means one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    rules: RulesArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SeatsFlag {
    /// Half of the seats each, in all combinations (6 with four players).
    Half,
    /// One seat for A and the others for B, in all combinations, as in the paper's tables.
    One,
}

/// One of the two agents.
struct Entrant {
    /// As given on the command line.
    given: String,
    /// Short name for tables.
    label: String,
    contender: Contender,
}

impl Compare {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        if self.rules.message().stop.is_some() {
            return Err(
                "--target-points, --target-shifts: use --shifts to set the length of games".into(),
            );
        }
        let rules = self.rules.rules()?;
        let entrants = [Entrant::of(&self.a)?, Entrant::of(&self.b)?];
        let plan = match self.seats {
            SeatsFlag::Half => SeatPlan::Half,
            SeatsFlag::One => SeatPlan::One,
        };
        let contenders = entrants.each_ref().map(|entrant| entrant.contender.clone());
        let duplicate = Duplicate::new(rules, self.shifts, contenders, plan, self.deals, self.seed)
            .map_err(|error| self.explained(error))?;
        let bar = ProgressBar::new(self.deals).with_style(ProgressStyle::with_template(
            "{bar:40} {human_pos} of {human_len} deals, {eta} left",
        )?);
        let pool = threads::pool(self.threads, self.deals)?;
        let comparison = pool.install(|| duplicate.run(|deals| bar.inc(deals)));
        bar.finish_and_clear();
        let played = report::Played {
            compare: &self,
            entrants: &entrants,
            duplicate: &duplicate,
            comparison: &comparison,
        };
        let mut out = anstream::stdout().lock();
        if self.json {
            writeln!(out, "{}", played.json())?;
        } else {
            write!(out, "{}", played.text())?;
        }
        Ok(ExitCode::SUCCESS)
    }

    fn explained(&self, error: DuplicateError) -> String {
        match error {
            DuplicateError::Deals(_) => format!("--deals: {error}"),
            DuplicateError::DoesNotFit { who, .. } => {
                let given = if who == "A" { &self.a } else { &self.b };
                format!("{given}: {error}: change --players, --faces or --jokers")
            }
        }
    }
}

impl Entrant {
    /// Reads a built-in agent, or else a network file.
    fn of(given: &str) -> Result<Entrant, CommandError> {
        if let Some(kind) = AgentKind::from_name(given) {
            return Ok(Entrant {
                given: given.to_owned(),
                label: given.to_owned(),
                contender: Contender::Kind(kind),
            });
        }
        let path = Path::new(given);
        if !path.exists() {
            let known = AgentKind::ALL.map(AgentKind::name).join(", ");
            return Err(format!(
                "{given}: neither a built-in agent ({known}) nor a file that exists"
            )
            .into());
        }
        if path.is_dir() {
            return Err(format!("{given} is a directory: name the network file in it").into());
        }
        let network = Network::load(path).map_err(|error| format!("{given}: {error}"))?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        Ok(Entrant {
            given: given.to_owned(),
            label: stem.chars().filter(|letter| !letter.is_control()).collect(),
            contender: Contender::Network(Arc::new(network)),
        })
    }
}
