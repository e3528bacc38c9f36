//! Headers, journals and interface traces of studies.

use std::sync::Arc;

use chefshat_proto::v1;
use chefshat_study::{
    Answer, Change, ConsentGiven, Device, ItemAnswer, Joined, Outcome, PlacedGame, Pointer,
};
use prost::Message;

use super::{Unreadable, array};
use crate::Store;
use crate::error::StoreError;
use crate::studies::{StoredStudy, StudyHeader};
use crate::units::{StoredTraces, StoredUnit, UnitKey, UnitWrite};
use chefshat_room::ids::{Id, SecretHash, StudyId};

#[derive(Clone, PartialEq, Message)]
struct HeaderForm {
    #[prost(bytes = "vec", tag = "1")]
    id: Vec<u8>,
    #[prost(message, optional, tag = "2")]
    settings: Option<v1::StudySettings>,
    #[prost(uint64, tag = "3")]
    created_at_ms: u64,
    #[prost(bytes = "vec", tag = "4")]
    owner: Vec<u8>,
    #[prost(bytes = "vec", tag = "5")]
    key: Vec<u8>,
}

#[derive(Clone, PartialEq, Message)]
struct ChangeForm {
    #[prost(
        oneof = "KindForm",
        tags = "1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15"
    )]
    kind: Option<KindForm>,
}

/// Whether these bytes are a change of a kind that this version knows.
#[cfg(test)]
pub(super) fn is_known(bytes: &[u8]) -> bool {
    ChangeForm::decode(bytes).is_ok_and(|change| change.kind.is_some())
}

#[derive(Clone, PartialEq, prost::Oneof)]
enum KindForm {
    #[prost(message, tag = "1")]
    Added(AddedForm),
    #[prost(message, tag = "2")]
    Opened(OpenedForm),
    #[prost(message, tag = "3")]
    Consented(ConsentForm),
    #[prost(message, tag = "4")]
    Answered(AnsweredForm),
    #[prost(message, tag = "5")]
    Placed(PlacedForm),
    #[prost(message, tag = "6")]
    GameEnded(MarkForm),
    #[prost(message, tag = "7")]
    Continued(MarkForm),
    #[prost(message, tag = "8")]
    DroppedOut(MarkForm),
    #[prost(message, tag = "9")]
    Withdrew(MarkForm),
    #[prost(message, tag = "10")]
    Removed(MarkForm),
    #[prost(bool, tag = "11")]
    Closed(bool),
    #[prost(message, tag = "12")]
    Saved(AnsweredForm),
    #[prost(message, tag = "13")]
    ScreenedOut(MarkForm),
    #[prost(message, tag = "14")]
    Grouped(GroupedForm),
    #[prost(message, tag = "15")]
    LeftOver(MarkForm),
}

#[derive(Clone, PartialEq, Message)]
struct AddedForm {
    #[prost(uint32, tag = "1")]
    number: u32,
    #[prost(string, tag = "2")]
    pseudonym: String,
    #[prost(message, optional, tag = "3")]
    joined: Option<JoinedForm>,
    #[prost(bool, tag = "4")]
    test: bool,
    #[prost(uint32, optional, tag = "5")]
    planned: Option<u32>,
}

#[derive(Clone, PartialEq, Message)]
struct GroupedForm {
    #[prost(uint32, tag = "1")]
    number: u32,
    #[prost(uint32, tag = "2")]
    group: u32,
    #[prost(uint32, tag = "3")]
    slot: u32,
    #[prost(uint32, tag = "4")]
    passed_over: u32,
    #[prost(uint64, tag = "5")]
    at_ms: u64,
}

#[derive(Clone, PartialEq, Message)]
struct JoinedForm {
    #[prost(bytes = "vec", tag = "1")]
    request_sha256: Vec<u8>,
    #[prost(string, tag = "2")]
    panel_id: String,
}

#[derive(Clone, PartialEq, Message)]
struct OpenedForm {
    #[prost(uint32, tag = "1")]
    number: u32,
    #[prost(uint32, optional, tag = "2")]
    slot: Option<u32>,
    #[prost(uint64, tag = "3")]
    at_ms: u64,
    #[prost(message, optional, tag = "4")]
    device: Option<DeviceForm>,
}

