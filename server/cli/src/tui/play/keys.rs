//! Which key names which cards of a hand. What becomes of a key is decided in `app`.

use crate::narration::hand::Stack;

/// Keys of the faces from 1 on. Those that a digit cannot name have a letter that means nothing else; it is drawn on the card.
const FACE_KEYS: [char; 15] = [
    '1', '2', '3', '4', '5', '6', '7', '8', '9', '0', 'a', 'b', 'c', 'f', 'g',
];
/// The key of the jokers; `j` adds one to the cards that are picked.
const JOKERS_KEY: char = 'J';

/// The key that picks a stack.
pub(super) fn key_of(stack: Stack) -> Option<char> {
    if stack.joker {
        return Some(JOKERS_KEY);
    }
    let index = usize::try_from(stack.face).ok()?.checked_sub(1)?;
    FACE_KEYS.get(index).copied()
}

/// Whether a key names cards.
pub(super) fn names_cards(key: char) -> bool {
    key == JOKERS_KEY || FACE_KEYS.contains(&key)
}

/// What a person is told whose key names cards that are not in the hand.
pub(super) fn not_held(key: char) -> String {
    let face = FACE_KEYS.iter().position(|other| *other == key);
    match face {
        Some(face) => format!("you have no {}", face + 1),
        None => "you have no joker".to_owned(),
    }
}
