//! The columns of the tables of questionnaires: their items, and what participants answered.

use chefshat_study::{
    Answer, AnswerSet, Condition, Item, ItemAnswer, ItemKind, Participant, Questionnaire, Settings,
    ShownIf,
};

use super::columns::{
    CONDITION, COUNT, MILLISECONDS, NO_GROUP, NUMBER, PSEUDONYM, SINCE_EPOCH, STEP, conditions,
    level, optional, text, with_factors, with_group,
};
use super::table::{Code, Kind, Table};

/// An item of a questionnaire.
pub(super) struct ItemRow<'s> {
    pub(super) questionnaire: &'s Questionnaire,
    /// Its index.
    pub(super) index: usize,
    pub(super) item: &'s Item,
}

pub(super) fn items<'s>() -> Table<ItemRow<'s>> {
    type Row<'s> = ItemRow<'s>;
    const IN_WORDS: &str = "it is answered in words";
    let kinds = [
        Code::new("likert", "by a point, by how much one agrees"),
        Code::new("semantic_differential", "by a point between two words"),
        Code::new("slider", "by a value on a slider"),
        Code::new("choice", "by an option of a list"),
        Code::new("choices", "by any number of options of a list"),
        Code::new("free_text", "in words"),
        Code::new("number", "by a number that is typed"),
    ];
    Table::new(
        "items.csv",
        "an item of a questionnaire",
        &["questionnaire", "item"],
    )
    .with(
        "questionnaire",
        Kind::Text,
        QUESTIONNAIRE,
        |row: &Row<'s>| row.questionnaire.id.clone(),
    )
    .with("item", Kind::Text, ITEM, |row| row.item.id.clone())
    .with(
        "position",
        COUNT,
        "place of the item in the settings, from 1",
        |row| text(row.index + 1),
    )
    .with("scale", Kind::Text, SCALE, |row| row.item.scale.clone())
    .empty(NO_SCALE)
    .with("text", Kind::Text, "the question or statement", |row| {
        row.item.text.clone()
    })
    .empty("the two words say it")
    .with("kind", Kind::one_of(kinds), "how it is answered", |row| {
        let kind = match row.item.kind {
            ItemKind::Likert { .. } => "likert",
            ItemKind::SemanticDifferential { .. } => "semantic_differential",
            ItemKind::Slider { .. } => "slider",
            ItemKind::Choice {
                multiple: false, ..
            } => "choice",
            ItemKind::Choice { multiple: true, .. } => "choices",
            ItemKind::FreeText { .. } => "free_text",
            ItemKind::Number { .. } => "number",
        };
        kind.to_owned()
    })
    .with(
        "required",
        Kind::Boolean,
        "whether it must be answered",
        |row| text(row.item.required),
    )
    .with("lowest", COUNT, "lowest number that answers it", |row| {
        optional(numbers_of(&row.item.kind).map(|(lowest, ..)| lowest))
    })
    .empty(IN_WORDS)
    .with("highest", COUNT, "highest number that answers it", |row| {
        optional(numbers_of(&row.item.kind).map(|(_, highest, _)| highest))
    })
    .empty(IN_WORDS)
    .with(
        "step",
        COUNT,
        "step between neighbouring numbers that answer it",
        |row| optional(numbers_of(&row.item.kind).map(|(.., step)| step)),
    )
    .empty(IN_WORDS)
    .with(
        "labels",
        Kind::Text,
        "numbers that have a label, each with it",
        |row| {
            let labels = labels_of(&row.item.kind).into_iter();
            let labels = labels.map(|(number, label)| format!("{number} = {label}"));
            labels.collect::<Vec<_>>().join("; ")
        },
    )
    .empty("it has no labels")
    .with(
        "unit",
        Kind::Text,
        "what the number counts or measures",
        |row| match &row.item.kind {
            ItemKind::Number { unit, .. } => unit.clone(),
            _ => String::new(),
        },
    )
    .empty("it is not answered by a number that is typed, or its text says it")
    .with("shown_if", Kind::Text, SHOWN_IF, |row| {
        let conditions = row.item.shown_if.iter().map(condition_text);
        conditions.collect::<Vec<_>>().join("; ")
    })
    .empty("everybody who was shown the questionnaire was shown the item")
    .with("attention_check", Kind::Text, ATTENTION_CHECK, |row| {
        optional(row.item.attention_check.as_ref().map(answers_text))
    })
    .empty(NO_ATTENTION_CHECK)
}

