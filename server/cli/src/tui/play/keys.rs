//! The keys of cards. `app` handles all others.

use crate::narration::hand::Stack;

/// Keys of the faces, from 1. Faces above 10 have letters without another meaning, which are drawn
/// on the card.
const FACE_KEYS: [char; 15] = [
    '1', '2', '3', '4', '5', '6', '7', '8', '9', '0', 'a', 'b', 'c', 'f', 'g',
];
/// Selects the jokers; `j` adds a joker to the selected cards.
const JOKERS_KEY: char = 'J';

/// The key that selects a stack.
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

/// Notice for the key of cards that are not in the hand.
pub(super) fn not_held(key: char) -> String {
    let face = FACE_KEYS.iter().position(|other| *other == key);
    match face {
        Some(face) => format!("you have no {}", face + 1),
        None => "you have no joker".to_owned(),
    }
}
