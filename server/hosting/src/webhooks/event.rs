//! An event that waits for delivery, and where what became of events is counted.

use std::sync::Arc;

use bytes::Bytes;
use chefshat_room::ids::UnitId;
use tokio::sync::OwnedSemaphorePermit;

use chefshat_admission::limits::LogPace;
use chefshat_base::metrics::Metrics;

/// Lines of the log about failures in a minute.
const LINES_PER_MINUTE: u32 = 10;

/// An event on its way.
#[derive(Debug)]
pub(super) struct Event {
    /// The room or tournament it is about. Events about the same one are delivered in order.
    pub(super) about: UnitId,
    /// The same for the same event, also if two servers announce it.
    pub(super) id: String,
    pub(super) body: Bytes,
    pub(super) _place: OwnedSemaphorePermit,
}

/// What became of events: counted, and a few lines in the log.
#[derive(Debug)]
pub(super) struct Outcomes {
    pub(super) metrics: Arc<Metrics>,
    pub(super) pace: LogPace,
}

impl Outcomes {
    /// Counts in these metrics.
    pub(super) fn new(metrics: Arc<Metrics>) -> Self {
        Self {
            metrics,
            pace: LogPace::new(LINES_PER_MINUTE),
        }
    }
}
