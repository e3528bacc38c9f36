//! Validates expressions.

use std::ops::RangeInclusive;

use chefshat_proto::v1::{self, expression::About};

use super::rules::FieldProblem;

/// The longest label, bytes.
const MAX_LABEL: usize = 64;
/// The longest reference to recorded media, bytes.
const MAX_MEDIA: usize = 256;
/// The range of timestamps, the years 1 to 9999, in seconds since the Unix epoch.
const SECONDS: RangeInclusive<i64> = -62_135_596_800..=LAST_SECOND;
/// The last second of the year 9999, since the Unix epoch.
const LAST_SECOND: i64 = 253_402_300_799;
/// The last millisecond of the year 9999, since the Unix epoch.
pub(crate) const LAST_MS: u64 = LAST_SECOND as u64 * 1000 + 999;
const NANOS: RangeInclusive<i32> = 0..=999_999_999;

/// How far outside of its frame a point of gaze may be, in widths or heights of the frame.
const GAZE: RangeInclusive<f32> = -10.0..=10.0;

/// Checks an expression in a room with this number of seats.
///
/// # Errors
/// The first field out of range.
pub fn check_expression(expression: &v1::Expression, seats: usize) -> Result<(), FieldProblem> {
    let text = |field, text: &str, bytes: RangeInclusive<usize>| {
        if bytes.contains(&text.len()) {
            Ok(())
        } else {
            let (least, most) = bytes.into_inner();
            Err(FieldProblem::new(
                field,
                format!("{} bytes, must be {least}..={most}", text.len()),
            ))
        }
    };
    let number = |field, value: Option<f32>, least: f32| match value {
        Some(value) if !(least..=1.0).contains(&value) => Err(FieldProblem::new(
            field,
            format!("{value} is not in {least}..=1"),
        )),
        _ => Ok(()),
    };
    text("label", &expression.label, 1..=MAX_LABEL)?;
    text("media", &expression.media, 0..=MAX_MEDIA)?;
    number("valence", expression.valence, -1.0)?;
    number("arousal", expression.arousal, -1.0)?;
    number("dominance", expression.dominance, -1.0)?;
    number("confidence", expression.confidence, 0.0)?;
    if let Some(time) = &expression.taken_at
        && !(SECONDS.contains(&time.seconds) && NANOS.contains(&time.nanos))
    {
        return Err(FieldProblem::new(
            "taken_at",
            "must be a time in the years 1 to 9999",
        ));
    }
    if v1::ExpressionSource::try_from(expression.source).is_err() {
        return Err(FieldProblem::new("source", "not a value of this enum"));
    }
    match &expression.about {
        Some(About::AboutSeat(seat))
            if usize::try_from(*seat).map_or(true, |seat| seat >= seats) =>
        {
            let problem = format!("{seat} is not a seat of the room");
            Err(FieldProblem::new("about_seat", problem))
        }
        Some(About::Gaze(gaze)) => check_gaze(gaze),
        _ => Ok(()),
    }
}

fn check_gaze(gaze: &v1::GazePoint) -> Result<(), FieldProblem> {
    for (field, value) in [("gaze.x", gaze.x), ("gaze.y", gaze.y)] {
        if !GAZE.contains(&value) {
            let problem = format!("{value} is not in -10..=10");
            return Err(FieldProblem::new(field, problem));
        }
    }
    match v1::GazeFrame::try_from(gaze.frame) {
        Ok(_) => Ok(()),
        Err(_) => Err(FieldProblem::new("gaze.frame", "not a value of this enum")),
    }
}
