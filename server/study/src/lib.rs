//! Studies with people as values: the assignment of conditions, what each participant does next,
//! questionnaires, and what a participant may see. A study moves by changes: its owner asks for a
//! change, stores it and folds it. Folding the same changes again gives the same study. There is no
//! clock, IO or thread here; rooms, connections and storage belong to the server.
//!
//! ```
//! use chefshat_study::{At, Content, NewParticipants, Outcome, Study, testing};
//!
//! // Two conditions between participants; consent, a game, a debriefing.
//! let mut study = Study::new(testing::settings())?;
//! for change in study.add(&NewParticipants::numbered(1))? {
//!     study.fold(&change);
//! }
//! let opened = study.open(1, None, 1000)?.expect("nobody has begun");
//! study.fold(&opened);
//! let at = |step| At { number: 1, session: 1, step };
//! study.fold(&study.consent(at(0), 2000)?);
//!
//! let due = study.due(1).expect("a game comes next");
//! assert_eq!((due.seat, due.attempt), (0, 1));
//! for placed in study.place(1, [1; 16], [2; 16]) {
//!     study.fold(&placed);
//! }
//! // Here the game would be played.
//! let ended = study.game_ended(1, [2; 16], Outcome::Finished, 9000);
//! study.fold(&ended.expect("it is running"));
//! study.fold(&study.proceed(at(1), 10_000)?);
//!
//! let view = study.view(1).expect("P01 has begun");
//! assert!(matches!(view.content, Content::Text(_)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod address;
mod assignment;
mod chance;
mod change;
mod checks;
mod commands;
mod device;
mod earlier;
mod games;
mod groups;
mod item_kind;
mod link;
mod picture;
mod presence;
mod questionnaire;
mod recruiting;
mod settings;
mod stage;
mod state;
mod templates;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
mod view;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

pub use assignment::Order;
pub use change::{
    Added, Answered, Change, Consented, Continued, Ended, GameEnded, Grouped, Joined, Opened,
    Outcome, Placed, PlacedGame, Saved, Withdrew,
};
pub use checks::SettingsProblem;
pub use commands::{At, MAX_SAVES, MAX_SESSIONS, NewParticipants, Refusal};
pub use device::{Device, DeviceSession, Pointer, RequiredDevice};
pub use games::{DueGame, MAX_ATTEMPTS};
pub use item_kind::{Answer, AnswerSet, Chosen, ItemKind, MAX_OPTIONS};
pub use link::{ParticipantLink, SessionSecret};
pub use picture::{Picture, PictureFormat};
pub use questionnaire::{
    AnswerProblem, Answers, Item, ItemAnswer, MAX_ITEMS, MAX_SHOWN_IF, Questionnaire, ShownIf,
    ShownItemIf,
};
pub use recruiting::Recruiting;
pub use settings::{
    Condition, Factor, GROUP_SIZES, Groups, Hide, Labels, LeftOverPolicy, MAX_FACTORS, MAX_GAMES,
    MAX_LEVELS, MAX_PARTICIPANTS, MAX_SEEDS, MAX_STEPS, MAX_TESTS, Settings,
};
pub use stage::{
    Arrival, Consent, ExternalQuestionnaire, MAX_BLOCK, MAX_STAGE_GAMES, MAX_STAGES, Part,
    ScreenOut, Stage, Step, Task, Text,
};
pub use state::{Participant, PlayedGame, Status};
pub use templates::{Language, Template};
pub use view::{Content, End, ShownArrival, ShownGame, ShownItem, ShownQuestionnaire, View};

use assignment::Assignment;
use earlier::EarlierAnswers;
use presence::Presence;
use state::StudyState;

/// For how long the date of a study must have passed before the study is closed, in milliseconds: a
/// clock may jump ahead and back, and what is closed stays closed.
pub const CONFIRMATION_TIME_MS: u64 = 600_000;
/// How often a study looks whether its date has passed, in milliseconds: the clock may be set
/// meanwhile, or the machine sleep.
pub const CLOCK_CHECK_MS: u64 = 60_000;

/// A study. Two are equal if their changes have led to the same state; who is connected does not
/// matter.
#[derive(Debug, Clone)]
pub struct Study {
    settings: Arc<Settings>,
    assignment: Assignment,
    step_count: usize,
    state: StudyState,
    presence: Presence,
    /// Since when its date has passed whenever [`Study::next`] was asked.
    past_date_since_ms: Option<u64>,
    /// The participants of whom the changes have data: a pseudonym at least.
    recorded: BTreeSet<u32>,
}

