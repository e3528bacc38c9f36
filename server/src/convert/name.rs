//! Names to show, of rooms, tournaments and those who play: which are taken.

use chefshat_records::convert::FieldProblem;

use crate::config::MAX_NAME_CHARS;

/// Checks a name of at least so many characters.
///
/// # Errors
/// It is too short or too long, or looks like another.
pub fn check_name(field: &'static str, name: &str, least: usize) -> Result<(), FieldProblem> {
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
    Ok(())
}

/// Whether a character shows nothing of itself: joiners, marks of direction, fillers, tags (Unicode's category Cf and the Hangul fillers).
fn is_unseen(letter: char) -> bool {
    matches!(letter,
        '\u{ad}' | '\u{61c}' | '\u{115f}' | '\u{1160}' | '\u{180e}' | '\u{200b}'..='\u{200f}'
        | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{3164}' | '\u{feff}' | '\u{ffa0}'
        | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e0fff}')
}
