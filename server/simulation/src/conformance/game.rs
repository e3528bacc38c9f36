//! Checks a vector of a complete game.

use chefshat_engine::{ActionId, Event, Game, Seed, SpecialAction};
use serde::{Deserialize, Serialize};

use super::compare::{Disagreement, LineError, agree, unreadable};
use crate::RulesForm;

/// A game played by another engine.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GameVector {
    rules: RulesForm,
    #[serde(with = "hex")]
    seed: [u8; 32],
    /// Seat, action, and all legal actions in ascending order.
    steps: Vec<(usize, u16, Vec<u16>)>,
    shifts: Vec<ShiftEnd>,
    scores: Vec<u64>,
    winner: usize,
}

/// How a Shift ended.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ShiftEnd {
    shift: u32,
    order: Vec<usize>,
    starter: usize,
    pizzas: u32,
    laps: u32,
    turns: u32,
    special: Option<Special>,
    adjudicated: bool,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Special {
    FoodFight,
    DinnerIsServed,
}

/// Replays the game decision by decision and compares every step. Returns the number of steps.
pub(super) fn check(vector: GameVector) -> Result<u64, LineError> {
    let rules = vector.rules.rule_set().map_err(unreadable)?;
    let mut expected_shifts = vector.shifts.iter();
    let mut game = Game::new(rules, Seed(vector.seed), |_| {});
    for (step, (seat, action, legal)) in vector.steps.iter().enumerate() {
        let at = |what: &str| format!("steps[{step}], {what}");
        let Some(decision) = game.decision() else {
            let expected = format!("{} steps", vector.steps.len());
            return Err(in_words(
                "steps",
                step,
                expected,
                format!("the game has ended after {step}"),
            )
            .into());
        };
        agree(&at("seat"), Some(step), seat, decision.seat.index())?;
        let mask: Vec<u16> = game.legal_actions().iter().map(ActionId::index).collect();
        if *legal != mask {
            let expected = format!("{legal:?}");
            let got = format!("{mask:?}{}", difference(legal, &mask));
            return Err(in_words(&at("legal actions"), step, expected, got).into());
        }
        let mut end = None;
        let on_event = |event: Event| end = shift_end(&event).or(end.take());
        if let Err(error) = game.apply(ActionId::new(*action), on_event) {
            return Err(
                in_words(&at("action"), step, action.to_string(), error.to_string()).into(),
            );
        }
        if let Some(got) = end {
            let place = format!("shifts[{}]", got.shift - 1);
            match expected_shifts.next() {
                Some(expected) => agree(&place, Some(step), expected, got)?,
                None => {
                    return Err(in_words(
                        &place,
                        step,
                        "no further Shift".into(),
                        "one that ended".into(),
                    )
                    .into());
                }
            }
        }
    }
    let step = vector.steps.len();
    let Some(standings) = game.standings() else {
        let expected = format!("the game's end after {step}");
        return Err(in_words("steps", step, expected, "a game that continues".into()).into());
    };
    let last = step.checked_sub(1);
    agree("number of shifts", last, vector.shifts.len(), game.shift())?;
    agree("scores", last, &vector.scores, standings.points.as_slice())?;
    agree("winner", last, vector.winner, standings.winner().index())?;
    Ok(step as u64)
}

fn in_words(place: &str, step: usize, expected: String, got: String) -> Disagreement {
    Disagreement {
        place: place.to_owned(),
        step: Some(step),
        expected,
        got,
    }
}

/// Describes which actions a list lacks and which it has in addition.
fn difference(expected: &[u16], got: &[u16]) -> String {
    let without = |these: &[u16], those: &[u16]| -> Vec<u16> {
        let rest = these.iter().filter(|action| !those.contains(action));
        rest.copied().collect()
    };
    let (lacks, more) = (without(expected, got), without(got, expected));
    let mut words = String::new();
    if !lacks.is_empty() {
        words += &format!(", without {lacks:?}");
    }
    if !more.is_empty() {
        words += &format!(", with {more:?} in addition");
    }
    if words.is_empty() {
        // The vector has the same actions, but one of them twice or in another order.
        words += ", each once, ascending";
    }
    words
}

/// The end of a Shift as the vectors write it.
fn shift_end(event: &Event) -> Option<ShiftEnd> {
    let Event::ShiftEnded(end) = event else {
        return None;
    };
    Some(ShiftEnd {
        shift: end.shift,
        order: end
            .order
            .as_slice()
            .iter()
            .map(|seat| seat.index())
            .collect(),
        starter: end.starter.index(),
        pizzas: end.pizzas,
        laps: end.laps,
        turns: end.turns,
        special: end.special.map(|special| match special {
            SpecialAction::FoodFight => Special::FoodFight,
            SpecialAction::DinnerIsServed => Special::DinnerIsServed,
        }),
        adjudicated: end.adjudicated,
    })
}
