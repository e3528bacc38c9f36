//! The transcript of a game at a real table: a CSV file with one row per observation, specified in
//! docs/records.md. This module parses it; whether the game is possible is checked in `mod.rs`.

use std::collections::BTreeMap;
use std::num::{IntErrorKind, ParseIntError};
use std::str::FromStr;

use chefshat_engine::{Action, Cards, MAX_SEATS, RewardScheme, RuleSet, Seat};
use chefshat_proto::v1;

use super::notation::{cards, kinds, play, rules};
use crate::convert::{
    check_expression, kind_from_name, reward_scheme_to_proto, rules_from_proto, seat_from_number,
};

/// Largest transcript, bytes.
pub const MAX_TRANSCRIPT_BYTES: usize = 16 * 1024 * 1024;
/// The columns of a transcript; only `what` is required.
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
/// The first row that is malformed or that no game can contain.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct TranscriptError {
    /// Number of the line in the file, from 1.
    pub line: usize,
    /// A description for people.
    pub problem: String,
}

pub(super) fn wrong(line: usize, problem: String) -> TranscriptError {
    TranscriptError { line, problem }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Player {
    pub(super) name: String,
    pub(super) kind: v1::ParticipantKind,
}

/// A parsed transcript.
#[derive(Debug)]
pub(super) struct Transcript {
    pub(super) table: String,
    pub(super) rules: RuleSet,
    pub(super) began_ms: u64,
    pub(super) scheme: v1::RewardScheme,
    pub(super) players: Vec<Player>,
    /// The rows of the Shifts, in order.
    pub(super) rows: Vec<Row>,
    /// Number of the last line.
    pub(super) last_line: usize,
}

/// Parses a transcript.
pub(super) fn read(bytes: &[u8]) -> Result<Transcript, TranscriptError> {
    let at = |line: usize, problem: String| TranscriptError { line, problem };
    if bytes.len() > MAX_TRANSCRIPT_BYTES {
        return Err(at(
            1,
            format!("a transcript has at most {MAX_TRANSCRIPT_BYTES} bytes"),
        ));
    }
    // Spreadsheets write a byte-order mark.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(bytes);
    let headers = reader
        .headers()
        .map_err(|error| at(line_of(&error), message(&error)))?
        .clone();
    if headers.len() == 1 && headers.iter().any(|name| name.contains([';', '\t'])) {
        return Err(at(
            1,
            "columns must be separated by commas; save the table as CSV with commas".to_owned(),
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
        let record = record.map_err(|error| at(line_of(&error), message(&error)))?;
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

/// The rows before the first Shift.
#[derive(Default)]
struct Settings {
    table: String,
    rules: Option<RuleSet>,
    began_ms: u64,
    scheme: v1::RewardScheme,
    players: BTreeMap<u32, Player>,
}

impl Settings {
    /// Reads a row; `false` if it belongs to a Shift.
    fn take(&mut self, cells: &Cells<'_>) -> Result<bool, TranscriptError> {
        let value = || cells.need("value");
        match cells.need("what")? {
            "table" => self.table = value()?.to_owned(),
            "rules" => {
                let stated = rules(value()?).map_err(|problem| cells.wrong(problem))?;
                let checked = rules_from_proto(&stated);
                let checked =
                    checked.map_err(|problem| cells.wrong(format!("rules: {problem}")))?;
                self.rules = Some(checked);
            }
            "rewards" => {
                let scheme = RewardScheme::from_name(value()?);
                let known = RewardScheme::ALL.map(RewardScheme::name);
                let scheme = scheme.ok_or_else(|| {
                    cells.wrong(format!("`rewards` must be one of {}", known.join(", ")))
                })?;
                self.scheme = reward_scheme_to_proto(Some(scheme));
            }
            "began" => self.began_ms = time_ms(value()?).map_err(|problem| cells.wrong(problem))?,
            name => {
                let Some(kind) = kind_from_name(name) else {
                    return Ok(false);
                };
                let seat: u32 = cells.number("seat")?;
                let name = value()?.to_owned();
                let player = Player { name, kind };
                if self.players.insert(seat, player).is_some() {
                    return Err(cells.wrong(format!("seat {seat} is taken already")));
                }
            }
        }
        if cells.cells.contains_key("shift") {
            return Err(cells.wrong("this row precedes the first Shift: leave `shift` empty"));
        }
        Ok(true)
    }

    /// The rule set, after checking that every seat has a name.
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
                "before the first Shift, each of the seats 0..={} needs one row `human`, `robot`, `agent` or `model` with a name as its value",
                players - 1
            )));
        }
        Ok(rules)
    }
}

