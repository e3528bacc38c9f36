//! Judges the form of cards that were seen: whether they are a play that the rules allow now, or
//! cards that a deck can have. Everything here follows from public facts alone.

use chefshat_engine::{Action, Cards, Face, PlayRequirement, RuleSet};

use crate::counts::{Counts, JOKER, cards_of, size_of};
use crate::words::kind_text;
use crate::{SeenCards, ViolatedRule};

/// A broken rule, with the text for people.
pub(crate) type Broken = (ViolatedRule, String);

/// The action that cards on the board are.
pub(crate) fn as_play(rules: &RuleSet, cards: &SeenCards) -> Result<Action, Broken> {
    let form = |text: String| Err((ViolatedRule::Form, text));
    let counts = &cards.counts;
    let kinds: Vec<usize> = (0..JOKER).filter(|kind| counts[*kind] > 0).collect();
    match (kinds.as_slice(), counts[JOKER]) {
        ([], 0) => form("No cards were laid.".into()),
        ([], 1) => Ok(Action::LoneJoker),
        ([], _) => form(
            "Jokers alone are no play: lay one alone, or jokers with cards of one face.".into(),
        ),
        ([kind], jokers) => {
            check_deck(rules, counts)?;
            let number = u8::try_from(kind + 1).unwrap_or(u8::MAX);
            let Some(face) = Face::new(number).filter(|face| face.get() <= rules.faces()) else {
                return Err((ViolatedRule::Cards, format!("The deck has no {number}s.")));
            };
            Ok(Action::Play {
                face,
                quantity: counts[*kind],
                jokers,
            })
        }
        (kinds, _) => {
            let names: Vec<String> = kinds.iter().map(|kind| kind_text(*kind)).collect();
            form(format!(
                "These cards are {}: a play has cards of one face, and jokers.",
                names.join(" and ")
            ))
        }
    }
}

/// Checks that a deck has these cards.
fn check_deck(rules: &RuleSet, counts: &Counts) -> Result<(), Broken> {
    let of_deck = |kind: usize| match kind {
        JOKER => rules.jokers(),
        kind if kind < usize::from(rules.faces()) => u8::try_from(kind + 1).unwrap_or(u8::MAX),
        _ => 0,
    };
    match (0..=JOKER).find(|kind| counts[*kind] > of_deck(*kind)) {
        Some(kind) => Err((
            ViolatedRule::Cards,
            format!(
                "These are {} {}, but the deck has {}.",
                counts[kind],
                kind_text(kind),
                of_deck(kind)
            ),
        )),
        None => Ok(()),
    }
}

/// Checks a play against what a play must be now.
pub(crate) fn check_play(
    rules: &RuleSet,
    required: &PlayRequirement,
    action: Action,
    golden: Option<bool>,
) -> Result<(), Broken> {
    let top = rules.faces();
    let fewest = required.fewest_cards;
    match action {
        Action::Pass if !required.may_pass && required.is_opening() => Err((
            ViolatedRule::Pass,
            "The first turn of a Shift must be a play.".into(),
        )),
        Action::Pass if !required.may_pass => Err((
            ViolatedRule::Pass,
            "Nobody played in the last pizzas: this turn must be a play.".into(),
        )),
        Action::Play { face, .. } if required.is_opening() && face.get() != top => Err((
            ViolatedRule::Opening,
            format!("The Shift is opened with {top}s, the Golden {top} among them."),
        )),
        Action::LoneJoker if required.is_opening() => Err((
            ViolatedRule::Opening,
            format!("The Shift is opened with {top}s, the Golden {top} among them."),
        )),
        Action::Play { .. } if required.golden_card && golden == Some(false) => Err((
            ViolatedRule::Opening,
            format!("The Golden {top} must be among the cards that open the Shift."),
        )),
        Action::Play { .. } if !required.golden_card && golden == Some(true) => Err((
            ViolatedRule::Cards,
            format!("The Golden {top} was played at the start of the Shift."),
        )),
        Action::LoneJoker if !required.lone_joker => Err((
            ViolatedRule::Face,
            "A joker alone can only start a pizza.".into(),
        )),
        Action::Play { face, .. } if face.get() > required.highest_face => {
            Err((ViolatedRule::Face, too_high(required.highest_face)))
        }
        Action::Play {
            quantity, jokers, ..
        } if quantity + jokers < fewest => Err((
            ViolatedRule::Size,
            format!(
                "That pizza has {fewest} cards: a play needs at least as many, jokers included."
            ),
        )),
        _ => Ok(()),
    }
}

fn too_high(highest: u8) -> String {
    let shown = highest + 1;
    match highest {
        0 => "That pizza already shows a 1, which nothing beats: only a pass is possible.".into(),
        1 => "That pizza already shows 2s: a play must be the 1.".into(),
        _ => format!("That pizza already shows {shown}s: a play must be {highest} or lower."),
    }
}

/// The cards of a hand or gift. `golden`: whether the Golden card is among them, if that is known
/// otherwise.
pub(crate) fn as_cards(
    rules: &RuleSet,
    seen: &SeenCards,
    golden: Option<bool>,
) -> Result<Cards, Broken> {
    check_deck(rules, &seen.counts)?;
    let top = usize::from(rules.faces()) - 1;
    let golden = match (seen.golden, golden, seen.counts[top]) {
        (_, _, 0) => seen.golden.unwrap_or(false),
        (Some(golden), _, _) | (None, Some(golden), _) => golden,
        (None, None, count) if count == rules.faces() => true,
        (None, None, _) => {
            return Err((
                ViolatedRule::Cards,
                format!(
                    "Say whether the Golden {} is among these cards.",
                    rules.faces()
                ),
            ));
        }
    };
    cards_of(rules, &seen.counts, golden).ok_or_else(|| {
        (
            ViolatedRule::Cards,
            format!("No deck has {} cards like these.", size_of(&seen.counts)),
        )
    })
}