#[derive(Clone, PartialEq, Message)]
struct DeviceForm {
    #[prost(uint32, tag = "1")]
    width: u32,
    #[prost(uint32, tag = "2")]
    height: u32,
    #[prost(uint32, tag = "3")]
    pixels: u32,
    /// A number of [`POINTERS`]; 0: not known.
    #[prost(uint32, tag = "4")]
    pointer: u32,
    #[prost(string, tag = "5")]
    time_zone: String,
}

/// The pointers of devices, by number.
const POINTERS: [(u32, Pointer); 3] =
    [(1, Pointer::None), (2, Pointer::Coarse), (3, Pointer::Fine)];

impl DeviceForm {
    fn of(device: &Device) -> Self {
        let pointer = POINTERS.iter().find(|(_, it)| Some(*it) == device.pointer);
        Self {
            width: device.width.into(),
            height: device.height.into(),
            pixels: device.pixels.into(),
            pointer: pointer.map_or(0, |(number, _)| *number),
            time_zone: device.time_zone.clone(),
        }
    }

    /// The device; `None` if it is not one.
    fn read(self) -> Option<Device> {
        let pointer = POINTERS.iter().find(|(number, _)| *number == self.pointer);
        Some(Device {
            width: self.width.try_into().ok()?,
            height: self.height.try_into().ok()?,
            pixels: self.pixels.try_into().ok()?,
            pointer: pointer.map(|(_, pointer)| *pointer),
            time_zone: self.time_zone,
        })
    }
}

#[derive(Clone, PartialEq, Message)]
struct ConsentForm {
    #[prost(uint32, tag = "1")]
    number: u32,
    #[prost(bytes = "vec", tag = "2")]
    text_sha256: Vec<u8>,
    #[prost(string, tag = "3")]
    version: String,
    #[prost(string, tag = "4")]
    language: String,
    #[prost(uint64, tag = "5")]
    at_ms: u64,
    #[prost(uint32, optional, tag = "6")]
    slot: Option<u32>,
}

#[derive(Clone, PartialEq, Message)]
struct AnsweredForm {
    #[prost(uint32, tag = "1")]
    number: u32,
    #[prost(message, repeated, tag = "2")]
    answers: Vec<AnswerForm>,
    #[prost(uint64, tag = "3")]
    at_ms: u64,
    #[prost(uint32, tag = "4")]
    passed_over: u32,
}

#[derive(Clone, PartialEq, Message)]
struct AnswerForm {
    #[prost(uint32, tag = "1")]
    item: u32,
    #[prost(oneof = "ValueForm", tags = "2, 3, 4")]
    value: Option<ValueForm>,
    #[prost(uint32, optional, tag = "5")]
    answered_after_ms: Option<u32>,
}

#[derive(Clone, PartialEq, prost::Oneof)]
enum ValueForm {
    #[prost(sint32, tag = "2")]
    Number(i32),
    #[prost(message, tag = "3")]
    Options(OptionsForm),
    #[prost(string, tag = "4")]
    Text(String),
}

#[derive(Clone, PartialEq, Message)]
struct OptionsForm {
    #[prost(uint32, repeated, tag = "1")]
    options: Vec<u32>,
}

#[derive(Clone, PartialEq, Message)]
struct PlacedForm {
    #[prost(uint32, tag = "1")]
    number: u32,
    #[prost(uint32, tag = "2")]
    step: u32,
    #[prost(uint32, tag = "3")]
    condition: u32,
    #[prost(bool, tag = "4")]
    practice: bool,
    #[prost(uint32, optional, tag = "5")]
    seed_index: Option<u32>,
    #[prost(uint32, tag = "6")]
    seat: u32,
    #[prost(uint32, tag = "7")]
    attempt: u32,
    #[prost(bytes = "vec", tag = "8")]
    room: Vec<u8>,
    #[prost(bytes = "vec", tag = "9")]
    game: Vec<u8>,
}

