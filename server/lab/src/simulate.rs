//! `chefshat simulate`: plays a batch of games offline on all cores and prints statistics.
//! `chefshat-simulation` plays, `report` prints, `records` writes records.

mod records;
mod report;

use std::io::Write as _;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use chefshat_agents::{AgentKind, Budget, NamedAgent};
use chefshat_engine::RewardScheme;
use chefshat_simulation::{Batch, BatchTable};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use rayon::prelude::*;

use chefshat_cli::error::{CommandError, tell};
use chefshat_cli::numbers::grouped;
use chefshat_cli::rules_args::RulesArgs;
use chefshat_cli::{progress, threads};
use chefshat_record::atomic_file::AtomicFile;
use chefshat_record::convert::MAX_RECORDED_ATTEMPTS;

const EXAMPLES: &str = "\
Examples:
  chefshat simulate --games 2000 --seed 7
  chefshat simulate --games 500 --agents greedy,random_unmasked,random --players 3 --reward validity
  chefshat simulate --games 50 --records simulated/
  chefshat simulate --games 20 --agents monte_carlo:64,trained,trained,trained
  chefshat simulate --games 10000 --preset original2020 --no-exchange --no-special-actions --json

The same seed gives the same output, on any number of threads, unless monte_carlo has a budget in milliseconds.";

/// Play many games offline on all cores and print statistics.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Simulate {
    /// Number of games.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..))]
    games: u64,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// The agents by seat, separated by commas; monte_carlo takes a budget for each decision:
    /// monte_carlo:50ms or monte_carlo:400 (rollouts). Default: greedy on the first seat, random on the others.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = str::parse::<NamedAgent>)]
    agents: Vec<NamedAgent>,
    /// Reward turns by this scheme and print each seat's mean reward.
    #[arg(long, value_name = "SCHEME", value_parser = schemes())]
    reward: Option<RewardScheme>,
    /// Take the default action after this many invalid answers to one decision. Default: no limit.
    #[arg(long, value_name = "N")]
    max_invalid_attempts: Option<NonZeroU32>,
    /// Number of threads, at most 256 and one per game; 0 means one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Write the record of every game to this directory, in the form of hosted games. A monte_carlo
    /// then needs a number of rollouts.
    #[arg(long, value_name = "DIR")]
    records: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    rules: RulesArgs,
}

fn schemes() -> impl TypedValueParser<Value = RewardScheme> {
    PossibleValuesParser::new(RewardScheme::ALL.map(RewardScheme::name))
        .map(|name| RewardScheme::from_name(&name).expect("the possible values are the names"))
}

impl Simulate {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        let batch = self.batch()?;
        if let Some(folder) = &self.records {
            check_writable(folder)?;
        }
        let pool = threads::pool(self.threads, batch.games())?;
        let bar = progress::of_items(batch.games(), "games");
        let start = Instant::now();
        let table = pool.install(|| batch.run(&|games| bar.inc(games)));
        bar.finish_and_clear();
        if !bar.is_hidden() {
            say_speed(&table, start.elapsed().as_secs_f64());
        }
        let records = self.records.as_deref();
        let written = records.map(|folder| pool.install(|| write_records(&batch, folder)));
        let mut out = anstream::stdout().lock();
        let printed = match self.json {
            true => writeln!(out, "{}", report::json(&batch, &table)),
            false => write!(out, "{}", report::text(&batch, &table)),
        };
        // A reader who has closed the output does not hide that records are missing.
        written.transpose()?;
        printed?;
        Ok(ExitCode::SUCCESS)
    }

    /// The batch to play.
    fn batch(&self) -> Result<Batch, CommandError> {
        let rules = self.rules.rules()?;
        let players = rules.players();
        let agents = if self.agents.is_empty() {
            let mut agents = vec![NamedAgent::from(AgentKind::Random); players];
            agents[0] = AgentKind::Greedy.into();
            agents
        } else {
            self.agents.clone()
        };
        let mut batch = Batch::new(rules, &agents, self.games, self.seed).map_err(|error| {
            let example = vec!["random"; players].join(",");
            format!("--agents: {error}, for example --agents {example}, or change --players")
        })?;
        if self.records.is_some() {
            check_repeatable(&agents)?;
        }
        if let Some(scheme) = self.reward {
            batch = batch.with_rewards(scheme);
        }
        if let Some(attempts) = self.max_invalid_attempts {
            if self.records.is_some() && attempts.get() > MAX_RECORDED_ATTEMPTS {
                return Err(format!(
                    "--max-invalid-attempts: with --records at most {}",
                    MAX_RECORDED_ATTEMPTS
                )
                .into());
            }
            batch = batch.with_max_invalid_attempts(attempts);
        }
        Ok(batch)
    }
}

/// Checks that games are the same when they are played again, which is how they are recorded.
fn check_repeatable(agents: &[NamedAgent]) -> Result<(), CommandError> {
    let timed = |agent: &&NamedAgent| {
        let search = agent.search();
        search.is_some_and(|plays| matches!(plays.budget, Budget::Time(_)))
    };
    match agents.iter().find(timed) {
        None => Ok(()),
        Some(agent) => Err(format!(
            "--agents: {agent} does not play a game the same way twice, so its games cannot be recorded; \
             give it a number of rollouts, for example monte_carlo:64, or leave out --records"
        )
        .into()),
    }
}

/// Creates the folder of the records before the games, so that none is played for a folder that cannot
/// be written to.
fn check_writable(folder: &Path) -> Result<(), CommandError> {
    std::fs::create_dir_all(folder)
        .map_err(|error| format!("--records: {}: {error}", folder.display()))?;
    // Removed at once.
    AtomicFile::create(&folder.join("games"))?;
    Ok(())
}

/// Writes the records of all games on the current thread pool.
fn write_records(batch: &Batch, folder: &Path) -> Result<(), CommandError> {
    let bar = progress::of_items(batch.games(), "records");
    (0..batch.games())
        .into_par_iter()
        .try_for_each(|index| records::write(batch, index, folder).inspect(|()| bar.inc(1)))?;
    bar.finish_and_clear();
    Ok(())
}

/// Prints the speed to standard error, because it differs from run to run.
fn say_speed(table: &BatchTable, seconds: f64) {
    let answers = table.decisions + table.seats.values().map(|seat| seat.wrong).sum::<u64>();
    tell(format_args!(
        "{} answers of agents in {seconds:.1} s, {:.1} million a second",
        grouped(answers),
        answers as f64 / seconds / 1e6
    ));
}
