//! Kinds of participants.

use chefshat_proto::v1;
use chefshat_record::convert::FieldProblem;
use chefshat_room::journal::ParticipantKind;

/// The kind of a participant; `None` when unspecified.
///
/// # Errors
/// The number is not a kind.
pub fn kind_from_proto(
    field: &'static str,
    kind: i32,
) -> Result<Option<ParticipantKind>, FieldProblem> {
    match v1::ParticipantKind::try_from(kind) {
        Ok(v1::ParticipantKind::Unspecified) => Ok(None),
        Ok(v1::ParticipantKind::Agent) => Ok(Some(ParticipantKind::Agent)),
        Ok(v1::ParticipantKind::Human) => Ok(Some(ParticipantKind::Human)),
        Ok(v1::ParticipantKind::Robot) => Ok(Some(ParticipantKind::Robot)),
        Ok(v1::ParticipantKind::Model) => Ok(Some(ParticipantKind::Model)),
        Err(_) => Err(FieldProblem::new(
            field,
            format!("{kind} is not a kind of participant"),
        )),
    }
}

/// Converts a kind to its number.
pub fn kind_to_proto(kind: Option<ParticipantKind>) -> i32 {
    match kind {
        None => v1::ParticipantKind::Unspecified,
        Some(ParticipantKind::Agent) => v1::ParticipantKind::Agent,
        Some(ParticipantKind::Human) => v1::ParticipantKind::Human,
        Some(ParticipantKind::Robot) => v1::ParticipantKind::Robot,
        Some(ParticipantKind::Model) => v1::ParticipantKind::Model,
    }
    .into()
}
