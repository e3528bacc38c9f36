//! The stored values of a study: its header and the changes of its journal.

use chefshat_proto::v1;
use chefshat_study::Change;

use super::units::{StoredUnit, UnitKind, UnitWrite};
use super::{Store, StoreError, form};
use chefshat_room::ids::{Id, SecretHash};

/// The header of a study, which exists before it has participants.
#[derive(Debug, Clone)]
pub struct StudyHeader {
    /// The study. Its last four bytes are 0, so that links can leave them out.
    pub id: Id,
    /// The settings, every field set.
    pub settings: v1::StudySettings,
    /// When it was created, milliseconds since the Unix epoch.
    pub created_at_ms: u64,
    /// The hash of the owner token.
    pub owner: SecretHash,
    /// The key of its links, sessions and tickets.
    pub key: [u8; 32],
}

impl StudyHeader {
    /// Its encoding.
    pub fn to_bytes(&self) -> Vec<u8> {
        form::study_to_bytes(self)
    }
}

/// The encoding of changes.
pub fn changes_to_bytes(changes: &[Change]) -> Vec<u8> {
    form::study_changes_to_bytes(changes)
}

/// A study in the store.
#[derive(Debug, Clone)]
pub struct StoredStudy {
    /// Its header.
    pub header: StudyHeader,
    /// The changes of its journal, in order.
    pub changes: Vec<Change>,
    /// Number of rows of the journal.
    pub rows: u64,
}

impl StoredStudy {
    /// Reads a study; `None` if it is not in the store.
    ///
    /// # Errors
    /// The store failed, or the study cannot be read.
    pub async fn read(store: &dyn Store, id: Id) -> Result<Option<Self>, StoreError> {
        let unit = store.unit(UnitKind::Study.id(id)).await?;
        unit.map(|unit| Self::decode(id, &unit)).transpose()
    }

    /// Decodes a study.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn decode(id: Id, unit: &StoredUnit) -> Result<Self, StoreError> {
        let decoded = unit.decode(form::study_from_bytes, form::study_changes_from_bytes);
        let (header, changes) =
            decoded.map_err(|problem| UnitKind::Study.id(id).unreadable(&problem))?;
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
        id: Id,
        changes: &[Change],
        forgotten: Vec<u32>,
    ) -> Result<(), StoreError> {
        let rewrite = UnitWrite::Rewrite {
            entries: changes_to_bytes(changes),
            forgotten,
        };
        store.write_unit(UnitKind::Study.id(id), rewrite).await
    }
}
