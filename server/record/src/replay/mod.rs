//! Replaying a record: the rules are applied to its decisions again, and every line must be what follows from them. What does not fit is
//! named with its line. The parts: `header` (the first line), `seed` (what is revealed, which seed dealt what), `seats` (events of the
//! room), `decision` (a decision against the game before it), `game` (the game's own events),
//! `end` (how it ended), `words` (what differs). How a file is read
//! is in [`crate::jsonl`]; games of real tables are completed in [`crate::table`].

mod decision;
mod end;
mod game;
mod header;
mod seats;
mod seed;
mod words;

use chefshat_engine::{BySeat, Game};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

pub(crate) use decision::{kind_to_proto, number};
use game::Replay;
pub(crate) use seats::game_started;

/// What a record that replays says.
#[derive(Debug, Clone, PartialEq)]
pub struct Replayed {
    /// How the game ended.
    pub state: v1::RoomState,
    /// Decisions in it.
    pub decisions: u64,
    /// Events in it.
    pub events: u64,
    /// The final table, best first; empty for an aborted game.
    pub standings: Vec<v1::Standing>,
}

/// The first line of a record that does not fit, and why.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct ReplayError {
    /// Number of the line, from 1; one more than there are lines when something is missing at the end.
    pub line: usize,
    /// What does not fit.
    pub problem: String,
}

/// Where a recorded game stands at one of its lines.
#[derive(Debug, Clone, Copy)]
pub struct Moment<'a> {
    /// Number of the line, from 1.
    pub line: usize,
    /// The line.
    pub entry: &'a Line,
    /// The game as it stands at the line: before a decision, and after the decision whose events follow. `None` before it begins.
    pub game: Option<&'a Game>,
    /// Whose hand is known: everybody's, but in an imported game. A hand that is not known stands in `game` as one that would fit.
    pub hands_known: BySeat<bool>,
    /// Of whose hand, which is known, it is known as well whether it holds the Golden card: of everybody's, but in an imported game. Where it
    /// is not, the hand may stand in `game` with the Golden card instead of another of the top face, or the other way round.
    pub golden_known: BySeat<bool>,
}

/// Replays a record: seeds, deals, masks, decisions, events, rewards, scores and counts.
///
/// # Errors
/// The first line that does not fit.
pub fn replay(lines: &[v1::RecordLine]) -> Result<Replayed, ReplayError> {
    walk(lines, |_| {})
}

/// Replays a record and shows every line that fits, the header first, with the game as it stands there.
///
/// # Errors
/// The first line that does not fit; it is not shown.
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
            problem: "there is nothing in it, not even a header".into(),
        }),
        Some(replay) => replay.finish().ok_or_else(|| ReplayError {
            line: lines.len() + 1,
            problem: "the record ends here, before its footer: it was cut off".into(),
        }),
    }
}

/// What a game reveals of its seed at its end.
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

/// Why a line does not fit, and, where the fault is seen on another line than the one being taken, on which.
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
