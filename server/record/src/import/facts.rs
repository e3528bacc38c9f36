//! The facts of a Shift, from the rows of a transcript.

use chefshat_referee::{Fact, ShiftFacts};

use super::transcript::{Entry, Transcript, TranscriptError, wrong};

/// The facts of a transcript, by Shift.
pub(super) fn facts_of_transcript(
    transcript: &Transcript,
) -> Result<Vec<ShiftFacts>, TranscriptError> {
    let mut shifts: Vec<ShiftFacts> = Vec::new();
    let mut current: Option<u32> = None;
    let mut playing = false;
    for row in &transcript.rows {
        let wrong_at = |problem: &str| Err(wrong(row.line, problem.to_owned()));
        if current != Some(row.shift) {
            if current.is_some_and(|shift| shift.checked_add(1) != Some(row.shift)) {
                return wrong_at("Shifts must follow one another");
            }
            if row.shift == 0 {
                return wrong_at("the number of the first Shift is 1");
            }
            current = Some(row.shift);
            playing = false;
            shifts.push(ShiftFacts::default());
        }
        let Some(shift) = shifts.last_mut() else {
            continue;
        };
        let mut push = |fact| shift.facts.push((row.line, fact));
        match &row.entry {
            Entry::Hand(_) | Entry::Gives(_) | Entry::Special(_) if playing => {
                return wrong_at(
                    "hands, special actions and gifts must come before the first turn of the Shift",
                );
            }
            Entry::Hand(cards) => push(Fact::Hand(row.seat, *cards)),
            Entry::Special(declared) => push(Fact::Special {
                seat: row.seat,
                declared: *declared,
            }),
            Entry::Gives(gift) => {
                push(Fact::Given(
                    row.seat,
                    gift.as_ref().map(|(cards, _)| *cards),
                ));
            }
            Entry::Turn(turn) => {
                playing = true;
                push(Fact::Turn(row.seat, *turn));
            }
            _ => {}
        }
    }
    Ok(shifts)
}
