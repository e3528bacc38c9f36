//! The form in which a person writes down a game of a real table: a CSV file with one row for each thing that was seen, described in
//! docs/records.md. Here rows become values; whether what they tell can have happened is judged in `import`. The cells of a row are
//! taken in `cells`, what is seen in a Shift in `row`, cards in `cards`, the rule set in `rules`.

mod cards;
mod cells;
mod row;
mod rules;

use std::collections::BTreeMap;

use chefshat_engine::{RewardScheme, RuleSet};
use chefshat_proto::v1;

use crate::convert::{reward_scheme_to_proto, rules_from_proto};
use cells::Cells;
use row::row;
pub(super) use row::{Row, Seen};
use rules::rules;

/// Largest transcript, bytes.
pub const MAX_TRANSCRIPT_BYTES: usize = 16 * 1024 * 1024;
/// Columns a transcript may have. Only `what` must be there.
const COLUMNS: [&str; 13] = [
    "shift",
    "seat",
    "what",
    "value",
    "seconds",
    "took",
    "label",
    "valence",
    "arousal",
    "dominance",
    "confidence",
    "source",
    "note",
];
/// The first row of a transcript that cannot be, and why.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct TranscriptError {
    /// Number of the line in the file, from 1.
    pub line: usize,
    /// What is wrong.
    pub problem: String,
}

/// Somebody at the table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Player {
    pub(super) name: String,
    pub(super) kind: v1::ParticipantKind,
}

/// A transcript, read.
#[derive(Debug)]
pub(super) struct Transcript {
    pub(super) table: String,
    pub(super) rules: RuleSet,
    pub(super) began_ms: u64,
    pub(super) scheme: v1::RewardScheme,
    pub(super) players: Vec<Player>,
    /// What was seen, in order.
    pub(super) rows: Vec<Row>,
    /// Number of the last line.
    pub(super) last_line: usize,
}

/// Reads a transcript.
pub(super) fn read(bytes: &[u8]) -> Result<Transcript, TranscriptError> {
    let at = |line: usize, problem: String| TranscriptError { line, problem };
    if bytes.len() > MAX_TRANSCRIPT_BYTES {
        return Err(at(
            1,
            format!("a transcript has at most {MAX_TRANSCRIPT_BYTES} bytes"),
        ));
    }
    // Spreadsheets write a mark before the first column.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(bytes);
    let headers = reader
        .headers()
        .map_err(|error| at(line_of(&error), words(&error)))?
        .clone();
    if headers.len() == 1 && headers.iter().any(|name| name.contains([';', '\t'])) {
        return Err(at(
            1,
            "columns are separated by commas here; save the table as CSV with commas".to_owned(),
        ));
    }
    for name in &headers {
        if !COLUMNS.contains(&name) {
            return Err(at(
                1,
                format!(
                    "there is no column {name:?}; use some of {}",
                    COLUMNS.join(", ")
                ),
            ));
        }
    }
    if !headers.iter().any(|name| name == "what") {
        return Err(at(
            1,
            "the first line names the columns; `what` is missing".into(),
        ));
    }
    let mut settings = Settings::default();
    let (mut rules, mut rows, mut last_line) = (None, Vec::new(), 1);
    for record in reader.records() {
        let record = record.map_err(|error| at(line_of(&error), words(&error)))?;
        let line = record.position().map_or(last_line + 1, |position| {
            usize::try_from(position.line()).unwrap_or(usize::MAX)
        });
        last_line = line;
        let cells = Cells {
            line,
            cells: headers
                .iter()
                .zip(&record)
                .filter(|(_, cell)| !cell.is_empty())
                .collect(),
        };
        if cells.cells.is_empty() {
            continue;
        }
        if rules.is_none() && settings.take(&cells)? {
            continue;
        }
        let rules = match rules {
            Some(rules) => rules,
            None => *rules.insert(settings.rules(line)?),
        };
        rows.push(row(&cells, &rules)?);
    }
    let rules = rules.map_or_else(|| settings.rules(last_line + 1), Ok)?;
    Ok(Transcript {
        table: settings.table,
        rules,
        began_ms: settings.began_ms,
        scheme: settings.scheme,
        players: settings.players.into_values().collect(),
        rows,
        last_line,
    })
}

