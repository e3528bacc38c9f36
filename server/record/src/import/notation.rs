//! The values of a transcript's cells: cards, plays and the rule set.

use chefshat_engine::{Action, Cards, Face};
use chefshat_proto::v1;

use chefshat_referee::counts::{JOKER, NOTHING, index};

/// Parses cards as faces, `None` for a joker: numbers, `J`, and `G` for the Golden card.
pub(super) fn kinds(text: &str, faces: u8) -> Result<Vec<Option<Face>>, String> {
    text.split_whitespace()
        .map(|word| match word {
            "J" | "j" => Ok(None),
            "G" | "g" => Ok(Face::new(faces)),
            word => match word.parse().ok().and_then(Face::new) {
                Some(face) if face.get() <= faces => Ok(Some(face)),
                _ => Err(format!(
                    "{word:?} is not a card: write faces 1..={faces}, J for a joker and G for the Golden card, separated by spaces"
                )),
            },
        })
        .collect()
}

/// Parses a set of cards.
pub(super) fn cards(text: &str, faces: u8) -> Result<Cards, String> {
    let golden = text
        .split_whitespace()
        .filter(|word| word.eq_ignore_ascii_case("g"))
        .count();
    let mut counts = NOTHING;
    for kind in kinds(text, faces)? {
        let count = &mut counts[kind.map_or(JOKER, index)];
        *count = count.saturating_add(1);
    }
    let mut list = counts[..usize::from(faces)].to_vec();
    list.push(counts[JOKER]);
    Cards::from_counts(faces, &list, golden > 0)
        .filter(|_| golden <= 1)
        .ok_or_else(|| "no deck has that many cards of one kind".into())
}

/// Parses a play: cards of one face with any jokers, or one joker alone.
pub(super) fn play(text: &str, faces: u8) -> Result<Action, String> {
    let kinds = kinds(text, faces)?;
    let jokers = kinds.iter().filter(|kind| kind.is_none()).count();
    let mut faces = kinds.into_iter().flatten();
    let small = |count: usize| u8::try_from(count).map_err(|_| "too many cards".to_owned());
    match faces.next() {
        None if jokers == 1 => Ok(Action::LoneJoker),
        None => Err("jokers must be played with cards of a face, or a single one alone".into()),
        Some(face) => {
            let rest: Vec<Face> = faces.collect();
            if rest.iter().any(|other| *other != face) {
                return Err("a play must be cards of one face, with any jokers".into());
            }
            Ok(Action::Play {
                face,
                quantity: small(rest.len() + 1)?,
                jokers: small(jokers)?,
            })
        }
    }
}

/// Parses a rule set: a preset, then fields that override it.
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