impl PartialEq for Study {
    fn eq(&self, other: &Self) -> bool {
        self.settings == other.settings && self.state == other.state
    }
}

impl Study {
    /// A study without participants. Its copies share its settings.
    ///
    /// # Errors
    /// Returns the first invalid setting.
    pub fn new(settings: impl Into<Arc<Settings>>) -> Result<Self, SettingsProblem> {
        let settings = settings.into();
        settings.check()?;
        let (sequences, block_size) = (settings.sequences(), settings.slots_of_block());
        let step_count = settings.steps(&sequences[0]).len();
        Ok(Self {
            assignment: Assignment::new(sequences, block_size, settings.assignment_seed),
            settings,
            step_count,
            state: StudyState::new(step_count),
            presence: Presence::default(),
            past_date_since_ms: None,
            recorded: BTreeSet::new(),
        })
    }

    /// Applies a change. Does not check that the change follows; one that does not fit has no
    /// effect.
    pub fn fold(&mut self, change: &Change) {
        if let Change::Added(added) = change
            && !added.pseudonym.is_empty()
        {
            self.recorded.insert(added.number);
        }
        self.state.apply(change);
    }

    /// Whether the changes had data of this participant when they were folded: [`Change::forget`]
    /// leaves none.
    pub fn is_recorded(&self, number: u32) -> bool {
        self.recorded.contains(&number)
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Whether nobody may begin any more.
    pub fn is_closed(&self) -> bool {
        self.state.closed
    }

    /// Whether nobody may begin at this time: the study is closed, or its date has passed.
    fn is_closed_at(&self, now_ms: u64) -> bool {
        self.is_closed() || (self.settings.end_ms()).is_some_and(|at_ms| at_ms <= now_ms)
    }

    /// The participants, by number from 1.
    pub fn participants(&self) -> &BTreeMap<u32, Participant> {
        &self.state.participants
    }

    /// The participant with this number.
    pub fn participant(&self, number: u32) -> Option<&Participant> {
        self.state.participants.get(&number)
    }

    /// Number of steps of every participant.
    pub fn step_count(&self) -> usize {
        self.step_count
    }

    /// The sequence of conditions of a slot, from 0: all slots of a group have the same.
    pub fn sequence(&self, slot: u32) -> &[usize] {
        self.assignment.sequence(slot / self.settings.group_size())
    }

    /// The order in which a participant meets the items of the questionnaire at a step, from 0;
    /// `None` if the step is not a questionnaire.
    pub fn item_order(&self, number: u32, step: usize) -> Option<Vec<usize>> {
        match self.steps_of(self.participant(number)?)?.get(step)?.task {
            Task::Questionnaire(it) => Some(it.order(self.settings.assignment_seed, number, step)),
            _ => None,
        }
    }

    /// Indices of the items that a participant was shown at a step in the order in which it met them,
    /// or is shown after what it has entered so far; `None` if the step is not a questionnaire. It was
    /// shown none of a step that it passed over.
    pub fn shown_items(&self, number: u32, step: usize) -> Option<Vec<usize>> {
        let participant = self.participant(number)?;
        let steps = self.steps_of(participant)?;
        let Task::Questionnaire(questionnaire) = steps.get(step)?.task else {
            return None;
        };
        if participant.passed_over.contains(&step) {
            return Some(Vec::new());
        }
        let entered = match participant.answers.get(&step) {
            Some(answers) => &answers[..],
            None if step == participant.step() => &participant.saved_answers,
            None => &[][..],
        };
        let items = self.items_after(participant, step, questionnaire);
        let shown = questionnaire.shown_by(&items, entered);
        let mut order = self.item_order(number, step)?;
        order.retain(|index| shown.contains(index));
        Some(order)
    }

    /// The answers of a participant by step, each with its questionnaire and item.
    pub fn answered_items<'s>(
        &'s self,
        participant: &'s Participant,
    ) -> impl Iterator<Item = (usize, &'s Questionnaire, Option<&'s Item>, &'s ItemAnswer)> {
        let steps = self.steps_of(participant).unwrap_or_default();
        let answered = participant
            .answers
            .iter()
            .filter_map(move |(step, answers)| match steps.get(*step)?.task {
                Task::Questionnaire(it) => Some((*step, it, answers)),
                _ => None,
            });
        answered.flat_map(|(step, it, answers)| {
            let answers = answers.iter();
            answers.map(move |answer| (step, it, it.items.get(answer.index()), answer))
        })
    }