/// What an earlier answer must be, for example "before/plays not 0..2".
fn condition_text(condition: &ShownIf) -> String {
    let questionnaire = condition.questionnaire.as_ref();
    let of = questionnaire.map_or_else(String::new, |id| format!("{id}/"));
    let not = if condition.not { "not " } else { "" };
    format!(
        "{of}{} {not}{}",
        condition.item,
        answers_text(&condition.answers)
    )
}

/// Some of the answers to an item: options separated by spaces, or the lowest and highest number.
fn answers_text(answers: &AnswerSet) -> String {
    if answers.options.is_empty() {
        let (min, max) = (optional(answers.min), optional(answers.max));
        return format!("{min}..{max}");
    }
    let options = answers.options.iter().map(text);
    options.collect::<Vec<_>>().join(" ")
}

/// The lowest and highest number that answers an item, and the step between neighbouring ones;
/// `None` if it is answered in words.
fn numbers_of(kind: &ItemKind) -> Option<(i64, i64, u32)> {
    if let ItemKind::Choice { options, .. } = kind {
        let last = i64::try_from(options.len()).unwrap_or(i64::MAX) - 1;
        return Some((0, last, 1));
    }
    let (lowest, highest, step) = kind.numbers()?;
    Some((i64::from(lowest), i64::from(highest), step))
}

/// The numbers that answer an item and have a label, each with it.
fn labels_of(kind: &ItemKind) -> Vec<(i64, &str)> {
    let Some((lowest, highest, _)) = numbers_of(kind) else {
        return Vec::new();
    };
    let ends = |left, right| vec![(lowest, left), (highest, right)];
    let mut labels: Vec<(i64, &str)> = match kind {
        ItemKind::Likert { labels, .. } => match labels.as_slice() {
            [left, right] => ends(left.as_str(), right.as_str()),
            all => (lowest..).zip(all.iter().map(String::as_str)).collect(),
        },
        ItemKind::SemanticDifferential { left, right, .. }
        | ItemKind::Slider { left, right, .. } => ends(left, right),
        ItemKind::Choice { options, .. } => {
            (lowest..).zip(options.iter().map(String::as_str)).collect()
        }
        ItemKind::Number { .. } | ItemKind::FreeText { .. } => Vec::new(),
    };
    labels.retain(|(_, label)| !label.is_empty());
    labels
}

const SHOWN_IF: &str = "the earlier answers for which the item was shown: item, after its \
    questionnaire and a slash if that is another, and its options or lowest and highest number, after \
    `not` where other answers count, or none";
const ATTENTION_CHECK: &str =
    "the answers that pass this attention check: its options, or the lowest and highest number";
const NO_ATTENTION_CHECK: &str = "the item is not an attention check";

const QUESTIONNAIRE: &str = "id of the questionnaire";
const ITEM: &str = "id of the item in the questionnaire";
const SCALE: &str = "scale that the item belongs to";
const NO_SCALE: &str = "it belongs to none";

/// An item of a questionnaire that a participant has reached.
pub(super) struct AnswerRow<'s> {
    pub(super) number: u32,
    pub(super) participant: &'s Participant,
    pub(super) step: usize,
    pub(super) condition: Option<&'s Condition>,
    pub(super) questionnaire: &'s Questionnaire,
    pub(super) item: &'s Item,
    /// Place of the item in the order in which the participant met them, from 1; `None` if it was not
    /// shown the item.
    pub(super) position: Option<usize>,
    pub(super) answer: Option<&'s ItemAnswer>,
}

impl AnswerRow<'_> {
    /// When the participant reached a step, unless it passed over the questionnaire.
    fn reached_at_ms(&self, step: usize) -> Option<u64> {
        let was_shown = !self.participant.passed_over.contains(&self.step);
        let reached = self.participant.reached_at_ms.get(step).copied();
        reached.filter(|_| was_shown)
    }

    fn value(&self) -> Option<&Answer> {
        self.answer?.value.as_ref()
    }

    /// The numbers that answer the item.
    fn chosen(&self) -> Vec<i64> {
        match self.value() {
            Some(Answer::Number(number)) => vec![i64::from(*number)],
            Some(Answer::Options(chosen)) => {
                chosen.options.iter().copied().map(i64::from).collect()
            }
            Some(Answer::Text(_)) | None => Vec::new(),
        }
    }
}

