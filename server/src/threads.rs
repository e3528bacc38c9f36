//! Threads for work that takes long, so that rooms stay responsive: a pool for each kind of work.

use std::panic::{AssertUnwindSafe, catch_unwind};

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use tokio::sync::oneshot;
use tracing::error;

/// A pool of threads. Work starts in the order in which it comes.
#[derive(Debug)]
pub(crate) struct Threads(ThreadPool);

impl Threads {
    /// Starts this number of threads (0: one for each core), named after `name`, which give way to
    /// others by `niceness`.
    ///
    /// # Errors
    /// The operating system cannot start the threads.
    pub(crate) fn new(
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

    /// Runs work on a thread; `None` if it panicked. If nobody waits any more, the work completes
    /// and its result is dropped.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Option<T> {
        let (sender, done) = oneshot::channel();
        self.0.spawn(move || {
            // It fails only if nobody waits any more.
            let _ = sender.send(caught(work));
        });
        done.await.ok().flatten()
    }
}

/// Runs work; `None` if it panics, which ends only this work because rooms share the process.
pub(crate) fn caught<T>(work: impl FnOnce() -> T) -> Option<T> {
    // The state of the work is dropped, so it is never seen half done.
    let done = catch_unwind(AssertUnwindSafe(work));
    if done.is_err() {
        error!("work that takes long was given up: it panicked");
    }
    done.ok()
}

/// Lets the calling thread give way to all others.
fn give_way(niceness: i32) {
    if niceness > 0
        && let Err(error) = rustix::process::nice(niceness)
    {
        error!(%error, "a thread in the background does not give way to others");
    }
}
