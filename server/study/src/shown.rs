//! What is shown only after certain answers: items of a questionnaire, and stages.

use std::collections::{BTreeMap, BTreeSet};

use crate::checks::{Checked, refuse, within};
use crate::questionnaire::{Answer, Item, ItemAnswer, ItemKind, Questionnaire};
use crate::stage::{Step, Task};

/// Maximum number of conditions of an item or a stage.
pub const MAX_SHOWN_IF: usize = 4;

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
            Answer::Options(chosen) => chosen.iter().any(|option| self.options.contains(option)),
            Answer::Text(_) => false,
        }
    }

    /// Whether an answer passes an attention check: it is one of these, or has these options and no
    /// others.
    pub fn is_passed_by(&self, answer: &Answer) -> bool {
        match answer {
            Answer::Number(number) => self.is_within(*number),
            Answer::Options(chosen) => *chosen == self.options,
            Answer::Text(_) => false,
        }
    }

    fn is_within(&self, number: i32) -> bool {
        self.min.is_none_or(|min| min <= number) && self.max.is_none_or(|max| number <= max)
    }
}

impl ShownIf {
    /// Whether it holds after an answer, or without one.
    fn holds(&self, answer: Option<&Answer>) -> bool {
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

    /// Whether all of these conditions hold that are about earlier questionnaires.
    pub(crate) fn all_hold(conditions: &[Self], earlier: &EarlierAnswers<'_>) -> bool {
        conditions.iter().all(|condition| {
            let id = condition.questionnaire.as_deref();
            id.is_none_or(|id| condition.holds(earlier.to(id, &condition.item)))
        })
    }
}

/// The last answers of a participant to each questionnaire before a step, by the questionnaire's id.
#[derive(Debug)]
pub(crate) struct EarlierAnswers<'a>(BTreeMap<&'a str, (&'a Questionnaire, &'a [ItemAnswer])>);

impl<'a> EarlierAnswers<'a> {
    /// Those before a step, of the answers that were given at these steps, in their order. In the
    /// block of a condition, the blocks of others do not count.
    pub(crate) fn before(
        steps: &[Step<'a>],
        step: usize,
        given: impl Iterator<Item = (usize, &'a [ItemAnswer])>,
    ) -> Self {
        let block = steps.get(step).and_then(|it| it.block);
        let earlier = given.take_while(|(at, _)| *at < step);
        let earlier = earlier.filter_map(|(at, answers)| {
            let of = steps.get(at)?;
            let counts = block.is_none() || of.block.is_none() || of.block == block;
            match of.task {
                Task::Questionnaire(it) if counts => Some((it.id.as_str(), (it, answers))),
                _ => None,
            }
        });
        Self(earlier.collect())
    }

    fn to(&self, questionnaire: &str, item: &str) -> Option<&'a Answer> {
        let (questionnaire, answers) = self.0.get(questionnaire)?;
        let index = questionnaire.items.iter().position(|it| it.id == item)?;
        let answer = answers.iter().find(|answer| answer.item == index)?;
        Some(&answer.value)
    }
}

impl Questionnaire {
    /// Indices of the items that a participant may be shown who gave these answers to earlier
    /// questionnaires, in the order of the definition.
    pub(crate) fn items_after(&self, earlier: &EarlierAnswers<'_>) -> Vec<usize> {
        let items = self.items.iter().enumerate();
        items
            .filter(|(_, item)| ShownIf::all_hold(&item.shown_if, earlier))
            .map(|(index, _)| index)
            .collect()
    }

    /// Those of these items, in the order of the definition, that are shown once these answers to
    /// this questionnaire are given.
    pub(crate) fn shown_by(&self, items: &[usize], answers: &[ItemAnswer]) -> BTreeSet<usize> {
        let mut shown = BTreeSet::new();
        for &index in items {
            let mut conditions = self.own_conditions(&self.items[index]);
            let is_shown = conditions.all(|(other, condition)| {
                let answer = answers.iter().find(|answer| answer.item == other);
                let answer = answer.filter(|_| shown.contains(&other));
                condition.holds(answer.map(|answer| &answer.value))
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
