//! The stored values of a study: its header and the changes of its journal.

use chefshat_proto::v1;
use chefshat_study::Change;

pub use super::form::changes_to_bytes;
use chefshat_room::ids::{SecretHash, StudyId};

/// The header of a study, which exists before it has participants.
#[derive(Debug, Clone)]
pub struct StudyHeader {
    /// The study. Its last four bytes are 0, so that links can leave them out.
    pub id: StudyId,
    /// The settings, every field set.
    pub settings: v1::StudySettings,
    /// When it was created, milliseconds since the Unix epoch.
    pub created_at_ms: u64,
    /// The hash of the owner token.
    pub owner: SecretHash,
    /// The key of its links, sessions and tickets.
    pub key: [u8; 32],
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
