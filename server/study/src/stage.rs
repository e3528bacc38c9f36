//! The stages of a study, and the steps of a participant: stages with those of a block repeated for
//! each of its conditions.

use crate::address;
use crate::checks::{Checked, characters, refuse, within};
use crate::questionnaire::{Questionnaire, ShownIf};

/// Maximum number of stages.
pub const MAX_STAGES: usize = 50;
/// Maximum number of stages of a block.
pub const MAX_BLOCK: usize = 20;
/// Maximum number of games of a stage in each condition.
pub const MAX_STAGE_GAMES: u32 = 100;
/// Maximum length of a text to read or agree to, in characters.
const MAX_TEXT: usize = 20_000;
/// Maximum length of the text above an address, in characters.
const MAX_TEXT_ABOVE: usize = 2000;
/// What an address may contain, to be replaced by the participant's pseudonym.
const PLACEHOLDER: &str = "{participant}";

/// A stage of a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Stage {
    /// Done once.
    Once(Part),
    /// Done for each condition of the participant, in the order of its sequence.
    PerCondition(Vec<Part>),
}

/// A task, and for whom it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// What to do.
    pub task: Task,
    /// Participants pass over it unless all of these hold, at most 4.
    pub shown_if: Vec<ShownIf>,
}

/// What a participant does at a step.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Task {
    /// Agrees to a text.
    Consent(Consent),
    /// Answers a questionnaire.
    Questionnaire(Questionnaire),
    /// Answers an external questionnaire.
    External(ExternalQuestionnaire),
    /// Plays a practice game, which has no seed of the list.
    Practice {
        /// Whether exported data include it.
        in_data: bool,
    },
    /// Plays games.
    Games {
        /// Number of games in each condition, 1..=100.
        count: u32,
    },
    /// Reads a text.
    Text(Text),
    /// Ends the participation.
    ScreenOut(ScreenOut),
    /// Waits for its group.
    Arrival(Arrival),
}

/// A text to agree to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Consent {
    /// The text, 1..=20000 characters.
    pub text: String,
    /// Its version, 1..=64 characters.
    pub version: String,
}

/// An external questionnaire.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExternalQuestionnaire {
    /// What the participant reads first, at most 2000 characters.
    pub text: String,
    /// The address, which begins with https://.
    pub url: String,
}

/// The end of a participation by earlier answers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScreenOut {
    /// What the participant reads, at most 2000 characters.
    pub text: String,
}

/// A wait for a group.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Arrival {
    /// What the participant reads meanwhile, at most 2000 characters.
    pub text: String,
}

/// A text to read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Text {
    /// Its title, at most 128 characters.
    pub title: String,
    /// The text, 1..=20000 characters.
    pub text: String,
}

/// A step of a participant.
#[derive(Debug, Clone, Copy)]
pub struct Step<'s> {
    /// What to do.
    pub task: &'s Task,
    /// Participants pass over it unless all of these hold.
    pub shown_if: &'s [ShownIf],
    /// The condition whose block it belongs to, if any.
    pub block: Option<usize>,
}

/// The steps of a participant with this sequence of conditions. Their number does not depend on the
/// sequence.
pub(crate) fn steps<'s>(stages: &'s [Stage], sequence: &[usize]) -> Vec<Step<'s>> {
    let mut steps = Vec::new();
    for stage in stages {
        match stage {
            Stage::Once(part) => steps.push(part.step(None)),
            Stage::PerCondition(parts) => {
                for &condition in sequence {
                    steps.extend(parts.iter().map(|part| part.step(Some(condition))));
                }
            }
        }
    }
    steps
}

impl Stage {
    /// A task that all participants do once.
    pub fn once(task: Task) -> Self {
        Self::Once(task.into())
    }

    /// Tasks that all participants do for each of their conditions.
    pub fn per_condition(tasks: impl IntoIterator<Item = Task>) -> Self {
        Self::PerCondition(tasks.into_iter().map(Part::from).collect())
    }

