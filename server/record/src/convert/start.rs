//! Converts scripted Shifts. The engine validates them; its errors become field names here.

use chefshat_engine::{BySeat, Cards, Game, RuleSet, Script, ScriptError, SeatOrder, Seed};
use chefshat_proto::v1;

use super::numbers::{cards_from_numbers, seat_cards, seat_from_number, seat_number};
use super::rules::FieldProblem;

/// Reads a script. `Game::scripted` accepts the result with these rules and any seed.
///
/// # Errors
/// The first invalid field.
pub fn script_from_proto(
    message: &v1::ScriptedShift,
    rules: &RuleSet,
) -> Result<Script, FieldProblem> {
    let players = rules.players();
    let last_order = message
        .last_order
        .iter()
        .map(|&seat| seat_from_number(seat, players))
        .collect::<Option<Vec<_>>>()
        .filter(|seats| seats.is_empty() || seats.len() == players)
        .and_then(|seats| SeatOrder::from_slice(&seats))
        .ok_or_else(|| {
            FieldProblem::new(
                "last_order",
                format!("list each of the seats 0..{players} once, best place first"),
            )
        })?;
    let scores = match message.points.as_slice() {
        [] => Some(BySeat::filled(players, 0)),
        points => BySeat::from_slice(points).filter(|points| points.len() == players),
    }
    .ok_or_else(|| {
        FieldProblem::new(
            "points",
            format!("give one number for each of the {players} seats, or none"),
        )
    })?;
    let drawn = message
        .drawn_seat
        .map(|seat| {
            seat_from_number(seat, players)
                .ok_or_else(|| FieldProblem::new("drawn_seat", format!("there is no seat {seat}")))
        })
        .transpose()?;
    let script = Script {
        shift: message.shift.max(1),
        hands: hands_from_proto(&message.hands, rules)?,
        last_order: Some(last_order).filter(|order| !order.is_empty()),
        scores,
        drawn,
    };
    Game::scripted(*rules, Seed([0; 32]), &script, |_| {})
        .map_err(|error| FieldProblem::new(field_of(&error), error.to_string()))?;
    Ok(script)
}

/// Converts a script of a game with `faces` faces.
pub fn script_to_proto(script: &Script, faces: u8) -> v1::ScriptedShift {
    v1::ScriptedShift {
        shift: script.shift,
        hands: script
            .hands
            .iter()
            .map(|(seat, &hand)| seat_cards(seat, hand, faces))
            .collect(),
        last_order: script.last_order.map_or_else(Vec::new, |order| {
            order.as_slice().iter().copied().map(seat_number).collect()
        }),
        points: script.scores.values().copied().collect(),
        drawn_seat: script.drawn.map(seat_number),
    }
}

/// The hands of all seats, each of which must be listed once.
fn hands_from_proto(
    listed: &[v1::SeatCards],
    rules: &RuleSet,
) -> Result<BySeat<Cards>, FieldProblem> {
    let players = rules.players();
    let problem = |message: String| FieldProblem::new("hands", message);
    let mut hands = BySeat::filled(players, None);
    for hand in listed {
        let seat = seat_from_number(hand.seat, players)
            .ok_or_else(|| problem(format!("there is no seat {}", hand.seat)))?;
        let cards =
            cards_from_numbers(&hand.cards, hand.golden, rules.faces()).ok_or_else(|| {
                problem(format!(
                    "no deck of {} faces contains the cards of seat {seat} (a joker is {}; the Golden card has face {})",
                    rules.faces(),
                    rules.faces() + 1,
                    rules.faces(),
                ))
            })?;
        if hands[seat].replace(cards).is_some() {
            return Err(problem(format!("seat {seat} has two hands")));
        }
    }
    match hands.iter().find(|(_, hand)| hand.is_none()) {
        Some((seat, _)) => Err(problem(format!("seat {seat} has no hand"))),
        None => Ok(hands.map(Option::unwrap_or_default)),
    }
}

fn field_of(error: &ScriptError) -> &'static str {
    match error {
        ScriptError::Seats(_)
        | ScriptError::HandSize { .. }
        | ScriptError::NotInDeck
        | ScriptError::Golden
        | ScriptError::NotATurn
        | ScriptError::Leader => "hands",
        ScriptError::Shift => "last_order",
        ScriptError::Ended => "points",
        ScriptError::Drawn => "drawn_seat",
    }
}
