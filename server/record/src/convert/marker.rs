//! Validates markers.

use chefshat_proto::v1;

use super::rules::FieldProblem;

/// The longest label, characters.
pub(crate) const MAX_LABEL: usize = 128;
/// How long after it was received a marker's moment may be, microseconds; and the millisecond to
/// which the time of receiving is rounded.
const MAX_AHEAD_US: u64 = 1_001_000;

/// Checks the label of a marker.
///
/// # Errors
/// It is too short, too long, or has control characters.
pub fn check_label(label: &str) -> Result<(), FieldProblem> {
    let characters = label.chars().count();
    if !(1..=MAX_LABEL).contains(&characters) {
        let problem = format!("{characters} characters, must be 1..={MAX_LABEL}");
        return Err(FieldProblem::new("label", problem));
    }
    match label.chars().any(char::is_control) {
        true => Err(FieldProblem::new("label", "has control characters")),
        false => Ok(()),
    }
}

/// Checks a recorded marker. `number`: how many there are so far, with this one.
///
/// # Errors
/// The first wrong field.
pub fn check_marker(marker: &v1::Marker, number: u64) -> Result<(), FieldProblem> {
    if marker.number != number {
        let problem = format!("{}, must be {number}", marker.number);
        return Err(FieldProblem::new("number", problem));
    }
    check_label(&marker.label)?;
    let latest = (marker.received_ms.saturating_mul(1000)).saturating_add(MAX_AHEAD_US);
    if marker.elapsed_us > latest {
        let problem = format!("{}, must be at most {latest}", marker.elapsed_us);
        return Err(FieldProblem::new("elapsed_us", problem));
    }
    Ok(())
}