    /// Whether it is the consent.
    pub(crate) fn is_consent(&self) -> bool {
        matches!(self, Self::Once(part) if matches!(part.task, Task::Consent(_)))
    }

    /// The parts of the stage, each once.
    pub fn parts(&self) -> &[Part] {
        match self {
            Self::Once(part) => std::slice::from_ref(part),
            Self::PerCondition(parts) => parts,
        }
    }

    /// The path of the part with this index.
    pub(crate) fn path(&self, field: &str, index: usize) -> String {
        match self {
            Self::Once(_) => field.to_owned(),
            Self::PerCondition(_) => format!("{field}.per_condition.stages[{index}]"),
        }
    }
}

impl From<Task> for Part {
    fn from(task: Task) -> Self {
        let shown_if = Vec::new();
        Self { task, shown_if }
    }
}

impl Part {
    fn step(&self, block: Option<usize>) -> Step<'_> {
        Step {
            task: &self.task,
            shown_if: &self.shown_if,
            block,
        }
    }

    /// Returns the first invalid setting of a part after these questionnaires.
    pub(crate) fn check(&self, field: &str, earlier: &[&Questionnaire]) -> Checked {
        self.task.check(field)?;
        let shown_if = format!("{field}.shown_if");
        let is_for_all = matches!(
            self.task,
            Task::Consent(_) | Task::Games { .. } | Task::Arrival(_)
        );
        if is_for_all && !self.shown_if.is_empty() {
            return refuse(
                shown_if,
                "consent, arrival and games are for all participants",
            );
        }
        if matches!(self.task, Task::ScreenOut(_)) && self.shown_if.is_empty() {
            return refuse(
                shown_if,
                "say after which answers participants are screened out",
            );
        }
        ShownIf::check_all(&self.shown_if, &shown_if, earlier, None)?;
        let Task::Questionnaire(questionnaire) = &self.task else {
            return Ok(());
        };
        for (index, item) in questionnaire.items.iter().enumerate() {
            let field = format!("{field}.questionnaire.items[{index}].shown_if");
            ShownIf::check_all(
                &item.shown_if,
                &field,
                earlier,
                Some((questionnaire, index)),
            )?;
        }
        Ok(())
    }
}

impl Task {
    /// Returns the first invalid setting.
    fn check(&self, field: &str) -> Checked {
        match self {
            Self::Consent(consent) => {
                let (text, version) = (&consent.text, &consent.version);
                characters(&format!("{field}.consent.text"), text, 1..=MAX_TEXT)?;
                characters(&format!("{field}.consent.version"), version, 1..=64)
            }
            Self::Questionnaire(it) => it.check(&format!("{field}.questionnaire")),
            Self::External(external) => {
                let field = format!("{field}.external_questionnaire");
                characters(&format!("{field}.text"), &external.text, 0..=MAX_TEXT_ABOVE)?;
                address::check(&format!("{field}.url"), &external.url, PLACEHOLDER)
            }
            Self::Practice { .. } => Ok(()),
            Self::Games { count } => {
                let field = format!("{field}.games.count");
                within(&field, *count, 1..=MAX_STAGE_GAMES)
            }
            Self::Text(text) => {
                characters(&format!("{field}.text.title"), &text.title, 0..=128)?;
                characters(&format!("{field}.text.text"), &text.text, 1..=MAX_TEXT)
            }
            Self::Arrival(arrival) => {
                let field = format!("{field}.arrival.text");
                characters(&field, &arrival.text, 0..=MAX_TEXT_ABOVE)
            }
            Self::ScreenOut(out) => {
                let field = format!("{field}.screen_out.text");
                characters(&field, &out.text, 0..=MAX_TEXT_ABOVE)
            }
        }
    }
}

impl ExternalQuestionnaire {
    /// The questionnaire with its address complete.
    pub(crate) fn filled_in(&self, pseudonym: &str) -> Self {
        Self {
            text: self.text.clone(),
            url: address::filled_in(&self.url, PLACEHOLDER, pseudonym),
        }
    }
}
