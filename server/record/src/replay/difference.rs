//! Describes the first difference between two messages, with fields named as in the record's file.

use serde::Serialize;
use serde_json::{Map, Value};

/// The most characters shown of a value.
const MAX_SHOWN: usize = 120;

/// The first field that differs, with both values; `None` if the messages are equal.
pub(super) fn difference<M: Serialize + PartialEq>(found: &M, expected: &M) -> Option<String> {
    if found == expected {
        return None;
    }
    let problem = match (serde_json::to_value(found), serde_json::to_value(expected)) {
        (Ok(found), Ok(expected)) => differing(String::new(), Some(&found), Some(&expected)),
        // An unknown enum value has no JSON form.
        _ => None,
    };
    Some(problem.unwrap_or_else(|| "a field has an unknown enum value".into()))
}

/// The message for one wrong field.
pub(super) fn must_be(field: &str, found: impl Into<Value>, right: impl Into<Value>) -> String {
    must_be_value(field, Some(&found.into()), Some(&right.into()))
}

fn differing(path: String, found: Option<&Value>, right: Option<&Value>) -> Option<String> {
    match (found, right) {
        (Some(Value::Object(found)), Some(Value::Object(right))) => {
            names(found, right).find_map(|name| {
                let inner = if path.is_empty() {
                    name.clone()
                } else {
                    format!("{path}.{name}")
                };
                differing(inner, found.get(name), right.get(name))
            })
        }
        (Some(Value::Array(found)), Some(Value::Array(right)))
            if found.len() == right.len() && found.iter().any(Value::is_object) =>
        {
            (0..found.len()).find_map(|index| {
                differing(
                    format!("{path}[{index}]"),
                    found.get(index),
                    right.get(index),
                )
            })
        }
        _ if found == right => None,
        _ => Some(must_be_value(&path, found, right)),
    }
}

/// The names of both objects, expected ones first.
fn names<'a>(
    found: &'a Map<String, Value>,
    right: &'a Map<String, Value>,
) -> impl Iterator<Item = &'a String> {
    let others = found.keys().filter(|name| !right.contains_key(*name));
    right.keys().chain(others)
}

fn must_be_value(field: &str, found: Option<&Value>, right: Option<&Value>) -> String {
    format!(
        "{field} is {} and must be {}",
        shown(found, right),
        shown(right, found)
    )
}

/// A value, shortened. An absent value is shown as the default of the other value's type.
fn shown(value: Option<&Value>, beside: Option<&Value>) -> String {
    let text = match (value, beside) {
        (Some(Value::Object(_)), _) => "present".to_owned(),
        (Some(Value::Array(values)), _) if values.iter().any(Value::is_object) => {
            format!("a list of {}", values.len())
        }
        (Some(value), _) => value.to_string(),
        (None, Some(Value::Number(_))) => "0".to_owned(),
        (None, Some(Value::String(text))) if text.parse::<u64>().is_ok() => "\"0\"".to_owned(),
        (None, Some(Value::Bool(_))) => "false".to_owned(),
        (None, Some(Value::Array(_))) => "[]".to_owned(),
        (None, _) => "absent".to_owned(),
    };
    if text.chars().count() <= MAX_SHOWN {
        return text;
    }
    let short: String = text.chars().take(MAX_SHOWN).collect();
    format!("{short}…")
}

/// The name of a game event's kind, as the record's file writes it.
pub(super) fn kind_name(event: &impl Serialize) -> String {
    const BESIDE: [&str; 3] = ["sequence", "elapsedMs", "rewards"];
    serde_json::to_value(event)
        .ok()
        .and_then(|event| {
            let names = event.as_object()?;
            names
                .keys()
                .find(|name| !BESIDE.contains(&name.as_str()))
                .cloned()
        })
        .unwrap_or_else(|| "of an unknown kind".into())
}
