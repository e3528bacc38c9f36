//! The thread pool of the offline commands.

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::CommandError;

/// Maximum number of threads.
const MAX_THREADS: usize = 256;

/// A pool of `asked` threads (0: one per core) for a number of tasks.
pub fn pool(asked: usize, pieces: u64) -> Result<ThreadPool, CommandError> {
    let threads = threads_for(asked, pieces);
    Ok(ThreadPoolBuilder::new().num_threads(threads).build()?)
}

/// Number of threads to start; 0 means one per core. More threads than tasks would be useless.
fn threads_for(asked: usize, pieces: u64) -> usize {
    let pieces = usize::try_from(pieces).unwrap_or(usize::MAX);
    asked.min(MAX_THREADS).min(pieces)
}

#[cfg(test)]
mod tests {
    use crate::threads::threads_for;

    #[test]
    fn no_more_threads_than_tasks() {
        assert_eq!(threads_for(0, 1000), 0, "the cores decide");
        assert_eq!(threads_for(3, 1000), 3);
        assert_eq!(threads_for(3, 2), 2);
        assert_eq!(threads_for(20_000, 1_000_000), 256);
    }
}
