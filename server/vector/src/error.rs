//! Why a request is refused, with the same reasons and words over every way to the games.

use chefshat_record::convert::FieldProblem;
use chefshat_simulation::vector::{StateError, StepError};
use thiserror::Error;

/// A refused request.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{message}")]
pub struct RequestError {
    /// The reason in UPPER_SNAKE, as documented at the service.
    pub reason: &'static str,
    /// The problem and what to do.
    pub message: String,
    /// Names the field at fault, and where it is.
    pub metadata: Vec<(&'static str, String)>,
}

impl RequestError {
    /// An invalid field.
    pub fn field(reason: &'static str, problem: &FieldProblem) -> Self {
        Self {
            reason,
            message: problem.to_string(),
            metadata: vec![("field", problem.field.to_owned())],
        }
    }
}

impl From<StepError> for RequestError {
    fn from(error: StepError) -> Self {
        let (reason, field, place) = match &error {
            StepError::Actions { rows, .. } => (
                "ACTIONS_REFUSED",
                "actions",
                vec![("rows", rows.to_string())],
            ),
            StepError::Illegal {
                row, game, seat, ..
            } => (
                "ILLEGAL_ACTION",
                "actions",
                vec![
                    ("row", row.to_string()),
                    ("game", game.to_string()),
                    ("seat", seat.index().to_string()),
                ],
            ),
            StepError::NoGame { .. } | StepError::Order { .. } => {
                let problem = FieldProblem::new("games", error.to_string());
                return Self::field("RESET_REFUSED", &problem);
            }
            StepError::RecordsTooLong => ("RECORDS_TOO_LONG", "records", Vec::new()),
        };
        let mut metadata = vec![("field", field.to_owned())];
        metadata.extend(place);
        Self {
            reason,
            message: error.to_string(),
            metadata,
        }
    }
}

impl From<StateError> for RequestError {
    fn from(error: StateError) -> Self {
        if error == StateError::Games(StepError::RecordsTooLong) {
            return StepError::RecordsTooLong.into();
        }
        let field = match &error {
            StateError::Games(_) | StateError::Count { .. } => "games",
            _ => "states",
        };
        Self::field(
            "STATES_REFUSED",
            &FieldProblem::new(field, error.to_string()),
        )
    }
}
