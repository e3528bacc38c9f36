//! Delays between connection attempts, and when to give up.

use std::time::Duration;

use rand::{Rng, RngExt as _};
use tokio::time::Instant;

/// Default delay before the first reconnection attempt.
pub const FIRST_DELAY: Duration = Duration::from_millis(100);
/// Default maximum delay between two attempts.
pub const MAX_DELAY: Duration = Duration::from_secs(5);
/// Default time without a connection after which the client gives up.
pub const GIVE_UP_AFTER: Duration = Duration::from_secs(600);

/// The delays between connection attempts: they double from `first` to `max`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Backoff {
    /// Delay before the first attempt.
    pub first: Duration,
    /// Maximum delay between two attempts. A connection that lasts this long ends the outage before
    /// it.
    pub max: Duration,
    /// Length of an outage after which the client gives up; zero disables reconnecting.
    pub give_up_after: Duration,
    /// Shortens each delay at random by up to a half, so that many clients do not reconnect at the
    /// same instant. Without it the delays are the same every time, as a simulation needs them.
    pub jitter: bool,
}

impl Default for Backoff {
    fn default() -> Self {
        Self {
            first: FIRST_DELAY,
            max: MAX_DELAY,
            give_up_after: GIVE_UP_AFTER,
            jitter: true,
        }
    }
}

impl Backoff {
    /// The wait before attempt number `attempt`, from 0.
    fn delay(&self, attempt: u32, rng: &mut impl Rng) -> Duration {
        let factor = 2u32.saturating_pow(attempt);
        let full = self.first.saturating_mul(factor).min(self.max);
        match self.jitter {
            true => full.mul_f64(rng.random_range(0.5..=1.0)),
            false => full,
        }
    }
}

/// The current outage, if any.
#[derive(Debug, Default)]
pub(crate) struct Outage {
    since: Option<Instant>,
    attempts: u32,
}

impl Outage {
    /// Ends the outage: the connection works.
    pub(crate) fn over(&mut self) {
        *self = Self::default();
    }

    /// Records a failure at `now`. Returns the delay before the next attempt, or the length of the
    /// outage if it is time to give up.
    pub(crate) fn failed(&mut self, backoff: &Backoff, now: Instant) -> Result<Duration, Duration> {
        let lasted = now.duration_since(*self.since.get_or_insert(now));
        let delay = backoff.delay(self.attempts, &mut rand::rng());
        self.attempts = self.attempts.saturating_add(1);
        if lasted + delay > backoff.give_up_after {
            return Err(lasted);
        }
        Ok(delay)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_double_up_to_the_longest() {
        let backoff = Backoff::default();
        let mut rng = rand::rng();
        let table = [
            (0, 100),
            (1, 200),
            (4, 1600),
            (5, 3200),
            (6, 5000),
            (40, 5000),
        ];
        for (attempt, full_ms) in table {
            for _ in 0..100 {
                let delay = backoff.delay(attempt, &mut rng);
                let full = Duration::from_millis(full_ms);
                assert!(
                    delay >= full / 2 && delay <= full,
                    "attempt {attempt}: {delay:?}"
                );
            }
        }
    }

    #[test]
    fn an_outage_ends_in_giving_up_and_begins_anew_after_a_connection() {
        let backoff = Backoff::default();
        let start = Instant::now();
        let mut now = start;
        let mut outage = Outage::default();
        let mut attempts = 0;
        let lasted = loop {
            match outage.failed(&backoff, now) {
                Ok(delay) => now += delay,
                Err(lasted) => break lasted,
            }
            attempts += 1;
        };
        assert_eq!(lasted, now - start);
        assert!(lasted <= backoff.give_up_after && lasted >= backoff.give_up_after - backoff.max);
        assert!(attempts > 10);

        outage.over();
        let delay = outage
            .failed(&backoff, now)
            .expect("a new outage has its whole time");
        assert!(delay <= backoff.first);
    }

    #[test]
    fn zero_time_never_tries_again() {
        let backoff = Backoff {
            give_up_after: Duration::ZERO,
            ..Backoff::default()
        };
        assert!(Outage::default().failed(&backoff, Instant::now()).is_err());
    }
}
