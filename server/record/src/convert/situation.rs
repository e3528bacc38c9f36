//! Situations: decisions as their seats see them, with the events of the Shift.

use chefshat_engine::{Event, Observation, RuleSet};
use chefshat_proto::v1;

use super::events::event_from_proto;
use super::numbers::seat_from_number;
use super::observation::observation_from_proto;
use super::rules::FieldProblem;

/// Reads a situation of a game with these rules: the observation of its seat, and the events that say
/// something about the cards.
///
/// # Errors
/// The first invalid field.
pub fn situation_from_proto(
    situation: &v1::Situation,
    rules: &RuleSet,
) -> Result<(Observation, Vec<Event>), FieldProblem> {
    let seat = seat_from_number(situation.seat, rules.players())
        .ok_or_else(|| FieldProblem::new("seat", "the game has no such seat"))?;
    let decision = situation.decision.as_ref();
    let decision = decision.ok_or_else(|| FieldProblem::new("decision", "not set"))?;
    let observation = observation_from_proto(decision, seat, rules)?;
    let kinds = situation.events.iter();
    let kinds = kinds.filter_map(|event| event.kind.as_ref());
    let events = kinds.filter_map(|kind| event_from_proto(kind, rules).transpose());
    Ok((observation, events.collect::<Result<_, _>>()?))
}
