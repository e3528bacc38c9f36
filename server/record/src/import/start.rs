//! The state of an imported game before its first stated Shift.

use chefshat_engine::{BySeat, Role, Seat, SeatOrder};
use chefshat_referee::StartState;

use super::transcript::{Entry, Transcript, TranscriptError, wrong};

/// Reads a transcript: the rows `role` and `points` of its first Shift, unless that is the
/// first of the game.
pub(super) fn start_of_transcript(transcript: &Transcript) -> Result<StartState, TranscriptError> {
    let players = transcript.rules.players();
    let mut start = StartState {
        shift: 1,
        last_order: None,
        scores: BySeat::filled(players, 0),
    };
    let Some(first) = transcript.rows.first().filter(|row| row.shift > 1) else {
        return Ok(start);
    };
    start.shift = first.shift;
    let mut roles: BySeat<Option<&str>> = BySeat::filled(players, None);
    for row in transcript.rows.iter().take_while(|row| {
        row.shift == first.shift && !matches!(row.entry, Entry::Turn(_) | Entry::Special(_))
    }) {
        match &row.entry {
            Entry::Role(name) => roles[row.seat] = Some(name),
            Entry::Points(points) => {
                start.scores[row.seat] = u32::try_from(*points)
                    .map_err(|_| wrong(row.line, "too many points".into()))?;
            }
            _ => {}
        }
    }
    let mut order: Vec<Seat> = Vec::new();
    for role in Role::in_order(players) {
        let next = roles
            .seats()
            .find(|seat| roles[*seat] == Some(role.name()) && !order.contains(seat));
        order.extend(next);
    }
    let order = SeatOrder::from_slice(&order).filter(|order| order.len() == players);
    start.last_order = Some(order.ok_or_else(|| {
        wrong(
            first.line,
            format!(
                "the transcript begins with Shift {}, which needs a row `role` for each seat ({})",
                first.shift,
                Role::in_order(players)
                    .map(Role::name)
                    .collect::<Vec<_>>()
                    .join(", ")
            ),
        )
    })?);
    Ok(start)
}
