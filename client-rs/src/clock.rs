//! The clocks of a server in terms of this machine's: [`ServerClock`].

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::client::Client;
use crate::error::Error;
use crate::repeat::repeated;
use crate::v1::{self, server_service_client::ServerServiceClient};

/// Readings of which [`Client::clock`] keeps the one with the shortest round trip.
const READINGS: u32 = 8;

/// What the clocks of a server showed at an instant of this machine. Clocks drift apart, so read them
/// again from time to time, and after a [`v1::ServerRestarted`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ServerClock {
    local: Instant,
    time_of_day: Duration,
    room: Option<Duration>,
    offset_us: i64,
    round_trip: Duration,
}

impl ServerClock {
    /// How far the server's time of day is ahead of this machine's, in microseconds.
    pub fn offset_us(&self) -> i64 {
        self.offset_us
    }

    /// Time that the request and its response took on the way. What this clock says is wrong by at
    /// most half of it.
    pub fn round_trip(&self) -> Duration {
        self.round_trip
    }

    /// The server's time of day at an instant of this machine, since the Unix epoch.
    pub fn time_of_day_at(&self, instant: Instant) -> Duration {
        self.shifted(self.time_of_day, instant)
    }

    /// The time since the room was created, at an instant of this machine; `None` for a clock
    /// without a room. `elapsed_ms` of events and records counts it in milliseconds.
    pub fn room_at(&self, instant: Instant) -> Option<Duration> {
        Some(self.shifted(self.room?, instant))
    }

    /// The instant of this machine at which something happened in the room, `elapsed_ms` after its
    /// creation; `None` for a clock without a room, or if it happened before this machine started.
    pub fn instant_of(&self, elapsed_ms: u64) -> Option<Instant> {
        let (room, elapsed) = (self.room?, Duration::from_millis(elapsed_ms));
        match elapsed.checked_sub(room) {
            Some(later) => self.local.checked_add(later),
            None => self.local.checked_sub(room - elapsed),
        }
    }

    /// The time of a clock that showed `time` at the reading.
    fn shifted(&self, time: Duration, instant: Instant) -> Duration {
        match instant.checked_duration_since(self.local) {
            Some(later) => time + later,
            None => time.saturating_sub(self.local - instant),
        }
    }

    /// Relates a response to the times of its request and arrival.
    fn of(response: &v1::GetClockResponse, sent: Moment, arrived: Moment) -> Self {
        let middle = |from: u64, to: u64| Duration::from_micros(from + to.saturating_sub(from) / 2);
        let (received_at, sent_at) = (response.received_at_us, response.sent_at_us);
        let answering = Duration::from_micros(sent_at.saturating_sub(received_at));
        let away = arrived.instant.saturating_duration_since(sent.instant);
        let time_of_day = middle(received_at, sent_at);
        let own = sent.time_of_day + arrived.time_of_day.saturating_sub(sent.time_of_day) / 2;
        let micros = |time: Duration| i64::try_from(time.as_micros()).unwrap_or(i64::MAX);
        let room = response.room.as_ref();
        Self {
            local: sent.instant + away / 2,
            time_of_day,
            room: room.map(|room| middle(room.received_us, room.sent_us)),
            offset_us: micros(time_of_day) - micros(own),
            round_trip: away.saturating_sub(answering),
        }
    }
}

/// A moment by both clocks of this machine.
#[derive(Debug, Clone, Copy)]
struct Moment {
    instant: Instant,
    time_of_day: Duration,
}

/// The time of day of this machine.
fn time_of_day() -> Duration {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH);
    since_epoch.unwrap_or_default()
}

impl Client {
    /// Reads the server's time of day, several times, and keeps the best reading.
    ///
    /// # Errors
    /// A failed connection.
    pub async fn clock(&self) -> Result<ServerClock, Error> {
        self.read_clock(String::new()).await
    }

    /// The same with the clock of a room, which measures the times of its events and record.
    ///
    /// # Errors
    /// `ROOM_UNKNOWN`.
    pub async fn room_clock(&self, room_id: impl Into<String>) -> Result<ServerClock, Error> {
        self.read_clock(room_id.into()).await
    }

    async fn read_clock(&self, room_id: String) -> Result<ServerClock, Error> {
        let service = ServerServiceClient::new(self.channel());
        let mut best = self.read_clock_once(&service, &room_id).await?;
        for _ in 1..READINGS {
            let reading = self.read_clock_once(&service, &room_id).await?;
            if reading.round_trip < best.round_trip {
                best = reading;
            }
        }
        Ok(best)
    }

    async fn read_clock_once(
        &self,
        service: &ServerServiceClient<crate::Connection>,
        room_id: &str,
    ) -> Result<ServerClock, Error> {
        let request = v1::GetClockRequest {
            room_id: room_id.to_owned(),
        };
        repeated(|| async {
            // The instants enclose the times of day, so that the round trip bounds the errors of both.
            let sent = Moment {
                instant: Instant::now(),
                time_of_day: time_of_day(),
            };
            let response = service.clone().get_clock(request.clone()).await?;
            let time_of_day = time_of_day();
            let arrived = Moment {
                instant: Instant::now(),
                time_of_day,
            };
            Ok(response.map(|response| ServerClock::of(&response, sent, arrived)))
        })
        .await
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_times_give_the_offset_and_the_round_trip() {
        // Ten milliseconds there, one to answer, twenty back; ten seconds ahead.
        let ms = Duration::from_millis;
        let sent = Moment {
            instant: Instant::now(),
            time_of_day: Duration::from_secs(1_000),
        };
        let arrived = Moment {
            instant: sent.instant + ms(31),
            time_of_day: sent.time_of_day + ms(31),
        };
        let response = v1::GetClockResponse {
            received_at_us: 1_010_010_000,
            sent_at_us: 1_010_011_000,
            room: Some(v1::RoomClock {
                received_us: 5_000_000,
                sent_us: 5_001_000,
                ..v1::RoomClock::default()
            }),
        };
        let clock = ServerClock::of(&response, sent, arrived);
        assert_eq!(clock.round_trip(), ms(30));
        // The way there was shorter: five milliseconds wrong, of at most fifteen.
        assert_eq!(clock.offset_us(), 9_995_000);
        let middle = sent.instant + Duration::from_micros(15_500);
        assert_eq!(
            clock.time_of_day_at(middle),
            Duration::from_micros(1_010_010_500)
        );
        assert_eq!(
            clock.room_at(middle - ms(1)),
            Some(Duration::from_micros(4_999_500))
        );
        assert_eq!(
            clock.room_at(middle + ms(1)),
            Some(Duration::from_micros(5_001_500))
        );
        let instant = clock.instant_of(5_002).expect("after the reading");
        assert_eq!(instant, middle + Duration::from_micros(1_500));
        let instant = clock.instant_of(4_000).expect("before the reading");
        assert_eq!(instant, middle - Duration::from_micros(1_000_500));
    }
}
