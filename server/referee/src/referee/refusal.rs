//! Reports that are refused before they are judged: nothing follows from them, and they are no
//! violations.

use super::{MAX_HELD, MAX_QUESTIONS, QUESTION_PREFIX, Referee};
use crate::Report;

/// Why a report is not judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// There are too many open questions.
    #[error("{MAX_QUESTIONS} questions are open; have one answered, or withdraw one")]
    TooManyQuestions,
    /// The id is one of the referee's own questions.
    #[error("only the ids of the referee's questions begin with `{QUESTION_PREFIX}`")]
    ReservedQuestionId,
    /// The question has no such answer.
    #[error("the question has no such answer: `option` is an index of its `options`")]
    NoSuchOption,
    /// Too many reports wait for the answer to a question.
    #[error("{MAX_HELD} reports wait for the answer to the referee's question; have it answered")]
    TooManyHeld,
    /// The report does not exist, does not count, or is too old.
    #[error(
        "this report cannot be corrected: it does not count in this Shift, or its pizza was over long ago"
    )]
    NotCorrectable,
    /// The game goes on.
    #[error("the game is not over: there is no end to confirm")]
    NotOver,
}

impl Referee {
    /// Checks whether a report can be judged.
    ///
    /// # Errors
    /// Why not.
    pub fn check(&self, report: &Report) -> Result<(), Refusal> {
        let is_refused = |refused: bool, refusal| if refused { Err(refusal) } else { Ok(()) };
        match report {
            Report::Question(question) => {
                let is_known = self.questions.iter().any(|it| it.id == question.id);
                let is_full = self.questions.len() >= MAX_QUESTIONS;
                let is_reserved = question.id.starts_with(QUESTION_PREFIX);
                is_refused(is_full && !is_known, Refusal::TooManyQuestions)?;
                is_refused(is_reserved && !is_known, Refusal::ReservedQuestionId)
            }
            Report::Answer { id, option } => {
                let question = self.questions.iter().find(|it| it.id == *id);
                let options = question.map_or(usize::MAX, |it| it.options.len());
                // A question that is not open any more is known to be answered.
                let is_wrong = question.is_some() && option.is_some_and(|it| it >= options);
                is_refused(is_wrong, Refusal::NoSuchOption)
            }
            Report::Laid { .. } | Report::Pass { .. } | Report::Cleared => is_refused(
                self.asked.is_some() && self.held.len() >= MAX_HELD,
                Refusal::TooManyHeld,
            ),
            Report::Correction { number, .. } => {
                is_refused(!self.can_correct(*number), Refusal::NotCorrectable)
            }
            Report::EndConfirmed => is_refused(!self.game().is_over(), Refusal::NotOver),
            Report::Hand { .. }
            | Report::PassWithdrawn { .. }
            | Report::Special { .. }
            | Report::Gift { .. }
            | Report::Role { .. }
            | Report::Pause(_) => Ok(()),
        }
    }

    fn can_correct(&self, number: u64) -> bool {
        let waits = self.held.iter().any(|(held, _)| *held == number);
        if waits || self.has(number) {
            return true;
        }
        // Until something of a Shift is reported, the one before can be corrected.
        if !self.shift().entries.is_empty() || self.shifts.len() < 2 {
            return false;
        }
        let mut before = self.clone();
        before.shifts.pop();
        before.played.pop();
        before.has(number)
    }
}
