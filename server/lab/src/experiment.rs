//! `chefshat experiment`: the paper's Experiment 1, its table next to ours. `chefshat-simulation`
//! plays the Shifts; the experiments with learning agents are in the Python package.

use std::io::Write as _;
use std::process::ExitCode;

use chefshat_engine::{RuleSet, RuleSetSpec};
use chefshat_simulation::RulesForm;
use chefshat_simulation::mechanics::{Condition, MechanicsTable, SHIFTS_PER_GAME};
use chefshat_tournament::statistics::Interval;
use clap::builder::PossibleValuesParser;
use clap::{Args, Subcommand};
use serde_json::{Value, json};

use chefshat_cli::error::CommandError;
use chefshat_cli::numbers::{counted, grouped};
use chefshat_cli::output::{heading, line, table};
use chefshat_cli::{progress, threads};

const HELP: &str = "\
What the paper calls a game is a Shift here; its rounds are laps. As in the paper, each Shift takes its roles from the result of the \
previous one, with 250 Shifts to a game. Conditions with the same deck play the same deals.

Examples:
  chefshat experiment mechanics
  chefshat experiment mechanics --large --seed 7
  chefshat experiment mechanics --shifts 5000 --preset paper --json

The same seed gives the same output, on any number of threads.";

/// Most Shifts of a condition: more would take weeks.
const MOST_SHIFTS: u64 = 1_000_000_000;
/// Shifts of each condition that `--large` adds.
const LARGE: u64 = 100_000;

/// Run an experiment of the paper.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat experiment mechanics --large\n\nThe paper's experiments with learning agents: \
                  python -m chefshat_paper.experiments --help"
)]
pub(super) struct ExperimentCommand {
    #[command(subcommand)]
    experiment: Experiment,
}

#[derive(Debug, Subcommand)]
enum Experiment {
    /// Experiment 1: measure the effect of jokers, exchange and special actions.
    Mechanics(Mechanics),
}

impl ExperimentCommand {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        match self.experiment {
            Experiment::Mechanics(command) => command.run(),
        }
    }
}

/// Experiment 1 of the paper: four random agents play with all mechanics, without jokers, without
/// the exchange, and without special actions. Prints how often the starter wins the Shift and how
/// many laps a Shift has.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
struct Mechanics {
    /// Shifts of each condition; the paper plays 250.
    #[arg(long, default_value_t = u64::from(SHIFTS_PER_GAME), value_parser = clap::value_parser!(u64).range(1..=MOST_SHIFTS))]
    shifts: u64,
    /// Also play 100,000 Shifts of each condition, for narrow intervals.
    #[arg(long)]
    large: bool,
    /// Presets of rules to test, separated by commas.
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "paper,original2020",
        value_parser = PossibleValuesParser::new(RuleSetSpec::PRESETS)
    )]
    preset: Vec<String>,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Number of threads, at most 256; 0 means one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// A condition under a preset.
struct Row {
    preset: String,
    condition: Condition,
    rules: RuleSet,
    /// Results, one for each number of Shifts.
    tables: Vec<MechanicsTable>,
}

impl Mechanics {
    fn run(self) -> Result<ExitCode, CommandError> {
        let numbers: Vec<u64> = std::iter::once(self.shifts)
            .chain(self.large.then_some(LARGE))
            .collect();
        let mut rows = self.rows();
        let shifts = numbers.iter().sum::<u64>() * rows.len() as u64;
        let bar = progress::of_items(shifts, "Shifts");
        let pool = threads::pool(self.threads, u64::MAX)?;
        pool.install(|| {
            for row in &mut rows {
                let play =
                    |&shifts| MechanicsTable::play(row.rules, shifts, self.seed, &|n| bar.inc(n));
                row.tables = numbers.iter().map(play).collect();
            }
        });
        bar.finish_and_clear();
        let mut out = anstream::stdout().lock();
        if self.json {
            writeln!(out, "{}", self.as_json(&rows))?;
        } else {
            write!(out, "{}", self.as_text(&rows, &numbers))?;
        }
        Ok(ExitCode::SUCCESS)
    }

    fn rows(&self) -> Vec<Row> {
        let conditions = |preset: &String| {
            Condition::ALL.map(|condition| Row {
                preset: preset.clone(),
                condition,
                rules: condition
                    .rules(preset)
                    .expect("the possible values are the presets"),
                tables: Vec::new(),
            })
        };
        self.preset.iter().flat_map(conditions).collect()
    }

