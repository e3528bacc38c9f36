//! The units that a node runs: resumes, stops and suspends their rooms, tournaments and studies.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use tracing::{info, warn};

use crate::rooms::Rooms;
use crate::studies::Studies;
use crate::tournaments::Tournaments;
use chefshat_base::lock::Lock;
use chefshat_base::metrics::Metrics;
use chefshat_room::ids::UnitId;
use chefshat_store::StoreError;
use chefshat_store::cluster::{ClusterStore, Epoch, Load, NodeId};
use chefshat_store::units::UnitKey;
use tokio::sync::Semaphore;
use tokio::time::{Duration, sleep, timeout};

/// Pause before a unit that could not be read is read again.
const RETRY: Duration = Duration::from_secs(1);
/// Units that are read and replayed at a time, so that many orphans do not slow down what runs.
pub(super) const LOADS_AT_ONCE: usize = 4;

/// Most rooms that are asked whether their games have begun.
const ASKED: usize = 256;

/// What became of resuming a unit.
pub(super) enum Resumed {
    /// It runs here, or is not to run here any more.
    Runs,
    /// It has nothing to run, or is not the node's.
    Nothing,
    /// This version of the program cannot resume it.
    Impossible,
}

/// What a server hosts.
#[derive(Debug)]
pub struct Hosted {
    /// The rooms, those of games of tournaments and studies as well.
    pub rooms: Arc<Rooms>,
    /// The tournaments.
    pub tournaments: Arc<Tournaments>,
    /// The studies.
    pub studies: Arc<Studies>,
}

/// The units of a node. What is done with one unit is done one after another, by the caller.
pub(super) struct Units {
    store: Arc<dyn ClusterStore>,
    rooms: Arc<Rooms>,
    tournaments: Arc<Tournaments>,
    studies: Arc<Studies>,
    /// How long ephemeral games may continue when the node hands over.
    grace: Duration,
    /// The units that are to run here, with their epochs.
    wanted: Lock<BTreeMap<UnitId, Epoch>>,
    loads: Semaphore,
    /// How many units are being resumed.
    resuming: AtomicUsize,
}

impl Units {
    pub(super) fn new(store: Arc<dyn ClusterStore>, hosted: Hosted, grace: Duration) -> Self {
        let Hosted {
            rooms,
            tournaments,
            studies,
        } = hosted;
        Self {
            grace,
            store,
            rooms,
            tournaments,
            studies,
            wanted: Lock::default(),
            loads: Semaphore::new(LOADS_AT_ONCE),
            resuming: AtomicUsize::new(0),
        }
    }

    /// How full the node is.
    pub(super) fn load(&self) -> Load {
        self.rooms.load()
    }

    /// How many units are being resumed.
    pub(super) fn resuming(&self) -> usize {
        self.resuming.load(Ordering::Relaxed)
    }

    /// At most `count` units to hand over, each with its next owner, so that these nodes get about
    /// these numbers of rooms: rooms whose games have not begun first, tournaments and studies last.
    pub(super) async fn to_hand_over(
        &self,
        moves: Vec<(NodeId, u64)>,
        count: usize,
    ) -> Vec<(UnitId, NodeId)> {
        if moves.is_empty() {
            return Vec::new();
        }
        let (mut waiting, mut playing, mut larger) = (Vec::new(), Vec::new(), Vec::new());
        for (unit, rooms) in self.rooms.durable_units() {
            match rooms.as_slice() {
                [room] if room.id().unit() == unit => {
                    // Each question wakes a room.
                    let is_asked = waiting.len() < count && playing.len() < ASKED;
                    match is_asked && room.has_started().await == Ok(false) {
                        true => waiting.push((unit, 1)),
                        false => playing.push((unit, 1)),
                    }
                }
                rooms => larger.push((unit, rooms.len() as u64)),
            }
        }
        larger.sort_by_key(|(_, rooms)| *rooms);
        let units = waiting.into_iter().chain(playing).chain(larger);
        let mut units = units.take(count).peekable();
        let mut chosen = Vec::new();
        for (node, mut wanted) in moves {
            while let Some((unit, rooms)) = units.next_if(|(_, rooms)| *rooms <= wanted) {
                wanted -= rooms;
                chosen.push((unit, node));
            }
        }
        chosen
    }

    /// Counts what the node does.
    pub(super) fn metrics(&self) -> &Metrics {
        self.rooms.metrics()
    }

    /// From here on, a unit is to run here at this epoch.
    pub(super) fn want(&self, unit: UnitId, epoch: Epoch) {
        self.wanted.lock().insert(unit, epoch);
    }

