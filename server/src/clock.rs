//! The time of a room: the time since it was created, restarts of the server included.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use tokio::time::Instant;

/// Turns instants into times since the room was created, and back.
#[derive(Debug, Clone, Copy)]
pub struct RoomClock {
    epoch: Instant,
    /// How old the room was at `epoch`.
    age: Duration,
}

impl RoomClock {
    /// The clock of a room that is so old now.
    pub fn of_age(age: Duration) -> Self {
        Self {
            epoch: Instant::now(),
            age,
        }
    }

    /// The time now.
    pub fn now(&self) -> Duration {
        self.at(Instant::now())
    }

    /// The time at an instant; for one before the clock was started, the time when it was.
    pub fn at(&self, instant: Instant) -> Duration {
        self.age + instant.saturating_duration_since(self.epoch)
    }

    /// The instant of a time; for one before the clock was started, the instant when it was.
    pub fn instant(&self, time: Duration) -> Instant {
        self.epoch + time.saturating_sub(self.age)
    }
}

/// The time of day, milliseconds since the Unix epoch.
pub fn since_epoch_ms() -> u64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |time| {
            u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
        })
}
