//! The time that a search has computed, without the time for which the system let other threads run:
//! a budget in time buys about as many rollouts on a busy machine as on an idle one.

use std::time::{Duration, Instant};

use rayon::ThreadPool;

/// The scheduler's counters of the calling thread on Linux; the first is its processor time in
/// nanoseconds.
const COUNTERS: &str = "/proc/thread-self/schedstat";

/// Measures the processor time of the thread that starts it, and is read by the same thread. Where
/// the system does not tell it, that is the time that passes.
#[derive(Clone, Copy, Debug)]
pub struct OwnTime {
    start: Instant,
    own: Option<Duration>,
}

impl OwnTime {
    /// Starts to measure.
    pub fn start() -> OwnTime {
        OwnTime {
            start: Instant::now(),
            own: processor_time(),
        }
    }

    /// Starts to measure a search on these threads: with a pool, where others than the caller's
    /// compute, the time that passes.
    pub fn of_search(pool: Option<&ThreadPool>) -> OwnTime {
        let own = OwnTime::start();
        OwnTime {
            own: own.own.filter(|_| pool.is_none()),
            ..own
        }
    }

    /// The processor time since the start, known to a few milliseconds.
    pub fn used(&self) -> Duration {
        let passed = self.start.elapsed();
        match (self.own, processor_time()) {
            (Some(before), Some(now)) => now.saturating_sub(before).min(passed),
            _ => passed,
        }
    }
}

/// The processor time of the calling thread, if the system tells it.
fn processor_time() -> Option<Duration> {
    let counters = std::fs::read_to_string(COUNTERS).ok()?;
    let nanoseconds = counters.split_ascii_whitespace().next()?.parse().ok()?;
    // A system that does not count leaves it at 0.
    (nanoseconds > 0).then(|| Duration::from_nanos(nanoseconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_waits_uses_less_time_than_passes() {
        let Some(before) = processor_time() else {
            return; // This system does not tell it.
        };
        let measured = OwnTime::start();
        // However slow the machine is, a thread that sleeps does not compute.
        std::thread::sleep(Duration::from_millis(300));
        assert!(measured.used() < Duration::from_millis(300));
        assert!(processor_time().is_some_and(|now| now >= before));
    }

    #[test]
    fn a_search_on_a_pool_uses_the_time_that_passes() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
        let pool = pool.expect("threads start");
        let on_pool = OwnTime::of_search(Some(&pool));
        std::thread::sleep(Duration::from_millis(300));
        assert!(on_pool.used() >= Duration::from_millis(300));
    }
}
