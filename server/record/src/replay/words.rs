//! Where two messages differ, in words: the first field in which what stands in a record is not what must stand there. Fields are named as
//! in the record's file, because that is where a person will look for them.

use serde::Serialize;
use serde_json::{Map, Value};

/// Most characters shown of a value.
const MAX_SHOWN: usize = 120;

/// The first field in which two messages differ, what stands there and what must; `None` if they are equal.
pub(super) fn difference<M: Serialize + PartialEq>(found: &M, right: &M) -> Option<String> {
    if found == right {
        return None;
    }
    let said = match (serde_json::to_value(found), serde_json::to_value(right)) {
        (Ok(found), Ok(right)) => differing(String::new(), Some(&found), Some(&right)),
        // A number that its field does not know has no JSON form.
        _ => None,
    };
    Some(said.unwrap_or_else(|| "a field holds a number that it does not know".into()))
}

/// The words for one field that is not right.
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

/// The names of both objects: first those that must be there.
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

/// A value in few characters. One that is left out is what its neighbour's kind of value is by default.
fn shown(value: Option<&Value>, beside: Option<&Value>) -> String {
    let text = match (value, beside) {
        (Some(Value::Object(_)), _) => "there".to_owned(),
        (Some(Value::Array(values)), _) if values.iter().any(Value::is_object) => {
            format!("a list of {}", values.len())
        }
        (Some(value), _) => value.to_string(),
        (None, Some(Value::Number(_))) => "0".to_owned(),
        (None, Some(Value::String(text))) if text.parse::<u64>().is_ok() => "\"0\"".to_owned(),
        (None, Some(Value::Bool(_))) => "false".to_owned(),
        (None, Some(Value::Array(_))) => "[]".to_owned(),
        (None, _) => "left out".to_owned(),
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
        .unwrap_or_else(|| "of no known kind".into())
}
