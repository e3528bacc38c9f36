//! Threads for work that takes long, which give way to all others.

use std::panic::{AssertUnwindSafe, catch_unwind};

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use tokio::sync::oneshot;
use tracing::error;

/// A pool of threads. Work starts in the order in which it comes.
#[derive(Debug)]
pub(super) struct Threads(ThreadPool);

impl Threads {
    /// Starts this number of threads, named after `name`, which give way to others by `niceness`.
    ///
    /// # Errors
    /// The operating system cannot start the threads.
    pub(super) fn new(
        name: &'static str,
        number: usize,
        niceness: i32,
    ) -> Result<Self, ThreadPoolBuildError> {
        let pool = ThreadPoolBuilder::new()
            .num_threads(number)
            .thread_name(move |index| format!("{name}-{index}"))
            .start_handler(move |_| give_way(niceness))
            .build()?;
        Ok(Self(pool))
    }

    /// Runs work on a thread. `None` if it panicked.
    pub(super) async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Option<T> {
        let (sender, done) = oneshot::channel();
        self.0.spawn(move || {
            let result = catch_unwind(AssertUnwindSafe(work));
            if result.is_err() {
                error!("work in the background panicked");
            }
            // If nobody waits any more, the result is dropped here.
            let _ = sender.send(result.ok());
        });
        done.await.ok().flatten()
    }
}

/// Lets the calling thread give way to all others.
fn give_way(niceness: i32) {
    if let Err(error) = rustix::process::nice(niceness) {
        error!(%error, "a thread in the background does not give way to others");
    }
}
