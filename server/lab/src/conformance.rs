//! `chefshat conformance FILE…`: checks the engine against test vectors. `chefshat-simulation`
//! replays them.

use std::fs::File;
use std::io::{BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chefshat_simulation::conformance::{Agreed, Failure, Report, check};
use clap::Args;
use indicatif::ProgressBar;
use serde_json::{Value, json};

use chefshat_cli::error::{CommandError, is_broken_pipe, tell};
use chefshat_cli::{numbers, progress};

const HELP: &str = "\
A vector file has one JSON object per line, either a deal (rules, seed, shift, hands, leader) or a complete game (rules, seed, steps, \
shifts, scores, winner).

Every file is checked. Exit code 0: all vectors agree. 1: a vector does not agree (the first of each file is reported), or a file is not \
a vector file.

Example:
  chefshat conformance tests/fixtures/vectors/*.jsonl";

/// Check the rule engine against deals and games of another engine.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Conformance {
    /// Files of test vectors.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Print one line of JSON for each file.
    #[arg(long)]
    json: bool,
}

impl Conformance {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        let mut code = ExitCode::SUCCESS;
        for file in &self.files {
            match self.check_file(file) {
                Ok(true) => {}
                Ok(false) => code = ExitCode::FAILURE,
                Err(error) if is_broken_pipe(&error) => return Err(error),
                Err(error) => {
                    tell(format_args!("chefshat: {error}"));
                    code = ExitCode::FAILURE;
                }
            }
        }
        Ok(code)
    }

    /// Whether all vectors of a file agree.
    ///
    /// # Errors
    /// It is not a file of vectors.
    fn check_file(&self, path: &Path) -> Result<bool, CommandError> {
        let name = path.display();
        let file = File::open(path).map_err(|error| format!("{name}: {error}"))?;
        let bytes = file
            .metadata()
            .map_err(|error| format!("{name}: {error}"))?;
        if bytes.is_dir() {
            return Err(format!("{name} is a folder: name the files of vectors in it").into());
        }
        let bar = progress::styled(
            ProgressBar::new(bytes.len()),
            "{bar:40} {bytes} of {total_bytes}",
        );
        let report = check(BufReader::new(file), |bytes| bar.inc(bytes));
        bar.finish_and_clear();
        let mut out = anstream::stdout().lock();
        if self.json {
            writeln!(out, "{}", json_report(path, &report))?;
        } else {
            write_report(&mut out, path, &report)?;
        }
        match report.failure {
            None => Ok(true),
            Some(Failure::Disagrees { .. }) => Ok(false),
            Some(problem) => Err(format!("{name}: {problem}").into()),
        }
    }
}

/// Writes the report for people. A file without vectors is reported as an error instead.
fn write_report(out: &mut impl Write, file: &Path, report: &Report) -> std::io::Result<()> {
    let name = file.display();
    match &report.failure {
        None => writeln!(out, "{name}: all agree: {}", counted(&report.agreed)),
        Some(Failure::Disagrees { line, disagreement }) => {
            let step = disagreement.step.map_or_else(String::new, |step| {
                format!(", step {step} (the first is 0)")
            });
            writeln!(out, "{name}: line {line}{step} does not agree")?;
            writeln!(out, "  where     {}", disagreement.place)?;
            writeln!(out, "  expected  {}", disagreement.expected)?;
            writeln!(out, "  got       {}", disagreement.got)?;
            writeln!(out, "before it: {}", counted(&report.agreed))
        }
        Some(_) => Ok(()),
    }
}

/// The number of vectors that agreed, in words.
fn counted(agreed: &Agreed) -> String {
    let Agreed {
        deals,
        games,
        steps,
    } = agreed;
    let of_deals = numbers::counted(*deals, "deal");
    let steps = numbers::counted(*steps, "decision");
    let of_games = format!("{} ({steps})", numbers::counted(*games, "game"));
    match (deals, games) {
        (0, 0) => "none".to_owned(),
        (_, 0) => of_deals,
        (0, _) => of_games,
        _ => format!("{of_deals}, {of_games}"),
    }
}

fn json_report(file: &Path, report: &Report) -> Value {
    let (mut disagreement, mut problem) = (Value::Null, Value::Null);
    match &report.failure {
        None => {}
        Some(Failure::Disagrees {
            line,
            disagreement: found,
        }) => {
            disagreement = json!({
                "line": line,
                "step": found.step,
                "place": found.place,
                "expected": found.expected,
                "got": found.got,
            });
        }
        Some(other) => problem = other.to_string().into(),
    }
    json!({
        "file": file.display().to_string(),
        "agree": report.failure.is_none(),
        "deals": report.agreed.deals,
        "games": report.agreed.games,
        "decisions": report.agreed.steps,
        "disagreement": disagreement,
        "problem": problem,
    })
}
