//! Names to show, of rooms, tournaments and those who play: which are taken.

use chefshat_record::convert::FieldProblem;

use crate::config::MAX_NAME_CHARS;

/// A name to show, without the spaces around it.
///
/// # Errors
/// It has fewer than `least` or too many characters, or looks like another.
pub fn name_to_show(field: &'static str, name: &str, least: usize) -> Result<String, FieldProblem> {
    let name = name.trim();
    let length = name.chars().count();
    if !(least..=MAX_NAME_CHARS).contains(&length) {
        return Err(FieldProblem::new(
            field,
            format!("{length} characters are not in {least}..={MAX_NAME_CHARS}"),
        ));
    }
    if name
        .chars()
        .any(|letter| letter.is_control() || is_unseen(letter))
    {
        return Err(FieldProblem::new(
            field,
            "characters that cannot be seen, or turn the direction of writing, would make it look like another name",
        ));
    }
    Ok(name.to_owned())
}

/// Whether a character shows nothing of itself: joiners, marks of direction, fillers, tags (Unicode's category Cf, the
/// Hangul fillers, the joiner of graphemes and the empty pattern of Braille).
fn is_unseen(letter: char) -> bool {
    matches!(letter,
        '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}' | '\u{1160}' | '\u{180e}' | '\u{200b}'..='\u{200f}'
        | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{2800}' | '\u{3164}' | '\u{feff}' | '\u{ffa0}'
        | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e0fff}')
}
