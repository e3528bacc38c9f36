//! From a record to an agent that plays as one of its players.

use std::sync::Arc;

use chefshat_arena::{RecordedDecision, RecordedPlayer};
use chefshat_proto::v1;
use chefshat_records::players::{self, PlayerError};

/// The player of a seat of a recorded game, for `BuiltInAgent::replay`.
///
/// # Errors
/// The record does not fit, has no such seat, or says nothing of its decisions.
pub fn recorded_player(
    lines: &[v1::RecordLine],
    seat: u32,
) -> Result<Arc<RecordedPlayer>, PlayerError> {
    let decisions = players::recorded_player(lines, seat)?.into_iter();
    let player = RecordedPlayer::new(decisions.map(|decision| RecordedDecision {
        observation: decision.observation,
        legal: decision.legal,
        action: decision.action,
        own: decision.own,
    }));
    Ok(Arc::new(player))
}
