//! How many lines of the log clients may cause by being refused, so that nobody fills the disk with
//! them.

use std::time::Duration;

use chefshat_base::lock::Lock;
use tokio::time::Instant;

/// The time for which lines are counted.
const INTERVAL: Duration = Duration::from_secs(60);

/// The lines of one kind.
#[derive(Debug)]
pub struct LogPace {
    most: u32,
    /// When the current interval began, and the lines since.
    written: Lock<Option<(Instant, u32)>>,
}

impl LogPace {
    /// Admits at most this many lines in a minute.
    pub fn new(most: u32) -> Self {
        Self {
            most,
            written: Lock::default(),
        }
    }

    /// Whether one more line may be written. Counts it.
    pub fn admits(&self) -> bool {
        let now = Instant::now();
        let mut written = self.written.lock();
        let (since, lines) = (*written)
            .filter(|(since, _)| now < *since + INTERVAL)
            .unwrap_or((now, 0));
        *written = Some((since, lines.saturating_add(1)));
        lines < self.most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test(start_paused = true)]
    async fn lines_beyond_those_of_a_minute_are_left_out() {
        let pace = LogPace::new(2);
        assert_eq!([(); 3].map(|()| pace.admits()), [true, true, false]);
        tokio::time::advance(INTERVAL).await;
        assert!(pace.admits());
    }
}