/// Parses an RFC 3339 time as milliseconds since the Unix epoch.
fn time_ms(text: &str) -> Result<u64, String> {
    let time: chefshat_proto::Timestamp = serde_json::from_value(text.into())
        .map_err(|_| "a time must be written like 2026-03-14T15:00:00Z".to_owned())?;
    let seconds = u64::try_from(time.seconds)
        .map_err(|_| "times before 1970 are not supported".to_owned())?;
    // Years have four digits, so nothing overflows.
    let millis = u64::try_from(time.nanos / 1_000_000).unwrap_or(0);
    Ok(seconds.saturating_mul(1000).saturating_add(millis))
}

fn line_of(error: &csv::Error) -> usize {
    error.position().map_or(1, |position| {
        usize::try_from(position.line()).unwrap_or(usize::MAX)
    })
}

fn message(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::UnequalLengths {
            expected_len, len, ..
        } => format!("the row has {len} cells and must have {expected_len}, one per column"),
        csv::ErrorKind::Utf8 { .. } => "the row is not UTF-8 text".into(),
        _ => error.to_string(),
    }
}

/// A row of a Shift.
#[derive(Debug)]
pub(super) struct Row {
    pub(super) line: usize,
    pub(super) shift: u32,
    pub(super) seat: Seat,
    /// Milliseconds since the game began, if stated.
    pub(super) at_ms: Option<u64>,
    /// Decision time in microseconds; 0 if not measured.
    pub(super) took_us: u64,
    pub(super) entry: Entry,
}

/// The content of a row.
#[derive(Debug)]
pub(super) enum Entry {
    /// The hand as dealt.
    Hand(Cards),
    /// The role in this Shift.
    Role(String),
    /// The points so far.
    Points(u64),
    /// Whether the seat declared its special action.
    Special(bool),
    /// The gift in the exchange: cards and actions; `None` if unknown.
    Gives(Option<(Cards, Vec<Action>)>),
    /// An illegal play the seat took back.
    Tries(Action),
    /// A play or a pass.
    Turn(Action),
    /// The place in this Shift.
    Finishes(u8),
    Expresses(Box<v1::Expression>),
}

pub(super) fn row(cells: &Cells<'_>, rules: &RuleSet) -> Result<Row, TranscriptError> {
    let wrong = |problem: String| cells.wrong(problem);
    let what = cells.need("what")?;
    let shift = cells.number("shift")?;
    let number: u32 = cells.number("seat")?;
    let seat = seat_from_number(number, rules.players())
        .ok_or_else(|| wrong(format!("there is no seat {number}")))?;
    let faces = rules.faces();
    let entry = match what {
        "hand" => Entry::Hand(cards(cells.need("value")?, faces).map_err(wrong)?),
        "role" => Entry::Role(cells.need("value")?.to_owned()),
        "points" => Entry::Points(cells.number("value")?),
        "declares" => Entry::Special(true),
        "declines" => Entry::Special(false),
        "gives" => Entry::Gives(match cells.cells.get("value") {
            None => None,
            Some(text) => {
                let gift = cards(text, faces).map_err(wrong)?;
                let moves = kinds(text, faces).map_err(wrong)?;
                Some((
                    gift,
                    moves
                        .into_iter()
                        .map(|kind| kind.map_or(Action::GiveJoker, Action::Give))
                        .collect(),
                ))
            }
        }),
        "tries" => Entry::Tries(play(cells.need("value")?, faces).map_err(wrong)?),
        "plays" => Entry::Turn(play(cells.need("value")?, faces).map_err(wrong)?),
        "passes" => Entry::Turn(Action::Pass),
        "finishes" => Entry::Finishes(
            u8::try_from(cells.number::<u32>("value")?)
                .map_err(|_| wrong("no such place".into()))?,
        ),
        "expresses" => Entry::Expresses(Box::new(expression(cells)?)),
        other => {
            return Err(wrong(format!(
                "`what` is {other:?} and must be one of hand, role, points, declares, declines, gives, tries, plays, passes, \
                 finishes, expresses"
            )));
        }
    };
    let valued = !matches!(
        entry,
        Entry::Special(_) | Entry::Turn(Action::Pass) | Entry::Expresses(_)
    );
    if !valued && cells.cells.contains_key("value") {
        return Err(wrong(format!("`{what}` takes no value")));
    }
    Ok(Row {
        line: cells.line,
        shift,
        seat,
        at_ms: cells.seconds("seconds", 1e3)?,
        took_us: cells.seconds("took", 1e6)?.unwrap_or(0),
        entry,
    })
}