    /// From here on, a unit is not to run here.
    pub(super) fn unwant(&self, unit: UnitId) {
        self.wanted.lock().remove(&unit);
    }

    /// Prevents a unit from publishing anything from here on. It ends with [`Units::stop`].
    pub(super) fn fence(&self, unit: UnitId) {
        self.unwant(unit);
        self.tournaments.fence(unit);
        self.studies.fence(unit);
        self.rooms.fence_unit(unit);
    }

    /// Whether a unit runs here, or is being created.
    fn runs(&self, unit: UnitId) -> bool {
        self.rooms.runs(unit) || self.tournaments.runs(unit) || self.studies.runs(unit)
    }

    /// Whether something of a unit is here: it runs, is being created, or is over.
    pub(super) fn has(&self, unit: UnitId) -> bool {
        self.runs(unit)
            || (self.rooms.by_unit(unit))
                .is_some_and(|room| self.rooms.is_over(room.id()) == Some(true))
            || (self.tournaments.by_unit(unit)).is_some_and(|tournament| tournament.is_over())
    }

    /// Runs a unit that the node owns at this epoch, as long as it is wanted. Tries again while the
    /// database cannot be read.
    pub(super) async fn resume(&self, unit: UnitId, epoch: Epoch) -> Resumed {
        // It was created here, and its node learns of it from its beat.
        let is_new = epoch == Epoch::FIRST;
        if is_new && self.runs(unit) {
            return Resumed::Runs;
        }
        self.metrics().taken_over();
        let _resuming = Counted::new(&self.resuming);
        self.stop(unit).await;
        while self.wanted.lock().get(&unit) == Some(&epoch) {
            match self.read(unit, epoch).await {
                Ok(resumed) => return resumed,
                Err(error) => {
                    warn!(%unit, %error, "a room or tournament cannot be read; trying again");
                    sleep(RETRY).await;
                }
            }
        }
        Resumed::Runs
    }

    /// Reads and runs a unit.
    async fn read(&self, unit: UnitId, epoch: Epoch) -> Result<Resumed, StoreError> {
        let _permit = self.loads.acquire().await.expect("it is never closed");
        let Some(loaded) = self.store.load(unit, epoch).await? else {
            return Ok(Resumed::Nothing);
        };
        let games = self.rooms.resume_all(loaded.games).await;
        let has_unit = match loaded.stored {
            Some((UnitKey::Tournament(id), stored)) => self.tournaments.resume(id, stored).await,
            Some((UnitKey::Study(id), stored)) => self.studies.resume(id, stored).await,
            None => false,
        };
        let is_resumed = games > 0 || has_unit;
        info!(%unit, epoch = epoch.0, games, is_resumed, "taken over");
        Ok(match is_resumed {
            true => Resumed::Runs,
            false => Resumed::Impossible,
        })
    }

    /// Ends everything of a unit that runs here.
    pub(super) async fn stop(&self, unit: UnitId) {
        self.tournaments.stop_one(unit).await;
        self.studies.stop_one(unit).await;
        self.rooms.stop_unit(unit).await;
    }

    /// Waits until a unit is not an ephemeral room in which a game is running, or for the grace: no
    /// other node can resume it.
    pub(super) async fn until_ephemeral_over(&self, unit: UnitId) {
        // If it is not over in time, it is ended.
        let _ = timeout(self.grace, self.rooms.until_ephemeral_over(unit)).await;
    }

    /// Releases a unit that cannot be resumed here, as long as it is wanted. Returns whether the
    /// database knows.
    pub(super) async fn give_up(&self, unit: UnitId, epoch: Epoch) -> bool {
        while self.wanted.lock().get(&unit) == Some(&epoch) {
            if self.release(unit, epoch, None).await {
                self.unwant(unit);
                return true;
            }
            sleep(RETRY).await;
        }
        false
    }

    /// Ends everything of a unit after its next commits, and gives it up, to `next` if it is set.
    /// Returns whether the database knows.
    pub(super) async fn release(&self, unit: UnitId, epoch: Epoch, next: Option<NodeId>) -> bool {
        self.tournaments.stop_one(unit).await;
        self.studies.stop_one(unit).await;
        self.rooms.suspend_unit(unit).await;
        match self.store.release(unit, epoch, next).await {
            Ok(()) => true,
            Err(error) => {
                warn!(%unit, %error, "a room or tournament cannot be released");
                sleep(RETRY).await;
                false
            }
        }
    }
}

/// Counted until it is dropped.
struct Counted<'c>(&'c AtomicUsize);

impl<'c> Counted<'c> {
    fn new(count: &'c AtomicUsize) -> Self {
        count.fetch_add(1, Ordering::Relaxed);
        Self(count)
    }
}

impl Drop for Counted<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}
