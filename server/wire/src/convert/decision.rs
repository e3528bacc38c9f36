//! Decisions: masks, answers and their results, annotations, expressions.

use chefshat_engine::{MAX_SEATS, Mask, RuleSet};
use chefshat_proto::v1::{self, expression::About};
use chefshat_record::convert::{FieldProblem, check_expression};
use chefshat_record::outcome::is_by_fallback;
use prost::Message as _;

use chefshat_room::{Answer, Answered, ExpressError, Expression, Verdict};

/// Encodes a mask.
pub(super) fn mask_bytes(mask: &Mask, rules: &RuleSet) -> Vec<u8> {
    mask.to_bytes(rules.actions().size())
}

/// The result of an answer, as a message.
pub fn answer_result(decision_id: u64, action: u32, answered: Answered) -> v1::AnswerResult {
    let mut result = v1::AnswerResult {
        decision_id,
        action,
        decision_time_us: u64::try_from(answered.time.as_micros()).unwrap_or(u64::MAX),
        annotations_dropped: answered.annotations_dropped,
        ..v1::AnswerResult::default()
    };
    let status = match answered.verdict {
        Verdict::Accepted => v1::AnswerStatus::Accepted,
        Verdict::Invalid {
            detail,
            attempts_left,
            reward,
        } => {
            result.detail = detail;
            result.invalid_attempts_left = attempts_left;
            result.reward = reward;
            v1::AnswerStatus::Invalid
        }
        Verdict::Closed => v1::AnswerStatus::Closed,
        Verdict::Unknown => v1::AnswerStatus::UnknownDecision,
    };
    result.set_status(status);
    result
}

/// Annotations contain a number that is not finite, which records cannot hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct NotFinite;

/// Encodes annotations for storage.
///
/// # Errors
/// An annotation is not a finite number.
fn annotations_from_proto(
    annotations: Option<v1::Annotations>,
) -> Result<Option<Box<[u8]>>, NotFinite> {
    let Some(annotations) = annotations else {
        return Ok(None);
    };
    let mut numbers = annotations
        .action_scores
        .iter()
        .chain(&annotations.value_estimate);
    if !numbers.all(|number| number.is_finite()) {
        return Err(NotFinite);
    }
    let bytes = annotations.encode_to_vec().into_boxed_slice();
    Ok(Some(bytes).filter(|bytes| !bytes.is_empty()))
}

/// Converts an answer and encodes its annotations for storage.
pub fn answer_from_proto(answer: v1::Answer) -> Answer {
    let by_fallback = answer.annotations.as_ref().is_some_and(is_by_fallback);
    let annotations = annotations_from_proto(answer.annotations);
    Answer {
        by_fallback,
        decision_id: answer.decision_id,
        action: answer.action,
        annotations_refused: annotations.is_err(),
        measured: None,
        annotations: annotations.unwrap_or_default(),
    }
}

/// Checks an expression and encodes it for storage.
///
/// # Errors
/// A field is out of its range.
pub fn expression_from_proto(expression: &v1::Expression) -> Result<Expression, FieldProblem> {
    check_expression(expression, MAX_SEATS)?;
    Ok(Expression {
        record_only: expression.record_only,
        about: match expression.about {
            Some(About::AboutSeat(seat)) => Some(seat),
            _ => None,
        },
        in_words: expression.media.starts_with("data:"),
        encoded: expression.encode_to_vec().into_boxed_slice(),
    })
}

/// Why an expression was refused, for the stream of its seat.
pub fn express_refused(error: ExpressError) -> v1::Refused {
    // Codes of google.rpc.Code.
    const INVALID_ARGUMENT: u32 = 3;
    const RESOURCE_EXHAUSTED: u32 = 8;
    const FAILED_PRECONDITION: u32 = 9;
    let (code, reason) = match error {
        ExpressError::GameOver => (FAILED_PRECONDITION, "GAME_OVER"),
        ExpressError::ChatOff => (FAILED_PRECONDITION, "CHAT_OFF"),
        ExpressError::TooMany | ExpressError::TooFast => {
            (RESOURCE_EXHAUSTED, "TOO_MANY_EXPRESSIONS")
        }
        ExpressError::DiskNearlyFull => (RESOURCE_EXHAUSTED, "DISK_NEARLY_FULL"),
        ExpressError::NoSuchSeat => (INVALID_ARGUMENT, "EXPRESSION_REFUSED"),
    };
    v1::Refused {
        reason: reason.into(),
        message: error.to_string(),
        code,
        ..v1::Refused::default()
    }
}
