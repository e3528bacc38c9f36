//! Checks of single settings. A problem names the field by its path in the protocol.

use std::collections::BTreeSet;
use std::fmt::Display;
use std::ops::RangeInclusive;

use thiserror::Error;

/// Maximum length of an identifier, in characters.
const MAX_IDENTIFIER: usize = 64;

/// An invalid setting.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{field}: {problem}")]
pub struct SettingsProblem {
    /// The field's path in the protocol, such as `conditions[1].id`.
    pub field: String,
    /// What is wrong with it.
    pub problem: String,
}

pub(crate) type Checked = Result<(), SettingsProblem>;

pub(crate) fn refuse(field: impl Into<String>, problem: impl Into<String>) -> Checked {
    let (field, problem) = (field.into(), problem.into());
    Err(SettingsProblem { field, problem })
}

/// A number must be in a range.
pub(crate) fn within<T: PartialOrd + Display>(
    field: &str,
    number: T,
    range: RangeInclusive<T>,
) -> Checked {
    if range.contains(&number) {
        return Ok(());
    }
    let (least, most) = (range.start(), range.end());
    refuse(field, format!("{number} is not within {least}..={most}"))
}

/// A text must have this number of characters, none of which is a control character other than a
/// line break or tab.
pub(crate) fn characters(field: &str, text: &str, range: RangeInclusive<usize>) -> Checked {
    let count = text.chars().count();
    if !range.contains(&count) {
        let (least, most) = (range.start(), range.end());
        let problem = format!("{count} characters are not within {least}..={most}");
        return refuse(field, problem);
    }
    if has_control_characters(text) {
        return refuse(field, "control characters are not allowed");
    }
    Ok(())
}

pub(crate) fn has_control_characters(text: &str) -> bool {
    text.chars()
        .any(|letter| letter.is_control() && letter != '\n' && letter != '\t')
}

/// An identifier becomes a value or a column of exported data.
pub(crate) fn identifier(field: &str, text: &str) -> Checked {
    if (1..=MAX_IDENTIFIER).contains(&text.len()) && text.chars().all(is_of_identifier) {
        return Ok(());
    }
    let problem = format!("{text:?} is not 1..={MAX_IDENTIFIER} letters, digits, `_`, `-`, `.`");
    refuse(field, problem)
}

/// Whether identifiers have this character.
pub(crate) fn is_of_identifier(letter: char) -> bool {
    letter.is_ascii_alphanumeric() || "_-.".contains(letter)
}

/// Names must differ. `field_of` has the field of the name with this index.
pub(crate) fn unique<'t>(
    names: impl IntoIterator<Item = &'t str>,
    field_of: impl Fn(usize) -> String,
) -> Checked {
    let mut seen = BTreeSet::new();
    for (index, name) in names.into_iter().enumerate() {
        if !seen.insert(name) {
            return refuse(field_of(index), format!("{name:?} occurs twice"));
        }
    }
    Ok(())
}
