//! `chefshat verify`: verifies records by replaying them and reports the first wrong line.
//! `chefshat-record` checks a record; this module finds the files, checks them on all cores and
//! prints the results.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chefshat_proto::v1::{self, record_line::Line};
use chefshat_record::jsonl;
use chefshat_record::jsonl::RecordFileError;
use chefshat_record::replay::{Replayed, walk_file};
use chefshat_record::signature::PublicKey;
use clap::Args;
use rayon::prelude::*;
use serde_json::{Value, json};

use super::data_dir::RecordsArg;
use super::error::{after_printing, plain};
use super::numbers::counted;
use super::{CommandError, progress};

const HELP: &str = "\
All contents are checked: the seed against the commitment, every deal, the seat and the legal actions of each decision, every event, \
reward, score and count, and the signature, if there is one. docs/records.md describes the format, and what a record cannot prove.

Exit code 0: all records fit. 1: one does not, or there is none. 3: all fit, but the signature of one cannot be checked: versions before \
0.3.0 signed annotations with several keys in an order that is lost. Such a signature proves as little as none.

Examples:
  chefshat verify
  chefshat verify ./chefshat-data/records game.jsonl
  chefshat verify game.jsonl --key ed25519:4b1f...
  chefshat verify --data-dir ./chefshat-data --json";

/// Records checked per batch: enough for all cores, with results printed as they come.
const AT_A_TIME: usize = 64;
/// The exit code if all records fit, but a signature cannot be checked.
const UNCHECKABLE: u8 = 3;

/// Verify records by replaying them; report the first wrong line.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Verify {
    #[command(flatten)]
    records: RecordsArg,
    /// Accept only records that this key signed, as `chefshat key show` prints it. Can be repeated.
    #[arg(long = "key", value_name = "KEY")]
    keys: Vec<PublicKey>,
    /// Print one JSON object per record.
    #[arg(long)]
    json: bool,
}

/// A correct record.
struct Fits {
    header: Box<v1::RecordHeader>,
    replayed: Replayed,
}

/// Why a record is wrong.
struct Problem {
    /// The first wrong line, from 1; none if the file is unreadable.
    line: Option<usize>,
    problem: String,
    /// Whether it is only that its signature cannot be checked.
    uncheckable: bool,
}

impl Verify {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        let found = self.records.find()?;
        let files: Vec<PathBuf> = found.files.into_iter().map(|file| file.path).collect();
        let records = files.len() + found.missing.len();
        let bar = progress::of_items(files.len().try_into().unwrap_or(u64::MAX), "records");
        let (mut fitting, mut decisions, mut uncheckable) = (0usize, 0u64, 0u64);
        // All are checked, also if nobody reads what is printed of them.
        let mut printed = Ok(());
        for files in files.chunks(AT_A_TIME) {
            let checked: Vec<_> = files
                .par_iter()
                .map(|file| {
                    let checked = check(file, &self.keys);
                    bar.inc(1);
                    (file, checked)
                })
                .collect();
            for (_, fits) in checked
                .iter()
                .filter_map(|(file, checked)| Some((file, checked.as_ref().ok()?)))
            {
                fitting += 1;
                decisions += fits.replayed.decisions;
                uncheckable += u64::from(fits.replayed.uncheckable.is_some());
            }
            printed = printed.and_then(|()| bar.suspend(|| print(&checked, self.json)));
        }
        bar.finish_and_clear();
        for missing in found.missing {
            let problem = Problem {
                line: None,
                problem: missing.problem.to_string(),
                uncheckable: false,
            };
            let missing = [(&missing.path, Err(problem))];
            printed = printed.and_then(|()| print(&missing, self.json));
        }
        if !self.json {
            let mut words = match records - fitting {
                0 => format!(
                    "{} {}, {}\n",
                    counted(records as u64, "record"),
                    if fitting == 1 { "fits" } else { "fit" },
                    counted(decisions, "decision")
                ),
                wrong => format!("{wrong} of {records} records do not fit\n"),
            };
            if uncheckable > 0 {
                let signatures = counted(uncheckable, "signature");
                words.push_str(&format!("{signatures} cannot be checked\n"));
            }
            printed = printed.and_then(|()| write!(io::stdout(), "{words}"));
        }
        let code = match (fitting == records, uncheckable) {
            (false, _) => ExitCode::FAILURE,
            (true, 0) => ExitCode::SUCCESS,
            (true, _) => ExitCode::from(UNCHECKABLE),
        };
        after_printing(printed, code)
    }
}

