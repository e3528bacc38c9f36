//! What takes a while to work out and many ask for: it is worked out once for all who ask, and to its end even if they all go away. What it
//! is, and how long it serves, is the affair of those who use this.

use std::sync::Arc;

use tokio::sync::Mutex;

use crate::store::StoreError;

/// Why something could not be worked out.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct NotWorkedOut(String);

impl From<tokio::task::JoinError> for NotWorkedOut {
    fn from(error: tokio::task::JoinError) -> Self {
        Self(error.to_string())
    }
}

impl From<StoreError> for NotWorkedOut {
    fn from(error: StoreError) -> Self {
        Self(error.to_string())
    }
}

/// What was worked out last.
#[derive(Debug)]
pub(super) struct Shared<T>(Arc<Mutex<Option<Arc<T>>>>);

impl<T> Default for Shared<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T: Send + Sync + 'static> Shared<T> {
    /// What was worked out last if that still `serves`, else what `work` makes anew. Whoever asks meanwhile waits, and is served by it if that
    /// will do.
    pub(super) async fn get(
        &self,
        serves: impl FnOnce(&T) -> bool,
        work: impl Future<Output = Result<T, NotWorkedOut>> + Send + 'static,
    ) -> Result<Arc<T>, NotWorkedOut> {
        let mut known = Arc::clone(&self.0).lock_owned().await;
        if let Some(value) = known.as_ref().filter(|value| serves(value)) {
            return Ok(Arc::clone(value));
        }
        let working = tokio::spawn(async move {
            let value = Arc::new(work.await?);
            *known = Some(Arc::clone(&value));
            Ok(value)
        });
        working.await?
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use tokio::sync::Notify;

    use crate::tournaments::shared::*;

    #[tokio::test]
    async fn it_is_worked_out_once_for_all_who_ask() {
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
        let anew = shared.get(|value| *value == 9, async { Ok(9) }).await;
        assert_eq!(anew, Ok(Arc::new(9)));
        assert_eq!(ask().await, Ok(Arc::new(9)));
    }

    #[tokio::test]
    async fn who_goes_away_does_not_throw_it_away() {
        let shared = Arc::new(Shared::default());
        let (begun, go_on) = (Arc::new(Notify::new()), Arc::new(Notify::new()));
        let asking = tokio::spawn({
            let (shared, begun, go_on) = (shared.clone(), begun.clone(), go_on.clone());
            async move {
                let work = async move {
                    begun.notify_one();
                    go_on.notified().await;
                    Ok(1)
                };
                shared.get(|_| true, work).await
            }
        });
        begun.notified().await;
        asking.abort();
        assert!(asking.await.is_err());
        go_on.notify_one();
        assert_eq!(shared.get(|_| true, async { Ok(2) }).await, Ok(Arc::new(1)));
    }

    #[tokio::test]
    async fn what_fails_is_tried_again() {
        let shared = Shared::default();
        let failed = async { Err(NotWorkedOut("no disk".into())) };
        assert!(shared.get(|_| true, failed).await.is_err());
        assert_eq!(shared.get(|_| true, async { Ok(2) }).await, Ok(Arc::new(2)));
    }
}
