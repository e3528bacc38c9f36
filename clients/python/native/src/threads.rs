//! Thread pools, shared by all games of the process. A process that was forked has none of its
//! parent's threads, so it gets pools of its own.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

/// Pools by their number of threads, and the process that they belong to.
#[derive(Debug)]
struct Pools {
    process: u32,
    by_threads: BTreeMap<usize, Option<Arc<ThreadPool>>>,
}

static POOLS: Mutex<Pools> = Mutex::new(Pools {
    process: 0,
    by_threads: BTreeMap::new(),
});

/// The pool with this number of threads (0: that of the environment variable RAYON_NUM_THREADS, or
/// else one for each core); `None` if one thread is enough.
///
/// Call it while attached to the interpreter: then no other thread holds the lock when a process
/// is forked.
pub(crate) fn pool(threads: usize) -> Option<Arc<ThreadPool>> {
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if pools.process != process {
        // Dropping a pool would signal threads that do not exist here.
        std::mem::forget(std::mem::take(&mut pools.by_threads));
        pools.process = process;
    }
    if let Some(pool) = pools.by_threads.get(&threads) {
        return pool.clone();
    }
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|index| format!("chefshat-{index}"))
        .build();
    // If the system has no more threads, the caller's steps the games.
    let pool = pool.ok().filter(|pool| pool.current_num_threads() > 1);
    let pool = pool.map(Arc::new);
    pools.by_threads.insert(threads, pool.clone());
    pool
}
