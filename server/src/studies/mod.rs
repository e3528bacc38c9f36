//! The studies of a server: creates, finds and resumes them. `chefshat_study` decides what each
//! participant does next; `task` runs one study; `export` gathers its data.

mod export;
mod games;
mod handle;
mod message;
mod task;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use chefshat_proto::v1;
use chefshat_study::{SettingsProblem, Study};
use tokio::sync::{Mutex as AsyncMutex, mpsc, watch};
use tokio_util::task::TaskTracker;
use tracing::{error, info};

pub use export::{ExportError, ExportedFile};
pub use handle::{MAX_TRACES, MAX_TRACES_OF_GAME, Presence, StudyHandle, TraceRefusal};
pub use message::Stopped;

use crate::clock::{TimeOfDay, since_epoch_ms};
use crate::config::{MAX_STUDIES, STUDY_MAILBOX};
use crate::convert::{self, StudyPlan};
use crate::limits::{Held, Key, Places, Refused};
use crate::rooms::Rooms;
use crate::store::StoreError;
use crate::store::studies::StudyHeader;
use chefshat_room::ids::{Id, RequestKey, Token, random_bytes};
use task::{Stop, Task};

/// When it is worth trying again to create a study.
const RETRY_STUDIES: Duration = Duration::from_secs(3_600);

/// Why a study was not created.
#[derive(Debug, thiserror::Error)]
pub enum CreateProblem {
    /// A setting is invalid.
    #[error(transparent)]
    Settings(#[from] SettingsProblem),
    /// This server hosts none.
    #[error(
        "a server that is a node of a cluster hosts no studies; run one with a data directory of its own (`chefshat serve --data-dir`)"
    )]
    NotHosted,
    /// Its creator, or the server, has too many studies.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// The request id was used for another study.
    #[error("this request id was used to create another study; draw a new one")]
    RequestIdUsed,
    /// The server is shutting down.
    #[error("the server is shutting down and accepts no new studies")]
    ShuttingDown,
    /// The disk has no space for more games.
    #[error("the server's disk is nearly full; the rest is reserved for running games")]
    DiskNearlyFull,
    /// The store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// The studies of a server.
#[derive(Debug)]
pub struct Studies {
    rooms: Arc<Rooms>,
    now: TimeOfDay,
    tracker: TaskTracker,
    stop: Stop,
    /// In the order of their creation, with a number.
    table: Mutex<Table>,
    /// Locked while a study is created.
    creating: AsyncMutex<()>,
    places: Arc<Places>,
}

#[derive(Debug, Default)]
struct Table {
    in_order: Vec<Arc<StudyHandle>>,
    by_id: BTreeMap<Id, Arc<StudyHandle>>,
}

impl Table {
    fn remove(&mut self, id: Id) {
        self.by_id.remove(&id);
        self.in_order.retain(|handle| handle.id() != id);
    }
}

impl Studies {
    /// Creates an empty set. A shutdown waits for the tasks in `tracker`.
    pub fn new(rooms: Arc<Rooms>, tracker: TaskTracker) -> Arc<Self> {
        Self::at(since_epoch_ms, rooms, tracker)
    }

    /// As [`Studies::new`], with this clock.
    fn at(now: TimeOfDay, rooms: Arc<Rooms>, tracker: TaskTracker) -> Arc<Self> {
        let places = Places::new(MAX_STUDIES, rooms.shares());
        Arc::new(Self {
            rooms,
            now,
            tracker,
            stop: Stop::default(),
            table: Mutex::default(),
            creating: AsyncMutex::default(),
            places,
        })
    }

    /// The rooms of its games.
    pub fn rooms(&self) -> &Arc<Rooms> {
        &self.rooms
    }

    /// Creates a study. Returns it with its owner token.
    ///
    /// # Errors
    /// See [`CreateProblem`].
    pub async fn create(
        self: &Arc<Self>,
        settings: v1::StudySettings,
        request: Option<RequestKey>,
        charged: Key,
    ) -> Result<(Arc<StudyHandle>, Token), CreateProblem> {
        let store = self.rooms.store();
        if !store.hosts_studies() || self.rooms.lease().is_some() {
            return Err(CreateProblem::NotHosted);
        }
        let durable = store.outlives_server();
        let settings = convert::complete_settings(settings, random_bytes, durable)?;
        let plan = convert::study_plan(&settings)?;
        let core = Study::new(plan.core.clone())?;
        if self.stop.no_more_games.is_cancelled() || self.rooms.is_shutting_down() {
            return Err(CreateProblem::ShuttingDown);
        }
        if !store.has_space() {
            return Err(CreateProblem::DiskNearlyFull);
        }
        let owner = request.map_or_else(|| Token::random(Id::random()), |key| key.owner());
        let owner = Token {
            room: shortened(owner.room),
            ..owner
        };
        // Runs to completion even if the caller is cancelled: a half-created study would be stored
        // without running.
        let studies = Arc::clone(self);
        let making = async move { studies.make(settings, (plan, core), owner, charged).await };
        (self.tracker.spawn(making).await)
            .map_err(|error| StoreError::Failed(format!("creating a study failed: {error}")))?
    }

