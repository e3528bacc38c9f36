//! Questionnaires: items, the order in which a participant meets them, and which answers are valid.

use std::collections::BTreeSet;
use std::ops::RangeInclusive;

use thiserror::Error;

use crate::chance::Chance;
use crate::checks::{
    Checked, characters, has_control_characters, identifier, refuse, unique, within,
};
use crate::shown::{AnswerSet, ShownIf};

/// Maximum number of items of a questionnaire.
pub const MAX_ITEMS: usize = 100;
/// Maximum number of options of a choice.
pub const MAX_OPTIONS: usize = 50;
/// Numbers of points of an item.
const POINTS: RangeInclusive<u32> = 2..=11;
/// Values of a slider, and numbers.
const NUMBERS: RangeInclusive<i32> = -1_000_000..=1_000_000;
/// Maximum length of a free text, in characters.
const MAX_TEXT: usize = 10_000;
const MAX_TITLE: usize = 128;
const MAX_INSTRUCTIONS: usize = 2000;
const MAX_QUESTION: usize = 500;
const MAX_OPTION: usize = 200;
const MAX_LABEL: usize = 100;

/// A questionnaire.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Questionnaire {
    /// Identifies it in exported data, unique in the study.
    pub id: String,
    /// Title, at most 128 characters.
    pub title: String,
    /// Text above the items, at most 2000 characters.
    pub instructions: String,
    /// The items, 1..=100.
    pub items: Vec<Item>,
    /// Whether each participant meets them in an order of its own.
    pub shuffled: bool,
}

/// An item.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Item {
    /// Identifies it in exported data, unique in the questionnaire.
    pub id: String,
    /// The scale it belongs to, or empty.
    pub scale: String,
    /// The question or statement, at most 500 characters. May be empty only for a semantic
    /// differential.
    pub text: String,
    /// Whether it must be answered.
    pub required: bool,
    /// How it is answered.
    pub kind: ItemKind,
    /// It is shown only if all of these hold, at most 4.
    pub shown_if: Vec<ShownIf>,
    /// For an attention check, the answers that pass it.
    pub attention_check: Option<AnswerSet>,
}

/// How an item is answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ItemKind {
    /// By one of 2..=11 points, by how much one agrees.
    Likert {
        /// Number of points.
        points: u32,
        /// Labels of the first and last point, or of all.
        labels: Vec<String>,
    },
    /// By one of 2..=11 points between two words.
    SemanticDifferential {
        /// Number of points.
        points: u32,
        /// The word at the first point.
        left: String,
        /// The word at the last point.
        right: String,
    },
    /// By a value on a slider.
    Slider {
        /// Lowest value.
        min: i32,
        /// Highest value.
        max: i32,
        /// Distance of two values, a divisor of `max - min`.
        step: u32,
        /// Label of the lowest value.
        left: String,
        /// Label of the highest value.
        right: String,
    },
    /// By a whole number that is typed.
    Number {
        /// Lowest number.
        min: i32,
        /// Highest number.
        max: i32,
        /// What it counts or measures, or empty.
        unit: String,
    },
    /// From a list of 2..=50 options.
    Choice {
        /// The options.
        options: Vec<String>,
        /// Whether several may be chosen.
        multiple: bool,
    },
    /// In words.
    FreeText {
        /// Maximum number of characters, 1..=10000.
        max_characters: usize,
    },
}

/// An answer to an item.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ItemAnswer {
    /// Index of the item in the questionnaire's definition.
    pub item: usize,
    /// The answer.
    pub value: Answer,
    /// Milliseconds from showing the questionnaire to the last change of this answer, measured by
    /// the participant's device.
    pub answered_after_ms: Option<u32>,
}

impl ItemAnswer {
    /// Bytes that it takes in memory.
    pub fn memory(&self) -> usize {
        let content = match &self.value {
            Answer::Number(_) => 0,
            Answer::Options(chosen) => chosen.capacity() * size_of::<usize>(),
            Answer::Text(text) => text.capacity(),
        };
        size_of::<Self>() + content
    }
}

/// The value of an answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Answer {
    /// A point, from 1, the value of a slider, or a number.
    Number(i32),
    /// Indices of the chosen options, ascending.
    Options(Vec<usize>),
    /// A free text.
    Text(String),
}

