//! Python literals, readable by `ast.literal_eval`, and unique names for dictionary keys.

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
                write!(quoted, "\\U{:08x}", u32::from(letter))
                    .expect("writing to a String succeeds");
            }
            letter => quoted.push(letter),
        }
    }
    quoted.push('\'');
    quoted
}

/// A list of literals.
pub(super) fn list(values: impl IntoIterator<Item: ToString>) -> String {
    let values: Vec<String> = values.into_iter().map(|value| value.to_string()).collect();
    format!("[{}]", values.join(", "))
}

/// A dictionary from names to literals.
pub(super) fn dictionary<'a>(
    entries: impl IntoIterator<Item = (&'a str, impl ToString)>,
) -> String {
    let entries: Vec<String> = entries
        .into_iter()
        .map(|(name, value)| format!("{}: {}", text(name), value.to_string()))
        .collect();
    format!("{{{}}}", entries.join(", "))
}

/// Makes names unique: adds the seat to those that are empty, duplicate or equal to `taken`.
pub(super) fn unique_names(names: &[&str], taken: &str) -> Vec<String> {
    let mut unique: Vec<String> = Vec::with_capacity(names.len());
    for (seat, name) in names.iter().enumerate() {
        let repeated = names.iter().filter(|other| *other == name).count() > 1;
        let mut candidate = if repeated || name.is_empty() || *name == taken {
            format!("{name} (seat {seat})").trim_start().to_owned()
        } else {
            (*name).to_owned()
        };
        // Another player may already have the resulting name.
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
    fn literals_are_valid_python() {
        assert_eq!(text("it's a \\ and\n"), r"'it\'s a \\ and\U0000000a'");
        assert_eq!(list([1, 2]), "[1, 2]");
        assert_eq!(list([text("a")]), "['a']");
        assert_eq!(dictionary([("a", 1), ("b", 2)]), "{'a': 1, 'b': 2}");
    }

    #[test]
    fn names_are_unique() {
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
