//! The tools: their names, what a model reads about them, and their arguments. The schemas are
//! written by hand, because a model reads them all, and generated ones are twice as long.

use rmcp::model::{JsonObject, Tool, ToolAnnotations};
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};
use serde_json::{Value, json};

use chefshat_cli::language::cards;

/// Arguments of `create_room`.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Create {
    pub(super) opponents: Option<String>,
    pub(super) name: Option<String>,
}

/// Arguments of `join_room`.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Join {
    pub(super) join_code: Option<String>,
    pub(super) name: Option<String>,
    #[serde(deserialize_with = "whole")]
    pub(super) seat: Option<u32>,
}

/// Arguments of tools about a table.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct AtTable {
    pub(super) table: Option<String>,
}

/// Arguments of `wait_for_turn`.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Wait {
    #[serde(deserialize_with = "whole")]
    pub(super) after_sequence: Option<u64>,
    pub(super) skip_forced: bool,
    pub(super) table: Option<String>,
}

/// Arguments of `play`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Play {
    #[serde(deserialize_with = "whole")]
    pub(super) decision: u64,
    #[serde(deserialize_with = "action")]
    pub(super) action: u32,
    #[serde(default)]
    pub(super) reason: Option<String>,
    #[serde(default)]
    pub(super) wait: bool,
    #[serde(default)]
    pub(super) skip_forced: bool,
    #[serde(default)]
    pub(super) table: Option<String>,
}

/// Arguments of `express`.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Express {
    pub(super) label: Option<String>,
    pub(super) words: Option<String>,
    pub(super) valence: Option<f32>,
    pub(super) arousal: Option<f32>,
    pub(super) table: Option<String>,
}

/// Reads a whole number as models write it: 199, 199.0 or "199"; or null, where it may be left out.
fn whole<'de, D, N>(deserializer: D) -> Result<N, D::Error>
where
    D: Deserializer<'de>,
    N: for<'v> Deserialize<'v>,
{
    let mut value = Value::deserialize(deserializer)?;
    if let Value::String(text) = &value
        && let Ok(number) = serde_json::from_str::<serde_json::Number>(text.trim())
    {
        value = Value::Number(number);
    }
    if let Some(number) = value.as_f64().filter(|number| number.fract() == 0.0)
        && !value.is_u64()
        && (0.0..=u32::MAX.into()).contains(&number)
    {
        value = Value::from(number as u64);
    }
    N::deserialize(&value).map_err(|_| D::Error::custom(format!("{value} is not a whole number")))
}

/// Reads the id of an action: "a84", or a whole number as models write it.
fn action<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
    let mut value = Value::deserialize(deserializer)?;
    if let Value::String(text) = &mut value {
        *text = cards::id_in(text.trim()).to_owned();
    }
    whole(value).map_err(D::Error::custom)
}

/// All tools. `must_name_table`: several clients may share the server.
pub(super) fn all(must_name_table: bool) -> Vec<Tool> {
    let table = json!({"type": "string", "description": match must_name_table {
        true => "handle from join_room",
        false => "handle from join_room; not needed with one seat",
    }});
    let define = |name: &'static str,
                  about: &'static str,
                  changes: bool,
                  required: &[&str],
                  fields: Value| {
        let mut fields = fields;
        let mut required: Vec<&str> = required.to_vec();
        if !["list_rooms", "create_room", "join_room"].contains(&name) {
            fields["table"] = table.clone();
            if must_name_table {
                required.push("table");
            }
        }
        let mut schema = json!({"type": "object", "properties": fields});
        if !required.is_empty() {
            schema["required"] = json!(required);
        }
        let hints = ToolAnnotations::new()
            .read_only(!changes)
            .open_world(false)
            .destructive(name == "leave");
        Tool::new(name, about, object(schema)).with_annotations(hints)
    };
    let skip_forced = json!({
        "type": "boolean",
        "description": "play for you where only one action is legal",
    });
    vec![
        define(
            "create_room",
            "Begin a game of your own against three built-in agents. Takes a seat, as join_room.",
            true,
            &[],
            json!({
                "opponents": {"type": "string", "description": "random, greedy (default) or trained"},
                "name": {"type": "string", "description": "your display name"},
            }),
        ),
        define(
            "list_rooms",
            "Rooms of the server with their state and free seats.",
            false,
            &[],
            json!({}),
        ),
        define(
            "join_room",
            "Take a seat. Returns the handle of the table.",
            true,
            &[],
            json!({
                "join_code": {"type": "string", "description": "from the host; not needed if this program was started with one"},
                "name": {"type": "string", "description": "your display name"},
                "seat": {"type": "integer", "description": "from 0; default: the first free one"},
            }),
        ),
        define(
            "wait_for_turn",
            "Wait up to 25 s for your turn. Returns what happened after event after_sequence (default: after what you were last shown), and your legal actions if it is your turn. Call again until the game is over.",
            false,
            &[],
            json!({"after_sequence": {"type": "integer"}, "skip_forced": skip_forced}),
        ),
        define(
            "get_table",
            "The whole table as you know it: hand, board, points, cards played, legal actions.",
            false,
            &[],
            json!({}),
        ),
        define(
            "play",
            "Answer the open decision with the id of a legal action. An illegal one is an error that lists the legal ones; it counts as an attempt.",
            true,
            &["decision", "action"],
            json!({
                "decision": {"type": "integer", "description": "number of the open decision"},
                "action": {"type": "string", "description": "id of a legal action, such as a84"},
                "reason": {"type": "string", "description": "recorded with the decision, hidden from others until the game is over"},
                "wait": {"type": "boolean", "description": "then do as wait_for_turn"},
                "skip_forced": skip_forced,
            }),
        ),
        define(
            "express",
            "Show the table a feeling, or say something. Everybody there sees it.",
            true,
            &[],
            json!({
                "label": {"type": "string", "description": "such as joy, surprise, annoyance"},
                "words": {"type": "string", "description": "to say, at most 80 characters"},
                "valence": {"type": "number", "description": "-1 to 1"},
                "arousal": {"type": "number", "description": "-1 to 1"},
            }),
        ),
        define(
            "leave",
            "Leave the table for good. In a running game a built-in agent plays on for you.",
            true,
            &[],
            json!({}),
        ),
    ]
}

fn object(schema: Value) -> JsonObject {
    match schema {
        Value::Object(object) => object,
        _ => JsonObject::new(),
    }
}
