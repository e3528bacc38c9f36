//! Built-in agents that replay a player of a record.

use std::sync::Arc;

use chefshat_agents::RecordedPlayer;
use chefshat_proto::v1;
use chefshat_record::players;
use chefshat_record::players::PlayerError;

/// The player of a seat of a recorded game, for `BuiltInAgent::replay`.
///
/// # Errors
/// The record is inconsistent, lacks the seat, or has none of its decisions.
pub fn recorded_player(
    lines: &[v1::RecordLine],
    seat: u32,
) -> Result<Arc<RecordedPlayer>, PlayerError> {
    let decisions = players::recorded_player(lines, seat)?;
    Ok(Arc::new(RecordedPlayer::new(decisions)))
}
