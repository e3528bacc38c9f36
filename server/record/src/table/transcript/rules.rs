//! The rule set of a transcript: a preset, and fields that differ from it.

use chefshat_proto::v1;

/// The rule set that a text asks for: a preset, then fields of the rule set with their values.
pub(super) fn rules(text: &str) -> Result<v1::RuleSet, String> {
    let mut words = text.split_whitespace().peekable();
    let preset = words
        .next_if(|word| !word.contains('='))
        .unwrap_or_default();
    let mut rules = v1::RuleSet {
        preset: preset.to_owned(),
        ..v1::RuleSet::default()
    };
    for word in words {
        let (field, value) = word.split_once('=').ok_or_else(|| {
            format!("{word:?} is not a field with its value, such as target_shifts=1")
        })?;
        let wrong = || format!("{value:?} is not a value of {field}");
        let number = || value.parse::<u32>().map_err(|_| wrong());
        let on = |yes: &str, no: &str| match value {
            value if value == yes => Ok(Some(true)),
            value if value == no => Ok(Some(false)),
            _ => Err(wrong()),
        };
        match field {
            "players" => rules.players = Some(number()?),
            "faces" => rules.faces = Some(number()?),
            "jokers" => rules.jokers = Some(number()?),
            "target_points" => rules.stop = Some(v1::rule_set::Stop::TargetPoints(number()?)),
            "target_shifts" => rules.stop = Some(v1::rule_set::Stop::TargetShifts(number()?)),
            "points" => {
                let points = value.split(['/', ',']).map(str::parse);
                rules.points = points.collect::<Result<_, _>>().map_err(|_| wrong())?;
            }
            "exchange" => rules.exchange = on("on", "off")?,
            "special_actions" => rules.special_actions = on("on", "off")?,
            "opening_pass" => rules.opening_pass = on("allowed", "forbidden")?,
            "opening" => {
                rules.opening = match value {
                    "golden" => v1::Opening::Golden,
                    "any_top_face" => v1::Opening::AnyTopFace,
                    _ => return Err(wrong()),
                }
                .into();
            }
            "pass_scope" => {
                rules.pass_scope = match value {
                    "pizza" => v1::PassScope::Pizza,
                    "turn" => v1::PassScope::Turn,
                    _ => return Err(wrong()),
                }
                .into();
            }
            "max_idle_pizzas" => rules.max_idle_pizzas = Some(number()?),
            "max_turns" => rules.max_turns = Some(number()?),
            _ => return Err(format!("the rule set has no field {field:?}")),
        }
    }
    Ok(rules)
}
