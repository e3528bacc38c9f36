//! The rows of a transcript, Shift by Shift, and where the first of them stands in its game.

use chefshat_engine::{BySeat, Role, Seat, SeatOrder};

use super::facts::{Fact, ShiftFacts};
use super::play::Beginning;
use super::transcript::{Seen, Transcript, TranscriptError};

/// What is told of each Shift, and where the first of them stands in its game.
pub(super) fn shifts_of(
    told: &Transcript,
) -> Result<(Beginning, Vec<ShiftFacts>), TranscriptError> {
    let mut shifts: Vec<ShiftFacts> = Vec::new();
    let mut current: Option<u32> = None;
    let mut playing = false;
    for row in &told.rows {
        let wrong_at = |problem: &str| Err(wrong(row.line, problem.to_owned()));
        if current != Some(row.shift) {
            if current.is_some_and(|shift| shift.checked_add(1) != Some(row.shift)) {
                return wrong_at("Shifts are told of one after the other");
            }
            if row.shift == 0 {
                return wrong_at("the first Shift has number 1");
            }
            current = Some(row.shift);
            playing = false;
            shifts.push(ShiftFacts::default());
        }
        let Some(shift) = shifts.last_mut() else {
            continue;
        };
        let mut note = |fact| shift.facts.push((row.line, fact));
        match &row.seen {
            Seen::Hand(_) | Seen::Gives(_) | Seen::Special(_) if playing => {
                return wrong_at(
                    "hands, special actions and gifts are told of before the Shift's first turn",
                );
            }
            Seen::Hand(cards) => note(Fact::Hand(row.seat, *cards)),
            Seen::Special(declared) => note(Fact::Special {
                seat: row.seat,
                declared: *declared,
            }),
            Seen::Gives(gift) => {
                note(Fact::Given(
                    row.seat,
                    gift.as_ref().map(|(cards, _)| *cards),
                ));
            }
            Seen::Turn(turn) => {
                playing = true;
                note(Fact::Turn(row.seat, *turn));
            }
            _ => {}
        }
    }
    Ok((beginning(told)?, shifts))
}

/// Where the first Shift that is told of stands in its game: if it is not the first of all, its roles and points say that.
fn beginning(told: &Transcript) -> Result<Beginning, TranscriptError> {
    let players = told.rules.players();
    let mut beginning = Beginning {
        shift: 1,
        last_order: None,
        scores: BySeat::filled(players, 0),
    };
    let Some(first) = told.rows.first().filter(|row| row.shift > 1) else {
        return Ok(beginning);
    };
    beginning.shift = first.shift;
    let mut roles: BySeat<Option<&str>> = BySeat::filled(players, None);
    for row in told.rows.iter().take_while(|row| {
        row.shift == first.shift && !matches!(row.seen, Seen::Turn(_) | Seen::Special(_))
    }) {
        match &row.seen {
            Seen::Role(name) => roles[row.seat] = Some(name),
            Seen::Points(points) => {
                beginning.scores[row.seat] = u32::try_from(*points)
                    .map_err(|_| wrong(row.line, "these are too many points".into()))?;
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
    beginning.last_order = Some(order.ok_or_else(|| {
        wrong(
            first.line,
            format!(
                "what is told begins with Shift {}: it needs a row `role` for each seat ({})",
                first.shift,
                Role::in_order(players)
                    .map(Role::name)
                    .collect::<Vec<_>>()
                    .join(", ")
            ),
        )
    })?);
    Ok(beginning)
}

/// The words for a row that cannot be.
pub(super) fn wrong(line: usize, problem: String) -> TranscriptError {
    TranscriptError { line, problem }
}
