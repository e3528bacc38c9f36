//! The studies of a server: creates, finds and resumes them. `chefshat_study` decides what each
//! participant does next; `task` runs one study; `export` gathers its data.

mod data;
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

use chefshat_proto::cost::{Cost, shapes};
use chefshat_proto::v1;
use chefshat_study::{SettingsProblem, Study};
use prost::Message as _;
use tokio::sync::{Mutex as AsyncMutex, Notify, mpsc, watch};
use tokio_util::task::TaskTracker;
use tracing::{error, info};

pub use export::{ExportError, ExportedFile};
pub use handle::{MAX_TRACES, MAX_TRACES_OF_GAME, NotAdded, Presence, StudyHandle, TraceRefusal};
pub use message::Stopped;

use crate::clock::{TimeOfDay, since_epoch_ms};
use crate::cluster::News;
use crate::config::{MAX_STUDIES, MAX_STUDY_DATA, MAX_STUDY_MEMORY, STUDY_MAILBOX};
use crate::convert::{self, StudyPlan};
use crate::limits::{Held, Key, Places, Refused};
use crate::rooms::Rooms;
use crate::store::StoreError;
use crate::store::studies::{StoredStudy, StudyHeader};
use crate::tasks::{LongTask, named, short};
use chefshat_room::ids::{Id, RequestKey, Token, random_bytes};
use data::{RETRY_STUDIES, StudyData};
use task::{Stop, Task};

/// Why a study was not created.
#[derive(Debug, thiserror::Error)]
pub enum CreateProblem {
    /// A setting is invalid.
    #[error(transparent)]
    Settings(#[from] SettingsProblem),
    /// The store of this server has no studies.
    #[error("this server cannot host studies")]
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
    /// Notified when the creation of a study has ended.
    created: Notify,
    places: Arc<Places>,
    /// The memory of their settings, in KiB.
    memory: Arc<Places>,
    /// The memory of their participants and answers, in bytes.
    data: Arc<Places>,
}

#[derive(Debug, Default)]
struct Table {
    in_order: Vec<Arc<StudyHandle>>,
    by_id: BTreeMap<Id, Arc<StudyHandle>>,
    /// The study that is being created, if there is one.
    in_creation: Option<Id>,
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
    pub(crate) fn at(now: TimeOfDay, rooms: Arc<Rooms>, tracker: TaskTracker) -> Arc<Self> {
        let places = Places::new(MAX_STUDIES, rooms.shares());
        let memory = Places::new(MAX_STUDY_MEMORY / 1024, rooms.shares());
        let data = Places::new(MAX_STUDY_DATA, rooms.shares());
        Arc::new(Self {
            memory,
            data,
            rooms,
            now,
            tracker,
            stop: Stop::default(),
            table: Mutex::default(),
            creating: AsyncMutex::default(),
            created: Notify::new(),
            places,
        })
    }

    /// The rooms of its games.
    pub fn rooms(&self) -> &Arc<Rooms> {
        &self.rooms
    }

    /// The id of the study that this request creates.
    pub fn created_id(request: RequestKey) -> Id {
        shortened(request.owner().room)
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
        if !store.hosts_studies() {
            return Err(CreateProblem::NotHosted);
        }
        let durable = store.outlives_server();
        // Long settings take milliseconds to check.
        let checked = tokio::task::spawn_blocking(move || {
            let settings = convert::complete_settings(settings, random_bytes, durable)?;
            let plan = convert::study_plan(&settings)?;
            let core = Study::new(Arc::clone(&plan.core))?;
            let memory = memory_of(&settings);
            Ok::<_, SettingsProblem>((settings, (plan, core, memory)))
        });
        let (settings, checked) = (checked.await)
            .map_err(|error| StoreError::Failed(format!("checking settings failed: {error}")))??;
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
        let making = async move { studies.make(settings, checked, owner, charged).await };
        (self.tracker.spawn(short("one study", making)).await)
            .map_err(|error| StoreError::Failed(format!("creating a study failed: {error}")))?
    }

