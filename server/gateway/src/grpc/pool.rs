//! Long computations of calls, on pools of threads of their own.

use tonic::Status;

use super::status::internal;
use chefshat_base::threads::Threads;

/// Runs work on a pool's threads. If the call is cancelled, the work completes and its result is
/// dropped.
///
/// # Errors
/// The work panicked.
pub(super) async fn on_pool<T: Send + 'static>(
    pool: &Threads,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Status> {
    pool.run(work).await.ok_or_else(internal)
}

#[cfg(test)]
mod tests {
    use tonic::Code;

    use crate::grpc::pool::*;
    use chefshat_base::threads::Priority;

    #[tokio::test]
    async fn a_panic_ends_only_its_own_work() {
        let pool = Threads::new("test", 1, Priority::Batches).unwrap();
        let failed = on_pool(&pool, || -> u32 { panic!("on purpose") }).await;
        assert_eq!(failed.unwrap_err().code(), Code::Internal);
        assert_eq!(on_pool(&pool, || 7).await.unwrap(), 7);
    }
}
