//! What researchers and participants ask for. A command returns the change that follows, or refuses
//! and leaves the study as it is. Secrets and links are checked before.

use std::collections::BTreeSet;

use sha2::{Digest as _, Sha256};
use thiserror::Error;

use crate::Study;
use crate::change::{
    Added, Answered, Change, Consented, Continued, Ended, Joined, Opened, Saved, Withdrew,
};
use crate::device::{Device, Pointer, RequiredDevice};
use crate::games::Phase;
use crate::questionnaire::{AnswerProblem, ItemAnswer};
use crate::settings::{MAX_PARTICIPANTS, MAX_TESTS};
use crate::stage::{Step, Task};
use crate::state::{Participant, Status};

/// Maximum number of sessions that a participant may open, which bounds the journal.
pub const MAX_SESSIONS: u32 = 1000;
/// Maximum number of times that a participant may save answers, which bounds the journal.
pub const MAX_SAVES: u32 = 1000;

/// Why a command is refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Refusal {
    /// No such participant.
    #[error("the study has no such participant")]
    Unknown,
    /// The study is closed.
    #[error("the study is closed")]
    Closed,
    /// All slots are taken.
    #[error("the study has all its participants")]
    Full,
    /// The participant has completed the study or left it.
    #[error("the participation is over")]
    Over,
    /// The study needs another device.
    #[error("{}", needed(*.0))]
    WrongDevice(RequiredDevice),
    /// A newer session was opened.
    #[error("the study was opened again, here or on another device; use that page")]
    Superseded,
    /// The participant is at another step.
    #[error("this step is over; reload the page")]
    StepOver,
    /// The step needs another command.
    #[error("this step needs another answer; reload the page")]
    StepMismatch,
    /// The game has not ended.
    #[error("the game has not ended")]
    GameNotOver,
    /// The participant has opened too many sessions.
    #[error("the study was opened more than {MAX_SESSIONS} times")]
    TooManySessions,
    /// The participant has saved answers too often.
    #[error("answers were saved more than {MAX_SAVES} times")]
    TooManySaves,
    /// The answers are invalid.
    #[error(transparent)]
    Answers(#[from] AnswerProblem),
    /// Not an id at the panel, or one that is not asked for.
    #[error("{0}")]
    PanelId(String),
    /// A participant has this id at the panel.
    #[error("somebody with this id already takes part; continue in the browser in which you began")]
    PanelIdTaken,
    /// Another participant has this pseudonym.
    #[error("another participant is called {0:?}")]
    NameTaken(String),
    /// Too many participants, with those who left.
    #[error("a study has at most {MAX_PARTICIPANTS} participants, with those who left")]
    TooManyParticipants,
    /// Those who are to play together make no whole groups of this size.
    #[error("{}", no_whole_groups(*.0))]
    NoWholeGroups(u32),
    /// Too many test participants.
    #[error("a study has at most {MAX_TESTS} test participants, with those who are done")]
    TooManyTests,
}

fn needed(RequiredDevice { pointer, min_width }: RequiredDevice) -> String {
    let device = match pointer {
        None | Some(Pointer::None) => "a device",
        Some(Pointer::Fine) => "a computer with a mouse or touchpad",
        Some(Pointer::Coarse) => "a phone or tablet",
    };
    let page = match min_width {
        0 => String::new(),
        _ => format!(" with a page at least {min_width} CSS pixels wide"),
    };
    format!("this study needs {device}{page}; open the link there")
}

fn no_whole_groups(size: u32) -> String {
    match size {
        1 => "nobody plays together in this study: its settings have no groups".to_owned(),
        _ => {
            format!("those who play together are added in a multiple of {size}, the size of groups")
        }
    }
}

/// Participants to add.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct NewParticipants {
    /// Their pseudonyms. An empty one stands for a name by number, such as "P01", or "T01" in a test.
    pub pseudonyms: Vec<String>,
    /// Whether they are test participants.
    pub test: bool,
    /// Whether they play with each other, in their order.
    pub together: bool,
}

impl NewParticipants {
    /// This number of participants who are named by number.
    pub fn numbered(count: usize) -> Self {
        Self {
            pseudonyms: vec![String::new(); count],
            ..Self::default()
        }
    }
}

/// Where a participant's command comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct At {
    /// Number of the participant.
    pub number: u32,
    /// Number of its session.
    pub session: u32,
    /// The step that was shown, from 0.
    pub step: usize,
}