/// A participant, a time, and what is particular to the change: whether the game finished, whether
/// the step is over, or whether data are deleted.
#[derive(Clone, PartialEq, Message)]
struct MarkForm {
    #[prost(uint32, tag = "1")]
    number: u32,
    #[prost(uint64, tag = "2")]
    at_ms: u64,
    #[prost(bool, tag = "3")]
    flag: bool,
    /// Of a participant who continues: the number of steps that it passes over.
    #[prost(uint32, tag = "4")]
    passed_over: u32,
}

#[derive(Clone, PartialEq, Message)]
struct TracesForm {
    #[prost(message, repeated, tag = "1")]
    traces: Vec<v1::StudyTrace>,
    #[prost(uint32, tag = "2")]
    session: u32,
}

impl StudyHeader {
    /// Its encoding.
    pub fn to_bytes(&self) -> Vec<u8> {
        HeaderForm {
            id: self.id.bytes().to_vec(),
            settings: Some(self.settings.clone()),
            created_at_ms: self.created_at_ms,
            owner: self.owner.bytes().to_vec(),
            key: self.key.to_vec(),
        }
        .encode_to_vec()
    }
}

/// The encoding of changes.
pub fn changes_to_bytes(changes: &[Change]) -> Vec<u8> {
    let mut out = Vec::new();
    for change in changes {
        let kind = Some(kind_of(change));
        (ChangeForm { kind }.encode_length_delimited(&mut out)).expect("a vector grows as needed");
    }
    out
}

/// Encodes interface traces.
pub(crate) fn traces_to_bytes(stored: &StoredTraces) -> Vec<u8> {
    let form = TracesForm {
        traces: stored.traces.clone(),
        session: stored.session,
    };
    form.encode_to_vec()
}

/// Decodes interface traces of a game.
///
/// # Errors
/// An invalid field.
pub(crate) fn stored_traces(
    number: u32,
    game: &[u8],
    bytes: &[u8],
) -> Result<StoredTraces, Unreadable> {
    let form = TracesForm::decode(bytes)?;
    Ok(StoredTraces {
        number,
        game: Id::from_bytes(array(game, "the game's id")?),
        session: form.session,
        traces: form.traces,
    })
}

/// Decodes a header.
///
/// # Errors
/// An invalid field.
fn study_from_bytes(bytes: &[u8]) -> Result<StudyHeader, Unreadable> {
    let form = HeaderForm::decode(bytes)?;
    Ok(StudyHeader {
        id: Id::from_bytes(array(&form.id, "the study's id")?),
        settings: form.settings.unwrap_or_default(),
        created_at_ms: form.created_at_ms,
        owner: SecretHash::from_bytes(array(&form.owner, "the owner's hash")?),
        key: array(&form.key, "the study's key")?,
    })
}

/// Decodes changes.
///
/// # Errors
/// An invalid change.
fn study_changes_from_bytes(mut bytes: &[u8]) -> Result<Vec<Change>, Unreadable> {
    let mut changes = Vec::new();
    while !bytes.is_empty() {
        let form = ChangeForm::decode_length_delimited(&mut bytes)?;
        let kind = (form.kind).ok_or_else(|| Unreadable::new("a change is empty"))?;
        changes.push(change_of(kind)?);
    }
    Ok(changes)
}

impl StoredStudy {
    /// Reads a study; `None` if it is not in the store.
    ///
    /// # Errors
    /// The store failed, or the study cannot be read.
    pub async fn read(store: &dyn Store, id: StudyId) -> Result<Option<Self>, StoreError> {
        let unit = store.unit(UnitKey::Study(id)).await?;
        unit.map(|unit| Self::decode(id, &unit)).transpose()
    }

    /// Decodes a study.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn decode(id: StudyId, unit: &StoredUnit) -> Result<Self, StoreError> {
        let decoded = unit.decode(study_from_bytes, study_changes_from_bytes);
        let (header, changes) =
            decoded.map_err(|problem| UnitKey::Study(id).unreadable(&problem))?;
        Ok(Self {
            header,
            changes,
            rows: unit.rows.len() as u64,
        })
    }

    /// Replaces its journal by these changes, and deletes the interface traces of participants.
    ///
    /// # Errors
    /// The store failed.
    pub async fn rewrite(
        store: &dyn Store,
        id: StudyId,
        changes: &[Change],
        forgotten: Vec<u32>,
    ) -> Result<(), StoreError> {
        let rewrite = UnitWrite::Rewrite {
            entries: changes_to_bytes(changes),
            forgotten,
        };
        store.write_unit(UnitKey::Study(id), rewrite).await
    }
}

