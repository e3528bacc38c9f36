//! The rows of a Shift: who did what, when.

use chefshat_engine::{Action, Cards, RuleSet, Seat};
use chefshat_proto::v1;

use super::TranscriptError;
use super::cards::{cards, kinds, play};
use super::cells::Cells;
use crate::convert::{check_expression, seat_from_number};

/// One thing that was seen in a Shift.
#[derive(Debug)]
pub(in crate::table) struct Row {
    pub(in crate::table) line: usize,
    pub(in crate::table) shift: u32,
    pub(in crate::table) seat: Seat,
    /// Milliseconds since the game began, if they were written down.
    pub(in crate::table) at_ms: Option<u64>,
    /// Time that the decision took, microseconds; 0 if it was not measured.
    pub(in crate::table) took_us: u64,
    pub(in crate::table) seen: Seen,
}

/// What was seen.
#[derive(Debug)]
pub(in crate::table) enum Seen {
    /// The seat's cards as dealt.
    Hand(Cards),
    /// Its role.
    Role(String),
    /// Its points so far.
    Points(u64),
    /// It declared its special action, or said that it does not.
    Special(bool),
    /// What it gave in the exchange; `None` if nobody saw.
    Gives(Option<(Cards, Vec<Action>)>),
    /// What it tried to play and took back, because the rules forbid it.
    Tries(Action),
    /// A play or a pass.
    Turn(Action),
    /// The place it took.
    Finishes(u8),
    /// What it showed.
    Expresses(Box<v1::Expression>),
}

/// One row of a Shift.
pub(super) fn row(cells: &Cells<'_>, rules: &RuleSet) -> Result<Row, TranscriptError> {
    let wrong = |problem: String| cells.wrong(problem);
    let what = cells.need("what")?;
    let shift = cells.number("shift")?;
    let number: u32 = cells.number("seat")?;
    let seat = seat_from_number(number, rules.players())
        .ok_or_else(|| wrong(format!("there is no seat {number}")))?;
    let faces = rules.faces();
    let seen = match what {
        "hand" => Seen::Hand(cards(cells.need("value")?, faces).map_err(wrong)?),
        "role" => Seen::Role(cells.need("value")?.to_owned()),
        "points" => Seen::Points(cells.number("value")?),
        "declares" => Seen::Special(true),
        "declines" => Seen::Special(false),
        "gives" => Seen::Gives(match cells.cells.get("value") {
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
        "tries" => Seen::Tries(play(cells.need("value")?, faces).map_err(wrong)?),
        "plays" => Seen::Turn(play(cells.need("value")?, faces).map_err(wrong)?),
        "passes" => Seen::Turn(Action::Pass),
        "finishes" => Seen::Finishes(
            u8::try_from(cells.number::<u32>("value")?)
                .map_err(|_| wrong("there is no such place".into()))?,
        ),
        "expresses" => Seen::Expresses(Box::new(expression(cells)?)),
        other => {
            return Err(wrong(format!(
                "`what` is {other:?}; in a Shift it is one of hand, role, points, declares, declines, gives, tries, plays, passes, \
                 finishes, expresses"
            )));
        }
    };
    let valued = !matches!(
        seen,
        Seen::Special(_) | Seen::Turn(Action::Pass) | Seen::Expresses(_)
    );
    if !valued && cells.cells.contains_key("value") {
        return Err(wrong(format!("`{what}` has no value")));
    }
    Ok(Row {
        line: cells.line,
        shift,
        seat,
        at_ms: cells.seconds("seconds", 1e3)?,
        took_us: cells.seconds("took", 1e6)?.unwrap_or(0),
        seen,
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
    check_expression(&expression).map_err(|problem| cells.wrong(problem.to_string()))?;
    Ok(expression)
}