/// Reads and replays a record.
fn check(file: &Path, keys: &[PublicKey]) -> Result<Fits, Problem> {
    let record = jsonl::read_record(file).map_err(|error| match error {
        RecordFileError::Io { source, .. } => Problem {
            line: None,
            problem: source.to_string(),
            uncheckable: false,
        },
        RecordFileError::Line { line, problem, .. } => Problem {
            line: Some(line),
            problem: format!("the line {problem}"),
            uncheckable: false,
        },
    })?;
    let replayed = walk_file(&record, |_| {}).map_err(|error| Problem {
        line: Some(error.line),
        problem: error.problem,
        uncheckable: false,
    })?;
    let trusted = replayed.signed_by.is_some_and(|key| keys.contains(&key));
    if !keys.is_empty() && !trusted {
        return Err(Problem {
            line: Some(record.lines.len()),
            problem: match (replayed.signed_by, replayed.uncheckable) {
                (Some(key), _) => format!("signed by {key}, which is not the key asked for"),
                (None, Some(key)) => uncheckable(key),
                (None, None) => "unsigned, but a signature was asked for with --key".into(),
            },
            uncheckable: replayed.uncheckable.is_some(),
        });
    }
    match record.lines.into_iter().next().and_then(|line| line.line) {
        Some(Line::Header(header)) => Ok(Fits { header, replayed }),
        _ => unreachable!("a record that replays begins with its header"),
    }
}

/// Why a signature cannot be checked.
fn uncheckable(key: PublicKey) -> String {
    format!(
        "unproven: it names {key}, but versions before 0.3.0 signed annotations with several keys \
         in an order that is lost; everything else fits"
    )
}

/// How the deals of a record were verified, in words.
pub(super) fn deals(header: &v1::RecordHeader) -> &'static str {
    use v1::GameOrigin::{Branched, Imported, Physical, Scripted};
    let committed = !header.seed_commitment.is_empty();
    match (header.origin(), committed) {
        (Imported | Physical, _) => "cards of a real table, as far as they are known",
        (Scripted, true) => "first hands scripted, then a committed seed",
        (Scripted, false) => "first hands scripted, then a fixed seed",
        (Branched, true) => "branched from a record, then a committed seed",
        (Branched, false) => "branched from a record, then a fixed seed",
        (_, true) => "committed seed",
        (_, false) => "fixed seed",
    }
}

/// How the game ended, in a word.
pub(super) fn ending(replayed: &Replayed) -> &'static str {
    match replayed.state {
        v1::RoomState::Finished => "finished",
        _ => "aborted",
    }
}

fn print(checked: &[(&PathBuf, Result<Fits, Problem>)], json: bool) -> io::Result<()> {
    let mut out = io::stdout().lock();
    for (file, checked) in checked {
        let name = file.display();
        match (checked, json) {
            (checked, true) => writeln!(out, "{}", json_report(file, checked))?,
            (Ok(Fits { header, replayed }), false) => writeln!(
                out,
                "{name}: fits: {}, {} decisions, {} events, {}, {}{}",
                ending(replayed),
                replayed.decisions,
                replayed.events,
                deals(header),
                match (replayed.signed_by, replayed.uncheckable) {
                    (Some(key), _) => format!("signed by {key}"),
                    (None, Some(key)) => format!("signature {}", uncheckable(key)),
                    (None, None) => "unsigned".into(),
                },
                match replayed.redacted {
                    true => ", redacted",
                    false => "",
                }
            )?,
            (Err(Problem { line, problem, .. }), false) => {
                let line = line.map_or_else(String::new, |line| format!("line {line}: "));
                writeln!(out, "{name}: {line}{}", plain(problem))?;
            }
        }
    }
    Ok(())
}

fn json_report(file: &Path, checked: &Result<Fits, Problem>) -> Value {
    let file = file.display().to_string();
    match checked {
        Ok(Fits { header, replayed }) => json!({
            "file": file,
            "fits": true,
            "game_id": header.game_id,
            "state": ending(replayed),
            "decisions": replayed.decisions,
            "events": replayed.events,
            "origin": header.origin().as_str_name(),
            "seed_committed": !header.seed_commitment.is_empty(),
            "signed_by": replayed.signed_by.map(|key| key.to_string()),
            "signature": match (replayed.signed_by, replayed.uncheckable) {
                (Some(_), _) => "valid",
                (None, Some(_)) => "uncheckable",
                (None, None) => "none",
            },
            "redacted": replayed.redacted,
            "line": null,
            "problem": null,
        }),
        Err(Problem {
            line,
            problem,
            uncheckable,
        }) => json!({
            "file": file,
            "fits": false,
            "signature": uncheckable.then_some("uncheckable"),
            "line": line,
            "problem": problem,
        }),
    }
}
