//! The state of a study, and the effect of each change on it. Nothing here decides what happens
//! next. A change that does not fit (for an unknown participant, say) has no effect, so the same
//! changes always lead to the same state.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::change::{Change, ConsentGiven, Joined, Outcome, PlacedGame};
use crate::device::{Device, DeviceSession};
use crate::questionnaire::ItemAnswer;

/// The state of a participant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Has not opened its link.
    Invited,
    /// Has begun.
    Active,
    /// Has finished all steps.
    Completed,
    /// Has withdrawn.
    Withdrawn,
    /// Had no session open for too long, or others waited for it for too long.
    DroppedOut,
    /// Was removed by the study's owner.
    Removed,
    /// Was screened out by its answers.
    ScreenedOut,
    /// Its group was not complete in time.
    LeftOver,
}

/// A participant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Participant {
    /// Its name in games and exported data; empty after its data were deleted.
    pub pseudonym: String,
    /// How it joined by the open link, if it did. Its id at the panel is empty after its data were
    /// deleted.
    pub joined: Option<Joined>,
    /// Whether it is a test participant, who takes no slot from others.
    pub test: bool,
    /// The first of those with whom it is to play, if that is planned.
    pub planned: Option<u32>,
    /// Its state.
    pub status: Status,
    /// Its slot, or after it has left the one it had; `None` until it begins, until its consent, or
    /// until it has a group.
    pub slot: Option<u32>,
    /// Number of its group, from 1.
    pub group: Option<u32>,
    /// Number of sessions it opened, which is the number of the newest.
    pub session: u32,
    /// Those on a device that is known, by number.
    pub devices: BTreeMap<u32, DeviceSession>,
    /// When it reached each step, in milliseconds since the Unix epoch, and last when it completed
    /// the study. Empty until it begins.
    pub reached_at_ms: Vec<u64>,
    /// Steps that it passed over.
    pub passed_over: BTreeSet<usize>,
    /// When it completed the study or left it, in milliseconds since the Unix epoch.
    pub ended_at_ms: Option<u64>,
    /// Its consent.
    pub consent: Option<ConsentGiven>,
    /// Its answers, by step. They may be long, so copies share them.
    pub answers: BTreeMap<usize, Arc<[ItemAnswer]>>,
    /// What it has entered in the questionnaire of its step so far.
    pub saved_answers: Arc<[ItemAnswer]>,
    /// Number of times that it saved answers.
    pub saves: u32,
    /// Its games, in order.
    pub games: Vec<PlayedGame>,
    /// Whether it had its data deleted.
    pub data_deleted: bool,
}

/// A game of a participant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlayedGame {
    /// The game.
    pub placed: PlacedGame,
    /// How and when it ended, in milliseconds since the Unix epoch.
    pub ended: Option<(Outcome, u64)>,
    /// Whether the participant has continued from it.
    pub continued: bool,
}

impl Participant {
    /// The step it is at, from 0; the number of steps once it has completed the study.
    pub fn step(&self) -> usize {
        self.reached_at_ms.len().saturating_sub(1)
    }

    /// Its id at the panel; empty if there is none.
    pub fn panel_id(&self) -> &str {
        self.joined.as_ref().map_or("", |it| &it.panel_id)
    }

    /// Whether it has begun and is not over, so that the study must wait for it. Nobody waits for a test
    /// participant.
    pub fn is_in_the_middle(&self) -> bool {
        self.status == Status::Active && !self.test
    }

    /// Whether it keeps its slot. Without its data somebody else is needed there.
    pub fn holds_slot(&self) -> bool {
        let stays = matches!(self.status, Status::Active | Status::Completed);
        stays && !self.data_deleted && self.slot.is_some()
    }

    /// Whether withdrawing changes its state. A deletion of its data does not undo what it has done.
    pub(crate) fn ends_by_withdrawing(&self, delete_data: bool) -> bool {
        match self.status {
            Status::Withdrawn => false,
            Status::Completed | Status::Removed | Status::ScreenedOut | Status::LeftOver => {
                !delete_data
            }
            Status::Invited | Status::Active | Status::DroppedOut => true,
        }
    }

    /// The last game of its step, if there is one.
    pub(crate) fn current_game(&self) -> Option<&PlayedGame> {
        let last = self.games.last()?;
        (last.placed.step == self.step()).then_some(last)
    }

    fn advance(&mut self, steps: usize, passed_over: u32, at_ms: u64) {
        for _ in 0..passed_over {
            self.reached_at_ms.push(at_ms);
            self.passed_over.insert(self.step());
        }
        self.reached_at_ms.push(at_ms);
        self.saved_answers = Arc::default();
        if self.step() >= steps {
            self.end(Status::Completed, at_ms);
        }
    }

    fn end(&mut self, status: Status, at_ms: u64) {
        self.status = status;
        self.ended_at_ms = Some(at_ms);
    }
}

/// The state of a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct StudyState {
    /// Number of steps of every participant.
    steps: usize,
    /// By number, from 1.
    pub(crate) participants: BTreeMap<u32, Participant>,
    /// The participants of each group, with those who have left, by number of the group.
    pub(crate) groups: BTreeMap<u32, BTreeSet<u32>>,
    pub(crate) closed: bool,
}

impl StudyState {
    pub(crate) fn new(steps: usize) -> Self {
        Self {
            steps,
            participants: BTreeMap::new(),
            groups: BTreeMap::new(),
            closed: false,
        }
    }