    /// Number of attention checks that a participant has answered, and of those that it passed.
    pub fn attention_checks(&self, participant: &Participant) -> (usize, usize) {
        let answered = self.answered_items(participant);
        let checks = answered.filter_map(|(.., item, answer)| {
            let passing = item?.attention_check.as_ref()?;
            Some(passing.is_passed_by(answer.value.as_ref()?))
        });
        checks.fold((0, 0), |(answered, passed), has_passed| {
            (answered + 1, passed + usize::from(has_passed))
        })
    }

    /// Indices of the items of a step that a participant may be shown, whatever it enters there.
    fn items_after(
        &self,
        participant: &Participant,
        step: usize,
        questionnaire: &Questionnaire,
    ) -> Vec<usize> {
        let steps = self.steps_of(participant).unwrap_or_default();
        let given = given_answers(participant, None);
        EarlierAnswers::before(&steps, step, given).items_of(questionnaire)
    }

    /// Number of steps that a participant passes over after its step, where it gives these answers:
    /// those that are for others, and questionnaires of which no item is for it.
    fn passed_over_next(&self, participant: &Participant, answers: Option<&[ItemAnswer]>) -> u32 {
        let steps = self.steps_of(participant).unwrap_or_default();
        let is_for_others = |step: &usize| {
            let given = given_answers(participant, answers);
            let earlier = EarlierAnswers::before(&steps, *step, given);
            let has_items = match steps[*step].task {
                Task::Questionnaire(it) => earlier.leave_items_of(it),
                _ => true,
            };
            !earlier.satisfy(steps[*step].shown_if) || !has_items
        };
        let next = participant.step() + 1..steps.len();
        next.take_while(is_for_others).count() as u32
    }

    /// The sequence of conditions of a participant who has a slot.
    pub fn sequence_of(&self, participant: &Participant) -> Option<&[usize]> {
        participant.slot.map(|slot| self.sequence(slot))
    }