fn kind_of(change: &Change) -> KindForm {
    let mark = |number: &u32, at_ms: &u64, flag: bool| MarkForm {
        number: *number,
        at_ms: *at_ms,
        flag,
        passed_over: 0,
    };
    match change {
        Change::Added {
            number,
            pseudonym,
            joined,
            test,
            planned,
        } => KindForm::Added(AddedForm {
            number: *number,
            pseudonym: pseudonym.clone(),
            joined: joined.as_ref().map(|joined| JoinedForm {
                request_sha256: joined.request_sha256.to_vec(),
                panel_id: joined.panel_id.clone(),
            }),
            test: *test,
            planned: *planned,
        }),
        Change::Opened {
            number,
            slot,
            at_ms,
            device,
        } => KindForm::Opened(OpenedForm {
            number: *number,
            slot: *slot,
            at_ms: *at_ms,
            device: device.as_ref().map(DeviceForm::of),
        }),
        Change::Consented {
            number,
            slot,
            consent,
        } => KindForm::Consented(ConsentForm {
            slot: *slot,
            number: *number,
            text_sha256: consent.text_sha256.to_vec(),
            version: consent.version.clone(),
            language: consent.language.clone(),
            at_ms: consent.at_ms,
        }),
        Change::Answered {
            number,
            answers,
            passed_over,
            at_ms,
        } => KindForm::Answered(AnsweredForm {
            number: *number,
            answers: answers.iter().map(answer_to_form).collect(),
            at_ms: *at_ms,
            passed_over: *passed_over,
        }),
        Change::Saved { number, answers } => KindForm::Saved(AnsweredForm {
            number: *number,
            answers: answers.iter().map(answer_to_form).collect(),
            ..AnsweredForm::default()
        }),
        Change::Placed { number, game } => KindForm::Placed(PlacedForm {
            number: *number,
            step: small(game.step),
            condition: small(game.condition),
            practice: game.practice,
            seed_index: game.seed_index.map(small),
            seat: small(game.seat),
            attempt: game.attempt,
            room: game.room.to_vec(),
            game: game.game.to_vec(),
        }),
        Change::GameEnded {
            number,
            outcome,
            at_ms,
        } => KindForm::GameEnded(mark(number, at_ms, *outcome == Outcome::Finished)),
        Change::Continued {
            number,
            step_over,
            passed_over,
            at_ms,
        } => KindForm::Continued(MarkForm {
            passed_over: *passed_over,
            ..mark(number, at_ms, *step_over)
        }),
        Change::Grouped {
            number,
            group,
            slot,
            passed_over,
            at_ms,
        } => KindForm::Grouped(GroupedForm {
            number: *number,
            group: *group,
            slot: *slot,
            passed_over: *passed_over,
            at_ms: *at_ms,
        }),
        Change::LeftOver { number, at_ms } => KindForm::LeftOver(mark(number, at_ms, false)),
        Change::DroppedOut { number, at_ms } => KindForm::DroppedOut(mark(number, at_ms, false)),
        Change::ScreenedOut { number, at_ms } => KindForm::ScreenedOut(mark(number, at_ms, false)),
        Change::Withdrew {
            number,
            delete_data,
            at_ms,
        } => KindForm::Withdrew(mark(number, at_ms, *delete_data)),
        Change::Removed { number, at_ms } => KindForm::Removed(mark(number, at_ms, false)),
        Change::Closed => KindForm::Closed(true),
    }
}