    fn active(&mut self, number: u32) -> Option<&mut Participant> {
        let participant = self.participants.get_mut(&number)?;
        (participant.status == Status::Active).then_some(participant)
    }

    pub(crate) fn apply(&mut self, change: &Change) {
        let steps = self.steps;
        match change {
            Change::Added {
                number,
                pseudonym,
                joined,
                test,
                planned,
            } => {
                let added = || Participant {
                    pseudonym: pseudonym.clone(),
                    joined: joined.clone(),
                    test: *test,
                    planned: *planned,
                    status: Status::Invited,
                    slot: None,
                    group: None,
                    session: 0,
                    devices: BTreeMap::new(),
                    reached_at_ms: Vec::new(),
                    passed_over: BTreeSet::new(),
                    ended_at_ms: None,
                    consent: None,
                    answers: BTreeMap::new(),
                    saved_answers: Arc::default(),
                    saves: 0,
                    games: Vec::new(),
                    data_deleted: false,
                };
                self.participants.entry(*number).or_insert_with(added);
            }
            Change::Opened {
                number,
                slot,
                at_ms,
                device,
            } => self.open(*number, *slot, *at_ms, device.clone()),
            Change::Consented {
                number,
                slot,
                consent,
            } => {
                if let Some(participant) = self.active(*number) {
                    participant.slot = participant.slot.or(*slot);
                    participant.consent = Some(consent.clone());
                    participant.advance(steps, 0, consent.at_ms);
                }
            }
            Change::Answered {
                number,
                answers,
                passed_over,
                at_ms,
            } => {
                if let Some(participant) = self.active(*number) {
                    let step = participant.step();
                    participant.answers.insert(step, Arc::clone(answers));
                    participant.advance(steps, *passed_over, *at_ms);
                }
            }
            Change::Saved { number, answers } => {
                if let Some(participant) = self.active(*number) {
                    participant.saved_answers = Arc::clone(answers);
                    participant.saves += 1;
                }
            }
            Change::Placed { number, game } => {
                if let Some(participant) = self.active(*number) {
                    participant.games.push(PlayedGame {
                        placed: game.clone(),
                        ended: None,
                        continued: false,
                    });
                }
            }
            Change::GameEnded {
                number,
                outcome,
                at_ms,
            } => {
                let participant = self.participants.get_mut(number);
                let last = participant.and_then(|it| it.games.last_mut());
                if let Some(game) = last.filter(|game| game.ended.is_none()) {
                    game.ended = Some((*outcome, *at_ms));
                }
            }
            Change::Continued {
                number,
                step_over,
                passed_over,
                at_ms,
            } => {
                if let Some(participant) = self.active(*number) {
                    if let Some(game) = participant.games.last_mut() {
                        game.continued = true;
                    }
                    if *step_over {
                        participant.advance(steps, *passed_over, *at_ms);
                    }
                }
            }
            Change::Grouped {
                number,
                group,
                slot,
                passed_over,
                at_ms,
            } => {
                if let Some(participant) = self.active(*number) {
                    participant.group = Some(*group);
                    participant.slot = Some(*slot);
                    participant.advance(steps, *passed_over, *at_ms);
                    self.groups.entry(*group).or_default().insert(*number);
                }
            }
            Change::LeftOver { number, at_ms } => {
                if let Some(participant) = self.active(*number) {
                    participant.end(Status::LeftOver, *at_ms);
                }
            }
            Change::DroppedOut { number, at_ms } => {
                if let Some(participant) = self.active(*number) {
                    participant.end(Status::DroppedOut, *at_ms);
                }
            }
            Change::ScreenedOut { number, at_ms } => {
                if let Some(participant) = self.active(*number) {
                    participant.end(Status::ScreenedOut, *at_ms);
                }
            }
            Change::Withdrew {
                number,
                delete_data,
                at_ms,
            } => self.withdraw(*number, *delete_data, *at_ms),
            Change::Removed { number, at_ms } => {
                if let Some(participant) = self.participants.get_mut(number) {
                    participant.end(Status::Removed, *at_ms);
                }
            }
            Change::Closed => self.closed = true,
        }
    }

    fn open(&mut self, number: u32, slot: Option<u32>, at_ms: u64, device: Option<Device>) {
        let Some(participant) = self.participants.get_mut(&number) else {
            return;
        };
        match participant.status {
            Status::Invited => {
                participant.slot = slot;
                participant.reached_at_ms.push(at_ms);
            }
            Status::Active | Status::DroppedOut => {}
            _ => return,
        }
        participant.status = Status::Active;
        participant.ended_at_ms = None;
        participant.session += 1;
        if let Some(device) = device {
            let session = DeviceSession { at_ms, device };
            participant.devices.insert(participant.session, session);
        }
    }

    fn withdraw(&mut self, number: u32, delete_data: bool, at_ms: u64) {
        let Some(participant) = self.participants.get_mut(&number) else {
            return;
        };
        if participant.ends_by_withdrawing(delete_data) {
            participant.end(Status::Withdrawn, at_ms);
        }
        if delete_data {
            participant.data_deleted = true;
            participant.pseudonym.clear();
            participant.devices.clear();
            if let Some(joined) = &mut participant.joined {
                joined.panel_id.clear();
            }
            participant.answers.clear();
            participant.saved_answers = Arc::default();
        }
    }
}