    async fn make(
        &self,
        settings: v1::StudySettings,
        (plan, core, memory): (StudyPlan, Study, usize),
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
        let refused = |what, limit: usize| Refused {
            reason: "TOO_MANY_STUDIES",
            what,
            limit: limit as u64,
            retry_after: RETRY_STUDIES,
        };
        let place = (self.places.try_take(charged))
            .ok_or_else(|| refused("too many studies", self.places.share_of(charged)))?;
        let share = self.memory.share_of(charged);
        let memory = (self.memory).try_take_many(charged, memory.div_ceil(1024).min(share));
        let memory = memory.ok_or_else(|| {
            let what = "studies take too much memory together; delete some, or shorten them";
            refused(what, share * 1024)
        })?;
        let header = StudyHeader {
            id: owner.room,
            settings,
            created_at_ms: (self.now)(),
            owner: owner.hash(),
            key: random_bytes(),
        };
        let store = self.rooms.store();
        self.lock().in_creation = Some(header.id);
        let stored = store.create_study(Arc::new(header.clone())).await;
        let created = stored.map(|()| {
            if let Some(lease) = self.rooms.lease() {
                lease.report(header.id, News::Created { ephemeral: false });
            }
            self.start_task(header, 0, plan, core, (charged, [place, memory]))
        });
        self.lock().in_creation = None;
        self.created.notify_waiters();
        Ok((created?, owner))
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
            match store.study(id).await {
                Ok(Some(stored)) => count += usize::from(self.resume(stored)),
                Ok(None) => {}
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

    /// Resumes a study, whose rooms must be restored already. Returns whether it runs; one that cannot
    /// be resumed is logged and left unchanged.
    pub(crate) fn resume(&self, stored: StoredStudy) -> bool {
        let id = stored.header.id;
        let problem = |problem: SettingsProblem| problem.to_string();
        let folded = || {
            let plan = convert::study_plan(&stored.header.settings).map_err(problem)?;
            let mut study = Study::new(Arc::clone(&plan.core)).map_err(problem)?;
            stored.changes.iter().for_each(|change| study.fold(change));
            Ok::<_, String>((plan, study))
        };
        match folded() {
            Ok((plan, study)) => {
                // It counts among those of the server; who created it is unknown.
                let charged = Key::Study(id);
                let memory = memory_of(&stored.header.settings).div_ceil(1024);
                let memory = self.memory.take_many_anyway(charged, memory);
                let places = [self.places.take_anyway(charged), memory];
                let charged = (charged, places);
                self.start_task(stored.header, stored.rows, plan, study, charged);
                true
            }
            Err(problem) => {
                error!(study = %id, %problem, "a study cannot be resumed; it is left unchanged");
                false
            }
        }
    }

    /// Whether this study runs here, or is being created.
    pub(crate) fn runs(&self, id: Id) -> bool {
        let table = self.lock();
        let running = |handle: &Arc<StudyHandle>| !handle.mailbox.is_closed();
        table.by_id.get(&id).is_some_and(running) || table.in_creation == Some(id)
    }

    /// Makes the task of a study end without publishing anything more.
    pub(crate) fn fence(&self, id: Id) {
        if let Some(handle) = self.get(id) {
            handle.end.cancel();
        }
    }

    /// Ends the task of a study, and forgets it: another node may have it.
    pub(crate) async fn stop_one(&self, id: Id) {
        loop {
            let created = self.created.notified();
            if self.lock().in_creation != Some(id) {
                break;
            }
            created.await;
        }
        let Some(handle) = self.get(id) else { return };
        handle.end.cancel();
        handle.mailbox.closed().await;
        self.lock().remove(id);
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
        let deleting = self.tracker.spawn(short("one study", async move {
            let games = match handle.delete(force).await? {
                Ok(games) => games,
                Err(active) => return Ok(Err(active)),
            };
            studies.lock().remove(handle.id());
            let participants = handle.read(|study| study.participants().len());
            Ok(Ok((participants, games)))
        }));
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

    /// The id that begins with these bytes, as links have them.
    pub fn full_id(short: [u8; 12]) -> Id {
        let mut id = [0; 16];
        id[..short.len()].copy_from_slice(&short);
        Id(id)
    }

    /// All studies, newest first.
    pub fn newest(&self) -> Vec<Arc<StudyHandle>> {
        self.lock().in_order.iter().rev().cloned().collect()
    }

    fn start_task(
        &self,
        header: StudyHeader,
        rows: u64,
        plan: StudyPlan,
        study: Study,
        (charged, places): (Key, [Held; 2]),
    ) -> Arc<StudyHandle> {
        let (mailbox, inbox) = mpsc::channel(STUDY_MAILBOX);
        let stop = Stop {
            end: self.stop.end.child_token(),
            ..self.stop.clone()
        };
        let id = header.id;
        let handle = Arc::new(StudyHandle {
            end: stop.end.clone(),
            header,
            plan,
            charged,
            _places: places,
            data: Arc::new(StudyData::of(&study, id, &self.data)),
            committed: Mutex::new(study),
            mailbox,
            changes: watch::Sender::new(0),
            views: Mutex::default(),
            deleting: Mutex::new(BTreeSet::new()),
            traces: AsyncMutex::default(),
            streams: AtomicU64::new(0),
        });
        let mut table = self.lock();
        table.remove(handle.id());
        table.in_order.push(Arc::clone(&handle));
        table.by_id.insert(handle.id(), Arc::clone(&handle));
        drop(table);
        let task = Task::new(Arc::clone(&handle), Arc::clone(&self.rooms), self.now, rows);
        let running = named(LongTask::Study, task.run(inbox, stop));
        self.tracker.spawn(running);
        handle
    }

    fn lock(&self) -> MutexGuard<'_, Table> {
        (self.table.lock()).expect("no code that holds this lock can panic")
    }
}

/// Bytes that settings take in memory, at most.
fn memory_of(settings: &v1::StudySettings) -> usize {
    let cost = shapes::STUDY_SETTINGS.cost(&settings.encode_to_vec(), Cost::MAX);
    cost.expect("what was just encoded is readable").memory
}

/// An id whose last four bytes are 0, so that links can leave them out.
fn shortened(id: Id) -> Id {
    Id(std::array::from_fn(|index| match index {
        0..12 => id.0[index],
        _ => 0,
    }))
}
