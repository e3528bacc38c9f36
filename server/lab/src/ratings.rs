//! `chefshat ratings`: recomputes the leaderboard from record files. `chefshat-record` decides
//! which games count, `chefshat-tournament` updates the ratings.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write as _;
use std::path::Path;
use std::process::ExitCode;

use chefshat_proto::v1;
use chefshat_record::files::RecordFile;
use chefshat_record::jsonl;
use chefshat_record::outcome::{Identity, Unrated};
use chefshat_record::rated::rated;
use chefshat_record::replay::walk_file;
use chefshat_record::summary::summary;
use chefshat_tournament::ratings::{Finish, Ratings};
use clap::Args;
use rayon::prelude::*;
use serde_json::{Value, json};

use chefshat_cli::data_dir::RecordsArg;
use chefshat_cli::error::{CommandError, after_printing, tell};
use chefshat_cli::kind::{KindArg, kind_filter};
use chefshat_cli::numbers::counted;
use chefshat_cli::output::{heading, line};
use chefshat_cli::{board, progress};
use chefshat_server::convert::leaderboard;
use chefshat_server::tournaments::finish;

const HELP: &str = "\
A game is rated if it was public, was dealt from a server's own seed, and each seat had a different participant. A participant who left it, broke it off or was \
given a hint has lost it. Every record is replayed first. Games count once, in the order in which they ended. A rating is a mean with its deviation: \
the skill lies within 1.96 deviations with a confidence of 95 %. Participants are sorted by the mean minus two deviations. \
docs/ratings.md says how reliable these numbers are.

Examples:
  chefshat ratings
  chefshat ratings ./chefshat-data/records --min-games 20
  chefshat ratings records/ --kind human --csv > people.csv";

/// Recompute the leaderboard from records.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct RatingsCommand {
    #[command(flatten)]
    records: RecordsArg,
    /// Only participants of this kind, rated by all their games.
    #[arg(long, value_enum)]
    kind: Option<KindArg>,
    /// Only participants with at least this many rated games.
    #[arg(long, value_name = "N", default_value_t = 0)]
    min_games: u32,
    /// Damaged records, which are left out, are no failure.
    #[arg(long)]
    skip_damaged: bool,
    /// Print one JSON object.
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print CSV, one line per participant.
    #[arg(long)]
    csv: bool,
}

/// The result of reading the records.
#[derive(Default)]
struct Gathered {
    records: u64,
    damaged: u64,
    /// Games that are not rated, by reason (code and words).
    not_rated: BTreeMap<(&'static str, String), u64>,
    ratings: Ratings<Identity>,
}

impl RatingsCommand {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        let found = self.records.find()?;
        let mut gathered = self.gather(&found.files)?;
        for missing in found.missing {
            tell(format_args!("chefshat: left out {missing}"));
            gathered.damaged += 1;
        }
        let kind = kind_filter(self.kind);
        let board = leaderboard(&gathered.ratings, kind, self.min_games, usize::MAX);
        let mut out = anstream::stdout().lock();
        let printed = if self.json {
            writeln!(out, "{}", as_json(&gathered, &board))
        } else if self.csv {
            out.write_all(&board::as_csv(&board)?)
        } else {
            write!(out, "{}", as_text(&gathered, &board))
        };
        let mut code = ExitCode::SUCCESS;
        if gathered.damaged > 0 && !self.skip_damaged {
            let damaged = counted(gathered.damaged, "damaged record");
            tell(format_args!(
                "{damaged} left out; with --skip-damaged this is no failure"
            ));
            code = ExitCode::FAILURE;
        }
        after_printing(printed, code)
    }

    /// Reads all records on all cores, then rates the games in order.
    fn gather(&self, files: &[RecordFile]) -> Result<Gathered, CommandError> {
        let bytes = files.iter().map(|file| file.bytes).sum();
        let bar = progress::of_record_bytes(bytes);
        let read: Vec<(&Path, Result<ReadRecord, String>)> = files
            .par_iter()
            .map(|file| {
                let read = read(&file.path);
                bar.inc(file.bytes);
                (file.path.as_path(), read)
            })
            .collect();
        bar.finish_and_clear();
        let mut gathered = Gathered::default();
        let (mut games, mut known) = (Vec::new(), BTreeSet::new());
        for (path, record) in read {
            let record = match record {
                Ok(record) => record,
                Err(problem) => {
                    tell(format_args!(
                        "chefshat: left out {}: {problem}",
                        path.display()
                    ));
                    gathered.damaged += 1;
                    continue;
                }
            };
            if !known.insert(record.game_id.clone()) {
                continue;
            }
            gathered.records += 1;
            match record.results {
                Ok(results) => games.push((record.ended_at_ms, record.game_id, results)),
                Err(reason) => {
                    let reason = (reason.name(), reason.to_string());
                    *gathered.not_rated.entry(reason).or_default() += 1;
                }
            }
        }
        games.sort_by(|left, right| (left.0, &left.1).cmp(&(right.0, &right.1)));
        for (_, _, results) in games {
            // The record would not have replayed with another number of seats.
            gathered.ratings.fold_finishes(&results)?;
        }
        Ok(gathered)
    }
}

/// What a record contributes to ratings.
struct ReadRecord {
    game_id: String,
    ended_at_ms: u64,
    /// The results, or why the game is not rated.
    results: Result<Vec<(Identity, Finish)>, Unrated>,
}

/// Reads and verifies a record.
fn read(path: &Path) -> Result<ReadRecord, String> {
    let record = jsonl::read_record(path).map_err(|error| match error {
        jsonl::RecordFileError::Io { source, .. } => source.to_string(),
        jsonl::RecordFileError::Line { line, problem, .. } => format!("line {line} {problem}"),
    })?;
    let replayed = walk_file(&record, |_| {}).map_err(|error| error.to_string())?;
    let lines = record.lines;
    let game_id = match lines.first().and_then(|line| line.line.as_ref()) {
        Some(v1::record_line::Line::Header(header)) => header.game_id.clone(),
        _ => String::new(),
    };
    let summary = summary(&lines, &replayed);
    Ok(ReadRecord {
        game_id,
        ended_at_ms: summary.as_ref().map_or(0, |summary| summary.ended_at_ms),
        results: summary
            .ok_or(Unrated::NotFinished)
            .and_then(|summary| rated(&summary))
            .map(|seats| seats.into_iter().map(finish).collect()),
    })
}

fn as_text(gathered: &Gathered, board: &v1::GetLeaderboardResponse) -> String {
    let mut text = String::new();
    heading(
        &mut text,
        &format!(
            "{} of {}",
            counted(board.games, "rated game"),
            counted(gathered.records, "record")
        ),
    );
    for ((_, reason), games) in &gathered.not_rated {
        line(
            &mut text,
            &format!("{} not rated: {reason}", counted(*games, "game")),
        );
    }
    if gathered.damaged > 0 {
        line(
            &mut text,
            &format!("{} damaged, skipped", counted(gathered.damaged, "record")),
        );
    }
    if !board.rated.is_empty() {
        text.push('\n');
    }
    board::add_table(&mut text, board);
    text
}

fn as_json(gathered: &Gathered, board: &v1::GetLeaderboardResponse) -> Value {
    let not_rated: BTreeMap<&str, u64> = (gathered.not_rated.iter())
        .map(|((reason, _), games)| (*reason, *games))
        .collect();
    json!({
        "records": gathered.records,
        "damaged": gathered.damaged,
        "rated_games": board.games,
        "not_rated": not_rated,
        "leaderboard": board::as_json(board),
    })
}
