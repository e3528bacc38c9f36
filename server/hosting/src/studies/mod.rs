//! The studies of a server: creates, finds and resumes them. `chefshat_study` decides what each
//! participant does next; `task` runs one study; `export` gathers its data.

mod data;
mod expiry;
mod export;
mod games;
mod handle;
mod message;
mod state;
mod task;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use bytes::Bytes;
use chefshat_proto::v1;
use chefshat_study::{SettingsProblem, Study};
use tokio_util::task::TaskTracker;

pub use export::{ExportError, ExportedFile};
pub use handle::{MAX_TRACES, MAX_TRACES_OF_GAME, NotDone, Presence, StudyHandle, TraceRefusal};
pub use message::NotDeleted;

use crate::config::{MAX_STUDY_DATA, MAX_STUDY_MEMORY};
use crate::journaled::{Folded, Journaled as _, New, Registry, Stopped, owner_of};
use crate::rooms::{self, Rooms};
use chefshat_admission::limits::{FairSemaphore, Key, Refused};
use chefshat_base::clock::{TimeOfDay, since_epoch_ms};
use chefshat_base::tasks::short;
use chefshat_room::ids::{Id, RequestKey, StudyId, StudyToken, Token, random_bytes};
use chefshat_store::StoreError;
use chefshat_store::studies::StudyHeader;
use chefshat_wire::convert::{self, StudyPlan};
use data::{StudyData, memory_of};
use state::{Budgets, StudyShared};
use task::StudyTask;
pub(crate) use task::restored;

/// Why a study was not created.
pub type CreateError = rooms::CreateError<SettingsProblem>;

/// The studies of a server.
pub type Studies = Registry<StudyTask>;

/// A study whose settings are valid.
struct Checked {
    settings: v1::StudySettings,
    plan: StudyPlan,
    core: Study,
    /// Bytes that the settings take in memory, at most.
    memory: usize,
}

impl Studies {
    /// Creates an empty set. A shutdown waits for the tasks in `tracker`.
    pub fn new(rooms: Arc<Rooms>, tracker: TaskTracker) -> Arc<Self> {
        Self::at(since_epoch_ms, rooms, tracker)
    }

    /// As [`Studies::new`], with this clock.
    pub fn at(now: TimeOfDay, rooms: Arc<Rooms>, tracker: TaskTracker) -> Arc<Self> {
        let memory = FairSemaphore::new(MAX_STUDY_MEMORY / 1024, rooms.shares());
        let data = FairSemaphore::new(MAX_STUDY_DATA, rooms.shares());
        Self::empty(rooms, tracker, Budgets { now, memory, data })
    }

    /// The id of the study that this request creates.
    pub fn created_id(request: RequestKey) -> StudyId {
        shortened(request.created_id())
    }

    /// Creates a study. Returns it with its owner token.
    ///
    /// # Errors
    /// See [`CreateError`].
    pub async fn create(
        self: &Arc<Self>,
        settings: v1::StudySettings,
        request: Option<RequestKey>,
        charged: Key,
    ) -> Result<(Arc<StudyHandle>, StudyToken), CreateError> {
        let durable = self.rooms.store().outlives_server();
        // Long settings take milliseconds to check.
        let checking = tokio::task::spawn_blocking(move || check(settings, durable));
        let checked = (checking.await)
            .map_err(|error| StoreError::Failed(format!("checking settings failed: {error}")))?
            .map_err(CreateError::Settings)?;
        let owner: StudyToken = owner_of(request);
        let owner = Token {
            subject: shortened(owner.subject),
            ..owner
        };
        let studies = Arc::clone(self);
        let making = async move { studies.make(checked, owner, charged).await };
        Ok((self.create_once(owner, charged, making).await?, owner))
    }

    async fn make(
        &self,
        checked: Checked,
        owner: StudyToken,
        charged: Key,
    ) -> Result<New<StudyTask>, CreateError> {
        // A repeated request for a study that there is does not come here.
        let deletes_at_ms = checked.plan.core.deletes_at_ms;
        if deletes_at_ms.is_some_and(|at_ms| at_ms <= (self.common.now)()) {
            return Err(CreateError::Settings(SettingsProblem {
                field: "deletes_at_ms".to_owned(),
                problem: "this time has passed".to_owned(),
            }));
        }
        let budget = &self.common.memory;
        let share = budget.share_of(charged);
        let memory = budget.try_take_many(charged, checked.memory.div_ceil(1024).min(share));
        let memory = memory.ok_or_else(|| Refused {
            what: "studies take too much memory together; delete some, or shorten them",
            ..StudyTask::too_many(share as u64 * 1024)
        })?;
        let header = StudyHeader {
            id: owner.subject,
            settings: checked.settings,
            created_at_ms: (self.common.now)(),
            owner: owner.hash(),
            key: random_bytes(),
        };
        self.store_new(&header, None).await?;
        let data = StudyData::of(&checked.core, header.id, &self.common.data);
        let folded = Folded {
            header,
            plan: checked.plan,
            state: checked.core,
            rows: 0,
        };
        let shared = StudyShared::new(memory, Arc::new(data));
        Ok(New { folded, shared })
    }

    /// Deletes a study with all its data. Returns the numbers of its participants and games.
    ///
    /// # Errors
    /// See [`NotDeleted`].
    pub async fn delete(
        self: &Arc<Self>,
        handle: Arc<StudyHandle>,
        force: bool,
    ) -> Result<(usize, usize), NotDeleted> {
        let studies = Arc::clone(self);
        // Runs to completion even if the caller is cancelled.
        let deleting = self
            .tracker
            .spawn(short("one tournament or study", async move {
                let games = handle.delete(force).await?;
                studies.forget_one(handle.id());
                let participants = handle.read(|study| {
                    let participants = study.participants().values();
                    participants.filter(|it| !it.test).count()
                });
                Ok((participants, games))
            }));
        deleting.await.map_err(|_| Stopped)?
    }

    /// The id that begins with these bytes, as links have them.
    pub fn full_id(short: [u8; 12]) -> StudyId {
        let mut id = [0; 16];
        id[..short.len()].copy_from_slice(&short);
        Id::from_bytes(id)
    }
}

fn check(settings: v1::StudySettings, durable: bool) -> Result<Checked, SettingsProblem> {
    let mut settings = convert::complete_settings(settings, random_bytes, durable)?;
    for picture in &mut settings.pictures {
        // A part of the request would keep all of it in memory.
        picture.data = Bytes::copy_from_slice(&picture.data);
    }
    let plan = convert::study_plan(&settings)?;
    let core = Study::new(Arc::clone(&plan.core))?;
    let memory = memory_of(&settings);
    Ok(Checked {
        settings,
        plan,
        core,
        memory,
    })
}

/// An id whose last four bytes are 0, so that links can leave them out.
fn shortened(id: StudyId) -> StudyId {
    Id::from_bytes(std::array::from_fn(|index| match index {
        0..12 => id.bytes()[index],
        _ => 0,
    }))
}
