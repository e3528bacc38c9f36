//! A rate that several tasks keep together.

use std::time::Duration;

use chefshat_base::lock::Lock;
use tokio::time::{Instant, sleep_until};

/// A number of bytes per second, for tasks in the order in which they ask.
#[derive(Debug)]
pub(super) struct Pace {
    per_second: usize,
    /// When all that came before has passed.
    free_at: Lock<Instant>,
}

impl Pace {
    /// A rate of bytes in a second.
    pub(super) fn new(per_second: usize) -> Self {
        Self {
            per_second,
            free_at: Lock::new(Instant::now()),
        }
    }

    /// Waits until these bytes have passed. If the future is dropped, what remains of their time is
    /// free for others.
    pub(super) async fn pass(&self, bytes: usize) {
        let time = Duration::from_secs_f64(bytes as f64 / self.per_second as f64);
        let passed = {
            let mut free_at = self.free_at.lock();
            *free_at = (*free_at).max(Instant::now()) + time;
            *free_at
        };
        let waiting = Waiting {
            pace: self,
            time,
            passed,
        };
        sleep_until(passed).await;
        std::mem::forget(waiting);
    }
}

/// Bytes that have not passed yet.
struct Waiting<'a> {
    pace: &'a Pace,
    /// How long they take.
    time: Duration,
    /// When they have passed.
    passed: Instant,
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        let left = self.passed.saturating_duration_since(Instant::now());
        *self.pace.free_at.lock() -= left.min(self.time);
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
        // But what has passed of its bytes until then has passed.
        let begun = Instant::now();
        let first = tokio::time::timeout(Duration::from_secs(1), pace.pass(2000));
        let (first, (), third) = tokio::join!(first, pace.pass(2000), async {
            tokio::time::sleep(Duration::from_millis(1500)).await;
            pace.pass(1000).await;
            begun.elapsed()
        });
        assert!(first.is_err());
        assert_eq!(third.as_millis(), 4000);
    }
}
