//! The state of a study, and the effect of each change on it. Nothing here decides what happens
//! next. A change that does not fit (for an unknown participant, say) has no effect, so the same
//! changes always lead to the same state.

use std::collections::{BTreeMap, BTreeSet};

use crate::change::{Change, Consented, Ended, Joined, Opened, Outcome, PlacedGame, Withdrew};
use crate::device::DeviceSession;
use crate::questionnaire::Answers;

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
    pub consent: Option<Consented>,
    /// Its answers, by step.
    pub answers: BTreeMap<usize, Answers>,
    /// What it has entered in the questionnaire of its step so far.
    pub saved_answers: Answers,
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
        self.saved_answers = Answers::default();
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
            Change::Added(added) => {
                let participant = || Participant {
                    pseudonym: added.pseudonym.clone(),
                    joined: added.joined.clone(),
                    test: added.test,
                    planned: added.planned,
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
                    saved_answers: Answers::default(),
                    saves: 0,
                    games: Vec::new(),
                    data_deleted: false,
                };
                let entry = self.participants.entry(added.number);
                entry.or_insert_with(participant);
            }
            Change::Opened(opened) => self.open(opened),
            Change::Consented(consented) => {
                if let Some(participant) = self.active(consented.number) {
                    participant.slot = participant.slot.or(consented.slot);
                    participant.consent = Some(consented.clone());
                    participant.advance(steps, 0, consented.at_ms);
                }
            }
            Change::Answered(answered) => {
                if let Some(participant) = self.active(answered.number) {
                    let step = participant.step();
                    participant.answers.insert(step, answered.answers.clone());
                    participant.advance(steps, answered.passed_over, answered.at_ms);
                }
            }
            Change::Saved(saved) => {
                if let Some(participant) = self.active(saved.number) {
                    participant.saved_answers = saved.answers.clone();
                    participant.saves += 1;
                }
            }
            Change::Placed(placed) => {
                if let Some(participant) = self.active(placed.number)
                    && let Ok(placed) = placed.game()
                {
                    participant.games.push(PlayedGame {
                        placed,
                        ended: None,
                        continued: false,
                    });
                }
            }
            Change::GameEnded(ended) => {
                let participant = self.participants.get_mut(&ended.number);
                let last = participant.and_then(|it| it.games.last_mut());
                if let Some(game) = last.filter(|game| game.ended.is_none()) {
                    let outcome = match ended.finished {
                        true => Outcome::Finished,
                        false => Outcome::Aborted,
                    };
                    game.ended = Some((outcome, ended.at_ms));
                }
            }
            Change::Continued(continued) => {
                if let Some(participant) = self.active(continued.number) {
                    if let Some(game) = participant.games.last_mut() {
                        game.continued = true;
                    }
                    if continued.step_over {
                        participant.advance(steps, continued.passed_over, continued.at_ms);
                    }
                }
            }
            Change::Grouped(grouped) => {
                if let Some(participant) = self.active(grouped.number) {
                    participant.group = Some(grouped.group);
                    participant.slot = Some(grouped.slot);
                    participant.advance(steps, grouped.passed_over, grouped.at_ms);
                    let group = self.groups.entry(grouped.group).or_default();
                    group.insert(grouped.number);
                }
            }
            Change::LeftOver(ended) => self.end(ended, Status::LeftOver),
            Change::DroppedOut(ended) => self.end(ended, Status::DroppedOut),
            Change::ScreenedOut(ended) => self.end(ended, Status::ScreenedOut),
            Change::Withdrew(withdrew) => self.withdraw(withdrew),
            Change::Removed(ended) => {
                if let Some(participant) = self.participants.get_mut(&ended.number) {
                    participant.end(Status::Removed, ended.at_ms);
                }
            }
            Change::Closed(_) => self.closed = true,
        }
    }

    /// Ends the participation of an active participant.
    fn end(&mut self, ended: &Ended, status: Status) {
        if let Some(participant) = self.active(ended.number) {
            participant.end(status, ended.at_ms);
        }
    }

    fn open(&mut self, opened: &Opened) {
        let Some(participant) = self.participants.get_mut(&opened.number) else {
            return;
        };
        match participant.status {
            Status::Invited => {
                participant.slot = opened.slot;
                participant.reached_at_ms.push(opened.at_ms);
            }
            Status::Active | Status::DroppedOut => {}
            _ => return,
        }
        participant.status = Status::Active;
        participant.ended_at_ms = None;
        participant.session += 1;
        if let Some(device) = opened.device.clone() {
            let at_ms = opened.at_ms;
            let session = DeviceSession { at_ms, device };
            participant.devices.insert(participant.session, session);
        }
    }

    fn withdraw(&mut self, withdrew: &Withdrew) {
        let Some(participant) = self.participants.get_mut(&withdrew.number) else {
            return;
        };
        if participant.ends_by_withdrawing(withdrew.delete_data) {
            participant.end(Status::Withdrawn, withdrew.at_ms);
        }
        if withdrew.delete_data {
            participant.data_deleted = true;
            participant.pseudonym.clear();
            participant.devices.clear();
            if let Some(joined) = &mut participant.joined {
                joined.panel_id.clear();
            }
            participant.answers.clear();
            participant.saved_answers = Answers::default();
        }
    }
}
