//! A rate that several tasks keep together.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::time::{Instant, sleep_until};

/// A number of bytes per second, for tasks in the order in which they ask.
#[derive(Debug)]
pub(super) struct Pace {
    per_second: usize,
    /// When all that came before has passed.
    free_at: Mutex<Instant>,
}

impl Pace {
    /// A rate of bytes in a second.
    pub(super) fn new(per_second: usize) -> Self {
        Self {
            per_second,
            free_at: Mutex::new(Instant::now()),
        }
    }

    /// Waits until these bytes have passed. Who stops waiting gives their time back.
    pub(super) async fn pass(&self, bytes: usize) {
        let time = Duration::from_secs_f64(bytes as f64 / self.per_second as f64);
        let passed = {
            let mut free_at = self.free_at();
            *free_at = (*free_at).max(Instant::now()) + time;
            *free_at
        };
        let waiting = Waiting { pace: self, time };
        sleep_until(passed).await;
        std::mem::forget(waiting);
    }

    fn free_at(&self) -> MutexGuard<'_, Instant> {
        self.free_at.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Time that is given back when this is dropped.
struct Waiting<'a> {
    pace: &'a Pace,
    time: Duration,
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        *self.pace.free_at() -= self.time;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test(start_paused = true)]
    async fn what_comes_together_passes_one_after_the_other() {
        let pace = Pace::new(1000);
        let begun = Instant::now();
        tokio::join!(pace.pass(500), pace.pass(250), pace.pass(0));
        assert_eq!(begun.elapsed().as_millis(), 750);
        // What was not used is not saved up.
        tokio::time::sleep(Duration::from_secs(9)).await;
        let begun = Instant::now();
        pace.pass(2000).await;
        assert_eq!(begun.elapsed().as_millis(), 2000);
        // Nor does who goes away leave its time to be waited for.
        let begun = Instant::now();
        let gone = tokio::time::timeout(Duration::from_secs(1), pace.pass(60_000));
        assert!(gone.await.is_err());
        pace.pass(1000).await;
        assert_eq!(begun.elapsed().as_millis(), 2000);
    }
}
