//! Checks the names of rooms, tournaments and participants.

use std::ops::RangeInclusive;

use chefshat_record::convert::FieldProblem;
use sha2::{Digest as _, Sha256};

/// Longest name of a room or participant, characters.
pub const MAX_NAME_CHARS: usize = 64;

/// Checks a name and trims it.
///
/// # Errors
/// It has fewer than `least` or too many characters, or contains invisible characters.
pub fn checked_name(field: &'static str, name: &str, least: usize) -> Result<String, FieldProblem> {
    checked_text(field, name, least..=MAX_NAME_CHARS)
}

/// The fingerprint of a name and its key, 16 hexadecimal digits: the beginning of the SHA-256 of
/// "chefshat name", the key and the name.
pub fn name_fingerprint(name: &str, key: &[u8; 32]) -> String {
    let hash = Sha256::new()
        .chain_update(b"chefshat name")
        .chain_update(key)
        .chain_update(name)
        .finalize();
    hex::encode(&hash[..8])
}

/// Checks a line of text and trims it.
///
/// # Errors
/// Its number of characters is not in `length`, or it contains invisible characters.
pub(super) fn checked_text(
    field: &'static str,
    text: &str,
    length: RangeInclusive<usize>,
) -> Result<String, FieldProblem> {
    let text = text.trim();
    let characters = text.chars().count();
    if !length.contains(&characters) {
        return Err(FieldProblem::new(
            field,
            format!(
                "{characters} characters are not in {}..={}",
                length.start(),
                length.end()
            ),
        ));
    }
    if text
        .chars()
        .any(|letter| letter.is_control() || is_invisible(letter))
    {
        return Err(FieldProblem::new(
            field,
            "invisible characters and direction marks are not allowed: they make names look alike",
        ));
    }
    Ok(text.to_owned())
}

/// Whether a character is invisible: joiners, direction marks, fillers, tags (Unicode's category
/// Cf, the Hangul fillers, the grapheme joiner and the blank Braille pattern).
fn is_invisible(letter: char) -> bool {
    matches!(letter,
        '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}' | '\u{1160}' | '\u{180e}' | '\u{200b}'..='\u{200f}'
        | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{2800}' | '\u{3164}' | '\u{feff}' | '\u{ffa0}'
        | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e0fff}')
}

#[cfg(test)]
mod tests {
    use crate::convert::name_fingerprint;

    #[test]
    fn a_fingerprint_depends_on_the_name_and_its_key_alone() {
        let fingerprint = name_fingerprint("Ada", &[7; 32]);
        // Recorded games contain it: the hash of the same bytes, made elsewhere.
        assert_eq!(fingerprint, "eff42f032b0bc531");
        assert_ne!(name_fingerprint("Bo", &[7; 32]), fingerprint);
        assert_ne!(name_fingerprint("Ada", &[8; 32]), fingerprint);
    }
}
