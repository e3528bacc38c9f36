//! Shares an expensive computation among concurrent callers. It runs to completion even if all
//! callers are cancelled. Users decide what is computed and how long it stays valid.

use std::sync::Arc;

use chefshat_tournament::State;
use tokio::sync::Mutex;

use chefshat_base::tasks::short;
use chefshat_store::StoreError;

/// Why a computation failed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ComputeError(String);

impl From<tokio::task::JoinError> for ComputeError {
    fn from(error: tokio::task::JoinError) -> Self {
        Self(error.to_string())
    }
}

impl From<StoreError> for ComputeError {
    fn from(error: StoreError) -> Self {
        Self(error.to_string())
    }
}

/// A message about a tournament, and the state it shows.
#[derive(Debug)]
pub struct AsOf<M> {
    pub(super) mark: Mark,
    /// The message.
    pub message: M,
}

/// The state of a tournament as far as it can be read at once. The number of the last change
/// follows a moment after the change; a client that knows that a tournament has started or is over
/// must not see an earlier state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Mark {
    pub(super) change: u64,
    pub(super) state: State,
    pub(super) participants: usize,
    pub(super) games: usize,
    pub(super) over: usize,
    pub(super) by_hand: u32,
}

/// The last computed value.
#[derive(Debug)]
pub(super) struct Shared<T>(Arc<Mutex<Option<Arc<T>>>>);

impl<T> Default for Shared<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T: Send + Sync + 'static> Shared<T> {
    /// Drops the last value.
    pub(super) async fn clear(&self) {
        *self.0.lock().await = None;
    }

    /// Returns the last value if it is still `valid`, else computes it with `work`. Concurrent
    /// callers wait for that value and use it if it is valid for them.
    pub(super) async fn get(
        &self,
        is_current: impl FnOnce(&T) -> bool,
        work: impl Future<Output = Result<T, ComputeError>> + Send + 'static,
    ) -> Result<Arc<T>, ComputeError> {
        let mut known = Arc::clone(&self.0).lock_owned().await;
        if let Some(value) = known.as_ref().filter(|value| is_current(value)) {
            return Ok(Arc::clone(value));
        }
        let working = tokio::spawn(short("one computation", async move {
            let value = Arc::new(work.await?);
            *known = Some(Arc::clone(&value));
            Ok(value)
        }));
        working.await?
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use tokio::sync::Notify;

    use crate::tournaments::shared::*;

    #[tokio::test]
    async fn concurrent_callers_share_one_computation() {
        let shared = Shared::default();
        let times = Arc::new(AtomicU32::new(0));
        let ask = || {
            let times = Arc::clone(&times);
            shared.get(|_: &u32| true, async move {
                Ok(times.fetch_add(1, Ordering::Relaxed))
            })
        };
        let answers = futures::future::join_all((0..8).map(|_| ask())).await;
        assert!(answers.iter().all(|answer| answer == &Ok(Arc::new(0))));
        let recomputed = shared.get(|value| *value == 9, async { Ok(9) }).await;
        assert_eq!(recomputed, Ok(Arc::new(9)));
        assert_eq!(ask().await, Ok(Arc::new(9)));
    }

    #[tokio::test]
    async fn a_cancelled_caller_does_not_discard_the_value() {
        let shared = Arc::new(Shared::default());
        let (started, proceed) = (Arc::new(Notify::new()), Arc::new(Notify::new()));
        let asking = tokio::spawn({
            let (shared, started, proceed) = (shared.clone(), started.clone(), proceed.clone());
            async move {
                let work = async move {
                    started.notify_one();
                    proceed.notified().await;
                    Ok(1)
                };
                shared.get(|_| true, work).await
            }
        });
        started.notified().await;
        asking.abort();
        assert!(asking.await.is_err());
        proceed.notify_one();
        assert_eq!(shared.get(|_| true, async { Ok(2) }).await, Ok(Arc::new(1)));
    }

    #[tokio::test]
    async fn a_failed_computation_is_tried_again() {
        let shared = Shared::default();
        let failed = async { Err(ComputeError("no disk".into())) };
        assert!(shared.get(|_| true, failed).await.is_err());
        assert_eq!(shared.get(|_| true, async { Ok(2) }).await, Ok(Arc::new(2)));
    }
}
