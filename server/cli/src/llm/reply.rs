//! What a language model answers: an action and a reason, found in text that may have more around
//! it.

use serde_json::Value;

use crate::language::cards;

/// The members of the object that a model is asked for.
const ACTION: &str = "action";
const REASON: &str = "reason";
/// How many braces are tried, from the end: a model that explains itself does so before its answer.
const MAX_BRACES: usize = 64;

/// An answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Reply {
    /// The action, legal or not.
    pub(super) action: u32,
    /// The reason; empty if there is none.
    pub(super) reason: String,
}

/// The last object with an action in a text, or an action alone, or what follows the last word
/// "action". An action is named by its id, or by its cards as `by_cards` knows them. `None`: there is
/// none.
pub(super) fn parse(text: &str, by_cards: impl Fn(&str) -> Option<u32>) -> Option<Reply> {
    let named = |name: &str| id(name).or_else(|| by_cards(name.trim()));
    let alone = |action| Reply {
        action,
        reason: String::new(),
    };
    if let Some(action) = named(text) {
        return Some(alone(action));
    }
    let mut braces = text.rmatch_indices('{').take(MAX_BRACES);
    let object = braces.find_map(|(at, _)| {
        let mut values = serde_json::Deserializer::from_str(&text[at..]).into_iter::<Value>();
        of_object(&values.next()?.ok()?, named)
    });
    object.or_else(|| in_words(text).map(alone))
}

/// An id in a text: `a84`, `84`, `84.0`.
fn id(text: &str) -> Option<u32> {
    let text = cards::id_in(text.trim());
    let whole = match text.split_once('.') {
        Some((whole, zeros)) if zeros.bytes().all(|digit| digit == b'0') => whole,
        Some(_) => return None,
        None => text,
    };
    whole.parse().ok()
}

fn of_object(value: &Value, named: impl Fn(&str) -> Option<u32>) -> Option<Reply> {
    let action = match value.get(ACTION)? {
        Value::String(name) => named(name)?,
        number @ Value::Number(_) => id(&number.to_string())?,
        _ => return None,
    };
    let reason = value.get(REASON).and_then(Value::as_str);
    Some(Reply {
        action,
        reason: reason.unwrap_or_default().to_owned(),
    })
}

/// The id after the last word "action" of a text without an object: "I play action a84."
fn in_words(text: &str) -> Option<u32> {
    let text = text.to_ascii_lowercase();
    let (_, after) = text.rsplit_once(ACTION).filter(|_| !text.contains('{'))?;
    let after = after.trim_start_matches([' ', ':', '=', '*', '`', '"', '#']);
    let number = cards::id_in(after);
    let is_number = |it: char| it.is_ascii_digit() || it == '.';
    let end = number.find(|it| !is_number(it)).unwrap_or(number.len());
    id(number[..end].trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sevens(cards: &str) -> Option<u32> {
        (cards == "2x7 J").then_some(67)
    }

    #[test]
    fn the_last_action_of_a_text_counts() {
        let cases = [
            (r#"{"action": "a84", "reason": "low"}"#, Some((84, "low"))),
            (r#"{"action": 84, "reason": "low"}"#, Some((84, "low"))),
            ("A84", Some((84, ""))),
            ("I play action a84.", Some((84, ""))),
            (
                "```json\n{\"reason\": \"a {b\", \"action\": \"7\"}\n```",
                Some((7, "a {b")),
            ),
            (
                r#"<think>{"action": 1} or 2?</think> {"action": 2}"#,
                Some((2, "")),
            ),
            (" 199\n", Some((199, ""))),
            (r#"{"move": {"action": 5}}"#, Some((5, ""))),
            (r#"{"action": 1} {"reason": "none"}"#, Some((1, ""))),
            ("84.0", Some((84, ""))),
            (r#"{"action": 84.0}"#, Some((84, ""))),
            ("2x7 J", Some((67, ""))),
            (
                r#"{"action": "2x7 J", "reason": "sevens"}"#,
                Some((67, "sevens")),
            ),
            ("I play action 84.", Some((84, ""))),
            ("**Action: 84**", Some((84, ""))),
            ("I would play 84.", None),
            ("My action is a pass.", None),
            ("Action 4.5", None),
            (r#"{"action": -1}"#, None),
            (r#"{"action": 4.5}"#, None),
            (r#"{"action": 99999999999}"#, None),
            (r#"{"action": 84"#, None),
            ("", None),
        ];
        for (text, expected) in cases {
            let expected = expected.map(|(action, reason)| Reply {
                action,
                reason: reason.to_owned(),
            });
            assert_eq!(parse(text, sevens), expected, "{text}");
        }
        assert_eq!(parse(&"{".repeat(1_000_000), sevens), None);
    }
}
