//! Encodes and decodes large data, such as a complete journal or an imported record, on blocking
//! threads, a few at a time.

use std::sync::Arc;

use tokio::sync::Semaphore;

use crate::StoreError;

/// Most records that are assembled or replayed at a time, for each purpose.
pub const MAX_CONCURRENT_RECORDS: usize = 2;

/// Most lines or entries that are processed in place: moving them to another thread would take
/// longer.
const FEW_PIECES: usize = 64;

/// Runs work on blocking threads, at most [`MAX_CONCURRENT_RECORDS`] pieces at a time.
#[derive(Clone)]
pub(super) struct DecodePool(Arc<Semaphore>);

impl DecodePool {
    pub(super) fn new() -> Self {
        Self(Arc::new(Semaphore::new(MAX_CONCURRENT_RECORDS)))
    }

    /// Runs `work`, which encodes or decodes `pieces` lines or entries. A few run in place. The
    /// work holds its permit even if the caller is cancelled.
    pub(super) async fn run<T: Send + 'static>(
        &self,
        pieces: usize,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, StoreError> {
        if pieces <= FEW_PIECES {
            return Ok(work());
        }
        let permit = Arc::clone(&self.0).acquire_owned().await;
        let permit = permit.expect("the semaphore is never closed");
        let working = tokio::task::spawn_blocking(move || {
            let _permit = permit;
            work()
        });
        working
            .await
            .map_err(|error| StoreError::Failed(format!("encoding or decoding failed: {error}")))
    }
}
