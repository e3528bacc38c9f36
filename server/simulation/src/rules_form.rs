//! A rule set as JSON, with the field names of the rules, as used by test vectors and results of
//! batches. The engine validates it.

use chefshat_engine::{Opening, PassScope, RuleSet, RuleSetError, RuleSetSpec, Stop};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A rule set with every field set.
#[derive(Clone, Eq, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RulesForm {
    /// Number of players.
    pub players: u8,
    /// Number of faces.
    pub faces: u8,
    /// Number of jokers.
    pub jokers: u8,
    /// Points that end the game, or null.
    pub target_points: Option<u32>,
    /// Shifts that end the game, or null.
    pub target_shifts: Option<u32>,
    /// Points by place.
    pub points: Vec<u32>,
    /// Whether cards are exchanged.
    pub exchange: bool,
    /// Whether special actions may be declared.
    pub special_actions: bool,
    /// `golden` or `any_top_face`.
    #[serde(with = "OpeningName")]
    pub opening: Opening,
    /// Whether a Shift's first turn may be a pass.
    pub opening_pass: bool,
    /// `pizza` or `turn`.
    #[serde(with = "PassScopeName")]
    pub pass_scope: PassScope,
    /// Consecutive pizzas without a play after which somebody must play.
    pub max_idle_pizzas: u32,
    /// Turns that end a Shift.
    pub max_turns: u32,
}

/// The names of the openings.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Opening", rename_all = "snake_case")]
enum OpeningName {
    Golden,
    AnyTopFace,
}

/// The names of the scopes of a pass.
#[derive(Serialize, Deserialize)]
#[serde(remote = "PassScope", rename_all = "snake_case")]
enum PassScopeName {
    Pizza,
    Turn,
}

/// Why a form is not a rule set.
#[derive(Clone, Eq, PartialEq, Debug, Error)]
pub enum RulesFormError {
    /// Not exactly one stop rule.
    #[error("exactly one of target_points and target_shifts must be set")]
    Stop,
    /// An invalid value.
    #[error("{}: {}", .0.field(), .0)]
    Rules(#[from] RuleSetError),
}

impl From<&RuleSet> for RulesForm {
    fn from(rules: &RuleSet) -> RulesForm {
        let spec = rules.spec();
        let (target_points, target_shifts) = match spec.stop {
            Stop::Points(points) => (Some(points), None),
            Stop::Shifts(shifts) => (None, Some(shifts)),
        };
        RulesForm {
            players: spec.players,
            faces: spec.faces,
            jokers: spec.jokers,
            target_points,
            target_shifts,
            points: spec.points,
            exchange: spec.exchange,
            special_actions: spec.special_actions,
            opening: spec.opening,
            opening_pass: spec.opening_pass,
            pass_scope: spec.pass_scope,
            max_idle_pizzas: spec.max_idle_pizzas,
            max_turns: spec.max_turns,
        }
    }
}

impl RulesForm {
    /// The rule set.
    ///
    /// # Errors
    /// If there is not exactly one stop rule, or the engine refuses a value.
    pub fn rule_set(&self) -> Result<RuleSet, RulesFormError> {
        let stop = match (self.target_points, self.target_shifts) {
            (Some(points), None) => Stop::Points(points),
            (None, Some(shifts)) => Stop::Shifts(shifts),
            _ => return Err(RulesFormError::Stop),
        };
        let spec = RuleSetSpec {
            players: self.players,
            faces: self.faces,
            jokers: self.jokers,
            stop,
            points: self.points.clone(),
            exchange: self.exchange,
            special_actions: self.special_actions,
            opening: self.opening,
            opening_pass: self.opening_pass,
            pass_scope: self.pass_scope,
            max_idle_pizzas: self.max_idle_pizzas,
            max_turns: self.max_turns,
        };
        Ok(spec.validate()?)
    }
}
