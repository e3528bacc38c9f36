//! The clocks of a server: the age of a room, which is the time since it was created, restarts of the
//! server included, and the time that the process has run, by which rooms measure their age.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use tokio::time::{Instant, sleep};
use tracing::warn;

/// How often a watched process looks at its clock.
const BEAT: Duration = Duration::from_millis(100);
/// Shortest time without a look at the clock that counts as a pause of the process.
const SHORTEST_PAUSE: Duration = Duration::from_secs(1);
/// Most time that is left out for one pause.
const LONGEST_PAUSE: Duration = Duration::from_mins(10);
/// Number of pauses that are known one by one. An instant before them is taken for one after those
/// that are forgotten, so it counts as earlier than it was.
const PAUSES_KEPT: usize = 64;
/// When a process that nobody watches was last seen to run.
const UNWATCHED: u64 = u64::MAX;

/// The time that the process has run. It stands still while the process is paused (stopped by a
/// signal or a debugger, or kept from running by a busy machine), so that the pause costs no
/// participant its time. The clock of the system does the same while the machine is suspended.
///
/// Only a process that is watched notices pauses: nobody looked at its clock for a second, although
/// the watcher does so ten times a second. The first look after a pause leaves it out, for all.
#[derive(Debug)]
pub struct ProcessClock {
    origin: Instant,
    /// When the process was last seen to run, nanoseconds since the origin.
    seen: AtomicU64,
    /// End of the latest time left out, nanoseconds since the origin. Written before `left_out` and
    /// read after it: with an older sum, instants count as earlier than this and are looked up.
    left_out_until: AtomicU64,
    /// Sum of the times left out, nanoseconds.
    left_out: AtomicU64,
    pauses: Mutex<Pauses>,
}

/// What is known of pauses.
#[derive(Debug, Default)]
struct Pauses {
    /// The latest ones, oldest first.
    latest: VecDeque<Pause>,
    count: u64,
}

/// Time that is left out; all times in nanoseconds.
#[derive(Debug, Clone, Copy)]
struct Pause {
    start: u64,
    length: u64,
    /// What was left out before it.
    before: u64,
}

impl Default for ProcessClock {
    fn default() -> Self {
        Self {
            origin: Instant::now(),
            seen: AtomicU64::new(UNWATCHED),
            left_out_until: AtomicU64::new(0),
            left_out: AtomicU64::new(0),
            pauses: Mutex::default(),
        }
    }
}

impl ProcessClock {
    /// Notices pauses of the process until it is dropped.
    pub async fn watch(self: Arc<Self>) {
        struct Watched(Arc<ProcessClock>);
        impl Drop for Watched {
            fn drop(&mut self) {
                self.0.seen.store(UNWATCHED, Ordering::Release);
            }
        }
        self.seen
            .store(self.nanos(Instant::now()), Ordering::Release);
        let watched = Watched(self);
        loop {
            sleep(BEAT).await;
            watched.0.look(watched.0.nanos(Instant::now()));
        }
    }

    /// The time that the process had run at an instant, which must have passed.
    pub fn at(&self, instant: Instant) -> Duration {
        let nanos = self.nanos(instant);
        self.look(nanos);
        Duration::from_nanos(self.without_pauses(nanos))
    }

    /// The instant at which the process will have run for this time, if it is not paused before.
    fn instant(&self, time: Duration) -> Instant {
        self.origin + time + self.left_out()
    }

    /// Number of pauses so far.
    pub fn pause_count(&self) -> u64 {
        self.pauses().count
    }

    /// The time that was left out for all pauses.
    pub fn left_out(&self) -> Duration {
        Duration::from_nanos(self.left_out.load(Ordering::Acquire))
    }

    /// Notes that the process ran at this time, and leaves out a pause that has just ended.
    fn look(&self, nanos: u64) {
        let since = nanos.saturating_sub(self.seen.load(Ordering::Acquire));
        if since >= in_nanos(SHORTEST_PAUSE) {
            self.leave_out(nanos);
        } else if since >= in_nanos(BEAT) {
            // The watcher is late. Otherwise nothing is written, because every decision looks.
            self.seen.fetch_max(nanos, Ordering::AcqRel);
        }
    }

    /// Leaves out a pause that ended at this time, unless another thread has noticed it.
    fn leave_out(&self, nanos: u64) {
        let mut pauses = self.pauses();
        let seen = self.seen.load(Ordering::Acquire);
        let gap = nanos.saturating_sub(seen);
        if gap < in_nanos(SHORTEST_PAUSE) {
            return;
        }
        // Until its next beat the process may have run.
        let start = seen + in_nanos(BEAT);
        let length = (nanos - start).min(in_nanos(LONGEST_PAUSE));
        let before = self.left_out.load(Ordering::Acquire);
        let pause = Pause {
            start,
            length,
            before,
        };
        pauses.latest.push_back(pause);
        if pauses.latest.len() > PAUSES_KEPT {
            pauses.latest.pop_front();
        }
        pauses.count += 1;
        self.left_out_until.store(start + length, Ordering::Release);
        self.left_out.store(before + length, Ordering::Release);
        // Last: a thread that sees this sees the pause.
        self.seen.fetch_max(nanos, Ordering::AcqRel);
        drop(pauses);
        warn!(
            paused_ms = gap / 1_000_000,
            left_out_ms = length / 1_000_000,
            "the process did not run; no participant is charged for this time"
        );
    }