impl Study {
    /// The changes that add participants.
    ///
    /// # Errors
    /// If the study is closed or has too many participants, if a pseudonym is taken, or if those who
    /// play together make no whole groups.
    pub fn add(&self, new: &NewParticipants) -> Result<Vec<Change>, Refusal> {
        if self.is_closed() {
            return Err(Refusal::Closed);
        }
        let (pseudonyms, test, together) = (&new.pseudonyms, new.test, new.together);
        let size = self.settings().group_size();
        if together && (size == 1 || !pseudonyms.len().is_multiple_of(size as usize)) {
            return Err(Refusal::NoWholeGroups(size));
        }
        let first = self.next_number();
        let alike = self.participants().values().filter(|it| it.test == test);
        let (most, refusal) = match test {
            true => (MAX_TESTS, Refusal::TooManyTests),
            false => (MAX_PARTICIPANTS, Refusal::TooManyParticipants),
        };
        if alike.count() + pseudonyms.len() > most as usize {
            return Err(refusal);
        }
        let participants = self.participants().values();
        let mut taken: BTreeSet<String> =
            participants.map(|it| it.pseudonym.to_lowercase()).collect();
        for pseudonym in pseudonyms.iter().filter(|it| !it.is_empty()) {
            if !taken.insert(pseudonym.to_lowercase()) {
                return Err(Refusal::NameTaken(pseudonym.clone()));
            }
        }
        let mut changes = Vec::new();
        for (number, pseudonym) in (first..).zip(pseudonyms) {
            let mut pseudonym = pseudonym.clone();
            if pseudonym.is_empty() {
                // A name by number that was given to somebody else is skipped.
                let letter = if test { 'T' } else { 'P' };
                pseudonym = (number..)
                    .map(|number| format!("{letter}{number:02}"))
                    .find(|name| taken.insert(name.to_lowercase()))
                    .expect("there are more numbers than participants");
            }
            changes.push(Change::Added(Added {
                number,
                pseudonym,
                joined: None,
                test,
                planned: together.then(|| number - (number - first) % size),
            }));
        }
        Ok(changes)
    }

    /// The changes that add somebody in the place of a participant: in its planned group, too, while
    /// that waits for it.
    ///
    /// # Errors
    /// As [`Study::add`].
    pub fn replacement(&self, number: u32) -> Result<Vec<Change>, Refusal> {
        let participant = self.participant(number);
        let mut changes = self.add(&NewParticipants {
            test: participant.is_some_and(|it| it.test),
            ..NewParticipants::numbered(1)
        })?;
        let plan = participant.and_then(|it| it.planned);
        let mut others = self.participants().values().filter(|it| it.planned == plan);
        let is_formed = others.any(|it| it.group.is_some());
        for change in &mut changes {
            if let Change::Added(added) = change {
                added.planned = plan.filter(|_| !is_formed);
            }
        }
        Ok(changes)
    }

    /// The number of the participant that is added next.
    pub fn next_number(&self) -> u32 {
        self.participants().len() as u32 + 1
    }

    /// The participant who joined by the open link with the request of this hash.
    pub fn joined_by(&self, request_sha256: &[u8]) -> Option<u32> {
        let is_by = |joined: &Joined| joined.request_sha256 == *request_sha256;
        let mut participants = self.participants().iter();
        participants
            .find(|(_, it)| it.joined.as_ref().is_some_and(is_by))
            .map(|(number, _)| *number)
    }

    /// The participant who joined by the open link with a request, and the change that adds it unless
    /// the request is repeated.
    ///
    /// # Errors
    /// The study has no open link, is closed, full, or has too many participants; the id at the panel
    /// is refused or taken; or the study needs another device.
    pub fn join(
        &self,
        joined: Joined,
        device: Option<&Device>,
        now_ms: u64,
    ) -> Result<(u32, Option<Change>), Refusal> {
        let recruiting = &self.settings().recruiting;
        if !recruiting.open_link {
            return Err(Refusal::Unknown);
        }
        if let Some(number) = self.joined_by(&joined.request_sha256) {
            return Ok((number, None));
        }
        recruiting
            .check_panel_id(&joined.panel_id)
            .map_err(Refusal::PanelId)?;
        let has_id = !joined.panel_id.is_empty();
        let mut others = self.participants().values();
        if has_id && others.any(|other| other.panel_id() == joined.panel_id) {
            return Err(Refusal::PanelIdTaken);
        }
        if self.is_closed_at(now_ms) {
            return Err(Refusal::Closed);
        }
        let mut change = self.add(&NewParticipants::numbered(1))?.pop();
        if !self.has_place(false, None) {
            return Err(Refusal::Full);
        }
        self.check_device(device, false)?;
        if let Some(Change::Added(added)) = &mut change {
            added.joined = Some(joined);
        }
        Ok((self.next_number(), change))
    }