fn expression(cells: &Cells<'_>) -> Result<v1::Expression, TranscriptError> {
    let number = |column| Ok(cells.float(column)?.map(|number| number as f32));
    let source = match cells.cells.get("source").copied() {
        None => v1::ExpressionSource::Unspecified,
        Some("face") => v1::ExpressionSource::Face,
        Some("voice") => v1::ExpressionSource::Voice,
        Some("self_report") => v1::ExpressionSource::SelfReport,
        Some("model") => v1::ExpressionSource::Model,
        Some(other) => {
            return Err(cells.wrong(format!(
                "`source` is {other:?} and must be face, voice, self_report or model"
            )));
        }
    };
    let expression = v1::Expression {
        label: cells.need("label")?.to_owned(),
        valence: number("valence")?,
        arousal: number("arousal")?,
        dominance: number("dominance")?,
        confidence: number("confidence")?,
        source: source.into(),
        ..v1::Expression::default()
    };
    check_expression(&expression, MAX_SEATS).map_err(|problem| cells.wrong(problem.to_string()))?;
    Ok(expression)
}

/// The longest time in a transcript, seconds: a hundred days.
const MAX_SECONDS: f64 = 8_640_000.0;

/// The non-empty cells of a row, by column.
pub(super) struct Cells<'a> {
    pub(super) line: usize,
    pub(super) cells: BTreeMap<&'a str, &'a str>,
}

impl<'a> Cells<'a> {
    pub(super) fn wrong(&self, problem: impl Into<String>) -> TranscriptError {
        TranscriptError {
            line: self.line,
            problem: problem.into(),
        }
    }

    pub(super) fn need(&self, column: &str) -> Result<&'a str, TranscriptError> {
        self.cells
            .get(column)
            .copied()
            .ok_or_else(|| self.wrong(format!("`{column}` is empty")))
    }

    /// A non-negative integer.
    pub(super) fn number<T>(&self, column: &str) -> Result<T, TranscriptError>
    where
        T: FromStr<Err = ParseIntError>,
    {
        let text = self.need(column)?;
        text.parse()
            .map_err(|error: ParseIntError| match error.kind() {
                IntErrorKind::PosOverflow => {
                    self.wrong(format!("`{column}` is {text}, which is too large"))
                }
                _ => self.wrong(format!("`{column}` is {text:?} and must be a whole number")),
            })
    }

    pub(super) fn float(&self, column: &str) -> Result<Option<f64>, TranscriptError> {
        let Some(text) = self.cells.get(column) else {
            return Ok(None);
        };
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        number
            .map(Some)
            .ok_or_else(|| self.wrong(format!("`{column}` is {text:?} and must be a number")))
    }

    /// A time in seconds, converted to `units` per second.
    pub(super) fn seconds(&self, column: &str, units: f64) -> Result<Option<u64>, TranscriptError> {
        match self.float(column)? {
            None => Ok(None),
            // MAX_SECONDS rules out overflow.
            Some(seconds) if (0.0..=MAX_SECONDS).contains(&seconds) => {
                Ok(Some((seconds * units).round() as u64))
            }
            Some(seconds) => Err(self.wrong(format!(
                "`{column}` is {seconds} and must be in 0..={MAX_SECONDS}"
            ))),
        }
    }
}
