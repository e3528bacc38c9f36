//! `chefshat bench pool`: the reference results. Built-in agents, and network files that are named,
//! play all tasks, and one seat of each against three of each other on duplicate deals.

use std::io::Write as _;
use std::num::NonZeroU32;
use std::process::ExitCode;

use chefshat_benchmark::{TaskResult, tasks};
use chefshat_cli::error::{CommandError, say};
use chefshat_cli::numbers::{counted, signed};
use chefshat_cli::output::{heading, line, table};
use chefshat_cli::progress;
use chefshat_engine::RuleSetSpec;
use chefshat_simulation::{Duplicate, Figure, RulesForm, SeatPlan};
use clap::Args;
use serde_json::{Value, json};

use super::{offline, report};
use crate::compare::Entrant;

/// Agents that are compared with each other by default.
const POOL: &str = "random,greedy,trained,monte_carlo:64";
/// The one that others are compared with in the tasks.
const VERSUS: &str = "greedy";

#[derive(Debug, Args)]
pub(super) struct Pool {
    /// Built-in agents and network files, separated by commas.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = POOL)]
    agents: Vec<String>,
    /// Deals of each pair of agents, each played from every seat.
    #[arg(long, default_value_t = 2500, value_parser = clap::value_parser!(u64).range(2..))]
    deals: u64,
    /// Deals of each task, at most those that it has.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..))]
    task_deals: Option<u64>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// One seat of an agent against others, on duplicate deals.
struct Pair {
    row: usize,
    column: usize,
    points: Figure,
}

impl Pool {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        let entrants = self.agents.iter().map(|agent| Entrant::of(agent));
        let entrants = entrants.collect::<Result<Vec<_>, _>>()?;
        let (results, versus) = self.tasks(&entrants)?;
        let pairs = self.pairs(&entrants)?;
        if self.json {
            let mut all = report::table_json(&results, &versus);
            all["cross"] = self.cross_json(&entrants, &pairs);
            say(all)?;
            return Ok(ExitCode::SUCCESS);
        }
        let mut text = report::table_text(&results, &versus);
        self.cross_text(&mut text, &entrants, &pairs);
        write!(anstream::stdout().lock(), "{text}")?;
        Ok(ExitCode::SUCCESS)
    }

    /// The results in all tasks, and those of the agent that the others are compared with. A network
    /// that was trained for games of another size has none.
    fn tasks(
        &self,
        entrants: &[Entrant],
    ) -> Result<(Vec<TaskResult>, Vec<TaskResult>), CommandError> {
        let (mut results, mut versus) = (Vec::new(), Vec::new());
        for task in tasks() {
            let most = self.task_deals.map_or(task.deals, |deals| deals as usize);
            let deals = most.min(task.deals);
            let mut compared = None;
            for entrant in entrants {
                if offline::check_fits(task, entrant).is_ok() {
                    let result = offline::result(task, entrant, deals)?;
                    // The file of a network may have its name.
                    if entrant.given == VERSUS {
                        compared = Some(result.clone());
                    }
                    results.push(result);
                }
            }
            versus.push(match compared {
                Some(result) => result,
                None => offline::result(task, &Entrant::of(VERSUS)?, deals)?,
            });
        }
        Ok((results, versus))
    }

    /// The duplicate deals of each agent with each other. A network that was trained for games of
    /// another size has none.
    fn pairs(&self, entrants: &[Entrant]) -> Result<Vec<Pair>, CommandError> {
        let rules = RuleSetSpec::default().validate()?;
        let fitting = entrants.iter().enumerate();
        let fitting = fitting.filter(|(_, it)| offline::fits(it, &rules));
        let fitting: Vec<_> = fitting.collect();
        let count = fitting.len() * fitting.len().saturating_sub(1);
        let bar = progress::of_items(count as u64 * self.deals, "deals");
        let duplicate = Duplicate::new(rules, NonZeroU32::MIN, SeatPlan::One, self.deals, 0)?;
        let mut pairs = Vec::with_capacity(count);
        for &(row, one) in &fitting {
            for &(column, others) in fitting.iter().filter(|(it, _)| *it != row) {
                let contenders = [one.contender.clone(), others.contender.clone()];
                let points = duplicate.run(&contenders, &|deals| bar.inc(deals))?.points;
                pairs.push(Pair {
                    row,
                    column,
                    points,
                });
            }
        }
        bar.finish_and_clear();
        Ok(pairs)
    }

    fn cross_text(&self, text: &mut String, entrants: &[Entrant], pairs: &[Pair]) {
        heading(text, "One seat against three of another agent");
        let deals = counted(self.deals, "deal");
        line(
            text,
            &format!("points a Shift more than one of the three has; {deals}, from all seats"),
        );
        let labels = entrants.iter().map(|it| it.label.as_str());
        let header: Vec<&str> = [""].into_iter().chain(labels).collect();
        let rows = entrants.iter().enumerate().map(|(row, entrant)| {
            let mut cells = vec![entrant.label.clone()];
            for column in 0..entrants.len() {
                let pair = pairs.iter().find(|it| (it.row, it.column) == (row, column));
                cells.push(pair.map_or_else(String::new, |pair| {
                    let difference = pair.points.difference();
                    let half = pair.points.interval95().high - difference;
                    format!("{} ± {half:.3}", signed(difference))
                }));
            }
            cells
        });
        table(text, &header, &[0], rows);
    }

    fn cross_json(&self, entrants: &[Entrant], pairs: &[Pair]) -> Value {
        let rows = pairs.iter().map(|pair| {
            let interval = pair.points.interval95();
            json!({
                "one": entrants[pair.row].label,
                "others": entrants[pair.column].label,
                "points_per_shift": pair.points.a(),
                "difference": pair.points.difference(),
                "difference_95": [interval.low, interval.high],
            })
        });
        json!({
            "deals": self.deals,
            "rules": RuleSetSpec::default().validate().ok().map(|rules| RulesForm::from(&rules)),
            "pairs": rows.collect::<Vec<_>>(),
        })
    }
}
