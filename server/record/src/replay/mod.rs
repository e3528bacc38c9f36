//! Verifies a record by replaying it: the rule engine applies its decisions again, and every line
//! must be exactly what follows. The first line that does not is reported. Files are read in
//! [`crate::jsonl`]; games with real cards are completed by `chefshat-referee`.

mod decision;
mod difference;
mod end;
mod fault;
mod game;
mod header;
mod seats;
mod seed;

use chefshat_engine::{BySeat, Game};
use chefshat_proto::v1::{self, record_line::Line};

use fault::Fault;
pub use fault::ReplayError;
use game::Replay;
pub use game::Replayed;
pub(crate) use seats::game_started;
pub(crate) use seed::reveal;

use crate::jsonl::Record;
use crate::signature::TextHash;

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
    /// Whether each hand is known; only games with real cards have unknown hands. `game` then has a
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
    visit: impl FnMut(Moment<'_>),
) -> Result<Replayed, ReplayError> {
    walk_text(lines, None, visit)
}

/// As [`walk`], for a record from a file, whose signature is that of its text.
///
/// # Errors
/// The first wrong line, which is not visited.
pub fn walk_file(record: &Record, visit: impl FnMut(Moment<'_>)) -> Result<Replayed, ReplayError> {
    walk_text(&record.lines, Some(record.text), visit)
}

fn walk_text(
    lines: &[v1::RecordLine],
    text: Option<TextHash>,
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
                let begun = Replay::new(header, lines, text).map_err(at)?;
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
