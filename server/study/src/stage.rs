//! The stages of a study, and the steps of a participant: stages with those of a block repeated for
//! each of its conditions.

use crate::address;
use crate::checks::{Checked, characters, within};
use crate::questionnaire::Questionnaire;

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
    Once(Task),
    /// Done for each condition of the participant, in the order of its sequence.
    PerCondition(Vec<Task>),
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
    /// The condition whose block it belongs to, if any.
    pub block: Option<usize>,
}

/// The steps of a participant with this sequence of conditions. Their number does not depend on the
/// sequence.
pub(crate) fn steps<'s>(stages: &'s [Stage], sequence: &[usize]) -> Vec<Step<'s>> {
    let mut steps = Vec::new();
    for stage in stages {
        match stage {
            Stage::Once(task) => steps.push(Step { task, block: None }),
            Stage::PerCondition(tasks) => {
                for &condition in sequence {
                    let block = Some(condition);
                    steps.extend(tasks.iter().map(|task| Step { task, block }));
                }
            }
        }
    }
    steps
}

impl Stage {
    /// The tasks of the stage, each once, with their paths.
    pub(crate) fn tasks<'s>(&'s self, field: &str) -> Vec<(String, &'s Task)> {
        match self {
            Self::Once(task) => vec![(field.to_owned(), task)],
            Self::PerCondition(tasks) => {
                let path = |index| format!("{field}.per_condition.stages[{index}]");
                let tasks = tasks.iter().enumerate();
                tasks.map(|(index, task)| (path(index), task)).collect()
            }
        }
    }
}

impl Task {
    /// Returns the first invalid setting.
    pub(crate) fn check(&self, field: &str) -> Checked {
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
