//! Converts rule sets, roles, reward schemes and action spaces.

use chefshat_engine::{
    ActionSpace, Opening, PassScope, RewardScheme, Role, RuleSet, RuleSetError, RuleSetSpec, Stop,
};
use chefshat_proto::v1;

/// An invalid field of a message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {message}")]
pub struct FieldProblem {
    /// The name in the `.proto`.
    pub field: &'static str,
    /// The problem and what to do.
    pub message: String,
}

impl FieldProblem {
    /// A problem of one field.
    pub fn new(field: &'static str, message: impl Into<String>) -> Self {
        Self {
            field,
            message: message.into(),
        }
    }

    /// A number that is not a value of the field's enum.
    pub fn unknown(field: &'static str, value: i32) -> Self {
        Self::new(field, format!("{value} is not a value of this enum"))
    }
}

/// Reads a rule set: its preset, overridden by every field that is set.
///
/// # Errors
/// The first invalid field.
pub fn rules_from_proto(message: &v1::RuleSet) -> Result<RuleSet, FieldProblem> {
    let preset = if message.preset.is_empty() {
        "paper"
    } else {
        message.preset.as_str()
    };
    let mut spec = RuleSetSpec::preset(preset).ok_or_else(|| {
        FieldProblem::new(
            "preset",
            format!(
                "there is no preset {preset:?}; use one of {}",
                RuleSetSpec::PRESETS.join(", ")
            ),
        )
    })?;
    if let Some(players) = message.players {
        spec.players = small("players", players)?;
    }
    if let Some(faces) = message.faces {
        spec.faces = small("faces", faces)?;
    }
    if let Some(jokers) = message.jokers {
        spec.jokers = small("jokers", jokers)?;
    }
    match message.stop {
        Some(v1::rule_set::Stop::TargetPoints(points)) => spec.stop = Stop::Points(points),
        Some(v1::rule_set::Stop::TargetShifts(shifts)) => spec.stop = Stop::Shifts(shifts),
        None => {}
    }
    if !message.points.is_empty() {
        spec.points = message.points.clone();
    }
    spec.exchange = message.exchange.unwrap_or(spec.exchange);
    spec.special_actions = message.special_actions.unwrap_or(spec.special_actions);
    match v1::Opening::try_from(message.opening) {
        Ok(v1::Opening::Unspecified) => {}
        Ok(v1::Opening::Golden) => spec.opening = Opening::Golden,
        Ok(v1::Opening::AnyTopFace) => spec.opening = Opening::AnyTopFace,
        Err(_) => return Err(FieldProblem::unknown("opening", message.opening)),
    }
    spec.opening_pass = message.opening_pass.unwrap_or(spec.opening_pass);
    match v1::PassScope::try_from(message.pass_scope) {
        Ok(v1::PassScope::Unspecified) => {}
        Ok(v1::PassScope::Pizza) => spec.pass_scope = PassScope::Pizza,
        Ok(v1::PassScope::Turn) => spec.pass_scope = PassScope::Turn,
        Err(_) => return Err(FieldProblem::unknown("pass_scope", message.pass_scope)),
    }
    spec.max_idle_pizzas = message.max_idle_pizzas.unwrap_or(spec.max_idle_pizzas);
    spec.max_turns = message.max_turns.unwrap_or(spec.max_turns);
    spec.validate().map_err(|error| {
        let message = match error {
            // Default points of the preset follow the number of players.
            RuleSetError::PointsCount { given, players } if message.points.is_empty() => format!(
                "the preset {preset} has points for {given} players, not for {players}: give the points of each place \
                 as well, or choose another preset"
            ),
            _ => error.to_string(),
        };
        FieldProblem::new(error.field(), message)
    })
}

/// Converts a rule set, with every field set and no preset.
pub fn rules_to_proto(rules: &RuleSet) -> v1::RuleSet {
    let spec = rules.spec();
    v1::RuleSet {
        preset: String::new(),
        players: Some(spec.players.into()),
        faces: Some(spec.faces.into()),
        jokers: Some(spec.jokers.into()),
        stop: Some(match spec.stop {
            Stop::Points(points) => v1::rule_set::Stop::TargetPoints(points),
            Stop::Shifts(shifts) => v1::rule_set::Stop::TargetShifts(shifts),
        }),
        points: spec.points,
        exchange: Some(spec.exchange),
        special_actions: Some(spec.special_actions),
        opening: match spec.opening {
            Opening::Golden => v1::Opening::Golden,
            Opening::AnyTopFace => v1::Opening::AnyTopFace,
        }
        .into(),
        opening_pass: Some(spec.opening_pass),
        pass_scope: match spec.pass_scope {
            PassScope::Pizza => v1::PassScope::Pizza,
            PassScope::Turn => v1::PassScope::Turn,
        }
        .into(),
        max_idle_pizzas: Some(spec.max_idle_pizzas),
        max_turns: Some(spec.max_turns),
    }
}

/// Converts an action space.
pub fn action_space(space: &ActionSpace) -> v1::ActionSpace {
    v1::ActionSpace {
        id: space.id(),
        size: space.size().into(),
        turn_actions: space.turn_actions().into(),
    }
}

/// The role with a number of `chefshat.v1.Role`; `None` for 0 and unknown numbers.
pub fn role_from_number(number: u8) -> Option<Role> {
    [
        Role::Chef,
        Role::SousChef,
        Role::Cook,
        Role::Waiter,
        Role::Dishwasher,
    ]
    .into_iter()
    .find(|role| *role as u8 == number)
}

/// Reads a reward scheme; `None` if unspecified.
pub fn reward_scheme_from_proto(scheme: v1::RewardScheme) -> Option<RewardScheme> {
    match scheme {
        v1::RewardScheme::Unspecified => None,
        v1::RewardScheme::Validity => Some(RewardScheme::Validity),
        v1::RewardScheme::Paper => Some(RewardScheme::Paper),
        v1::RewardScheme::PaperIntended => Some(RewardScheme::PaperIntended),
        v1::RewardScheme::Winning => Some(RewardScheme::Winning),
        v1::RewardScheme::Points => Some(RewardScheme::Points),
    }
}

/// Converts a reward scheme.
pub fn reward_scheme_to_proto(scheme: Option<RewardScheme>) -> v1::RewardScheme {
    match scheme {
        None => v1::RewardScheme::Unspecified,
        Some(RewardScheme::Validity) => v1::RewardScheme::Validity,
        Some(RewardScheme::Paper) => v1::RewardScheme::Paper,
        Some(RewardScheme::PaperIntended) => v1::RewardScheme::PaperIntended,
        Some(RewardScheme::Winning) => v1::RewardScheme::Winning,
        Some(RewardScheme::Points) => v1::RewardScheme::Points,
    }
}

fn small(field: &'static str, value: u32) -> Result<u8, FieldProblem> {
    u8::try_from(value).map_err(|_| FieldProblem::new(field, format!("{value} is out of range")))
}