fn change_of(kind: KindForm) -> Result<Change, Unreadable> {
    Ok(match kind {
        KindForm::Added(form) => Change::Added {
            number: form.number,
            pseudonym: form.pseudonym,
            joined: match form.joined {
                None => None,
                Some(joined) => Some(Joined {
                    request_sha256: array(&joined.request_sha256, "the hash of a request id")?,
                    panel_id: joined.panel_id,
                }),
            },
            test: form.test,
            planned: form.planned,
        },
        KindForm::Opened(form) => Change::Opened {
            number: form.number,
            slot: form.slot,
            at_ms: form.at_ms,
            device: form.device.and_then(DeviceForm::read),
        },
        KindForm::Consented(form) => Change::Consented {
            number: form.number,
            slot: form.slot,
            consent: ConsentGiven {
                text_sha256: array(&form.text_sha256, "the hash of a consent")?,
                version: form.version,
                language: form.language,
                at_ms: form.at_ms,
            },
        },
        KindForm::Answered(form) => Change::Answered {
            number: form.number,
            answers: answers_from_form(form.answers)?,
            passed_over: form.passed_over,
            at_ms: form.at_ms,
        },
        KindForm::Saved(form) => Change::Saved {
            number: form.number,
            answers: answers_from_form(form.answers)?,
        },
        KindForm::Placed(form) => Change::Placed {
            number: form.number,
            game: PlacedGame {
                step: wide(form.step),
                condition: wide(form.condition),
                practice: form.practice,
                seed_index: form.seed_index.map(wide),
                seat: wide(form.seat),
                attempt: form.attempt,
                room: array(&form.room, "a room's id")?,
                game: array(&form.game, "a game's id")?,
            },
        },
        KindForm::GameEnded(form) => Change::GameEnded {
            number: form.number,
            outcome: match form.flag {
                true => Outcome::Finished,
                false => Outcome::Aborted,
            },
            at_ms: form.at_ms,
        },
        KindForm::Continued(form) => Change::Continued {
            number: form.number,
            step_over: form.flag,
            passed_over: form.passed_over,
            at_ms: form.at_ms,
        },
        KindForm::Grouped(form) => Change::Grouped {
            number: form.number,
            group: form.group,
            slot: form.slot,
            passed_over: form.passed_over,
            at_ms: form.at_ms,
        },
        KindForm::LeftOver(MarkForm { number, at_ms, .. }) => Change::LeftOver { number, at_ms },
        KindForm::DroppedOut(MarkForm { number, at_ms, .. }) => {
            Change::DroppedOut { number, at_ms }
        }
        KindForm::ScreenedOut(MarkForm { number, at_ms, .. }) => {
            Change::ScreenedOut { number, at_ms }
        }
        KindForm::Removed(MarkForm { number, at_ms, .. }) => Change::Removed { number, at_ms },
        KindForm::Withdrew(form) => Change::Withdrew {
            number: form.number,
            delete_data: form.flag,
            at_ms: form.at_ms,
        },
        KindForm::Closed(_) => Change::Closed,
    })
}

fn answer_to_form(answer: &ItemAnswer) -> AnswerForm {
    AnswerForm {
        item: small(answer.item),
        value: Some(match &answer.value {
            Answer::Number(number) => ValueForm::Number(*number),
            Answer::Options(options) => ValueForm::Options(OptionsForm {
                options: options.iter().copied().map(small).collect(),
            }),
            Answer::Text(text) => ValueForm::Text(text.clone()),
        }),
        answered_after_ms: answer.answered_after_ms,
    }
}

fn answers_from_form(forms: Vec<AnswerForm>) -> Result<Arc<[ItemAnswer]>, Unreadable> {
    forms.into_iter().map(answer_from_form).collect()
}

fn answer_from_form(form: AnswerForm) -> Result<ItemAnswer, Unreadable> {
    let value = (form.value).ok_or_else(|| Unreadable::new("an answer is empty"))?;
    Ok(ItemAnswer {
        item: wide(form.item),
        value: match value {
            ValueForm::Number(number) => Answer::Number(number),
            ValueForm::Options(form) => {
                Answer::Options(form.options.into_iter().map(wide).collect())
            }
            ValueForm::Text(text) => Answer::Text(text),
        },
        answered_after_ms: form.answered_after_ms,
    })
}

fn small(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

fn wide(number: u32) -> usize {
    usize::try_from(number).unwrap_or(usize::MAX)
}
