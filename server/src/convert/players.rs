//! From a record to an agent that plays as one of its players.

use std::sync::Arc;

use chefshat_agents::RecordedPlayer;
use chefshat_proto::v1;
use chefshat_record::players;
use chefshat_record::players::PlayerError;

/// The player of a seat of a recorded game, for `BuiltInAgent::replay`.
///
/// # Errors
/// The record does not fit, has no such seat, or says nothing of its decisions.
pub fn recorded_player(
    lines: &[v1::RecordLine],
    seat: u32,
) -> Result<Arc<RecordedPlayer>, PlayerError> {
    let decisions = players::recorded_player(lines, seat)?;
    Ok(Arc::new(RecordedPlayer::new(decisions)))
}
