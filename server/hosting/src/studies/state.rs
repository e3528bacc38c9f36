//! What is shared besides the state of a study: by its readers, and by all studies of a server.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use tokio::sync::{Mutex as AsyncMutex, watch};

use super::data::StudyData;
use chefshat_admission::limits::{FairSemaphore, Permit};
use chefshat_base::clock::TimeOfDay;
use chefshat_base::lock::Lock;
use chefshat_room::ids::GameId;

/// What all studies of a server share.
#[derive(Debug)]
pub struct Budgets {
    pub(super) now: TimeOfDay,
    /// The memory of their settings, in KiB.
    pub(super) memory: Arc<FairSemaphore>,
    /// The memory of their participants and answers, in bytes.
    pub(super) data: Arc<FairSemaphore>,
}

/// What readers of a study share besides its state.
#[derive(Debug)]
pub struct StudyShared {
    /// The memory of its settings.
    pub(super) _memory: Permit,
    /// The memory of its participants and answers.
    pub(super) data: Arc<StudyData>,
    /// Counts the changes of each participant to whom somebody has listened.
    pub(super) views: Lock<BTreeMap<u32, watch::Sender<u64>>>,
    /// Participants whose data are being deleted, and whether the file system has refused it.
    pub(super) deleting: Lock<BTreeMap<u32, bool>>,
    /// Number of interface traces by participant and game, since the server was started. Locked while
    /// traces are added or deleted.
    pub(super) traces: Arc<AsyncMutex<BTreeMap<(u32, GameId), usize>>>,
    pub(super) streams: AtomicU64,
}

impl StudyShared {
    pub(super) fn new(memory: Permit, data: Arc<StudyData>) -> Self {
        Self {
            _memory: memory,
            data,
            views: Lock::default(),
            deleting: Lock::default(),
            traces: Arc::default(),
            streams: AtomicU64::new(0),
        }
    }
}
