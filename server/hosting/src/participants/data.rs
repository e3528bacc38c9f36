//! What a store and a data directory have about participants; `delete`, `export` and
//! `stored_studies` work on it.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use chefshat_record::signature::SigningKey;

use chefshat_store::{ForgetError, Store, StoreError};

/// Why a participant's data were not exported or deleted completely.
#[derive(Debug, thiserror::Error)]
pub enum DataError {
    /// The store refuses or failed.
    #[error(transparent)]
    Forget(#[from] ForgetError),
    /// The folder of records cannot be read or written.
    #[error("the folder of records failed: {0}; check it and try again")]
    Io(#[from] io::Error),
    /// The server is shutting down.
    #[error("the server is shutting down; try again when it is back")]
    ShuttingDown,
    /// No node has a study with the name at present; nothing was deleted in it.
    #[error(
        "a study with the name is just being taken over, or its server does not answer; try again"
    )]
    StudyUnreachable,
    /// Nobody receives the lines any more.
    #[error("the client has gone")]
    Gone,
}

impl From<StoreError> for DataError {
    fn from(error: StoreError) -> Self {
        Self::Forget(error.into())
    }
}

/// What is stored about participants.
pub struct ParticipantData {
    pub(super) store: Arc<dyn Store>,
    /// Where files of records are; `None` if there are none.
    pub(super) data_dir: Option<PathBuf>,
    /// Signs again the records that it had signed and that change.
    pub(super) key: Option<Arc<SigningKey>>,
}

impl ParticipantData {
    /// For this store, and the files of records in this data directory.
    pub fn new(store: Arc<dyn Store>, data_dir: Option<PathBuf>) -> Self {
        Self {
            store,
            data_dir,
            key: None,
        }
    }

    /// Signs records that change again with this key, if it had signed them.
    pub fn signing_with(self, key: Option<Arc<SigningKey>>) -> Self {
        Self { key, ..self }
    }
}

/// Runs work that reads files or decodes games on a thread of its own.
pub(super) async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, StoreError> {
    let working = tokio::task::spawn_blocking(work).await;
    working.map_err(|error| StoreError::Failed(format!("reading stored data failed: {error}")))
}
