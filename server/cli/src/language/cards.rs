//! Cards, names and actions in the text form for a language model (docs/mcp.md).

use chefshat_client::v1;
use chefshat_engine::{Action, ActionId, ActionSpace, Mask};

use crate::narration::hand::Hand;
use crate::narration::view::GameView;

/// How the seat of the reader is called.
const YOU: &str = "you";
/// What marks the Golden card.
pub const GOLDEN: &str = "*";
/// A joker.
const JOKER: &str = "J";

/// A number of equal cards: `7`, `2x7`; empty for none.
fn stack(count: u32, card: &str) -> String {
    match count {
        0 => String::new(),
        1 => card.to_owned(),
        count => format!("{count}x{card}"),
    }
}

/// The cards of a play: `2x7 J`.
pub fn cards(face: u32, quantity: u32, jokers: u32, golden: bool) -> String {
    let golden = if golden { GOLDEN } else { "" };
    let stacks = [
        stack(quantity, &format!("{face}{golden}")),
        stack(jokers, JOKER),
    ];
    let stacks = stacks.into_iter().filter(|stack| !stack.is_empty());
    stacks.collect::<Vec<_>>().join(" ")
}

/// A hand, rarest first.
pub fn hand(hand: &Hand) -> String {
    let stacks = hand.stacks().into_iter().map(|it| match it.joker {
        true => stack(it.count.into(), JOKER),
        false => cards(it.face, it.count.into(), 0, it.golden),
    });
    stacks.collect::<Vec<_>>().join(" ")
}

/// The name of a seat for a reader at seat `me`.
pub fn name(view: &GameView, me: Option<u32>, seat: u32) -> String {
    match me == Some(seat) {
        true => YOU.to_owned(),
        false => view.name(seat),
    }
}

/// The name of a seat as the subject of a sentence in the third person.
pub fn subject(view: &GameView, me: Option<u32>, seat: u32) -> String {
    match me == Some(seat) {
        true => format!("{} ({YOU})", view.name(seat)),
        false => view.name(seat),
    }
}

/// An action in words; `special` is what `declare` declares.
pub fn action(space: ActionSpace, id: u32, special: v1::SpecialAction) -> String {
    let action = u16::try_from(id).ok().map(ActionId::new);
    let words = action.and_then(|id| space.decode(id)).map(|it| match it {
        Action::Play {
            face,
            quantity,
            jokers,
        } => cards(face.get().into(), quantity.into(), jokers.into(), false),
        Action::LoneJoker => JOKER.to_owned(),
        Action::Pass => "pass".to_owned(),
        Action::Give(face) => format!("give {}", face.get()),
        Action::GiveJoker => "give J".to_owned(),
        Action::Decline => "decline".to_owned(),
        Action::Declare => match special {
            v1::SpecialAction::FoodFight => "declare Food Fight".to_owned(),
            _ => "declare Dinner is Served".to_owned(),
        },
    });
    words.unwrap_or_else(|| "not an action".to_owned())
}

/// The legal actions of a decision, with their words.
fn legal(space: ActionSpace, request: &v1::DecisionRequest) -> Vec<(u32, String)> {
    let legal = Mask::from_bytes(&request.action_mask);
    let legal = legal.iter().flat_map(Mask::iter).map(|id| {
        let id = u32::from(id.index());
        (id, action(space, id, request.special_action()))
    });
    legal.collect()
}

/// What an id of an action begins with, so that it is not mistaken for a face.
const OF_ACTION: char = 'a';

/// The id of an action as a model reads it: `a84`.
pub fn id(action: u32) -> String {
    format!("{OF_ACTION}{action}")
}

/// The number of an id: of `a84`, or of a number alone.
pub fn id_in(word: &str) -> &str {
    word.strip_prefix([OF_ACTION, OF_ACTION.to_ascii_uppercase()])
        .unwrap_or(word)
}

/// The legal actions of a decision, each in a line: `a13=2x6`, `a199=pass`.
pub fn options(space: ActionSpace, request: &v1::DecisionRequest) -> String {
    let legal = legal(space, request).into_iter();
    let lines: Vec<String> = legal
        .map(|(id, words)| format!("{}={words}", self::id(id)))
        .collect();
    lines.join("\n")
}

/// The legal action with these words.
pub fn option_of(space: ActionSpace, request: &v1::DecisionRequest, words: &str) -> Option<u32> {
    let mut legal = legal(space, request).into_iter();
    legal.find_map(|(id, option)| (option == words).then_some(id))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cards, hands and actions are read as docs/mcp.md says.
    #[test]
    fn cards_are_counted_and_the_golden_card_is_marked() {
        let table = [
            (cards(7, 1, 0, false), "7"),
            (cards(7, 2, 1, false), "2x7 J"),
            (cards(11, 3, 2, true), "3x11* 2xJ"),
            (cards(12, 0, 1, false), "J"),
        ];
        for (words, expected) in table {
            assert_eq!(words, expected);
        }
        let held = Hand::of(11, &[11, 2, 11, 12, 5, 5], true);
        assert_eq!(hand(&held), "2 2x5 2x11* J");
        let space = ActionSpace::new(11).unwrap();
        let none = v1::SpecialAction::Unspecified;
        let table = [
            (19, none, "4 J"),
            (66, none, "2x7"),
            (198, none, "J"),
            (199, none, "pass"),
            (203, none, "give 4"),
            (211, none, "give J"),
            (212, none, "decline"),
            (213, v1::SpecialAction::FoodFight, "declare Food Fight"),
            (
                213,
                v1::SpecialAction::DinnerIsServed,
                "declare Dinner is Served",
            ),
            (214, none, "not an action"),
            (u32::MAX, none, "not an action"),
        ];
        for (id, special, expected) in table {
            assert_eq!(action(space, id, special), expected, "{id}");
        }
    }
}
