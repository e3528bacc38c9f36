//! The state of a game as a viewer who comes later sees it.

use chefshat_engine::Viewer;
use chefshat_proto::v1;
use chefshat_record::convert::observation_to_proto;

use super::event::game_started;
use chefshat_room::Core;

/// The state of the game, for a viewer.
pub fn snapshot(core: &Core, viewer: Viewer) -> v1::Snapshot {
    v1::Snapshot {
        game_started: core.game().map(|_| game_started(core)),
        observation: core
            .observe(viewer)
            .map(|observation| observation_to_proto(&observation)),
        next_sequence: next_sequence(core),
    }
}

/// The number of the next event.
pub fn next_sequence(core: &Core) -> u64 {
    u64::try_from(core.log().len()).unwrap_or(u64::MAX) + 1
}
