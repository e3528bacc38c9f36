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
    pub opening: OpeningName,
    /// Whether a Shift's first turn may be a pass.
    pub opening_pass: bool,
    /// `pizza` or `turn`.
    pub pass_scope: PassScopeName,
    /// Consecutive pizzas without a play after which somebody must play.
    pub max_idle_pizzas: u32,
    /// Turns that end a Shift.
    pub max_turns: u32,
}

/// The opening, by name.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OpeningName {
    /// The Golden card.
    Golden,
    /// Any card of the top face.
    AnyTopFace,
}

/// The scope of a pass, by name.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PassScopeName {
    /// Until the next pizza.
    Pizza,
    /// For that turn.
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
            opening: match spec.opening {
                Opening::Golden => OpeningName::Golden,
                Opening::AnyTopFace => OpeningName::AnyTopFace,
            },
            opening_pass: spec.opening_pass,
            pass_scope: match spec.pass_scope {
                PassScope::Pizza => PassScopeName::Pizza,
                PassScope::Turn => PassScopeName::Turn,
            },
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
            opening: match self.opening {
                OpeningName::Golden => Opening::Golden,
                OpeningName::AnyTopFace => Opening::AnyTopFace,
            },
            opening_pass: self.opening_pass,
            pass_scope: match self.pass_scope {
                PassScopeName::Pizza => PassScope::Pizza,
                PassScopeName::Turn => PassScope::Turn,
            },
            max_idle_pizzas: self.max_idle_pizzas,
            max_turns: self.max_turns,
        };
        Ok(spec.validate()?)
    }
}
