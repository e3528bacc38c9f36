//! Headers, journals and interface traces of studies.

use chefshat_proto::v1;
use chefshat_study::{Added, Answers, Change};
use prost::Message;

use super::{Unreadable, array, read_messages};
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
        oneof = "Change",
        tags = "1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15"
    )]
    kind: Option<Change>,
}

/// Whether these bytes are a change of a kind that this version knows.
#[cfg(test)]
pub(super) fn is_known(bytes: &[u8]) -> bool {
    ChangeForm::decode(bytes).is_ok_and(|change| change.kind.is_some())
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
        let kind = Some(change.clone());
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
fn study_changes_from_bytes(bytes: &[u8]) -> Result<Vec<Change>, Unreadable> {
    read_messages(bytes, |form: ChangeForm| {
        let change = (form.kind).ok_or_else(|| Unreadable::new("a change is empty"))?;
        check(&change)?;
        Ok(change)
    })
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

/// Checks what the form of a change leaves open.
fn check(change: &Change) -> Result<(), Unreadable> {
    let is_sha256 = |bytes: &[u8], what| array::<32>(bytes, what).map(drop);
    let have_values = |answers: &Answers| match answers.iter().all(|it| it.value.is_some()) {
        true => Ok(()),
        false => Err(Unreadable::new("an answer is empty")),
    };
    match change {
        Change::Added(Added {
            joined: Some(joined),
            ..
        }) => is_sha256(&joined.request_sha256, "the hash of a request id"),
        Change::Consented(it) => is_sha256(&it.text_sha256, "the hash of a consent"),
        Change::Answered(it) => have_values(&it.answers),
        Change::Saved(it) => have_values(&it.answers),
        Change::Placed(it) => match it.game() {
            Ok(_) => Ok(()),
            Err(_) => Err(Unreadable::new(
                "the id of a room or game does not have 16 bytes",
            )),
        },
        Change::Added(_)
        | Change::Opened(_)
        | Change::GameEnded(_)
        | Change::Continued(_)
        | Change::DroppedOut(_)
        | Change::Withdrew(_)
        | Change::Removed(_)
        | Change::Closed(_)
        | Change::ScreenedOut(_)
        | Change::Grouped(_)
        | Change::LeftOver(_) => Ok(()),
    }
}