pub(super) fn answers<'s>(settings: &Settings) -> Table<AnswerRow<'s>> {
    type Row<'s> = AnswerRow<'s>;
    const NO_CONDITION: &str = "the step belongs to no condition, or to several";
    const POSITION: &str =
        "place of the item in the order in which the participant met them, from 1";
    const ANSWER: &str = "a number of items.csv, several separated by spaces, or words";
    const NO_ANSWER: &str = "it was not answered, or by none of several options";
    const LABEL: &str = "label of that number; several separated by semicolons";
    const NO_LABEL: &str = "it was not answered, or in words, or the number has no label";
    const AFTER: &str = "time from showing the questionnaire to the last change of the answer, \
        measured by the participant's device";
    const PASSED_OVER: &str = "the participant passed over the questionnaire";
    const PASSED: &str = "whether the attention check was passed";
    const NOT_MEASURED: &str = "it was not answered, or the device did not measure it";
    let statuses = [
        Code::new("answered", "the item was answered"),
        Code::new("left_out", "the questionnaire was sent without it"),
        Code::new("not_sent", "the questionnaire was shown and not sent"),
        Code::new(
            "not_shown",
            "earlier answers left the item, or the questionnaire, out",
        ),
    ];
    let condition = Kind::one_of(conditions(settings));
    let table = Table::new(
        "answers.csv",
        "an item of a questionnaire that a participant has reached",
        &["number", "step", "item"],
    )
    .with("number", COUNT, NUMBER, |row: &Row<'s>| text(row.number))
    .with("participant", Kind::Text, PSEUDONYM, |row| {
        row.participant.pseudonym.clone()
    })
    .with("step", COUNT, STEP, |row| text(row.step))
    .with("condition", condition, CONDITION, |row| {
        optional(row.condition.map(|it| &it.id))
    })
    .empty(NO_CONDITION);
    let table = with_group(table, settings, NO_GROUP, |row| row.participant.group);
    with_factors(table, settings, false, Some(NO_CONDITION), |row, factor| {
        row.condition
            .map_or_else(String::new, |it| level(it, factor))
    })
    .with("questionnaire", Kind::Text, QUESTIONNAIRE, |row| {
        row.questionnaire.id.clone()
    })
    .with("item", Kind::Text, ITEM, |row| row.item.id.clone())
    .with("scale", Kind::Text, SCALE, |row| row.item.scale.clone())
    .empty(NO_SCALE)
    .with("position", COUNT, POSITION, |row| optional(row.position))
    .empty("the item was not shown")
    .with(
        "status",
        Kind::one_of(statuses),
        "whether it was answered",
        |row| {
            let was_sent = row.participant.answers.contains_key(&row.step);
            let status = match row.answer {
                Some(_) => "answered",
                None if row.position.is_none() => "not_shown",
                None if was_sent => "left_out",
                None => "not_sent",
            };
            status.to_owned()
        },
    )
    .with("answer", Kind::Text, ANSWER, |row| match row.value() {
        Some(Answer::Text(words)) => words.clone(),
        _ => row.chosen().iter().map(text).collect::<Vec<_>>().join(" "),
    })
    .empty(NO_ANSWER)
    .with("label", Kind::Text, LABEL, |row| {
        let (labels, chosen) = (labels_of(&row.item.kind), row.chosen());
        let labels = labels
            .into_iter()
            .filter(|(number, _)| chosen.contains(number));
        labels
            .map(|(_, label)| label)
            .collect::<Vec<_>>()
            .join("; ")
    })
    .empty(NO_LABEL)
    .with("passed", Kind::Boolean, PASSED, |row| {
        let passing = row.item.attention_check.as_ref();
        let passing = passing.zip(row.value());
        optional(passing.map(|(passing, answer)| passing.is_passed_by(answer)))
    })
    .empty("the item is not an attention check, or was not answered")
    .with("answered_after_ms", MILLISECONDS, AFTER, |row| {
        optional(row.answer.and_then(|it| it.answered_after_ms))
    })
    .empty(NOT_MEASURED)
    .with(
        "questionnaire_shown_at_ms",
        SINCE_EPOCH,
        "when the participant reached the step",
        |row| optional(row.reached_at_ms(row.step)),
    )
    .empty(PASSED_OVER)
    .with(
        "questionnaire_answered_at_ms",
        SINCE_EPOCH,
        "when the questionnaire was sent",
        |row| {
            let was_sent = row.participant.answers.contains_key(&row.step);
            optional(row.reached_at_ms(row.step + 1).filter(|_| was_sent))
        },
    )
    .empty("it was not sent, or not shown")
}