/// An invalid answer, or a missing one.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("item {item}: {problem}")]
pub struct AnswerProblem {
    /// Index of the item.
    pub item: usize,
    /// What is wrong with it.
    pub problem: String,
}

impl Questionnaire {
    /// Returns the first invalid setting. `field` is the questionnaire's own path.
    pub(crate) fn check(&self, field: &str) -> Checked {
        identifier(&format!("{field}.id"), &self.id)?;
        characters(&format!("{field}.title"), &self.title, 0..=MAX_TITLE)?;
        let instructions = format!("{field}.instructions");
        characters(&instructions, &self.instructions, 0..=MAX_INSTRUCTIONS)?;
        within(&format!("{field}.items"), self.items.len(), 1..=MAX_ITEMS)?;
        let ids = self.items.iter().map(|item| item.id.as_str());
        unique(ids, |index| format!("{field}.items[{index}].id"))?;
        let mut items = self.items.iter().enumerate();
        items.try_for_each(|(index, item)| item.check(&format!("{field}.items[{index}]")))
    }

    /// Indices of the items in the order in which a participant meets them at a step, from 0.
    pub(crate) fn order(&self, seed: [u8; 32], participant: u32, step: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.items.len()).collect();
        if self.shuffled {
            Chance::of_items(seed, participant, step).shuffle(&mut order);
        }
        order
    }

    /// Checks answers to those of its items that may be shown: at most one for each item, each valid
    /// and of an item that is shown, and, unless they are only saved, one for each required item.
    pub(crate) fn check_answers(
        &self,
        items: &[usize],
        answers: &[ItemAnswer],
        only_saved: bool,
    ) -> Result<(), AnswerProblem> {
        let problem = |item, problem: String| Err(AnswerProblem { item, problem });
        let is_required = |item: &Item| item.required && !only_saved;
        let mut answered = BTreeSet::new();
        for answer in answers {
            if !answered.insert(answer.item) {
                return problem(answer.item, "it has two answers".to_owned());
            }
            let Some(item) = self.items.get(answer.item) else {
                return problem(answer.item, "the questionnaire has no such item".to_owned());
            };
            if let Some(wrong) = item.kind.problem_of(&answer.value, is_required(item)) {
                return problem(answer.item, wrong);
            }
        }
        let shown = self.shown_by(items, answers);
        if let Some(&hidden) = answered.difference(&shown).next() {
            return problem(hidden, "it is not shown after these answers".to_owned());
        }
        for index in shown {
            if is_required(&self.items[index]) && !answered.contains(&index) {
                return problem(index, "it must be answered".to_owned());
            }
        }
        Ok(())
    }
}

impl Item {
    /// An item that everybody must answer, of no scale.
    pub fn new(id: impl Into<String>, text: impl Into<String>, kind: ItemKind) -> Self {
        Self {
            id: id.into(),
            scale: String::new(),
            text: text.into(),
            required: true,
            kind,
            shown_if: Vec::new(),
            attention_check: None,
        }
    }

    fn check(&self, field: &str) -> Checked {
        identifier(&format!("{field}.id"), &self.id)?;
        characters(&format!("{field}.scale"), &self.scale, 0..=64)?;
        let needs_text = !matches!(self.kind, ItemKind::SemanticDifferential { .. });
        let least = usize::from(needs_text);
        characters(&format!("{field}.text"), &self.text, least..=MAX_QUESTION)?;
        self.kind.check(field)?;
        match &self.attention_check {
            Some(passing) => passing.check_passing(&format!("{field}.attention_check"), &self.kind),
            None => Ok(()),
        }
    }
}

