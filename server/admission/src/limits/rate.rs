//! How much of something each caller may do in a time: a bucket for each, which fills steadily and
//! may be overdrawn, because the cost of a call is known only afterwards.

use std::collections::HashMap;
use std::time::Duration;

use tokio::time::Instant;

use super::Key;
use chefshat_base::lock::Lock;

/// Fewest buckets of which full ones, which say nothing, are removed.
const MANY: usize = 4_096;

/// The buckets of all callers.
#[derive(Debug)]
pub struct Rate {
    per_second: u64,
    burst: u64,
    buckets: Lock<Buckets>,
}

#[derive(Debug)]
struct Buckets {
    by_key: HashMap<Key, Bucket>,
    /// Number of buckets at which full ones are removed: twice as many as were left the last time.
    many: usize,
}

#[derive(Debug, Clone, Copy)]
struct Bucket {
    /// When it will be full; a full bucket lies in the past.
    full_at: Instant,
}

impl Rate {
    /// Creates full buckets that hold `burst` and fill with `per_second`.
    pub fn new(per_second: u64, burst: u64) -> Self {
        Self {
            per_second: per_second.max(1),
            burst,
            buckets: Lock::new(Buckets {
                by_key: HashMap::new(),
                many: MANY,
            }),
        }
    }

    /// What a bucket is filled with in a second.
    pub fn per_second(&self) -> u64 {
        self.per_second
    }

    /// Whether a caller's bucket is full: it has taken nothing for a while.
    pub fn is_full(&self, key: Key) -> bool {
        let now = Instant::now();
        (self.buckets.lock().by_key.get(&key)).is_none_or(|bucket| bucket.full_at <= now)
    }

    /// How long to wait until a caller's bucket is not empty.
    pub fn wait(&self, key: Key) -> Duration {
        let now = Instant::now();
        let Some(bucket) = self.buckets.lock().by_key.get(&key).copied() else {
            return Duration::ZERO;
        };
        (bucket.full_at.saturating_duration_since(now)).saturating_sub(self.time(self.burst))
    }

    /// Takes `cost` from a caller's bucket, even if it is empty then.
    pub fn charge(&self, key: Key, cost: u64) {
        // Most messages of a stream, and most short answers, cost nothing.
        if cost == 0 {
            return;
        }
        let now = Instant::now();
        let mut buckets = self.buckets.lock();
        if buckets.by_key.len() >= buckets.many {
            buckets.by_key.retain(|_, bucket| bucket.full_at > now);
            buckets.many = MANY.max(2 * buckets.by_key.len());
        }
        let bucket = buckets.by_key.entry(key).or_insert(Bucket { full_at: now });
        bucket.full_at = bucket.full_at.max(now) + self.time(cost);
    }

    /// The time in which a bucket fills by `cost`.
    fn time(&self, cost: u64) -> Duration {
        Duration::from_nanos(cost.saturating_mul(1_000_000_000) / self.per_second)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_bucket_can_be_overdrawn_and_then_makes_its_caller_wait() {
        let rate = Rate::new(10, 100);
        let (busy, other) = (Key::Local, Key::Resumed);
        rate.charge(busy, 100);
        assert_eq!(rate.wait(busy), Duration::ZERO, "the burst is free");
        rate.charge(busy, 50);
        assert_eq!(rate.wait(busy), Duration::from_secs(5));
        assert_eq!(rate.wait(other), Duration::ZERO);
        tokio::time::advance(Duration::from_secs(15)).await;
        assert_eq!(rate.wait(busy), Duration::ZERO);
        rate.charge(busy, 100);
        assert_eq!(rate.wait(busy), Duration::ZERO, "it has filled again");
    }
}
