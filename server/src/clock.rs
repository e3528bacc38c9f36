//! The age of a room: the time since it was created, restarts of the server included.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use tokio::time::Instant;

/// Converts between instants and the age of a room.
#[derive(Debug, Clone, Copy)]
pub struct RoomClock {
    epoch: Instant,
    /// The age of the room at `epoch`.
    age: Duration,
}

impl RoomClock {
    /// Starts the clock of a room that has this age now.
    pub fn of_age(age: Duration) -> Self {
        Self {
            epoch: Instant::now(),
            age,
        }
    }

    /// The age now.
    pub fn now(&self) -> Duration {
        self.at(Instant::now())
    }

    /// The age at an instant, or at the start of the clock if the instant is earlier.
    pub fn at(&self, instant: Instant) -> Duration {
        self.age + instant.saturating_duration_since(self.epoch)
    }

    /// The instant of an age, or the start of the clock if the age was reached earlier.
    pub fn instant(&self, time: Duration) -> Instant {
        self.epoch + time.saturating_sub(self.age)
    }
}

/// Tells the time of day, milliseconds since the Unix epoch: [`since_epoch_ms`], except in tests.
pub type TimeOfDay = fn() -> u64;

/// The time of day, milliseconds since the Unix epoch.
pub fn since_epoch_ms() -> u64 {
    u64::try_from(since_epoch().as_millis()).unwrap_or(u64::MAX)
}

/// The time of day since the Unix epoch; zero if the system clock is set before it.
pub fn since_epoch() -> Duration {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default()
}
