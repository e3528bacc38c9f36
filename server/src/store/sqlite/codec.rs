//! Encoding and decoding of what can be large, such as a complete journal or an imported record: on threads that serve nobody, a few at
//! a time.

use std::sync::Arc;

use tokio::sync::Semaphore;

use crate::config::MAX_RECORDS_IN_HAND;
use crate::store::StoreError;

/// Lines or entries that are encoded or decoded where they are: handing them to another thread would take longer.
const FEW_PIECES: usize = 64;

/// Runs work on blocking threads, at most [`MAX_RECORDS_IN_HAND`] pieces at a time.
#[derive(Clone)]
pub(super) struct Codec(Arc<Semaphore>);

impl Codec {
    pub(super) fn new() -> Self {
        Self(Arc::new(Semaphore::new(MAX_RECORDS_IN_HAND)))
    }

    /// Runs `work`, which encodes or decodes `pieces` lines or entries. A few are done where they are. The work holds its permit even if the
    /// caller is cancelled.
    pub(super) async fn run<T: Send + 'static>(
        &self,
        pieces: usize,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, StoreError> {
        if pieces <= FEW_PIECES {
            return Ok(work());
        }
        let permit = Arc::clone(&self.0).acquire_owned().await;
        let permit = permit.expect("nothing closes the semaphore");
        let working = tokio::task::spawn_blocking(move || {
            let _permit = permit;
            work()
        });
        working
            .await
            .map_err(|error| StoreError::Failed(format!("encoding or decoding failed: {error}")))
    }
}
