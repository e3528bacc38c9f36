//! Long computations, on pools of threads of their own so that rooms stay responsive.

use std::panic::AssertUnwindSafe;
use std::sync::Arc;

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use tokio::sync::oneshot;
use tonic::Status;

use super::status::internal;

/// Starts a pool with this number of threads (0: one for each core), named after `name`.
///
/// # Errors
/// The operating system cannot start the threads.
pub(super) fn pool(
    name: &'static str,
    threads: usize,
) -> Result<Arc<ThreadPool>, ThreadPoolBuildError> {
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(move |index| format!("{name}-{index}"))
        .build()?;
    Ok(Arc::new(pool))
}

/// Runs work; `None` if it panics, which ends only this work because rooms share the process.
pub(super) fn caught<T>(work: impl FnOnce() -> T) -> Option<T> {
    // The state of the work is dropped, so it is never seen half done.
    let done = std::panic::catch_unwind(AssertUnwindSafe(work));
    if done.is_err() {
        tracing::error!("the work for a client was given up: it panicked");
    }
    done.ok()
}

/// Runs work on a pool's threads. If the call is cancelled, the work completes and its result is
/// dropped.
///
/// # Errors
/// The work panicked.
pub(super) async fn on_pool<T: Send + 'static>(
    pool: &ThreadPool,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Status> {
    let (done, result) = oneshot::channel();
    pool.spawn(move || {
        if let Some(value) = caught(work) {
            // It fails only if the client has gone.
            let _ = done.send(value);
        }
    });
    result.await.map_err(|_| internal())
}

#[cfg(test)]
mod tests {
    use tonic::Code;

    use crate::grpc::pool::*;

    #[tokio::test]
    async fn a_panic_ends_only_its_own_work() {
        let pool = pool("test", 1).unwrap();
        let failed = on_pool(&pool, || -> u32 { panic!("on purpose") }).await;
        assert_eq!(failed.unwrap_err().code(), Code::Internal);
        assert_eq!(on_pool(&pool, || 7).await.unwrap(), 7);
    }
}
