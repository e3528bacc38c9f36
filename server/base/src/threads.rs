//! Threads for work that takes long, so that rooms stay responsive: a pool for each kind of work.

use std::panic::{AssertUnwindSafe, catch_unwind};

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use tokio::sync::oneshot;
use tracing::error;

/// How much the threads of a pool give way to those that rooms run on. No pool is their equal: what
/// it computes would delay decisions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Priority {
    /// Searches in rooms: participants and spectators wait for what they find. TLS handshakes.
    Searches,
    /// Analyses and batches of games: a client waits, but nobody else.
    Batches,
    /// Nobody waits.
    Background,
}

impl Priority {
    /// How much a thread gives way, in the units of `nice`: the last one is the most there is.
    #[cfg(target_os = "linux")]
    pub fn niceness(self) -> i32 {
        match self {
            Self::Searches => 5,
            Self::Batches => 10,
            Self::Background => 19,
        }
    }
}

/// A pool of threads. Work starts in the order in which it comes.
#[derive(Debug)]
pub struct Threads(ThreadPool);

impl Threads {
    /// Starts this number of threads (0: one for each core), named after `name`.
    ///
    /// # Errors
    /// The operating system cannot start the threads.
    pub fn new(
        name: &'static str,
        number: usize,
        priority: Priority,
    ) -> Result<Self, ThreadPoolBuildError> {
        let pool = ThreadPoolBuilder::new()
            .num_threads(number)
            .thread_name(move |index| format!("{name}-{index}"))
            .start_handler(move |_| give_way(priority))
            .build()?;
        Ok(Self(pool))
    }

    /// The number of threads.
    pub fn number(&self) -> usize {
        self.0.current_num_threads()
    }

    /// Runs work on a thread; `None` if it panicked. If nobody waits any more, the work completes
    /// and its result is dropped.
    pub async fn run<T: Send + 'static>(
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
pub fn caught<T>(work: impl FnOnce() -> T) -> Option<T> {
    // The state of the work is dropped, so it is never seen half done.
    let done = catch_unwind(AssertUnwindSafe(work));
    if done.is_err() {
        error!("work that takes long was given up: it panicked");
    }
    done.ok()
}

/// Lets the calling thread give way. On Linux the niceness is that of the thread; elsewhere it may be
/// that of the process, so it stays as it is.
fn give_way(priority: Priority) {
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::nice(priority.niceness()) {
        error!(%error, "a thread in the background does not give way to others");
    }
    #[cfg(not(target_os = "linux"))]
    let _ = priority;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_panic_ends_only_its_own_work() {
        let pool = Threads::new("test", 1, Priority::Batches).expect("a thread");
        assert_eq!(pool.run(|| -> u32 { panic!("on purpose") }).await, None);
        assert_eq!(pool.run(|| 7).await, Some(7));
    }

    #[tokio::test]
    #[cfg(target_os = "linux")]
    async fn the_threads_of_a_pool_give_way_and_others_do_not() {
        let niceness = || rustix::process::getpriority_process(None).expect("a number");
        let own = niceness();
        for priority in [Priority::Searches, Priority::Batches, Priority::Background] {
            let pool = Threads::new("test", 2, priority).expect("threads");
            let of_thread = pool.run(niceness).await.expect("a number");
            assert_eq!(of_thread, (own + priority.niceness()).min(19));
            assert!(of_thread > own, "{priority:?}");
            assert_eq!(niceness(), own);
        }
    }
}
