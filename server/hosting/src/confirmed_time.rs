//! The time of day, as far as it is confirmed. A clock may jump ahead and back, and what is deleted
//! stays deleted: what is deleted at a time waits until every look at the clock for an hour has said
//! that the time has passed.

use std::collections::VecDeque;
use std::time::Duration;

use tokio::time::Instant;

/// For how long a time must have passed at every look.
pub(crate) const CONFIRMATION_TIME: Duration = Duration::from_secs(3_600);

/// What the clock has said for [`CONFIRMATION_TIME`].
#[derive(Debug, Default)]
pub(crate) struct ConfirmedTime(VecDeque<(Instant, u64)>);

impl ConfirmedTime {
    /// Notes what the clock says now, milliseconds since the Unix epoch. Returns the latest time that
    /// is confirmed; `None` before the first look is old enough.
    pub(crate) fn look(&mut self, now_ms: u64) -> Option<u64> {
        let looks = &mut self.0;
        looks.push_back((Instant::now(), now_ms));
        let is_old = |(at, _): &(Instant, u64)| at.elapsed() >= CONFIRMATION_TIME;
        // One that is old enough says what the clock said when the time began.
        while looks.get(1).is_some_and(is_old) {
            looks.pop_front();
        }
        let is_confirmed = looks.front().is_some_and(is_old);
        let earliest = looks.iter().map(|(_, said_ms)| *said_ms).min();
        earliest.filter(|_| is_confirmed)
    }
}