impl ItemKind {
    fn check(&self, field: &str) -> Checked {
        let field = |name: &str| format!("{field}.{name}");
        let label = |name: &str, text: &str| characters(&field(name), text, 1..=MAX_LABEL);
        match self {
            Self::Likert { points, labels } => {
                within(&field("points"), *points, POINTS)?;
                if labels.len() != 2 && labels.len() != *points as usize {
                    let (given, points) = (labels.len(), *points);
                    let problem = format!("{given} labels for {points} points: give 2 or {points}");
                    return refuse(field("labels"), problem);
                }
                labels.iter().try_for_each(|text| label("labels", text))
            }
            Self::SemanticDifferential {
                points,
                left,
                right,
            } => {
                within(&field("points"), *points, POINTS)?;
                label("left", left)?;
                label("right", right)
            }
            Self::Slider {
                min,
                max,
                step,
                left,
                right,
            } => {
                within(&field("min"), *min, NUMBERS)?;
                within(&field("max"), *max, NUMBERS)?;
                if min >= max {
                    return refuse(field("max"), format!("{max} is not above `min`, {min}"));
                }
                if *step == 0 || max.abs_diff(*min) % step != 0 {
                    let problem = format!("{step} does not divide {}", max.abs_diff(*min));
                    return refuse(field("step"), problem);
                }
                characters(&field("left"), left, 0..=MAX_LABEL)?;
                characters(&field("right"), right, 0..=MAX_LABEL)
            }
            Self::Number { min, max, unit } => {
                within(&field("min"), *min, NUMBERS)?;
                within(&field("max"), *max, *min..=*NUMBERS.end())?;
                characters(&field("unit"), unit, 0..=MAX_LABEL)
            }
            Self::Choice { options, .. } => {
                within(&field("options"), options.len(), 2..=MAX_OPTIONS)?;
                let names = options.iter().map(String::as_str);
                unique(names, |index| field(&format!("options[{index}]")))?;
                let mut options = options.iter();
                options.try_for_each(|text| characters(&field("options"), text, 1..=MAX_OPTION))
            }
            Self::FreeText { max_characters } => {
                within(&field("max_characters"), *max_characters, 1..=MAX_TEXT)
            }
        }
    }

    /// The lowest and highest number that answers it, and the step between neighbouring ones; `None` if
    /// it is answered by options or in words.
    pub fn numbers(&self) -> Option<(i32, i32, u32)> {
        match self {
            Self::Likert { points, .. } | Self::SemanticDifferential { points, .. } => {
                Some((1, i32::try_from(*points).unwrap_or(i32::MAX), 1))
            }
            Self::Slider { min, max, step, .. } => Some((*min, *max, *step)),
            Self::Number { min, max, .. } => Some((*min, *max, 1)),
            Self::Choice { .. } | Self::FreeText { .. } => None,
        }
    }

    /// What is wrong with an answer.
    fn problem_of(&self, answer: &Answer, required: bool) -> Option<String> {
        match (self, answer) {
            (
                Self::Likert { points, .. } | Self::SemanticDifferential { points, .. },
                Answer::Number(number),
            ) => {
                let is_valid = u32::try_from(*number).is_ok_and(|it| (1..=*points).contains(&it));
                (!is_valid).then(|| format!("{number} is not a point within 1..={points}"))
            }
            (Self::Slider { min, max, step, .. }, Answer::Number(number)) => {
                let is_valid = (min..=max).contains(&number) && number.abs_diff(*min) % step == 0;
                let problem = || format!("{number} is not within {min}..={max} in steps of {step}");
                (!is_valid).then(problem)
            }
            (Self::Number { min, max, .. }, Answer::Number(number)) => {
                let is_valid = (min..=max).contains(&number);
                (!is_valid).then(|| format!("{number} is not within {min}..={max}"))
            }
            (Self::Choice { options, multiple }, Answer::Options(chosen)) => {
                let distinct: BTreeSet<_> = chosen.iter().collect();
                let (least, most) = match multiple {
                    true => (usize::from(required), options.len()),
                    false => (1, 1),
                };
                if !(least..=most).contains(&chosen.len()) {
                    let count = chosen.len();
                    return Some(format!("{count} options are not within {least}..={most}"));
                }
                let is_valid = distinct.len() == chosen.len()
                    && chosen.is_sorted()
                    && chosen.iter().all(|option| *option < options.len());
                let most = options.len() - 1;
                (!is_valid).then(|| format!("options must ascend within 0..={most}"))
            }
            (Self::FreeText { max_characters }, Answer::Text(text)) => {
                let count = text.chars().count();
                if !(1..=*max_characters).contains(&count) {
                    let problem = format!("{count} characters are not within 1..={max_characters}");
                    return Some(problem);
                }
                has_control_characters(text)
                    .then(|| "control characters are not allowed".to_owned())
            }
            (Self::Choice { .. }, _) => Some("it is answered by options".to_owned()),
            (Self::FreeText { .. }, _) => Some("it is answered by a text".to_owned()),
            _ => Some("it is answered by a number".to_owned()),
        }
    }
}
