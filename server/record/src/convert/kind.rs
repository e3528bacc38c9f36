//! Names of the kinds of participants, as in transcripts, datasets and on the command line, and
//! which games had real cards.

use chefshat_proto::v1::{GameOrigin, ParticipantKind};

/// The name of a kind. An unspecified kind is an agent.
pub fn kind_name(kind: ParticipantKind) -> &'static str {
    match kind {
        ParticipantKind::Human => "human",
        ParticipantKind::Robot => "robot",
        ParticipantKind::Model => "model",
        ParticipantKind::Agent | ParticipantKind::Unspecified => "agent",
    }
}

/// The kind with this name.
pub fn kind_from_name(name: &str) -> Option<ParticipantKind> {
    let kinds = [
        ParticipantKind::Agent,
        ParticipantKind::Human,
        ParticipantKind::Robot,
        ParticipantKind::Model,
    ];
    kinds.into_iter().find(|kind| kind_name(*kind) == name)
}

/// Whether a game of this origin was played with real cards, so that some may be unknown.
pub fn has_real_cards(origin: GameOrigin) -> bool {
    matches!(origin, GameOrigin::Imported | GameOrigin::Physical)
}
