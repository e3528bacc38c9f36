//! What participants of a study see and answer, as messages. `chefshat_study::View` decides what
//! that is.

use chefshat_proto::v1::{self, study_item, study_item_answer, study_shown_item, study_view};
use chefshat_room::ids::{GameId, RoomId};
use chefshat_study::{
    Answer, Content, ItemAnswer, ShownGame, ShownItem, ShownItemIf, ShownQuestionnaire, View,
};

use super::mirrored::Mirrored as _;
use super::number;
use super::study::{answer_set_to_proto, item_kind};

/// A view as a message. `ticket_of` has the ticket of the participant's seat in a room.
pub fn study_view(view: View, ticket_of: impl FnOnce(RoomId) -> String) -> v1::StudyView {
    use study_view::Content as Message;
    v1::StudyView {
        title: view.title,
        language: view.language.code().to_owned(),
        pseudonym: view.pseudonym,
        step: number(view.step),
        steps: number(view.steps),
        traces: view.traces,
        test: view.test,
        deletes_at_ms: view.deletes_at_ms.unwrap_or(0),
        content: Some(match view.content {
            Content::Consent(consent) => Message::Consent(v1::StudyConsent {
                text: consent.text,
                version: consent.version,
            }),
            Content::Questionnaire(it) => Message::Questionnaire(questionnaire(it)),
            Content::External(it) => {
                Message::ExternalQuestionnaire(v1::StudyExternalQuestionnaire {
                    text: it.text,
                    url: it.url,
                })
            }
            Content::Text(text) => Message::Text(v1::StudyText {
                title: text.title,
                text: text.text,
            }),
            Content::Game(game) => Message::Game(shown_game(&game, ticket_of)),
            Content::Arrival(arrival) => Message::Arrival(v1::StudyShownArrival {
                text: arrival.text,
                size: arrival.size,
                here: arrival.here,
                wait_ms: arrival.wait_ms,
            }),
            Content::End { reason, url, text } => Message::End(v1::StudyEnd {
                reason: reason.to_proto().into(),
                url: url.unwrap_or_default(),
                text,
            }),
        }),
    }
}

fn questionnaire(shown: ShownQuestionnaire) -> v1::StudyShownQuestionnaire {
    v1::StudyShownQuestionnaire {
        title: shown.title,
        instructions: shown.instructions,
        items: shown.items.into_iter().map(item).collect(),
    }
}

fn item(shown: ShownItem) -> v1::StudyShownItem {
    use study_item::Kind;
    use study_shown_item::Kind as Shown;
    v1::StudyShownItem {
        item: number(shown.item),
        text: shown.text,
        optional: !shown.required,
        kind: Some(match item_kind(shown.kind) {
            Kind::Likert(it) => Shown::Likert(it),
            Kind::SemanticDifferential(it) => Shown::SemanticDifferential(it),
            Kind::Slider(it) => Shown::Slider(it),
            Kind::Choice(it) => Shown::Choice(it),
            Kind::FreeText(it) => Shown::FreeText(it),
            Kind::Number(it) => Shown::Number(it),
        }),
        shown_if: shown.shown_if.iter().map(shown_item_if).collect(),
    }
}

fn shown_item_if(condition: &ShownItemIf) -> v1::StudyShownItemIf {
    v1::StudyShownItemIf {
        item: number(condition.item),
        answers: Some(answer_set_to_proto(&condition.answers)),
        not: condition.not,
    }
}

fn shown_game(game: &ShownGame, ticket_of: impl FnOnce(RoomId) -> String) -> v1::StudyShownGame {
    let (room_id, game_id, ticket) = match game.place {
        None => (String::new(), String::new(), String::new()),
        Some((room, game)) => {
            let (room, game) = (RoomId::from_bytes(room), GameId::from_bytes(game));
            (room.to_string(), game.to_string(), ticket_of(room))
        }
    };
    v1::StudyShownGame {
        practice: game.practice,
        game: game.game,
        games: game.games,
        hide: (game.hide.iter())
            .map(|part| part.to_proto().into())
            .collect(),
        room_id,
        game_id,
        ticket,
        ended: game.ended,
        labelled: game.labelled,
        waits_for: game.waits_for,
    }
}

/// Converts answers to messages.
pub fn answers_to_proto(answers: &[ItemAnswer]) -> Vec<v1::StudyItemAnswer> {
    use study_item_answer::Value;
    let answer = |answer: &ItemAnswer| v1::StudyItemAnswer {
        item: answer.item,
        value: answer.value.as_ref().map(|value| match value {
            Answer::Number(number) => Value::Number(*number),
            Answer::Options(chosen) => Value::Options(v1::StudyChosen {
                options: chosen.options.clone(),
            }),
            Answer::Text(text) => Value::Text(text.clone()),
        }),
        answered_after_ms: answer.answered_after_ms,
    };
    answers.iter().map(answer).collect()
}

/// The answers of a request; `Err` is the item of one without a value.
///
/// # Errors
/// An answer has no value.
pub fn answers_from_proto(answers: Vec<v1::StudyItemAnswer>) -> Result<Vec<ItemAnswer>, u32> {
    use study_item_answer::Value;
    let answer = |message: v1::StudyItemAnswer| {
        let value = match message.value {
            None => return Err(message.item),
            Some(Value::Number(number)) => Answer::Number(number),
            Some(Value::Options(chosen)) => Answer::options(chosen.options),
            Some(Value::Text(text)) => Answer::Text(text),
        };
        Ok(ItemAnswer {
            item: message.item,
            value: Some(value),
            answered_after_ms: message.answered_after_ms,
        })
    };
    answers.into_iter().map(answer).collect()
}
