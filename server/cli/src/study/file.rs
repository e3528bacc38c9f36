//! The TOML file of a study: the fields of `StudySettings` by their names in the protocol. Values of
//! enums are written in short ("within"), seeds in hexadecimal digits. Long texts may be in files of
//! their own (`text_file`), and pictures are (`file`).

use std::fs;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use chefshat_proto::v1;
use chrono::DateTime;
use serde_json::{Map, Value};
use toml::de::{DeTable, DeValue};

use crate::CommandError;
use crate::toml_file;

/// Fields with values of enums, and the prefixes of their values.
const ENUMS: [(&str, &str); 12] = [
    ("left_over", "STUDY_LEFT_OVER_"),
    ("pointer", "STUDY_POINTER_"),
    ("order", "STUDY_ORDER_"),
    ("labels", "STUDY_LABELS_"),
    ("hide", "STUDY_HIDE_"),
    ("opening", "OPENING_"),
    ("pass_scope", "PASS_SCOPE_"),
    ("abort", "ABORT_POLICY_"),
    ("reward_scheme", "REWARD_SCHEME_"),
    ("reserved_for", "PARTICIPANT_KIND_"),
    ("kind", "PARTICIPANT_KIND_"),
    ("durability", "DURABILITY_"),
];
/// What the names of fields with times end with: milliseconds since the Unix epoch.
const TIME: &str = "_at_ms";
/// Fields with bytes.
const BYTES: [&str; 2] = ["seeds", "assignment_seed"];

/// Reads the settings of a study.
///
/// # Errors
/// The file cannot be read, is not TOML, or has a field that the protocol does not have.
pub(super) fn settings(path: &Path) -> Result<v1::StudySettings, CommandError> {
    let shown = path.display();
    let text = fs::read_to_string(path).map_err(|error| format!("{shown}: {error}"))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    parse(&text, folder).map_err(|problem| format!("{shown}: {problem}").into())
}

fn parse(text: &str, folder: &Path) -> Result<v1::StudySettings, String> {
    let table = toml_file::parse(text).map_err(toml_file::in_words)?;
    let json = object(table.get_ref(), folder)?;
    serde_json::from_value(Value::Object(json)).map_err(|error| error.to_string())
}

fn object(table: &DeTable<'_>, folder: &Path) -> Result<Map<String, Value>, String> {
    let mut fields = Map::new();
    for (key, value) in table {
        let key = key.get_ref().to_string();
        let value = value.get_ref();
        if key == "text_file" {
            let name = value.as_str().ok_or("text_file: give the name of a file")?;
            let text = fs::read_to_string(folder.join(name))
                .map_err(|error| format!("text_file {name:?}: {error}"))?;
            fields.insert("text".to_owned(), text.trim().into());
            continue;
        }
        if key == "file" {
            let name = value.as_str().ok_or("file: give the name of a picture")?;
            let data =
                fs::read(folder.join(name)).map_err(|error| format!("file {name:?}: {error}"))?;
            fields.insert("data".to_owned(), STANDARD.encode(data).into());
            continue;
        }
        let value = convert(&key, value, folder)?;
        fields.insert(key, value);
    }
    Ok(fields)
}

fn convert(key: &str, value: &DeValue<'_>, folder: &Path) -> Result<Value, String> {
    Ok(match value {
        DeValue::String(text) => word(key, text)?,
        DeValue::Integer(number) => {
            let digits = number.as_str().replace('_', "");
            let number = i64::from_str_radix(&digits, number.radix())
                .map_err(|_| format!("{key}: {digits} is too large"))?;
            number.into()
        }
        DeValue::Float(number) => {
            let number = number.as_str().parse::<f64>();
            number.map_err(|_| format!("{key}: not a number"))?.into()
        }
        DeValue::Boolean(set) => (*set).into(),
        DeValue::Datetime(time) if key.ends_with(TIME) => {
            let mut time = *time;
            if let Some(clock) = &mut time.time {
                clock.second.get_or_insert(0);
            }
            let time = DateTime::parse_from_rfc3339(&time.to_string());
            let problem = "give the time with its zone, such as 2031-05-01T18:00:00+02:00";
            let time = time.map_err(|_| format!("{key}: {problem}"))?;
            time.timestamp_millis().into()
        }
        DeValue::Datetime(_) => return Err(format!("{key}: it is no time")),
        DeValue::Array(items) => {
            // Labels of a condition are a value of an enum, those of an item a list of texts.
            let key = if key == "labels" { "" } else { key };
            let items = items
                .iter()
                .map(|item| convert(key, item.get_ref(), folder));
            Value::Array(items.collect::<Result<_, _>>()?)
        }
        // The keys are names of factors, not fields.
        DeValue::Table(levels) if key == "levels" => {
            let level = |value: &DeValue<'_>| value.as_str().map(Value::from);
            let levels = levels.iter().map(|(factor, value)| {
                let value = level(value.get_ref());
                let value = value.ok_or_else(|| format!("{key}: a level is a text"))?;
                Ok((factor.get_ref().to_string(), value))
            });
            Value::Object(levels.collect::<Result<_, String>>()?)
        }
        DeValue::Table(table) => Value::Object(object(table, folder)?),
    })
}

