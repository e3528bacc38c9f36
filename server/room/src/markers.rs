//! Markers: moments that the owner of a room, or an instrument with the owner's token, puts into
//! the recording. They change nothing in the game, and no event shows them.

use std::time::Duration;

use crate::Core;
use crate::journal::{Change, Marked, Marker};
use crate::limits::{MARKERS_AT_ONCE, MARKERS_PER_SECOND, MAX_MARKER_AHEAD, MAX_MARKERS};

/// Why a marker is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MarkError {
    /// The game is over.
    #[error("the game is over")]
    GameOver,
    /// The room has too many markers.
    #[error("a room has at most {MAX_MARKERS} markers")]
    TooMany,
    /// Too many markers came in a short time.
    #[error("at most {MARKERS_PER_SECOND} markers a second and {MARKERS_AT_ONCE} at once")]
    TooFast,
    /// The marked moment is in the future.
    #[error("the moment is in the future: read the clock of the room again")]
    Future,
}

impl Core {
    /// Adds a marker. Returns its number, from 1.
    ///
    /// # Errors
    /// The marker is refused.
    pub fn mark(&mut self, now: Duration, marked: Marked) -> Result<usize, MarkError> {
        let interval = Duration::from_secs(1) / MARKERS_PER_SECOND;
        if self.state().is_over() {
            return Err(MarkError::GameOver);
        }
        if marked.moment > now + MAX_MARKER_AHEAD {
            return Err(MarkError::Future);
        }
        if self.markers.len() >= MAX_MARKERS {
            return Err(MarkError::TooMany);
        }
        let free_at = self.marker_free_at.max(now) + interval;
        if free_at > now + interval * MARKERS_AT_ONCE {
            return Err(MarkError::TooFast);
        }
        self.marker_free_at = free_at;
        self.commit(now, Change::Marked(Box::new(marked)));
        Ok(self.markers.len())
    }

    /// The markers, in order.
    pub fn markers(&self) -> &[Marker] {
        &self.markers
    }
}
