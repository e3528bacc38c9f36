//! Questionnaires: items, the order in which a participant meets them, which of them it is shown, and
//! what it must answer.

use std::collections::BTreeSet;
use std::ops::{Deref, DerefMut};
use std::slice;
use std::sync::Arc;

use prost::Message;
use thiserror::Error;

use crate::chance::Chance;
use crate::checks::{Checked, characters, identifier, refuse, unique, within};
use crate::item_kind::{Answer, AnswerSet, ItemKind};

/// Maximum number of conditions of an item or a stage.
pub const MAX_SHOWN_IF: usize = 4;
/// Maximum number of items of a questionnaire.
pub const MAX_ITEMS: usize = 100;
const MAX_TITLE: usize = 128;
const MAX_INSTRUCTIONS: usize = 2000;
const MAX_QUESTION: usize = 500;

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

/// What an earlier answer must be for something to be shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShownIf {
    /// Id of an earlier questionnaire; `None`: the item's own.
    pub questionnaire: Option<String>,
    /// Id of its item.
    pub item: String,
    /// Its answer is one of these, or has one of these options.
    pub answers: AnswerSet,
    /// The answer is none of these, or there is none.
    pub not: bool,
}

/// What the answer to another item of the questionnaire must be for an item to be shown, as
/// participants see it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShownItemIf {
    /// Index of that item in the questionnaire's definition.
    pub item: usize,
    /// Its answer is one of these, or has one of these options.
    pub answers: AnswerSet,
    /// The answer is none of these, or there is none.
    pub not: bool,
}

/// An answer to an item, in the form in which it is stored.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct ItemAnswer {
    /// Index of the item in the questionnaire's definition.
    #[prost(uint32, tag = "1")]
    pub item: u32,
    /// The answer; always there.
    #[prost(oneof = "Answer", tags = "2, 3, 4")]
    pub value: Option<Answer>,
    /// Milliseconds from showing the questionnaire to the last change of this answer, measured by
    /// the participant's device.
    #[prost(uint32, optional, tag = "5")]
    pub answered_after_ms: Option<u32>,
}

impl ItemAnswer {
    /// Index of the item in the questionnaire's definition.
    pub fn index(&self) -> usize {
        self.item as usize
    }

    /// Bytes that it takes in memory.
    pub fn memory(&self) -> usize {
        let content = match &self.value {
            Some(Answer::Options(chosen)) => chosen.options.capacity() * size_of::<u32>(),
            Some(Answer::Text(text)) => text.capacity(),
            Some(Answer::Number(_)) | None => 0,
        };
        size_of::<Self>() + content
    }
}

/// Answers to a questionnaire. They may be long, so copies share them until one is changed.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Answers(Arc<Vec<ItemAnswer>>);

impl From<Vec<ItemAnswer>> for Answers {
    fn from(answers: Vec<ItemAnswer>) -> Self {
        Self(Arc::new(answers))
    }
}

impl Deref for Answers {
    type Target = Vec<ItemAnswer>;

    fn deref(&self) -> &Vec<ItemAnswer> {
        &self.0
    }
}

impl DerefMut for Answers {
    fn deref_mut(&mut self) -> &mut Vec<ItemAnswer> {
        Arc::make_mut(&mut self.0)
    }
}

impl<'a> IntoIterator for &'a Answers {
    type Item = &'a ItemAnswer;
    type IntoIter = slice::Iter<'a, ItemAnswer>;

    fn into_iter(self) -> slice::Iter<'a, ItemAnswer> {
        self.iter()
    }
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
            let index = answer.index();
            if !answered.insert(index) {
                return problem(index, "it has two answers".to_owned());
            }
            let Some(item) = self.items.get(index) else {
                return problem(index, "the questionnaire has no such item".to_owned());
            };
            let Some(value) = &answer.value else {
                return problem(index, "its answer is empty".to_owned());
            };
            if let Some(wrong) = item.kind.problem_of(value, is_required(item)) {
                return problem(index, wrong);
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

impl ShownIf {
    /// Whether it holds after an answer, or without one.
    pub(crate) fn holds(&self, answer: Option<&Answer>) -> bool {
        answer.is_some_and(|answer| self.answers.has(answer)) != self.not
    }

    /// Returns the first invalid field of conditions on the answers to `earlier` questionnaires. Those
    /// on the answers of `own`, where there is one, are about items before the one with this index.
    pub(crate) fn check_all(
        conditions: &[Self],
        field: &str,
        earlier: &[&Questionnaire],
        own: Option<(&Questionnaire, usize)>,
    ) -> Checked {
        within(field, conditions.len(), 0..=MAX_SHOWN_IF)?;
        for (index, condition) in conditions.iter().enumerate() {
            condition.check(&format!("{field}[{index}]"), earlier, own)?;
        }
        Ok(())
    }

    fn check(
        &self,
        field: &str,
        earlier: &[&Questionnaire],
        own: Option<(&Questionnaire, usize)>,
    ) -> Checked {
        let of_field = format!("{field}.questionnaire");
        let items = match (&self.questionnaire, own) {
            (Some(id), _) => match earlier.iter().find(|it| it.id == *id) {
                Some(questionnaire) => &questionnaire.items[..],
                None => return refuse(of_field, format!("no earlier questionnaire is {id:?}")),
            },
            (None, None) => return refuse(of_field, "name an earlier questionnaire"),
            (None, Some((questionnaire, _))) if questionnaire.shuffled => {
                let problem = "name an earlier questionnaire: this one is shuffled, so that the \
                    item may come first";
                return refuse(of_field, problem);
            }
            (None, Some((questionnaire, index))) => &questionnaire.items[..index],
        };
        match items.iter().find(|item| item.id == self.item) {
            Some(item) => self.answers.check(&format!("{field}.answers"), &item.kind),
            None => {
                let problem = format!("no item before it is {:?}", self.item);
                refuse(format!("{field}.item"), problem)
            }
        }
    }
}

impl Questionnaire {
    /// Those of these items, in the order of the definition, that are shown once these answers to
    /// this questionnaire are given.
    pub(crate) fn shown_by(&self, items: &[usize], answers: &[ItemAnswer]) -> BTreeSet<usize> {
        let mut shown = BTreeSet::new();
        for &index in items {
            let mut conditions = self.own_conditions(&self.items[index]);
            let is_shown = conditions.all(|(other, condition)| {
                let answer = answers.iter().find(|answer| answer.index() == other);
                let answer = answer.filter(|_| shown.contains(&other));
                condition.holds(answer.and_then(|answer| answer.value.as_ref()))
            });
            if is_shown {
                shown.insert(index);
            }
        }
        shown
    }

    /// The conditions of an item on the answers of its own questionnaire, as participants see them.
    pub(crate) fn shown_if(&self, item: &Item) -> Vec<ShownItemIf> {
        let conditions = self.own_conditions(item);
        conditions
            .map(|(item, condition)| ShownItemIf {
                item,
                answers: condition.answers.clone(),
                not: condition.not,
            })
            .collect()
    }

    /// The conditions of an item on the answers of its own questionnaire, with the indices of the
    /// items that they are about.
    fn own_conditions<'q>(&'q self, item: &'q Item) -> impl Iterator<Item = (usize, &'q ShownIf)> {
        let own = item.shown_if.iter().filter(|it| it.questionnaire.is_none());
        own.filter_map(|condition| {
            let other = self.items.iter().position(|it| it.id == condition.item)?;
            Some((other, condition))
        })
    }
}