    fn without_pauses(&self, nanos: u64) -> u64 {
        let left_out = self.left_out.load(Ordering::Acquire);
        if nanos >= self.left_out_until.load(Ordering::Acquire) {
            return nanos.saturating_sub(left_out);
        }
        let pauses = self.pauses();
        let mut newest_first = pauses.latest.iter().rev();
        let left_out = match newest_first.find(|pause| pause.start <= nanos) {
            Some(pause) => pause.before + (nanos - pause.start).min(pause.length),
            None => pauses.latest.front().map_or(0, |first| first.before),
        };
        nanos.saturating_sub(left_out)
    }

    /// Nanoseconds since the origin, which are enough for centuries.
    fn nanos(&self, instant: Instant) -> u64 {
        in_nanos(instant.saturating_duration_since(self.origin))
    }

    fn pauses(&self) -> MutexGuard<'_, Pauses> {
        (self.pauses.lock()).expect("nothing panics under this lock")
    }
}

fn in_nanos(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

/// Converts between instants and the age of a room, which does not grow while the process is paused.
#[derive(Debug, Clone)]
pub struct RoomClock {
    process: Arc<ProcessClock>,
    /// The time that the process had run when the clock was started.
    epoch: Duration,
    /// The age of the room at `epoch`.
    age: Duration,
}

impl RoomClock {
    /// Starts the clock of a room that has this age now.
    pub fn of_age(age: Duration, process: &Arc<ProcessClock>) -> Self {
        Self {
            epoch: process.at(Instant::now()),
            process: Arc::clone(process),
            age,
        }
    }

    /// The age now.
    pub fn now(&self) -> Duration {
        self.at(Instant::now())
    }

    /// The age at an instant that has passed, or at the start of the clock if the instant is earlier.
    pub fn at(&self, instant: Instant) -> Duration {
        self.age + self.process.at(instant).saturating_sub(self.epoch)
    }

    /// The clock of its process.
    #[cfg(any(test, feature = "testing"))]
    pub fn process(&self) -> &Arc<ProcessClock> {
        &self.process
    }

    /// The instant of an age, or the start of the clock if the age was reached earlier. A pause of the
    /// process before that instant moves it.
    pub fn instant(&self, time: Duration) -> Instant {
        self.process
            .instant(self.epoch + time.saturating_sub(self.age))
    }
}

/// Tells the time of day, milliseconds since the Unix epoch: [`since_epoch_ms`], except in tests.
pub type TimeOfDay = fn() -> u64;

/// The time of day, milliseconds since the Unix epoch.
pub fn since_epoch_ms() -> u64 {
    millis(since_epoch())
}

/// Whole milliseconds.
pub fn millis(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}

/// The time of day since the Unix epoch; zero if the system clock is set before it.
pub fn since_epoch() -> Duration {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    /// A clock that was last looked at when it was created.
    fn watched() -> ProcessClock {
        let clock = ProcessClock::default();
        clock.seen.store(0, Ordering::Release);
        clock
    }

    #[test]
    fn a_pause_is_left_out_once_by_the_first_who_looks() {
        let clock = watched();
        let resumed = clock.origin + 6 * SECOND;
        // The watcher and rooms look at the same time.
        let looks: Vec<Duration> = std::thread::scope(|scope| {
            let look = |number| clock.at(resumed + number * Duration::from_micros(1));
            let looks: Vec<_> = (0..8).map(|it| scope.spawn(move || look(it))).collect();
            let looks = looks.into_iter().map(|it| it.join().expect("no panic"));
            looks.collect()
        });
        assert_eq!(clock.pause_count(), 1);
        let left_out = clock.left_out();
        assert!(left_out >= 6 * SECOND - BEAT, "{left_out:?}");
        for (look, number) in looks.iter().zip(0..) {
            let run = (resumed - clock.origin + number * Duration::from_micros(1)) - left_out;
            // One that looked at an instant before the end of the pause is within it.
            assert!(*look == run || *look == BEAT, "{look:?}, not {run:?}");
        }
    }

    #[test]
    fn only_a_watched_process_that_did_not_run_for_a_second_was_paused() {
        let (clock, unwatched) = (watched(), ProcessClock::default());
        let mut at = Duration::ZERO;
        for gap in [999, 500, 100, 999] {
            at += Duration::from_millis(gap);
            assert_eq!(clock.at(clock.origin + at), at);
        }
        assert_eq!(unwatched.at(unwatched.origin + 60 * SECOND), 60 * SECOND);
        assert_eq!((clock.pause_count(), unwatched.pause_count()), (0, 0));
        clock.at(clock.origin + at + SECOND);
        assert_eq!(clock.pause_count(), 1);
        assert_eq!(clock.left_out(), SECOND - BEAT);
    }

    #[test]
    fn at_most_ten_minutes_of_a_pause_are_left_out() {
        let clock = watched();
        let resumed = Duration::from_hours(2);
        assert_eq!(clock.at(clock.origin + resumed), resumed - LONGEST_PAUSE);
    }

    #[test]
    fn instants_before_during_and_after_pauses_keep_their_order() {
        let clock = watched();
        let pauses = 3 * u32::try_from(PAUSES_KEPT).expect("few");
        // Each minute ends with a pause of ten seconds.
        for minute in 0..pauses {
            for second in 0..=50 {
                let ran = Duration::from_secs(second) + minute * 60 * SECOND;
                let expected = clock.at(clock.origin + ran);
                assert_eq!(clock.instant(expected), clock.origin + ran, "{ran:?}");
                // Beats between.
                clock.at(clock.origin + ran + SECOND / 2);
            }
        }
        assert_eq!(clock.pause_count(), u64::from(pauses - 1));
        let mut last = Duration::ZERO;
        for second in 0..pauses * 60 - 10 {
            let at = clock.at(clock.origin + second * SECOND);
            assert!(at >= last && at - last <= SECOND + SECOND / 2, "{second}");
            last = at;
        }
    }
}