    fn as_json(&self, rows: &[Row]) -> Value {
        let results = rows.iter().flat_map(|row| {
            let paper = row.condition.paper();
            row.tables.iter().map(move |table| {
                json!({
                    "preset": row.preset,
                    "condition": row.condition.name(),
                    "rules": RulesForm::from(&row.rules),
                    "shifts": table.shifts(),
                    "starter_won": table.starter_won,
                    "starter_wins": table.starter_wins(),
                    "starter_wins_95": ends(table.starter_wins_interval()),
                    "laps_per_shift": table.laps.mean(),
                    "laps_per_shift_95": ends(table.laps.interval95()),
                    "laps_standard_deviation": table.laps.variance().sqrt(),
                    "pizzas_per_shift": table.pizzas.mean(),
                    "turns_per_shift": table.turns.mean(),
                    "special_actions": table.special_actions,
                    "paper": {
                        "shifts": SHIFTS_PER_GAME,
                        "starter_wins": paper.starter_wins,
                        "starter_wins_95": ends(paper.starter_wins_interval()),
                        "laps_per_shift": paper.laps,
                    },
                })
            })
        });
        json!({
            "experiment": "mechanics",
            "agents": "random",
            "seed": self.seed,
            "shifts_per_game": SHIFTS_PER_GAME,
            "results": results.collect::<Vec<Value>>(),
        })
    }

    /// The result as lines of at most 100 columns.
    fn as_text(&self, rows: &[Row], numbers: &[u64]) -> String {
        let mut text = String::new();
        heading(
            &mut text,
            &format!(
                "The paper's Experiment 1: four random agents, seed {}",
                self.seed
            ),
        );
        line(
            &mut text,
            &format!(
                "{} of each condition, {SHIFTS_PER_GAME} to a game; the paper's figures are of {SHIFTS_PER_GAME}.",
                counted_all(numbers)
            ),
        );
        text.push('\n');
        heading(
            &mut text,
            "The starter wins the Shift, % (95 % interval: Wilson's)",
        );
        let paper = |condition: Condition| {
            let interval = condition.paper().starter_wins_interval();
            with_interval(
                100.0 * condition.paper().starter_wins,
                percents(interval),
                0,
            )
        };
        let ours = |table: &MechanicsTable| {
            let interval = percents(table.starter_wins_interval());
            with_interval(100.0 * table.starter_wins(), interval, 1)
        };
        figures(&mut text, rows, numbers, paper, ours);
        text.push('\n');
        heading(
            &mut text,
            "Laps a Shift (95 % interval: mean ± 1.96 standard errors; the paper gives no spread)",
        );
        let paper = |condition: Condition| format!("{}", condition.paper().laps);
        let ours =
            |table: &MechanicsTable| with_interval(table.laps.mean(), table.laps.interval95(), 2);
        figures(&mut text, rows, numbers, paper, ours);
        text
    }
}

/// Adds the table of one figure for all conditions.
fn figures(
    text: &mut String,
    rows: &[Row],
    numbers: &[u64],
    paper: impl Fn(Condition) -> String,
    ours: impl Fn(&MechanicsTable) -> String,
) {
    let ours_header: Vec<String> = numbers
        .iter()
        .map(|&number| counted(number, "Shift"))
        .collect();
    let mut header = vec!["Preset", "Condition", "Paper"];
    header.extend(ours_header.iter().map(String::as_str));
    let rows = rows.iter().map(|row| {
        let mut cells = vec![
            row.preset.clone(),
            row.condition.name().replace('_', " "),
            paper(row.condition),
        ];
        cells.extend(row.tables.iter().map(&ours));
        cells
    });
    table(text, &header, &[0, 1], rows);
}

/// `28.0 (22.8–33.9)`; the interval always has at least one decimal.
fn with_interval(figure: f64, Interval { low, high }: Interval, decimals: usize) -> String {
    let finer = decimals.max(1);
    format!("{figure:.decimals$} ({low:.finer$}–{high:.finer$})")
}

fn percents(interval: Interval) -> Interval {
    Interval {
        low: 100.0 * interval.low,
        high: 100.0 * interval.high,
    }
}

fn ends(interval: Interval) -> [f64; 2] {
    [interval.low, interval.high]
}

/// `250 Shifts`, `250 and 100,000 Shifts`.
fn counted_all(numbers: &[u64]) -> String {
    let (last, before) = numbers.split_last().expect("there is a number of Shifts");
    let mut words: String = before
        .iter()
        .map(|&number| format!("{} and ", grouped(number)))
        .collect();
    words.push_str(&counted(*last, "Shift"));
    words
}
