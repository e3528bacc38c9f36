//! Units as stored: which encoding they have, and what it contains.

use super::{FORM, Unreadable, check_form, study};
use crate::error::StoreError;
use crate::units::{StoredTraces, StoredUnit, UnitKey};
use chefshat_room::ids::StudyId;

impl StoredUnit {
    /// A new one.
    pub fn new(header: Vec<u8>, rows: Vec<Vec<u8>>) -> Self {
        Self {
            form: FORM,
            header,
            rows,
        }
    }

    /// The header and the entries of the journal.
    ///
    /// # Errors
    /// An encoding that this version does not read, or an invalid field or entry.
    pub(super) fn decode<H, E>(
        &self,
        header: impl FnOnce(&[u8]) -> Result<H, Unreadable>,
        entries: impl Fn(&[u8]) -> Result<Vec<E>, Unreadable>,
    ) -> Result<(H, Vec<E>), Unreadable> {
        check_form(self.form)?;
        let mut all = Vec::new();
        for row in &self.rows {
            all.extend(entries(row)?);
        }
        Ok((header(&self.header)?, all))
    }
}

impl StoredTraces {
    /// From columns of a table; one that cannot be read is logged and left out.
    pub(crate) fn read(study: StudyId, number: u32, game: &[u8], traces: &[u8]) -> Option<Self> {
        study::stored_traces(number, game, traces)
            .inspect_err(|problem| {
                tracing::error!(%study, %problem, "traces of a game are left out");
            })
            .ok()
    }
}

impl UnitKey {
    /// That the unit cannot be read.
    pub(crate) fn unreadable(self, problem: &Unreadable) -> StoreError {
        let (kind, id) = (self.kind(), self.id());
        StoreError::Unreadable(format!("{kind} {id} cannot be read: {problem}"))
    }
}
