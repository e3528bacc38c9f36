//! Checks the names of rooms, tournaments and participants.

use std::ops::RangeInclusive;

use chefshat_record::convert::FieldProblem;
use chefshat_record::words::has_invisible;
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
    if has_invisible(text) {
        return Err(FieldProblem::new(
            field,
            "invisible characters and direction marks are not allowed: they make names look alike",
        ));
    }
    Ok(text.to_owned())
}

#[cfg(test)]
mod tests {
    use crate::convert::{checked_name, name_fingerprint};

    #[test]
    fn names_that_look_like_others_are_refused() {
        for name in ["Ada", "Zoë", "料理長", "Ada ☕\u{fe0f}", "\u{2764}\u{fe0f}"] {
            assert_eq!(checked_name("name", name, 1).ok().as_deref(), Some(name));
        }
        for invisible in [
            "\u{fe00}",
            "\u{fe0f}",
            "\u{180b}",
            "\u{17b4}",
            "\u{1d173}",
            "\u{1bca0}",
            "\u{200d}",
            "\u{e0041}",
            "\u{3164}",
            "\u{7}",
        ] {
            for name in [
                format!("Ada{invisible}"),
                format!("A{invisible}da"),
                format!("☕{invisible}{invisible}"),
            ] {
                assert!(checked_name("name", &name, 1).is_err(), "{name:?}");
            }
        }
    }

    #[test]
    fn a_fingerprint_depends_on_the_name_and_its_key_alone() {
        let fingerprint = name_fingerprint("Ada", &[7; 32]);
        // Recorded games contain it: the hash of the same bytes, made elsewhere.
        assert_eq!(fingerprint, "eff42f032b0bc531");
        assert_ne!(name_fingerprint("Bo", &[7; 32]), fingerprint);
        assert_ne!(name_fingerprint("Ada", &[8; 32]), fingerprint);
    }
}