    /// The change that opens a session of a participant, which is the newest then; `None` if its
    /// participation is over, and there is only its end to show. The first session takes a slot, unless
    /// the participant is asked for consent before its condition matters.
    ///
    /// # Errors
    /// If the participant is unknown, cannot begin, or needs another device.
    pub fn open(
        &self,
        number: u32,
        device: Option<Device>,
        now_ms: u64,
    ) -> Result<Option<Change>, Refusal> {
        let participant = self.known(number)?;
        let has_place = || self.has_place(participant.test, participant.planned);
        let slot = match participant.status {
            Status::Invited if self.is_closed_at(now_ms) => return Err(Refusal::Closed),
            Status::Invited if !has_place() => return Err(Refusal::Full),
            Status::Invited => {
                let settings = self.settings();
                let assigns = settings.groups.is_none() && !settings.assigns_by_consent();
                assigns.then(|| self.free_slot(participant.test)).flatten()
            }
            Status::Active => None,
            Status::DroppedOut if self.is_replaced(participant) => return Ok(None),
            Status::DroppedOut => {
                // Who has no group needs a place in one.
                let needs_place = self.settings().groups.is_some() && participant.group.is_none();
                if needs_place && !has_place() {
                    return Err(Refusal::Full);
                }
                None
            }
            _ => return Ok(None),
        };
        self.check_device(device.as_ref(), participant.test)?;
        if participant.session >= MAX_SESSIONS {
            return Err(Refusal::TooManySessions);
        }
        Ok(Some(Change::Opened(Opened {
            number,
            slot,
            at_ms: now_ms,
            device,
        })))
    }

    /// Refuses a device on which nobody may take part. A test participant may be a program, without one.
    fn check_device(&self, device: Option<&Device>, test: bool) -> Result<(), Refusal> {
        let Some(required) = self.settings().device else {
            return Ok(());
        };
        match device.map_or(test, |device| required.is_met_by(device)) {
            true => Ok(()),
            false => Err(Refusal::WrongDevice(required)),
        }
    }

    /// The change by which a participant consents, and gets a slot if it has none.
    ///
    /// # Errors
    /// If the participant is not at this step in this session, it is not consent, or all slots are
    /// taken.
    pub fn consent(&self, at: At, now_ms: u64) -> Result<Change, Refusal> {
        let (participant, step) = self.at(at)?;
        let Task::Consent(consent) = step.task else {
            return Err(Refusal::StepMismatch);
        };
        let slot = match participant.slot {
            Some(_) => None,
            None if !self.has_place(participant.test, participant.planned) => {
                return Err(Refusal::Full);
            }
            None if self.settings().groups.is_some() => None,
            None => self.free_slot(participant.test),
        };
        Ok(Change::Consented(Consented {
            number: at.number,
            text_sha256: Sha256::digest(&consent.text).to_vec(),
            version: consent.version.clone(),
            language: self.settings().language.code().to_owned(),
            at_ms: now_ms,
            slot,
        }))
    }

    /// The change by which a participant answers a questionnaire.
    ///
    /// # Errors
    /// If the participant is not at this step in this session, it is not a questionnaire, or the
    /// answers are invalid.
    pub fn answer(&self, at: At, answers: Vec<ItemAnswer>, now_ms: u64) -> Result<Change, Refusal> {
        let participant = self.check_answers(at, &answers, false)?;
        Ok(Change::Answered(Answered {
            number: at.number,
            passed_over: self.passed_over_next(participant, Some(&answers)),
            answers: answers.into(),
            at_ms: now_ms,
        }))
    }

    /// The change by which what a participant has entered so far is saved.
    ///
    /// # Errors
    /// As [`Study::answer`], but answers may be missing; or it has saved too often.
    pub fn save(&self, at: At, answers: Vec<ItemAnswer>) -> Result<Change, Refusal> {
        let participant = self.check_answers(at, &answers, true)?;
        if participant.saves >= MAX_SAVES {
            return Err(Refusal::TooManySaves);
        }
        Ok(Change::Saved(Saved {
            number: at.number,
            answers: answers.into(),
        }))
    }

