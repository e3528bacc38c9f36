//! The markers of a room for the streams that follow them.

use std::sync::Arc;

use chefshat_proto::v1;
use chefshat_room::Core;
use tokio::sync::watch::{self, error::RecvError};

use chefshat_base::lock::Lock;
use chefshat_wire::convert;

/// Most streams that follow the markers of one room.
const MAX_MARKER_FOLLOWERS: usize = 16;
/// Most markers in a message.
const MARKERS_PER_MESSAGE: usize = 256;

/// The markers that have been published.
#[derive(Debug)]
pub(super) struct MarkerLog {
    markers: Arc<Lock<Vec<v1::Marker>>>,
    published: watch::Sender<Published>,
}

/// How far the markers of a room have been published.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Published {
    count: usize,
    over: bool,
}

impl MarkerLog {
    /// Publishes the markers of a room so far.
    pub(super) fn new(core: &Core) -> Self {
        let nothing = Published {
            count: 0,
            over: false,
        };
        let log = Self {
            markers: Arc::default(),
            published: watch::Sender::new(nothing),
        };
        log.follow(core);
        log
    }

    /// Publishes what is new.
    pub(super) fn follow(&self, core: &Core) {
        let published = Published {
            count: core.markers().len(),
            over: core.state().is_over(),
        };
        self.published.send_if_modified(|last| {
            let new = core.markers().iter().enumerate().skip(last.count);
            (self.markers.lock())
                .extend(new.map(|(index, marker)| convert::marker_to_proto(index, marker)));
            let modified = *last != published;
            *last = published;
            modified
        });
    }

    /// Follows the markers from a position on; `None` if too many streams do.
    pub(super) fn subscribe(&self, position: usize) -> Option<MarkerFollower> {
        let is_full = self.published.receiver_count() >= MAX_MARKER_FOLLOWERS;
        (!is_full).then(|| MarkerFollower {
            markers: Arc::clone(&self.markers),
            published: self.published.subscribe(),
            position,
        })
    }
}

/// Follows the markers of a room.
#[derive(Debug)]
pub struct MarkerFollower {
    markers: Arc<Lock<Vec<v1::Marker>>>,
    published: watch::Receiver<Published>,
    position: usize,
}

impl MarkerFollower {
    /// The next markers. `None` when the game is over and all have been returned.
    ///
    /// # Errors
    /// The room is gone.
    pub async fn next(&mut self) -> Result<Option<Vec<v1::Marker>>, RecvError> {
        loop {
            let published = *self.published.borrow_and_update();
            if self.position < published.count {
                let end = published.count.min(self.position + MARKERS_PER_MESSAGE);
                let markers = self.markers.lock()[self.position..end].to_vec();
                self.position = end;
                return Ok(Some(markers));
            }
            if published.over {
                return Ok(None);
            }
            self.published.changed().await?;
        }
    }
}