/// What stands before the first Shift.
#[derive(Default)]
struct Settings {
    table: String,
    rules: Option<RuleSet>,
    began_ms: u64,
    scheme: v1::RewardScheme,
    players: BTreeMap<u32, Player>,
}

impl Settings {
    /// Takes a row; `false` if it is the first of a Shift.
    fn take(&mut self, cells: &Cells<'_>) -> Result<bool, TranscriptError> {
        let value = || cells.need("value");
        match cells.need("what")? {
            "table" => self.table = value()?.to_owned(),
            "rules" => {
                let told = rules(value()?).map_err(|problem| cells.wrong(problem))?;
                let checked = rules_from_proto(&told);
                let checked =
                    checked.map_err(|problem| cells.wrong(format!("rules: {problem}")))?;
                self.rules = Some(checked);
            }
            "rewards" => {
                let scheme = RewardScheme::from_name(value()?);
                let known = RewardScheme::ALL.map(RewardScheme::name);
                let scheme = scheme.ok_or_else(|| {
                    cells.wrong(format!("rewards are one of {}", known.join(", ")))
                })?;
                self.scheme = reward_scheme_to_proto(Some(scheme));
            }
            "began" => self.began_ms = moment(value()?).map_err(|problem| cells.wrong(problem))?,
            kind @ ("agent" | "human" | "robot") => {
                let seat: u32 = cells.number("seat")?;
                let player = Player {
                    name: value()?.to_owned(),
                    kind: match kind {
                        "agent" => v1::ParticipantKind::Agent,
                        "human" => v1::ParticipantKind::Human,
                        _ => v1::ParticipantKind::Robot,
                    },
                };
                if self.players.insert(seat, player).is_some() {
                    return Err(cells.wrong(format!("seat {seat} is taken already")));
                }
            }
            _ => return Ok(false),
        }
        if cells.cells.contains_key("shift") {
            return Err(cells.wrong("this stands before the first Shift: leave `shift` empty"));
        }
        Ok(true)
    }

    /// The rule set, once it is settled that everybody is named.
    fn rules(&self, line: usize) -> Result<RuleSet, TranscriptError> {
        let at = |problem: String| TranscriptError { line, problem };
        let rules = match self.rules {
            Some(rules) => rules,
            None => rules_from_proto(&v1::RuleSet::default())
                .map_err(|problem| at(format!("rules: {problem}")))?,
        };
        let players = rules.players();
        let named = self.players.keys().copied().eq((0..).take(players));
        if !named {
            return Err(at(format!(
                "before the first Shift each of the seats 0..={} needs one row `human`, `robot` or `agent` with its name as value",
                players - 1
            )));
        }
        Ok(rules)
    }
}

/// A date and time, in milliseconds since 1970.
fn moment(text: &str) -> Result<u64, String> {
    let time: chefshat_proto::Timestamp = serde_json::from_value(text.into())
        .map_err(|_| "a time is written like 2026-03-14T15:00:00Z".to_owned())?;
    let seconds = u64::try_from(time.seconds)
        .map_err(|_| "records know no times before the year 1970".to_owned())?;
    // The text has a year of four digits, and so few milliseconds.
    let millis = u64::try_from(time.nanos / 1_000_000).unwrap_or(0);
    Ok(seconds.saturating_mul(1000).saturating_add(millis))
}

fn line_of(error: &csv::Error) -> usize {
    error.position().map_or(1, |position| {
        usize::try_from(position.line()).unwrap_or(usize::MAX)
    })
}

fn words(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::UnequalLengths {
            expected_len, len, ..
        } => format!("the row has {len} cells and must have {expected_len}, one for each column"),
        csv::ErrorKind::Utf8 { .. } => "the row is not UTF-8 text".into(),
        _ => error.to_string(),
    }
}
