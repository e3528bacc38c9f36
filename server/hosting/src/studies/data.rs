//! The memory of the participants of one study and of their answers, which last as long as the study:
//! a budget of the whole server, of which each caller may use its share. Settings have a budget of
//! their own.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use chefshat_proto::cost::{Cost, shapes};
use chefshat_proto::v1;
use chefshat_study::{Device, DeviceSession, ItemAnswer, Participant, Study};
use prost::Message as _;

use chefshat_admission::limits::{FairSemaphore, Key, Permit, Refused};
use chefshat_base::lock::Lock;
use chefshat_room::ids::StudyId;

/// When it is worth trying again to create a study, or to add to one.
pub(super) const RETRY_STUDIES: Duration = Duration::from_secs(3_600);
/// Bytes that the answers of a questionnaire take besides their content.
const OVERHEAD_OF_ANSWERS: usize = 256;

/// The memory that one study has taken, until it is dropped.
#[derive(Debug)]
pub(super) struct StudyData {
    /// One place is one byte.
    budget: Arc<FairSemaphore>,
    participants: Lock<Vec<Permit>>,
    /// By number of the participant.
    answers: Lock<BTreeMap<u32, Answers>>,
}

/// The memory of the answers, devices and traces of a participant.
#[derive(Debug, Default)]
struct Answers {
    given: Vec<Permit>,
    others: Vec<Permit>,
    /// Of those that were saved while they are entered.
    saved: Option<Permit>,
}

impl StudyData {
    /// Takes what a study has, even beyond the budget: a study that was stored is always resumed.
    /// Who sent it is unknown.
    pub(super) fn of(study: &Study, id: StudyId, budget: &Arc<FairSemaphore>) -> Self {
        let take = |bytes| budget.take_many_anyway(Key::Study(id), bytes);
        let participants = study.participants();
        let bytes: usize = (participants.values())
            .map(|it| memory_of_participant(it.pseudonym.len() + it.panel_id().len()))
            .sum();
        let answers = participants.iter().map(|(number, participant)| {
            let given = participant.answers.values();
            let given = given.map(|answers| take(memory_of_answers(answers)));
            let saved = &participant.saved_answers;
            let saved = (!saved.is_empty()).then(|| take(memory_of_answers(saved)));
            let given = given.collect();
            let devices = participant.devices.values();
            let devices = devices.map(|it| take(memory_of_device(&it.device)));
            let answers = Answers {
                given,
                others: devices.collect(),
                saved,
            };
            (*number, answers)
        });
        Self {
            answers: Lock::new(answers.collect()),
            participants: Lock::new(Vec::from_iter((bytes > 0).then(|| take(bytes)))),
            budget: Arc::clone(budget),
        }
    }

    /// Takes memory for new participants with these pseudonyms.
    ///
    /// # Errors
    /// The caller, or the server, has too much.
    pub(super) fn for_participants(&self, key: Key, names: &[String]) -> Result<Permit, Refused> {
        let bytes = names.iter().map(|name| memory_of_participant(name.len()));
        self.take(key, bytes.sum()).ok_or_else(|| Refused {
            reason: "TOO_MANY_PARTICIPANTS",
            what: "the participants of studies take too much memory together, in bytes; delete a study that is over",
            ..self.refused(key)
        })
    }

    /// Takes memory for answers.
    ///
    /// # Errors
    /// The caller, or the server, has too much.
    pub(super) fn for_answers(&self, key: Key, answers: &[ItemAnswer]) -> Result<Permit, Refused> {
        let taken = self.take(key, memory_of_answers(answers));
        taken.ok_or_else(|| self.refused(key))
    }

    /// Takes memory for a device; `None` if the caller, or the server, has too much.
    pub(super) fn for_device(&self, key: Key, device: &Device) -> Option<Permit> {
        self.take(key, memory_of_device(device))
    }

    /// Takes memory for traces, where the store keeps them in memory; `None` if the caller, or the server,
    /// has too much.
    pub(super) fn for_traces(&self, key: Key, traces: &[v1::StudyTrace]) -> Option<Permit> {
        let bytes = traces
            .iter()
            .map(|it| size_of::<v1::StudyTrace>() + it.target.len());
        self.take(key, bytes.sum())
    }

    /// Keeps the memory of a device or of traces of a participant.
    pub(super) fn keep(&self, number: u32, held: Permit) {
        let mut answers = self.answers.lock();
        answers.entry(number).or_default().others.push(held);
    }

    /// Keeps the memory of participants that were added.
    pub(super) fn keep_participants(&self, held: Permit) {
        self.participants.lock().push(held);
    }

    /// Keeps the memory of answers that a participant gave, and no longer that of those it had saved.
    pub(super) fn keep_answers(&self, number: u32, held: Permit) {
        let mut answers = self.answers.lock();
        let answers = answers.entry(number).or_default();
        answers.given.push(held);
        answers.saved = None;
    }

    /// Keeps the memory of answers that a participant saved, in place of those it had saved before.
    pub(super) fn keep_saved_answers(&self, number: u32, held: Permit) {
        self.answers.lock().entry(number).or_default().saved = Some(held);
    }

    /// Gives the memory of a participant's answers and devices back.
    pub(super) fn forget_answers(&self, number: u32) {
        let forgotten = self.answers.lock().remove(&number);
        drop(forgotten);
    }

    fn take(&self, key: Key, bytes: usize) -> Option<Permit> {
        self.budget.try_take_many(key, bytes)
    }

    fn refused(&self, key: Key) -> Refused {
        Refused {
            reason: "TOO_MANY_ANSWERS",
            what: "the answers of studies take too much memory together, in bytes; shorten yours, or delete a study that is over",
            limit: self.budget.share_of(key) as u64,
            retry_after: RETRY_STUDIES,
        }
    }
}

/// Bytes of a participant with a name, and an id at a panel, of this length together. The task and its
/// handle have a copy each.
fn memory_of_participant(names: usize) -> usize {
    2 * (size_of::<Participant>() + names)
}

/// Bytes of a session on a device, of which the task and its handle have a copy each.
fn memory_of_device(device: &Device) -> usize {
    2 * (size_of::<(u32, DeviceSession)>() + device.time_zone.len())
}

/// Bytes of answers, which the copies share.
fn memory_of_answers(answers: &[ItemAnswer]) -> usize {
    let content: usize = answers.iter().map(ItemAnswer::memory).sum();
    OVERHEAD_OF_ANSWERS + content
}

/// Bytes that settings take in memory, at most.
pub(super) fn memory_of(settings: &v1::StudySettings) -> usize {
    let cost = shapes::STUDY_SETTINGS.cost(&settings.encode_to_vec(), Cost::MAX);
    cost.expect("what was just encoded is readable").memory
}