    /// The step of a participant; `None` before it begins and after the last.
    pub fn step_of(&self, participant: &Participant) -> Option<Step<'_>> {
        self.steps_of(participant)?.get(participant.step()).copied()
    }

    /// The steps of a participant; `None` before it begins. Those before the consent by which it gets
    /// its slot are the same in every sequence.
    fn steps_of(&self, participant: &Participant) -> Option<Vec<Step<'_>>> {
        let has_begun = !participant.reached_at_ms.is_empty();
        let sequence = (self.sequence_of(participant)).unwrap_or_else(|| self.sequence(0));
        has_begun.then(|| self.settings.steps(sequence))
    }

    /// Sets whether a participant has a session open. `elapsed_ms`: of a clock that never jumps.
    pub fn set_connected(&mut self, number: u32, connected: bool, elapsed_ms: u64) {
        self.presence.set(number, connected, elapsed_ms);
    }

    /// Whether a participant has a session open.
    pub fn is_connected(&self, number: u32) -> bool {
        self.presence.is_connected(number)
    }

    /// The changes that follow by themselves at this time, if any: the study closes, a group is formed,
    /// or a participant drops out or is left over. To be folded before the next are asked for.
    /// `elapsed_ms`: as for [`Study::set_connected`].
    pub fn next(&mut self, now_ms: u64, elapsed_ms: u64) -> Vec<Change> {
        if self.is_closed() || !self.is_closed_at(now_ms) {
            self.past_date_since_ms = None;
        } else {
            let since_ms = *self.past_date_since_ms.get_or_insert(elapsed_ms);
            if elapsed_ms.saturating_sub(since_ms) >= CONFIRMATION_TIME_MS {
                return vec![Change::Closed(true)];
            }
        }
        let grouped = self.next_of_groups(now_ms, elapsed_ms);
        if !grouped.is_empty() {
            return grouped;
        }
        let participants = self.state.participants.iter();
        let active = participants.filter(|(_, it)| it.status == Status::Active);
        let active = active.map(|(number, _)| *number);
        let limit_ms = self.settings.drop_out_after_ms;
        let number = self.presence.drop_out(active, limit_ms, elapsed_ms);
        let dropped_out = number.map(|number| {
            Change::DroppedOut(Ended {
                number,
                at_ms: now_ms,
            })
        });
        Vec::from_iter(dropped_out)
    }

    /// In how many milliseconds [`Study::next`] is to be asked again if nothing else happens. Valid after
    /// it returned nothing at these times.
    pub fn wake_in(&self, now_ms: u64, elapsed_ms: u64) -> Option<u64> {
        let limit_ms = self.settings.drop_out_after_ms;
        let drop_out = self.presence.next_drop_out_ms(limit_ms);
        let groups = self.settings.groups;
        let waited = groups.and_then(|it| self.presence.next_waited_ms(it.wait_ms, elapsed_ms));
        let by_presence = drop_out.into_iter().chain(waited).min();
        let by_presence = by_presence.map(|at_ms| at_ms.saturating_sub(elapsed_ms));
        let close = match (self.past_date_since_ms, self.settings.end_ms()) {
            (Some(since_ms), _) => {
                Some((since_ms + CONFIRMATION_TIME_MS).saturating_sub(elapsed_ms))
            }
            (None, end_ms) => end_ms.map(|at_ms| at_ms.saturating_sub(now_ms).min(CLOCK_CHECK_MS)),
        };
        let close = close.filter(|_| !self.is_closed());
        by_presence.into_iter().chain(close).min()
    }

    /// Whether somebody keeps the slot that a participant had, or its group is in the middle of the
    /// study without it.
    fn is_replaced(&self, participant: &Participant) -> bool {
        let Some(slot) = participant.slot else {
            return false;
        };
        let size = self.settings.group_size();
        let first = slot - slot % size;
        let others = self.state.participants.values().filter(|it| {
            let is_alike = it.test == participant.test && it.holds_slot();
            is_alike
                && it
                    .slot
                    .is_some_and(|slot| (first..first + size).contains(&slot))
        });
        let mut others = others.map(|it| (it.group, it.status));
        others.any(|(group, status)| {
            group.is_none() || group != participant.group || status == Status::Active
        })
    }

    /// The first slot that nobody keeps, or that nobody of its group keeps. A slot that is given again
    /// comes before new ones, so that blocks fill up in order.
    fn free_slot(&self, test: bool) -> Option<u32> {
        self.free_slots(test).next()
    }

    /// The slots that nobody keeps, in order: of groups the first of each.
    fn free_slots(&self, test: bool) -> impl Iterator<Item = u32> {
        let size = self.settings.group_size();
        let kept = self.kept_slots(test);
        let slots = match test {
            true => MAX_TESTS - MAX_TESTS % size,
            false => self.settings.participants,
        };
        let firsts = (0..slots).step_by(size as usize);
        firsts.filter(move |first| kept.range(*first..first + size).next().is_none())
    }

    /// Whether one more may begin, who gets a slot now or in a group: as those of its plan, or with
    /// anybody.
    fn has_place(&self, test: bool, planned: Option<u32>) -> bool {
        let free = self.free_slots(test);
        if self.settings.groups.is_none() {
            return free.take(1).count() > 0;
        }
        let asks = self.settings.asks_for_consent();
        let expects = |it: &&Participant| {
            let has_begun = it.status == Status::Active && (!asks || it.consent.is_some());
            it.test == test && has_begun && it.group.is_none()
        };
        let expecting = self.state.participants.values().filter(expects);
        let (mut plans, mut others) = (BTreeSet::new(), 0);
        for plan in expecting.map(|it| it.planned).chain([planned]) {
            match plan {
                Some(plan) => drop(plans.insert(plan)),
                None => others += 1,
            }
        }
        let groups = plans.len() + usize::div_ceil(others, self.settings.group_size() as usize);
        free.count() >= groups
    }

    /// The slots that participants keep. Test participants have slots of their own.
    fn kept_slots(&self, test: bool) -> BTreeSet<u32> {
        let participants = self.state.participants.values();
        let kept = participants.filter(|it| it.test == test && it.holds_slot());
        kept.filter_map(|it| it.slot).collect()
    }
}

/// The answers of a participant by step, with those that it gives at its own, if it does.
fn given_answers<'p>(
    participant: &'p Participant,
    now: Option<&'p [ItemAnswer]>,
) -> impl Iterator<Item = (usize, &'p [ItemAnswer])> {
    let given = participant.answers.iter();
    let given = given.map(|(step, answers)| (*step, &answers[..]));
    given.chain(now.map(|answers| (participant.step(), answers)))
}