    fn check_answers(
        &self,
        at: At,
        answers: &[ItemAnswer],
        only_saved: bool,
    ) -> Result<&Participant, Refusal> {
        let (participant, step) = self.at(at)?;
        let Task::Questionnaire(questionnaire) = step.task else {
            return Err(Refusal::StepMismatch);
        };
        let items = self.items_after(participant, at.step, questionnaire);
        questionnaire.check_answers(&items, answers, only_saved)?;
        Ok(participant)
    }

    /// The change by which a participant continues from a text, an external questionnaire or a game
    /// that has ended; in a test also from a questionnaire, without answers, and from its arrival, as a
    /// group of its own.
    ///
    /// # Errors
    /// If the participant is not at this step in this session, or the step is not over.
    pub fn proceed(&self, at: At, now_ms: u64) -> Result<Change, Refusal> {
        let (participant, step) = self.at(at)?;
        let count = match step.task {
            Task::Text(_) | Task::External(_) => 0,
            Task::Questionnaire(_) if participant.test => 0,
            Task::Arrival(_) if participant.test => {
                let alone = self.grouped(&[at.number], now_ms).pop();
                return alone.ok_or(Refusal::Full);
            }
            Task::Practice { .. } => 1,
            Task::Games { count } => *count,
            Task::Consent(_) | Task::Questionnaire(_) | Task::ScreenOut(_) | Task::Arrival(_) => {
                return Err(Refusal::StepMismatch);
            }
        };
        if count > 0 && !matches!(Phase::of(participant), Phase::Over(_)) {
            return Err(Refusal::GameNotOver);
        }
        let step_over = participant.games_done() + 1 >= count;
        Ok(Change::Continued(Continued {
            number: at.number,
            step_over,
            passed_over: match step_over {
                true => self.passed_over_next(participant, None),
                false => 0,
            },
            at_ms: now_ms,
        }))
    }

    /// The change that ends the participation of somebody who has come to a step that screens it out;
    /// `None` for all others.
    pub fn screen_out(&self, number: u32, now_ms: u64) -> Option<Change> {
        let participant = self.participant(number);
        let active = participant.filter(|it| it.status == Status::Active)?;
        let is_out = matches!(self.step_of(active)?.task, Task::ScreenOut(_));
        is_out.then_some(Change::ScreenedOut(Ended {
            number,
            at_ms: now_ms,
        }))
    }

    /// The change by which a participant withdraws; `None` if it has, and no more data are to be
    /// deleted.
    ///
    /// # Errors
    /// If the participant is unknown.
    pub fn withdraw(
        &self,
        number: u32,
        delete_data: bool,
        now_ms: u64,
    ) -> Result<Option<Change>, Refusal> {
        let participant = self.known(number)?;
        let deletes = delete_data && !participant.data_deleted;
        let ends = participant.ends_by_withdrawing(delete_data);
        Ok((ends || deletes).then_some(Change::Withdrew(Withdrew {
            number,
            delete_data,
            at_ms: now_ms,
        })))
    }

    /// The change that removes a participant; `None` if it was removed before.
    ///
    /// # Errors
    /// If there is no such participant, or it has withdrawn.
    pub fn remove(&self, number: u32, now_ms: u64) -> Result<Option<Change>, Refusal> {
        let participant = self.known(number)?;
        match participant.status {
            Status::Removed => Ok(None),
            Status::Withdrawn => Err(Refusal::Over),
            _ => Ok(Some(Change::Removed(Ended {
                number,
                at_ms: now_ms,
            }))),
        }
    }

    /// The change that closes the study; `None` if it is closed.
    pub fn close(&self) -> Option<Change> {
        (!self.is_closed()).then_some(Change::Closed(true))
    }

    fn known(&self, number: u32) -> Result<&Participant, Refusal> {
        self.participant(number).ok_or(Refusal::Unknown)
    }

    /// The participant and its step, if the command comes from there.
    fn at(&self, at: At) -> Result<(&Participant, Step<'_>), Refusal> {
        let participant = self.known(at.number)?;
        if participant.status != Status::Active {
            return Err(Refusal::Over);
        }
        if participant.session != at.session {
            return Err(Refusal::Superseded);
        }
        if participant.step() != at.step {
            return Err(Refusal::StepOver);
        }
        let step = self.step_of(participant).ok_or(Refusal::Over)?;
        Ok((participant, step))
    }
}
