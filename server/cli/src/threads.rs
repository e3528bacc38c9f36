//! The threads that the offline commands play on. What they do there is in the modules of the commands.

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::CommandError;

/// Most threads; more than any machine has cores for.
const MAX_THREADS: usize = 256;

/// A pool of so many threads, 0 for one for each core, for so many pieces of work.
pub(super) fn pool(asked: usize, pieces: u64) -> Result<ThreadPool, CommandError> {
    let threads = threads_for(asked, pieces);
    Ok(ThreadPoolBuilder::new().num_threads(threads).build()?)
}

/// Threads to start; 0 leaves it to the number of cores. Threads without a piece of work would only be started and ended.
fn threads_for(asked: usize, pieces: u64) -> usize {
    let pieces = usize::try_from(pieces).unwrap_or(usize::MAX);
    asked.min(MAX_THREADS).min(pieces)
}

#[cfg(test)]
mod tests {
    use crate::threads::threads_for;

    #[test]
    fn threads_are_no_more_than_are_of_use() {
        assert_eq!(threads_for(0, 1000), 0, "the cores decide");
        assert_eq!(threads_for(3, 1000), 3);
        assert_eq!(threads_for(3, 2), 2);
        assert_eq!(threads_for(20_000, 1_000_000), 256);
    }
}
