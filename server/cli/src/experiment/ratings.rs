//! `chefshat experiment ratings`: do ratings claim what is true? Fields of made-up participants with known skills are rated, and the table says how
//! often the skill lies where the rating says. How that is measured is decided in `chefshat-arena`.

use std::io::Write as _;
use std::process::ExitCode;

use chefshat_simulation::calibration::{Calibration, Fields, calibration};
use chefshat_tournament::ratings::after_game;
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

use super::super::numbers::grouped;
use super::super::sheet::{heading, line, percent, table};
use super::super::{CommandError, threads};

const HELP: &str = "\
In every round everybody plays one game, at tables drawn anew. Skills are normally distributed with the spread of the row; who is better by \
5.9 wins 73 % of the games of two. Covered: how often a skill lies within 1.96 deviations of the rating's mean, relative to the field, and \
the difference of two within 1.96 of theirs. Honest ratings come to 95 %, or a little more.

Examples:
  chefshat experiment ratings
  chefshat experiment ratings --players 6 --participants 600 --json

The same seed gives the same output, on any number of threads.";

/// Sizes of the fields.
const SIZES: [usize; 3] = [8, 16, 40];
/// Spreads of their skills: from one at which the best of sixteen wins 64 % of games of two against the middle to one of 93 %.
const SPREADS: [f64; 3] = [2.0, 4.0, 8.0];
/// Games of each after which is looked.
const ROUNDS: [u32; 4] = [10, 50, 200, 1000];

/// Do ratings claim what is true? Rate fields of known skills and count how often the stated uncertainty covers them.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(in super::super) struct Calibrate {
    /// Participants of each kind of field, in all.
    #[arg(long, default_value_t = 4800, value_parser = clap::value_parser!(u64).range(40..=1_000_000))]
    participants: u64,
    /// Players of a game.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u64).range(2..=6))]
    players: u64,
    /// The number that all chance is drawn from.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Threads to work on, at most 256; 0 is one for each core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Fields of a kind after some games.
struct Row {
    fields: Fields,
    games: u32,
    found: Calibration,
}

impl Calibrate {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        let kinds = SIZES.iter().flat_map(|&participants| {
            SPREADS.map(|spread| Fields {
                fields: self.participants / participants as u64,
                participants,
                spread,
                players: self.players as usize,
                seed: self.seed,
            })
        });
        let bar = ProgressBar::new((SIZES.len() * SPREADS.len()) as u64).with_style(
            ProgressStyle::with_template("{bar:40} {pos} of {len} kinds of fields, {eta} left")?,
        );
        let pool = threads::pool(self.threads, self.participants)?;
        let mut rows = Vec::new();
        for fields in kinds {
            let found = pool.install(|| calibration(&fields, &ROUNDS, after_game));
            rows.extend(found.into_iter().zip(ROUNDS).map(|(found, games)| Row {
                fields,
                games,
                found,
            }));
            bar.inc(1);
        }
        bar.finish_and_clear();
        let mut out = anstream::stdout().lock();
        if self.json {
            let rows: Vec<Value> = rows.iter().map(Row::json).collect();
            let report = json!({
                "experiment": "ratings",
                "players": self.players,
                "seed": self.seed,
                "rows": rows,
            });
            writeln!(out, "{report}")?;
        } else {
            write!(out, "{}", self.text(&rows))?;
        }
        Ok(ExitCode::SUCCESS)
    }

    fn text(&self, rows: &[Row]) -> String {
        let mut text = String::new();
        let title = format!(
            "Ratings of known skills, games of {}: {} participants a row, seed {}",
            self.players,
            grouped(self.participants),
            self.seed
        );
        heading(&mut text, &title);
        let header = [
            "Field",
            "Spread",
            "Games\nof each",
            "Covered",
            "Pairs\ncovered",
            "Pairs in\norder",
            "Mean\nerror",
            "Deviation",
        ];
        let cells = |row: &Row| {
            vec![
                row.fields.participants.to_string(),
                row.fields.spread.to_string(),
                row.games.to_string(),
                percent(row.found.covered.mean()),
                percent(row.found.pairs_covered.mean()),
                percent(row.found.in_order.mean()),
                format!("{:.2}", row.found.error.mean()),
                format!("{:.2}", row.found.deviation.mean()),
            ]
        };
        table(&mut text, &header, &[], rows.iter().map(cells));
        let mean = rows.iter().map(|row| row.found.covered.mean()).sum::<f64>() / rows.len() as f64;
        text.push('\n');
        line(
            &mut text,
            &format!("Over all rows {} are covered.", percent(mean)),
        );
        text
    }
}

impl Row {
    fn json(&self) -> Value {
        json!({
            "fields": self.fields.fields,
            "participants": self.fields.participants,
            "spread": self.fields.spread,
            "games": self.games,
            "covered": self.found.covered.mean(),
            "pairs_covered": self.found.pairs_covered.mean(),
            "in_order": self.found.in_order.mean(),
            "error": self.found.error.mean(),
            "deviation": self.found.deviation.mean(),
        })
    }
}
