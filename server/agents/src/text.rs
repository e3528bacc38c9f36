//! Texts from outside in messages.

/// Most characters of a text from outside in a message.
const MAX_SHOWN: usize = 100;

/// The beginning of a text from outside, for a message.
pub fn shortened(text: &str) -> String {
    text.chars().take(MAX_SHOWN).collect()
}
