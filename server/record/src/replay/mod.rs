//! Verifies a record by replaying it: the rule engine applies its decisions again, and every line
//! must be exactly what follows. The first line that does not is reported. Files are read in
//! [`crate::jsonl`]; imported games are completed in [`crate::import`].

mod decision;
mod difference;
mod end;
mod game;
mod header;
mod seats;
mod seed;

use chefshat_engine::{BySeat, Game};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

pub(crate) use decision::action_id;
use game::Replay;
pub(crate) use seats::game_started;

/// The result of a verified record.
#[derive(Debug, Clone, PartialEq)]
pub struct Replayed {
    /// Finished or aborted.
    pub state: v1::RoomState,
    /// The number of decisions.
    pub decisions: u64,
    /// The number of events.
    pub events: u64,
    /// The final standings, best first; empty for an aborted game.
    pub standings: Vec<v1::Standing>,
}

/// The first wrong line of a record.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct ReplayError {
    /// Number of the line, from 1; one past the last line if the end is missing.
    pub line: usize,
    /// A description for people.
    pub problem: String,
}

/// A line of a record and the game at that line.
#[derive(Debug, Clone, Copy)]
pub struct Moment<'a> {
    /// Number of the line, from 1.
    pub line: usize,
    /// The line.
    pub entry: &'a Line,
    /// The game before a decision, or after the decision whose events follow. `None` before the
    /// start.
    pub game: Option<&'a Game>,
    /// Whether each hand is known; only imported games have unknown hands. `game` then has a
    /// possible hand.
    pub hands_known: BySeat<bool>,
    /// Whether it is also known if each hand contains the Golden card. If not, `game` may have the
    /// Golden card in place of another top-face card, or vice versa.
    pub golden_known: BySeat<bool>,
}

/// Verifies a record: seeds, deals, masks, decisions, events, rewards, scores and counts.
///
/// # Errors
/// The first wrong line.
pub fn replay(lines: &[v1::RecordLine]) -> Result<Replayed, ReplayError> {
    walk(lines, |_| {})
}

/// Verifies a record and calls `visit` for every line, the header first.
///
/// # Errors
/// The first wrong line, which is not visited.
pub fn walk(
    lines: &[v1::RecordLine],
    mut visit: impl FnMut(Moment<'_>),
) -> Result<Replayed, ReplayError> {
    let mut replay = None;
    for (line, entry) in (1..).zip(lines) {
        let at = |fault: Fault| ReplayError {
            line: fault.line.unwrap_or(line),
            problem: fault.problem,
        };
        let entry = entry
            .line
            .as_ref()
            .ok_or_else(|| at("the line is empty".into()))?;
        let mut show = |game: Option<&Game>, (hands_known, golden_known)| {
            visit(Moment {
                line,
                entry,
                game,
                hands_known,
                golden_known,
            });
        };
        match (&mut replay, entry) {
            (None, Line::Header(header)) => {
                let begun = Replay::new(header, lines).map_err(at)?;
                show(None, begun.known());
                replay = Some(begun);
            }
            (None, _) => return Err(at("the first line must be the header".into())),
            (Some(_), Line::Header(_)) => return Err(at("a second header".into())),
            (Some(replay), Line::Decision(decision)) => {
                let before = replay.game().cloned();
                let known = replay.known();
                replay.decide(line, decision).map_err(at)?;
                show(before.as_ref(), known);
            }
            (Some(replay), entry) => {
                replay.take(line, entry).map_err(at)?;
                show(replay.game(), replay.known());
            }
        }
    }
    match replay {
        None => Err(ReplayError {
            line: 1,
            problem: "the record is empty".into(),
        }),
        Some(replay) => replay.finish().ok_or_else(|| ReplayError {
            line: lines.len() + 1,
            problem: "the record is truncated: it ends before its footer".into(),
        }),
    }
}

/// The seed reveal of a line that ends the game.
pub(crate) fn reveal(line: &v1::RecordLine) -> Option<&v1::SeedReveal> {
    match line.line.as_ref()? {
        Line::Event(event) => match event.kind.as_ref()? {
            Kind::GameEnded(ended) => ended.reveal.as_ref(),
            Kind::GameAborted(aborted) => aborted.reveal.as_ref(),
            _ => None,
        },
        _ => None,
    }
}

/// A problem, with its line if that is not the current one.
#[derive(Debug)]
struct Fault {
    line: Option<usize>,
    problem: String,
}

impl From<String> for Fault {
    fn from(problem: String) -> Self {
        Self {
            line: None,
            problem,
        }
    }
}

impl From<&str> for Fault {
    fn from(problem: &str) -> Self {
        problem.to_owned().into()
    }
}
