//! What a language model answers: an action and a reason, found in text that may have more around
//! it.

use serde_json::Value;

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

/// The last object with an action in a text, or a number alone. `None`: there is neither.
pub(super) fn parse(text: &str) -> Option<Reply> {
    if let Ok(action) = text.trim().parse() {
        let reason = String::new();
        return Some(Reply { action, reason });
    }
    let braces = text.rmatch_indices('{').take(MAX_BRACES);
    braces.into_iter().find_map(|(at, _)| {
        let mut values = serde_json::Deserializer::from_str(&text[at..]).into_iter::<Value>();
        of_object(&values.next()?.ok()?)
    })
}

fn of_object(value: &Value) -> Option<Reply> {
    let action = match value.get(ACTION)? {
        Value::String(number) => number.trim().parse().ok()?,
        number => u32::try_from(number.as_u64()?).ok()?,
    };
    let reason = value.get(REASON).and_then(Value::as_str);
    Some(Reply {
        action,
        reason: reason.unwrap_or_default().to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_action_of_a_text_counts() {
        let cases = [
            (r#"{"action": 84, "reason": "low"}"#, Some((84, "low"))),
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
            ("I would play 84.", None),
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
            assert_eq!(parse(text), expected, "{text}");
        }
        assert_eq!(parse(&"{".repeat(1_000_000)), None);
    }
}
