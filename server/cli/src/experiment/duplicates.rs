//! `chefshat experiment duplicates`: how much fewer games tell two agents apart when both are dealt the same cards. What is played is decided in
//! `chefshat-arena`, the figure is drawn by the Python package.

use std::io::Write as _;
use std::process::ExitCode;

use chefshat_agents::AgentKind;
use chefshat_engine::{RuleSet, RuleSetSpec, Stop};
use chefshat_simulation::{Contender, Measured, Newcomer, SameSeat};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

use super::super::numbers::counted;
use super::super::sheet::{heading, line, table};
use super::super::{CommandError, threads};

const HELP: &str = "\
Each of the two sits in the same seats among three greedy agents, as participants of a tournament do who never meet. A game is worth 5, 3, 1, 0 \
points by place. The standard error of the difference is measured twice: with both on the same deals, and with deals of their own. \
`trained, slips` is `trained` that takes any legal action at one decision of twenty: another agent, but a similar one.

Examples:
  chefshat experiment duplicates
  chefshat experiment duplicates --games 6400 --json > duplicates.json

The same seed gives the same output, on any number of threads.";

/// Fewest games after which is looked; then twice as many each time.
const FIRST_LOOK: u64 = 50;

/// How much fewer games tell two agents apart when both are dealt the same cards?
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(in super::super) struct Duplicates {
    /// Games of each agent.
    #[arg(long, default_value_t = 3200, value_parser = clap::value_parser!(u64).range(FIRST_LOOK..=1_000_000))]
    games: u64,
    /// The number that all chance is drawn from.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Threads to play on, at most 256; 0 is one for each core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Two agents and how long their games are.
struct Case {
    names: [&'static str; 2],
    length: &'static str,
    same_seat: SameSeat,
}

/// A case and what was known after each look.
type Told = (Case, Vec<Measured>);

impl Duplicates {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        let looks = self.looks();
        let cases = self.cases();
        // Each deal is played by both, and another one by the second.
        let bar = ProgressBar::new(3 * self.games * cases.len() as u64).with_style(
            ProgressStyle::with_template("{bar:40} {human_pos} of {human_len} games, {eta} left")?,
        );
        let pool = threads::pool(self.threads, self.games)?;
        let told: Vec<Told> = cases
            .into_iter()
            .map(|case| {
                let measured = pool.install(|| case.same_seat.measure(&looks, |n| bar.inc(n)));
                (case, measured)
            })
            .collect();
        bar.finish_and_clear();
        let mut out = anstream::stdout().lock();
        if self.json {
            writeln!(out, "{}", self.report(&told))?;
        } else {
            write!(out, "{}", self.text(&told))?;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Numbers of games after which is looked.
    fn looks(&self) -> Vec<u64> {
        let doubled = std::iter::successors(Some(FIRST_LOOK), |games| games.checked_mul(2));
        let mut looks: Vec<u64> = doubled.take_while(|games| *games < self.games).collect();
        looks.push(self.games);
        looks
    }

    fn cases(&self) -> Vec<Case> {
        let newcomer = |kind, slips_percent| Newcomer {
            plays: Contender::Kind(kind),
            slips_percent,
        };
        let (trained, greedy) = (AgentKind::Trained, AgentKind::Greedy);
        let pairs = [
            (
                ["trained", "trained, slips"],
                [newcomer(trained, 0), newcomer(trained, 5)],
            ),
            (
                ["trained", "greedy"],
                [newcomer(trained, 0), newcomer(greedy, 0)],
            ),
            (
                ["greedy", "random"],
                [newcomer(greedy, 0), newcomer(AgentKind::Random, 0)],
            ),
        ];
        let lengths = [
            ("1 Shift", Stop::Shifts(1)),
            ("15 points", Stop::Points(15)),
        ];
        let case = |(length, stop): (&'static str, Stop)| {
            pairs.clone().map(|(names, newcomers)| Case {
                names,
                length,
                same_seat: SameSeat {
                    rules: rules(stop),
                    newcomers,
                    others: Contender::Kind(greedy),
                    seed: self.seed,
                },
            })
        };
        lengths.into_iter().flat_map(case).collect()
    }

    fn text(&self, told: &[Told]) -> String {
        let mut text = String::new();
        let title = format!(
            "Two agents among three greedy ones: {} of each, seed {}",
            counted(self.games, "game"),
            self.seed
        );
        heading(&mut text, &title);
        let header = [
            "First",
            "Second",
            "Game",
            "Difference",
            "Error,\nown deals",
            "Error,\nsame deals",
            "Worth, times\nas many games",
        ];
        let rows = told.iter().filter_map(|(case, measured)| {
            let last = measured.last()?;
            let [first, second] = case.names;
            Some(vec![
                first.to_owned(),
                second.to_owned(),
                case.length.to_owned(),
                format!("{:.3}", last.difference),
                format!("{:.4}", last.independent_error),
                format!("{:.4}", last.duplicate_error),
                last.gain()
                    .map_or_else(|| "∞".to_owned(), |gain| format!("{gain:.1}")),
            ])
        });
        table(&mut text, &header, &[0, 1, 2], rows);
        text.push('\n');
        line(
            &mut text,
            "Differences are points of a game by place (5, 3, 1, 0); errors are standard errors.",
        );
        text
    }

    fn report(&self, told: &[Told]) -> Value {
        let rows = told.iter().flat_map(|(case, measured)| {
            measured.iter().map(|measured| {
                json!({
                    "first": case.names[0],
                    "second": case.names[1],
                    "game": case.length,
                    "games": measured.games,
                    "difference": measured.difference,
                    "independent_error": measured.independent_error,
                    "duplicate_error": measured.duplicate_error,
                    "gain": measured.gain(),
                })
            })
        });
        json!({
            "experiment": "duplicates",
            "seed": self.seed,
            "rows": rows.collect::<Vec<Value>>(),
        })
    }
}

fn rules(stop: Stop) -> RuleSet {
    let spec = RuleSetSpec {
        stop,
        ..RuleSetSpec::default()
    };
    spec.validate()
        .expect("the standard game makes sense however it ends")
}