    async fn make(
        &self,
        settings: v1::StudySettings,
        (plan, core): (StudyPlan, Study),
        owner: Token,
        charged: Key,
    ) -> Result<(Arc<StudyHandle>, Token), CreateProblem> {
        // One at a time: a repetition of a request finds the study.
        let _creating = self.creating.lock().await;
        if let Some(handle) = self.get(owner.room) {
            return match handle.header.owner.matches(&owner.secret) {
                true => Ok((handle, owner)),
                false => Err(CreateProblem::RequestIdUsed),
            };
        }
        let place = self.places.try_take(charged).ok_or(Refused {
            reason: "TOO_MANY_STUDIES",
            what: "too many studies",
            limit: self.places.share_of(charged) as u64,
            retry_after: RETRY_STUDIES,
        })?;
        let header = StudyHeader {
            id: owner.room,
            settings,
            created_at_ms: (self.now)(),
            owner: owner.hash(),
            key: random_bytes(),
        };
        let store = self.rooms.store();
        store.create_study(Arc::new(header.clone())).await?;
        let handle = self.start_task(header, 0, plan, core, (charged, Some(place)));
        Ok((handle, owner))
    }

    /// Resumes the studies of the store. The rooms must be restored already. One that cannot be read
    /// is logged and left unchanged.
    ///
    /// # Errors
    /// The store failed.
    pub async fn restore(&self) -> Result<(), StoreError> {
        let store = self.rooms.store();
        if !store.hosts_studies() {
            return Ok(());
        }
        let mut count = 0;
        for id in store.studies().await? {
            let restored = store.study(id).await.map_err(|error| error.to_string());
            let restored = restored.and_then(|stored| {
                let Some(stored) = stored else { return Ok(()) };
                let problem = |problem: SettingsProblem| problem.to_string();
                let plan = convert::study_plan(&stored.header.settings).map_err(problem)?;
                let mut study = Study::new(plan.core.clone()).map_err(problem)?;
                stored.changes.iter().for_each(|change| study.fold(change));
                let charged = (Key::Study(id), None);
                self.start_task(stored.header, stored.rows, plan, study, charged);
                Ok(())
            });
            match restored {
                Ok(()) => count += 1,
                Err(problem) => {
                    error!(study = %id, %problem, "a study cannot be resumed; it is left unchanged");
                }
            }
        }
        if count > 0 {
            info!(studies = count, "studies resumed");
        }
        Ok(())
    }

    /// Deletes a study with all its data. Returns the numbers of its participants and games.
    ///
    /// # Errors
    /// The server ends or its store failed, or (inner result) somebody is in the middle of it: how
    /// many.
    pub async fn delete(
        self: &Arc<Self>,
        handle: Arc<StudyHandle>,
        force: bool,
    ) -> Result<Result<(usize, usize), usize>, Stopped> {
        let studies = Arc::clone(self);
        // Runs to completion even if the caller is cancelled.
        let deleting = self.tracker.spawn(async move {
            let games = match handle.delete(force).await? {
                Ok(games) => games,
                Err(active) => return Ok(Err(active)),
            };
            studies.lock().remove(handle.id());
            let participants = handle.read(|study| study.participants().len());
            Ok(Ok((participants, games)))
        });
        deleting.await.map_err(|_| Stopped)?
    }

    /// Stops beginning and counting games; those that end from here on count when the server is
    /// restarted.
    pub fn stop(&self) {
        self.stop.no_more_games.cancel();
    }

    /// Ends the tasks of all studies.
    pub fn end(&self) {
        self.stop.end.cancel();
    }

    /// The study with this id.
    pub fn get(&self, id: Id) -> Option<Arc<StudyHandle>> {
        self.lock().by_id.get(&id).cloned()
    }

    /// The study whose id begins with these bytes, as links have them.
    pub fn by_short_id(&self, short: [u8; 12]) -> Option<Arc<StudyHandle>> {
        let mut id = [0; 16];
        id[..short.len()].copy_from_slice(&short);
        self.get(Id(id))
    }

    /// All studies, newest first.
    pub fn newest(&self) -> Vec<Arc<StudyHandle>> {
        self.lock().in_order.iter().rev().cloned().collect()
    }

    /// The games of all studies.
    pub fn games(&self) -> BTreeSet<Id> {
        let mut games = BTreeSet::new();
        for handle in self.newest() {
            handle.read(|study| {
                let played = study.participants().values().flat_map(|it| &it.games);
                games.extend(played.map(|game| Id(game.placed.game)));
            });
        }
        games
    }

    fn start_task(
        &self,
        header: StudyHeader,
        rows: u64,
        plan: StudyPlan,
        study: Study,
        (charged, place): (Key, Option<Held>),
    ) -> Arc<StudyHandle> {
        let (mailbox, inbox) = mpsc::channel(STUDY_MAILBOX);
        let handle = Arc::new(StudyHandle {
            header,
            plan,
            charged,
            _place: place,
            committed: Mutex::new(study),
            mailbox,
            changes: watch::Sender::new(0),
            views: Mutex::default(),
            deleting: Mutex::new(BTreeSet::new()),
            traces: AsyncMutex::default(),
            streams: AtomicU64::new(0),
        });
        let mut table = self.lock();
        table.in_order.push(Arc::clone(&handle));
        table.by_id.insert(handle.id(), Arc::clone(&handle));
        drop(table);
        let task = Task::new(Arc::clone(&handle), Arc::clone(&self.rooms), self.now, rows);
        self.tracker.spawn(task.run(inbox, self.stop.clone()));
        handle
    }

    fn lock(&self) -> MutexGuard<'_, Table> {
        (self.table.lock()).expect("no code that holds this lock can panic")
    }
}

/// An id whose last four bytes are 0, so that links can leave them out.
fn shortened(id: Id) -> Id {
    Id(std::array::from_fn(|index| match index {
        0..12 => id.0[index],
        _ => 0,
    }))
}
