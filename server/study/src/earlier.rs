//! What is shown to a participant after its answers to earlier questionnaires.

use std::collections::BTreeMap;

use crate::item_kind::Answer;
use crate::questionnaire::{ItemAnswer, Questionnaire, ShownIf};
use crate::stage::{Step, Task};

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

    /// Whether all of these conditions hold that are about earlier questionnaires.
    pub(crate) fn satisfy(&self, conditions: &[ShownIf]) -> bool {
        conditions.iter().all(|condition| {
            let id = condition.questionnaire.as_deref();
            id.is_none_or(|id| condition.holds(self.to(id, &condition.item)))
        })
    }

    /// Whether there is an item of a questionnaire that may be shown after these answers.
    pub(crate) fn leave_items_of(&self, questionnaire: &Questionnaire) -> bool {
        let mut items = questionnaire.items.iter();
        items.any(|item| self.satisfy(&item.shown_if))
    }

    /// Indices of the items of a questionnaire that may be shown after these answers, in the order of
    /// the definition.
    pub(crate) fn items_of(&self, questionnaire: &Questionnaire) -> Vec<usize> {
        let items = questionnaire.items.iter().enumerate();
        items
            .filter(|(_, item)| self.satisfy(&item.shown_if))
            .map(|(index, _)| index)
            .collect()
    }

    fn to(&self, questionnaire: &str, item: &str) -> Option<&'a Answer> {
        let (questionnaire, answers) = self.0.get(questionnaire)?;
        let index = questionnaire.items.iter().position(|it| it.id == item)?;
        let answer = answers.iter().find(|answer| answer.index() == index)?;
        answer.value.as_ref()
    }
}