fn word(key: &str, text: &str) -> Result<Value, String> {
    if BYTES.contains(&key) {
        let bytes = hex::decode(text)
            .map_err(|_| format!("{key}: a seed has 64 hexadecimal digits, not {text:?}"))?;
        return Ok(STANDARD.encode(bytes).into());
    }
    let prefix = ENUMS.iter().find(|(name, _)| *name == key);
    Ok(match prefix {
        Some((_, prefix)) => format!("{prefix}{}", text.to_uppercase().replace('-', "_")).into(),
        None => text.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_written_in_short() {
        let text = r#"
            name = "n"
            order = "within"
            seeds = ["0000000000000000000000000000000000000000000000000000000000000001"]
            drop_out_after_ms = 60_000
            closes_at_ms = 2031-05-01T18:00:00.5+02:00
            groups = { size = 2, left_over = "agents" }
            device = { pointer = "fine", min_width = 1024 }
            [[conditions]]
            id = "a"
            labels = "players"
            hide = ["log", "pages"]
            levels = { kind = "calm" }
            rules = { target_shifts = 1 }
            policy = { abort = "never" }
            [[conditions.seats]]
            built_in_agent = "greedy"
            [[conditions.seats]]
            reserved_for = "robot"
            [[stages]]
            consent = { text = "I agree.", version = "1" }
            [[stages]]
            [stages.per_condition]
            stages = [{ games = { count = 2 } }]
        "#;
        let settings = parse(text, Path::new("")).expect("valid");
        assert_eq!(settings.order(), v1::StudyOrder::Within);
        assert_eq!(settings.seeds[0][31], 1);
        assert_eq!(settings.drop_out_after_ms, 60_000);
        let groups = settings.groups.as_ref().expect("they are set");
        assert_eq!(groups.left_over(), v1::StudyLeftOver::Agents);
        let device = settings.device.as_ref().expect("it is set");
        assert_eq!(device.pointer(), v1::StudyPointer::Fine);
        assert_eq!(settings.closes_at_ms, 1_935_417_600_500);
        let minutes = parse("closes_at_ms = 2031-05-01T18:00+02:00", Path::new(""));
        assert_eq!(minutes.expect("valid").closes_at_ms, 1_935_417_600_000);
        let condition = &settings.conditions[0];
        assert_eq!(condition.labels(), v1::StudyLabels::Players);
        assert_eq!(condition.hide().count(), 2);
        assert_eq!(condition.levels["kind"], "calm");
        assert_eq!(condition.seats.len(), 2);
        assert_eq!(settings.stages.len(), 2);
    }

    #[test]
    fn texts_and_pictures_are_in_files_beside_it() {
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join("hand.gif"), "GIF89a").expect("it is written");
        fs::write(folder.path().join("consent.md"), "I agree.\n").expect("it is written");
        let text = r#"
            pictures = [{ name = "hand", file = "hand.gif" }]
            stages = [{ consent = { text_file = "consent.md", version = "1" } }]
        "#;
        let settings = parse(text, folder.path()).expect("valid");
        assert_eq!(settings.pictures[0].data, "GIF89a");
        let Some(v1::study_stage::Stage::Consent(consent)) = &settings.stages[0].stage else {
            panic!("it is a consent");
        };
        assert_eq!(consent.text, "I agree.");
    }

    #[test]
    fn the_examples_are_valid() {
        let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/studies");
        for (file, conditions) in [("example.toml", 2), ("pairs.toml", 4)] {
            let settings = settings(&docs.join(file)).expect("it is read");
            let complete = chefshat_server::convert::complete_settings(settings, || [1; 32], true);
            let complete = complete.expect("the server accepts it");
            assert_eq!(complete.conditions.len(), conditions);
            assert_eq!(complete.block_size as usize, conditions);
        }
    }

    #[test]
    fn a_problem_names_what_is_wrong() {
        for (text, expected) in [
            ("name = ", "line 1"),
            ("nam = \"x\"", "nam"),
            ("seeds = [\"12\", \"x\"]", "seeds"),
            ("order = \"sideways\"", "SIDEWAYS"),
            ("closes_at_ms = 2031-05-01T18:00:00", "with its zone"),
            ("closes_at_ms = 2031-05-01", "with its zone"),
            ("name = 2031-05-01T18:00:00Z", "no time"),
            (
                "stages = [{ text = { text_file = \"missing.md\" } }]",
                "missing.md",
            ),
            ("pictures = [{ file = \"missing.png\" }]", "missing.png"),
        ] {
            let problem = parse(text, Path::new("/nonexistent")).expect_err(text);
            assert!(problem.contains(expected), "{text}: {problem}");
        }
    }
}
