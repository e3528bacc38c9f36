//! `chefshat bench`: plays the tasks of the benchmark ChefsHat-v1, checks the folders of records that
//! others submit, and prints tables of results. `chefshat-benchmark` has the tasks and decides what
//! counts.

mod deals_key;
mod folder;
mod hosted;
mod offline;
mod pool;
mod report;
mod run;
mod series;

use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use chefshat_agents::NamedAgent;
use chefshat_benchmark::{BENCHMARK, DealsKey, Task, TaskResult, tasks};
use chefshat_cli::error::{CommandError, say, tell};
use chefshat_cli::numbers::counted;
use chefshat_cli::output::{heading, line, rules_in_short};
use chefshat_cli::program::in_runtime;
use chefshat_record::signature::PublicKey;
use clap::{Args, Subcommand};
use serde_json::json;

use crate::compare::Entrant;
use deals_key::{CreateKey, DealsKeyArg};
use folder::Folder;

const HELP: &str = "\
An agent plays one game on each deal of a task, always against the same built-in agents. The records of its games prove the result: `submit` \
replays each, and computes every decision of the opponents again. docs/benchmark.md says how to cite a result.

Examples:
  chefshat bench tasks
  chefshat bench run shift --agent greedy --out results/greedy
  chefshat bench run shift --out results/mine --name mine -- python agent.py
  chefshat bench run shift --out results/mine --name mine --deals 20 -- ./agent {address} {code}
  chefshat bench run shift --out results/mine --name mine --deals-key deals.key -- ./agent {address} {code}
  chefshat bench series models.toml --out results --deals 20 --budget 5
  chefshat bench submit results/mine
  chefshat bench table results/*";

/// Play the benchmark ChefsHat-v1, check submissions, print tables of results.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct BenchCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// List the tasks.
    Tasks(Tasks),
    /// Play a task, and keep the records of its games in a folder.
    Run(run::Run),
    /// Play a task with several agents, such as language models, within a budget, and compare them.
    Series(series::Series),
    /// Create the key of hidden deals, and print its commitment, which is published before the games.
    DealsKey(CreateKey),
    /// Check a folder of records and print its result.
    Submit(Submit),
    /// Compare results, with the differences on the same deals.
    Table(TableCommand),
    /// Play all tasks with the built-in agents, and these against each other: the tables of
    /// docs/benchmark.md.
    Pool(pool::Pool),
}

impl BenchCommand {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        match self.action {
            Action::Tasks(command) => command.run(),
            Action::Run(command) => in_runtime(command.run()),
            Action::Series(command) => in_runtime(command.run()),
            Action::DealsKey(command) => command.run(),
            Action::Submit(command) => command.run(),
            Action::Table(command) => command.run(),
            Action::Pool(command) => command.run(),
        }
    }
}

#[derive(Debug, Args)]
struct Tasks {
    /// Print one JSON object with everything that the tasks fix but the seeds, which are the SHA-256
    /// of the text "ChefsHat-v1 TASK DEAL", with deals from 0.
    #[arg(long)]
    json: bool,
}

impl Tasks {
    fn run(self) -> Result<ExitCode, CommandError> {
        if self.json {
            let tasks = tasks().iter().map(|task| {
                let mut data = serde_json::to_value(task)?;
                data["policy"] = serde_json::to_value(task.policy())?;
                Ok(data)
            });
            let tasks = tasks.collect::<Result<Vec<_>, serde_json::Error>>()?;
            say(json!({"benchmark": BENCHMARK, "tasks": tasks}))?;
            return Ok(ExitCode::SUCCESS);
        }
        let mut text = String::new();
        for task in tasks() {
            heading(&mut text, &task.name);
            line(&mut text, &format!("{}.", task.about));
            line(&mut text, &rules_in_short(&task.rule_set()));
            let seconds = task.decision_time_ms / 1000;
            let deals = counted(task.deals as u64, "deal");
            line(&mut text, &format!("{deals}, {seconds} s for a decision"));
        }
        write!(anstream::stdout().lock(), "{text}")?;
        Ok(ExitCode::SUCCESS)
    }
}

const TABLE_HELP: &str =
    "Exit code 1: a result is left out of the table, and named, or there is none.";

#[derive(Debug, Args)]
struct Submit {
    /// The folder that `chefshat bench` wrote.
    folder: PathBuf,
    /// Accept only records that this key signed, as `chefshat key show` prints it. Can be repeated.
    #[arg(long = "key", value_name = "KEY")]
    keys: Vec<PublicKey>,
    #[command(flatten)]
    deals_key: DealsKeyArg,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Submit {
    fn run(self) -> Result<ExitCode, CommandError> {
        let folder = Folder::open(&self.folder, self.deals_key.key()?.as_ref())?;
        let mut result = folder.check()?;
        let keys: Vec<String> = self.keys.iter().map(PublicKey::to_string).collect();
        let is_other = |by: &&String| !keys.is_empty() && !keys.contains(by);
        if let Some(by) = result.signed_by.iter().find(is_other) {
            let problem = format!("there are records that are {by}, not signed by a key of --key");
            result.problems.push(problem);
        }
        report::print(&result, self.json)
    }
}

#[derive(Debug, Args)]
#[command(after_help = TABLE_HELP)]
struct TableCommand {
    /// Folders that `chefshat bench` wrote, which are checked, or files with results, which are
    /// believed.
    #[arg(required = true)]
    results: Vec<PathBuf>,
    /// The agent to compare with: a built-in agent or a network file, which plays now, or the name of
    /// one of the results.
    #[arg(long, value_name = "AGENT", default_value = report::VERSUS)]
    versus: String,
    #[command(flatten)]
    deals_key: DealsKeyArg,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl TableCommand {
    fn run(self) -> Result<ExitCode, CommandError> {
        let key = self.deals_key.key()?;
        let mut results: Vec<TaskResult> = Vec::new();
        let mut left_out = None;
        for path in &self.results {
            match folder::read_result(path, key.as_ref()) {
                Ok(result) => results.push(result),
                Err(error) => {
                    tell(format_args!("left out: {error}"));
                    left_out = Some(error);
                }
            }
        }
        let mut versus: Vec<TaskResult> = Vec::new();
        for task in tasks() {
            while let Some(result) = results.iter().find(|it| {
                it.task == task.name && !versus.iter().any(|versus| versus.is_comparable(it))
            }) {
                match self.versus(task, result, key.as_ref(), &results) {
                    Ok(compared) => versus.push(compared),
                    Err(error) => {
                        tell(format_args!("left out: {}: {error}", task.name));
                        left_out = Some(error);
                        let result = result.clone();
                        results.retain(|it| !it.is_comparable(&result));
                    }
                }
            }
        }
        match left_out {
            Some(error) if results.is_empty() => return Err(error),
            _ => report::print_table(&results, &versus, self.json)?,
        }
        Ok(match left_out {
            Some(_) => ExitCode::FAILURE,
            None => ExitCode::SUCCESS,
        })
    }

    /// The result with which those are compared that have the deals of `result`.
    fn versus(
        &self,
        task: &Task,
        result: &TaskResult,
        key: Option<&DealsKey>,
        results: &[TaskResult],
    ) -> Result<TaskResult, CommandError> {
        // Nobody takes the place of a built-in agent by its name.
        let is_built_in = self.versus.parse::<NamedAgent>().is_ok();
        let is_named = |it: &&TaskResult| it.agent.name == self.versus && it.is_comparable(result);
        if let (false, Some(named)) = (is_built_in, results.iter().find(is_named)) {
            return Ok(named.clone());
        }
        let entrant = Entrant::of(&self.versus).map_err(|error| {
            format!("--versus: no result on the same deals has this name, and {error}")
        })?;
        let hidden = &result.deals_commitment;
        let task = task.with_deals(key.filter(|_| hidden.is_some()));
        if task.deals_commitment() != *hidden {
            let (name, versus) = (&result.agent.name, &entrant.label);
            return Err(format!(
                "{name} has hidden deals: {versus} can play them if --deals-key names the file of their key"
            )
            .into());
        }
        offline::reference(&task, &entrant, results)
    }
}
