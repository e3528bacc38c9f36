//! Values as Python's `repr` writes them and `ast.literal_eval` reads them, and names that can be the keys of a dictionary.

use std::fmt::Write as _;

/// `True` or `False`.
pub(super) fn boolean(value: bool) -> &'static str {
    if value { "True" } else { "False" }
}

/// A string in single quotes.
pub(super) fn text(value: &str) -> String {
    let mut quoted = String::from("'");
    for letter in value.chars() {
        match letter {
            '\\' => quoted.push_str("\\\\"),
            '\'' => quoted.push_str("\\'"),
            letter if letter.is_control() => {
                write!(quoted, "\\U{:08x}", u32::from(letter)).expect("a String takes everything");
            }
            letter => quoted.push(letter),
        }
    }
    quoted.push('\'');
    quoted
}

/// A list of values that are written already.
pub(super) fn list(values: impl IntoIterator<Item: ToString>) -> String {
    let values: Vec<String> = values.into_iter().map(|value| value.to_string()).collect();
    format!("[{}]", values.join(", "))
}

/// A dictionary from names to values that are written already.
pub(super) fn dictionary<'a>(
    entries: impl IntoIterator<Item = (&'a str, impl ToString)>,
) -> String {
    let entries: Vec<String> = entries
        .into_iter()
        .map(|(name, value)| format!("{}: {}", text(name), value.to_string()))
        .collect();
    format!("{{{}}}", entries.join(", "))
}

/// The names, changed where one is empty, is `taken` or stands twice: then the seat is added to it.
pub(super) fn unique_names(names: &[&str], taken: &str) -> Vec<String> {
    let mut unique: Vec<String> = Vec::with_capacity(names.len());
    for (seat, name) in names.iter().enumerate() {
        let repeated = names.iter().filter(|other| *other == name).count() > 1;
        let mut candidate = if repeated || name.is_empty() || *name == taken {
            format!("{name} (seat {seat})").trim_start().to_owned()
        } else {
            (*name).to_owned()
        };
        // Somebody may bear the very name that was made for another.
        while unique.contains(&candidate) {
            candidate.push('\'');
        }
        unique.push(candidate);
    }
    unique
}

#[cfg(test)]
mod tests {
    use crate::python::*;

    #[test]
    fn python_reads_it() {
        assert_eq!(text("it's a \\ and\n"), r"'it\'s a \\ and\U0000000a'");
        assert_eq!(list([1, 2]), "[1, 2]");
        assert_eq!(list([text("a")]), "['a']");
        assert_eq!(dictionary([("a", 1), ("b", 2)]), "{'a': 1, 'b': 2}");
    }

    #[test]
    fn every_player_has_a_name_of_its_own() {
        let table: &[(&[&str], &[&str])] = &[
            (&["a", "b"], &["a", "b"]),
            (&["a", "a", "b"], &["a (seat 0)", "a (seat 1)", "b"]),
            (&["", "SYSTEM"], &["(seat 0)", "SYSTEM (seat 1)"]),
            (
                &["a (seat 1)", "a", "a"],
                &["a (seat 1)", "a (seat 1)'", "a (seat 2)"],
            ),
        ];
        for (names, expected) in table {
            assert_eq!(unique_names(names, "SYSTEM"), *expected);
        }
    }
}
