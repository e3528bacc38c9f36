//! How items are answered, and which answers are valid.

use std::collections::BTreeSet;
use std::ops::RangeInclusive;

use crate::checks::{Checked, characters, has_control_characters, refuse, unique, within};

/// Maximum number of options of a choice.
pub const MAX_OPTIONS: usize = 50;
/// Numbers of points of an item.
const POINTS: RangeInclusive<u32> = 2..=11;
/// Values of a slider, and numbers.
const NUMBERS: RangeInclusive<i32> = -1_000_000..=1_000_000;
/// Maximum length of a free text, in characters.
const MAX_TEXT: usize = 10_000;
const MAX_OPTION: usize = 200;
const MAX_LABEL: usize = 100;

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

/// The value of an answer, in the form in which it is stored.
#[derive(Clone, PartialEq, Eq, prost::Oneof)]
pub enum Answer {
    /// A point, from 1, the value of a slider, or a number.
    #[prost(sint32, tag = "2")]
    Number(i32),
    /// The chosen options.
    #[prost(message, tag = "3")]
    Options(Chosen),
    /// A free text.
    #[prost(string, tag = "4")]
    Text(String),
}

/// Chosen options.
#[derive(Clone, PartialEq, Eq, prost::Message)]
pub struct Chosen {
    /// Their indices, ascending.
    #[prost(uint32, repeated, tag = "1")]
    pub options: Vec<u32>,
}

impl Answer {
    /// Options by their indices, ascending.
    pub fn options(options: Vec<u32>) -> Self {
        Self::Options(Chosen { options })
    }
}

impl Chosen {
    /// Their indices, ascending.
    pub fn indices(&self) -> impl Iterator<Item = usize> {
        self.options.iter().map(|index| *index as usize)
    }
}

/// Some of the answers to an item.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct AnswerSet {
    /// The lowest number, if there is one.
    pub min: Option<i32>,
    /// The highest number, if there is one.
    pub max: Option<i32>,
    /// Indices of options, ascending; empty for an item that is answered by a number.
    pub options: Vec<usize>,
}

impl ItemKind {
    /// Returns the first invalid setting.
    pub(crate) fn check(&self, field: &str) -> Checked {
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
    pub(crate) fn problem_of(&self, answer: &Answer, required: bool) -> Option<String> {
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
                let count = chosen.options.len();
                let distinct: BTreeSet<_> = chosen.indices().collect();
                let (least, most) = match multiple {
                    true => (usize::from(required), options.len()),
                    false => (1, 1),
                };
                if !(least..=most).contains(&count) {
                    return Some(format!("{count} options are not within {least}..={most}"));
                }
                let is_valid = distinct.len() == count
                    && chosen.options.is_sorted()
                    && chosen.indices().all(|option| option < options.len());
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

impl AnswerSet {
    /// Returns the first invalid field, for answers to an item of this kind.
    pub(crate) fn check(&self, field: &str, kind: &ItemKind) -> Checked {
        if let ItemKind::Choice { options, .. } = kind {
            if self.min.is_some() || self.max.is_some() {
                return refuse(field, "a choice is answered by `options`");
            }
            let field = format!("{field}.options");
            within(&field, self.options.len(), 1..=options.len())?;
            let is_valid = self.options.is_sorted_by(|one, next| one < next)
                && self.options.iter().all(|option| *option < options.len());
            if !is_valid {
                let most = options.len() - 1;
                return refuse(field, format!("options must ascend within 0..={most}"));
            }
            return Ok(());
        }
        let Some((lowest, highest, step)) = kind.numbers() else {
            return refuse(field, "it must be answered by a number or a choice");
        };
        if !self.options.is_empty() {
            return refuse(field, "it is answered by a number: set `min` and `max`");
        }
        if self.min.is_none() && self.max.is_none() {
            return refuse(field, "set `min`, `max` or both");
        }
        // The first number from `min` on.
        let (lowest, step) = (i64::from(lowest), i64::from(step).max(1));
        let above = (self.min.map_or(0, |min| i64::from(min) - lowest)).max(0);
        let first = lowest + (above + step - 1) / step * step;
        if first > i64::from(self.max.unwrap_or(highest).min(highest)) {
            return refuse(field, "no answer to the item is within `min` and `max`");
        }
        Ok(())
    }

    /// Returns the first invalid field of the answers that pass an attention check.
    pub(crate) fn check_passing(&self, field: &str, kind: &ItemKind) -> Checked {
        self.check(field, kind)?;
        match kind {
            ItemKind::Choice {
                multiple: false, ..
            } if self.options.len() > 1 => {
                refuse(format!("{field}.options"), "nobody can choose several")
            }
            _ => Ok(()),
        }
    }

    /// Whether an answer is one of these, or has one of these options.
    pub fn has(&self, answer: &Answer) -> bool {
        match answer {
            Answer::Number(number) => self.is_within(*number),
            Answer::Options(chosen) => {
                (chosen.indices()).any(|option| self.options.contains(&option))
            }
            Answer::Text(_) => false,
        }
    }

    /// Whether an answer passes an attention check: it is one of these, or has these options and no
    /// others.
    pub fn is_passed_by(&self, answer: &Answer) -> bool {
        match answer {
            Answer::Number(number) => self.is_within(*number),
            Answer::Options(chosen) => chosen.indices().eq(self.options.iter().copied()),
            Answer::Text(_) => false,
        }
    }

    fn is_within(&self, number: i32) -> bool {
        self.min.is_none_or(|min| min <= number) && self.max.is_none_or(|max| number <= max)
    }
}
