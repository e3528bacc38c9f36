//! The spectators of a room: each has a position in the log, and is cut off when it does not keep up.

use std::sync::Arc;

use chefshat_engine::Viewer;
use chefshat_proto::v1::{self, SpectatorServiceWatchResponse};

use super::delivery::snapshot;
use crate::convert;
use crate::grpc::status;
use crate::outbox::{OnSpace, Outbox};
use chefshat_room::Core;
use tonic::Status;

/// Events that may happen while a spectator's stream has no space, before it is cut off.
pub const MAX_SPECTATOR_LAG: usize = 1_024;
/// Most spectators of one room.
pub const MAX_SPECTATORS: usize = 256;
/// Most events put into the stream at once.
const EVENTS_PER_MESSAGE: usize = 256;

/// One spectator.
#[derive(Debug)]
pub(super) struct Spectator {
    outbox: Arc<Outbox<Vec<SpectatorServiceWatchResponse>>>,
    position: usize,
    /// Length of what it may see when its stream last had space.
    kept_up_at: usize,
}

impl Spectator {
    /// A spectator from an event on (position from 0). The first message is in its outbox.
    pub(super) fn new(
        core: &Core,
        outbox: Arc<Outbox<Vec<SpectatorServiceWatchResponse>>>,
        from: usize,
        with_snapshot: bool,
    ) -> Self {
        let visible = core.visible_to_spectators();
        let mut first = vec![SpectatorServiceWatchResponse {
            room: Some(convert::describe(core)),
            snapshot: with_snapshot.then(|| snapshot(core, Viewer::Spectator)),
            events: Vec::new(),
        }];
        outbox.push(&mut first, None, None);
        Self {
            outbox,
            position: if with_snapshot {
                visible
            } else {
                from.min(visible)
            },
            kept_up_at: visible,
        }
    }

    /// Sends what it may see and has not seen. `false` when the spectator is done with or gone.
    pub(super) fn deliver(&mut self, core: &Core, on_space: &Arc<dyn OnSpace>) -> bool {
        let visible = core.visible_to_spectators();
        while self.position < visible {
            let end = (self.position + EVENTS_PER_MESSAGE).min(visible);
            let mut message = vec![SpectatorServiceWatchResponse {
                room: None,
                snapshot: None,
                events: (self.position..end)
                    .filter_map(|position| self.event(core, position))
                    .collect(),
            }];
            if !self.outbox.push(&mut message, None, Some(on_space)) {
                if visible.saturating_sub(self.kept_up_at) <= MAX_SPECTATOR_LAG {
                    return true;
                }
                self.outbox.cut(status::spectator_too_slow());
                return false;
            }
            self.position = end;
            self.kept_up_at = visible;
        }
        if core.state().is_over() {
            self.outbox.end(Ok(()));
            return false;
        }
        !self.outbox.is_abandoned()
    }

    /// Ends the stream because the server ends.
    pub(super) fn end(self, status: Status) {
        self.outbox.end(Err(status));
    }

    fn event(&self, core: &Core, position: usize) -> Option<v1::GameEvent> {
        let header = core.header();
        // The hands of a series are those of games that others still play.
        let sees_hands = header.series().is_none()
            && (header.policy.spectators_see_hands || core.state().is_over());
        let viewer = if sees_hands {
            Viewer::Everything
        } else {
            Viewer::Spectator
        };
        let mut event = convert::view(core, position, viewer)?;
        // Rewards are told to their own seats alone, even where all hands are shown.
        event.rewards.clear();
        Some(event)
    }
}
