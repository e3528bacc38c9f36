//! What the calls of one caller may take: how many calls, how many answers that it has not read,
//! how many streams, and how many wrong join codes.

use std::sync::Arc;
use std::time::Duration;

use super::fair_semaphore::{MAX_WAIT, within};
use super::{Decoding, FairSemaphore, Key, Permit, Rate, Refused, Shares};
use chefshat_base::lock::Lock;

/// Most streams of all callers, except those that have limits of their own.
pub const MAX_STREAMS: usize = 20_000;
/// Most answers of all callers that have not been read.
pub const MAX_ANSWERS: usize = 1_024;
/// Most calls of all callers that are executed at a time.
pub const MAX_EXECUTED: usize = 64;
/// Most bytes of streams of other nodes that are kept for spectators who share them, of all callers.
pub const MAX_HISTORY: usize = 64 * 1024 * 1024;
/// Bytes that such a stream takes at a time.
pub const HISTORY_STEP: usize = 16 * 1024;
/// Most lists of rooms and of studies that are made at a time: each asks many rooms.
pub const MAX_LISTS: usize = 4;
/// Most calls of all callers that wait for something.
pub const MAX_WAITING: usize = 16_384;
/// Calls of one caller in a second; an answer counts as one more call for each 512 bytes.
pub const CALLS_PER_SECOND: u64 = 2_000;
/// Calls of one caller at once.
pub const CALLS_AT_ONCE: u64 = 20_000;
/// Bytes of an answer that cost as much as one call.
pub const BYTES_PER_CALL: u64 = 512;
/// Bytes of a decoded message that cost as much as one call.
pub const DECODED_BYTES_PER_CALL: u64 = 4 * 1024;
/// A message of a stream, after its first, costs nothing if it takes no more bytes than this once it
/// is decoded: the answers of a player, the actions of a batch. A larger one waits until its caller
/// may make another call.
pub const MAX_FREE_DECODED: usize = 512 * 1024;
/// Calls that creating a room counts as: it is written to the disk, with its game and record.
pub const COST_OF_ROOM: u64 = 20;
/// The same if the server plays all seats.
pub const COST_OF_BUILT_IN_GAME: u64 = 100;
/// Calls that creating a tournament counts as: its games cost far more than the request.
pub const COST_OF_TOURNAMENT: u64 = 100;
/// How long a refusal takes: a caller that ignores it and calls again waits each time.
const REFUSAL_DELAY: Duration = Duration::from_secs(1);
/// Wrong join codes of one caller in a second.
pub const WRONG_CODES_PER_SECOND: u64 = 1;
/// Wrong join codes of one caller at once.
pub const WRONG_CODES_AT_ONCE: u64 = 100;
/// Wrong join codes of all callers in a second. Beyond them, callers that have just sent wrong codes
/// are refused.
pub const ALL_WRONG_CODES_PER_SECOND: u64 = 50;
/// Those at once.
pub const ALL_WRONG_CODES_AT_ONCE: u64 = 5_000;

/// What the calls of all callers take.
#[derive(Debug)]
pub struct CallLimits {
    streams: Arc<FairSemaphore>,
    answers: Arc<FairSemaphore>,
    executed: Arc<FairSemaphore>,
    lists: Arc<FairSemaphore>,
    histories: Arc<FairSemaphore>,
    waiting: Arc<FairSemaphore>,
    decoding: Decoding,
    playing: Decoding,
    calls: Rate,
    wrong_codes: Rate,
    all_wrong_codes: Rate,
}

/// A call that may be executed. Keeps its places until it is dropped.
#[derive(Debug)]
pub struct Admitted {
    /// `None` for a stream: it may wait for a long time before it begins.
    executing: Option<Executing>,
    _kept: Permit,
}

impl Admitted {
    /// The place of a call that is being executed.
    pub fn executing(&self) -> Option<&Executing> {
        self.executing.as_ref()
    }

    /// The answer is ready: others may be executed.
    pub fn executed(&self) {
        if let Some(executing) = &self.executing {
            executing.give_back();
        }
    }
}

impl Drop for Admitted {
    fn drop(&mut self) {
        self.executed();
    }
}

/// The place of a call among those that are executed. The call finds it in the extensions of its
/// request.
#[derive(Debug, Clone)]
pub struct Executing(Arc<Lock<Option<Permit>>>);

impl Executing {
    fn new(place: Permit) -> Self {
        Self(Arc::new(Lock::new(Some(place))))
    }

    /// Lets others be executed, because this call only waits from now on.
    pub fn give_back(&self) {
        let place = self.0.lock().take();
        drop(place);
    }
}

impl CallLimits {
    /// No calls yet.
    pub fn new(shares: Shares) -> Self {
        Self {
            streams: FairSemaphore::new(MAX_STREAMS, shares),
            answers: FairSemaphore::new(MAX_ANSWERS, shares),
            executed: FairSemaphore::new(MAX_EXECUTED, shares),
            lists: FairSemaphore::new(MAX_LISTS, shares),
            histories: FairSemaphore::new(MAX_HISTORY / HISTORY_STEP, shares),
            waiting: FairSemaphore::new(MAX_WAITING, shares),
            decoding: Decoding::new(shares),
            playing: Decoding::new(shares),
            calls: Rate::new(CALLS_PER_SECOND, CALLS_AT_ONCE),
            wrong_codes: Rate::new(WRONG_CODES_PER_SECOND, WRONG_CODES_AT_ONCE),
            all_wrong_codes: Rate::new(ALL_WRONG_CODES_PER_SECOND, ALL_WRONG_CODES_AT_ONCE),
        }
    }

    /// The limits by their names in `GetServerInfo`.
    pub fn named(&self) -> [(&'static str, u64); 4] {
        [
            ("max_streams", self.streams.total() as u64),
            ("max_unread_answers", self.answers.total() as u64),
            ("max_calls_per_second", self.calls.per_second()),
            ("max_wrong_codes_per_second", self.wrong_codes.per_second()),
        ]
    }

    /// The memory for messages that are received and decoded.
    pub fn decoding(&self) -> &Decoding {
        &self.decoding
    }

    /// Memory for messages of players, separate from `decoding`, so that they never wait for studies,
    /// imports or vector streams.
    pub fn playing(&self) -> &Decoding {
        &self.playing
    }

    /// Admits a call that counts as `cost` calls, or a stream, at once, if its caller has made few.
    pub fn admit_now(&self, key: Key, is_stream: bool, cost: u64) -> Option<Admitted> {
        if !self.calls.wait(key).is_zero() {
            return None;
        }
        let kept = match is_stream {
            true => self.streams.try_take(key)?,
            false => self.answers.try_take(key)?,
        };
        let executing = match is_stream {
            true => None,
            false => Some(Executing::new(self.executed.try_take(key)?)),
        };
        self.calls.charge(key, cost);
        Some(Admitted {
            executing,
            _kept: kept,
        })
    }

    /// Admits a call that counts as `cost` calls, or a stream, as soon as its caller may make another
    /// one.
    ///
    /// # Errors
    /// That would take too long.
    pub async fn admit(&self, key: Key, is_stream: bool, cost: u64) -> Result<Admitted, Refused> {
        let wait = self.calls.wait(key);
        if wait > MAX_WAIT {
            return Err(Refused {
                reason: "TOO_MANY_CALLS",
                what: "too many calls in a second; large answers count as several",
                limit: self.calls.per_second(),
                retry_after: wait,
            });
        }
        self.calls.charge(key, cost);
        tokio::time::sleep(wait).await;
        let kept = match is_stream {
            true => self.streams.try_take(key).ok_or(Refused {
                reason: "TOO_MANY_STREAMS",
                what: "too many open streams; end some, or attach more seats to each",
                limit: self.streams.share_of(key) as u64,
                retry_after: REFUSAL_DELAY,
            })?,
            false => within(self.answers.take(key)).await.ok_or(Refused {
                reason: "TOO_MANY_UNREAD_ANSWERS",
                what: "too many calls whose answers have not been read; read them, or make fewer calls at a time",
                limit: self.answers.share_of(key) as u64,
                retry_after: MAX_WAIT,
            })?,
        };
        if is_stream {
            return Ok(Admitted {
                executing: None,
                _kept: kept,
            });
        }
        let executed = within(self.executed.take(key)).await.ok_or(Refused {
            reason: "TOO_MANY_CALLS_AT_ONCE",
            what: "too many calls at a time",
            limit: self.executed.share_of(key) as u64,
            retry_after: MAX_WAIT,
        })?;
        Ok(Admitted {
            executing: Some(Executing::new(executed)),
            _kept: kept,
        })
    }

    /// Waits for the right to make a list of rooms or studies.
    pub async fn list(&self, key: Key) -> Permit {
        self.lists.take(key).await
    }

    /// Admits an answer that is ready, to a request that is no call, as soon as the caller may make
    /// another call and has read enough others; `None` if that takes too long.
    pub async fn admit_answer(&self, key: Key) -> Option<Admitted> {
        let wait = self.calls.wait(key);
        let at_once = wait.is_zero().then(|| self.answers.try_take(key)).flatten();
        let kept = match at_once {
            Some(kept) => {
                self.calls.charge(key, 1);
                kept
            }
            None => {
                let _waiting = self.place_to_wait(key)?;
                if wait > MAX_WAIT {
                    self.delay_refusal().await;
                    return None;
                }
                self.calls.charge(key, 1);
                tokio::time::sleep(wait).await;
                within(self.answers.take(key)).await?
            }
        };
        Some(Admitted {
            executing: None,
            _kept: kept,
        })
    }

    /// A place to wait in, for a call or for a refusal; `None` if its caller has too many calls
    /// that wait.
    pub fn place_to_wait(&self, key: Key) -> Option<Permit> {
        self.waiting.try_take(key)
    }

    /// Charges a call that is refused; returns how long the refusal waits.
    pub fn charge_refused(&self, key: Key) -> Duration {
        let wait = self.calls.wait(key).min(MAX_WAIT);
        self.calls.charge(key, 1);
        wait
    }

    /// Delays a refusal.
    pub async fn delay_refusal(&self) {
        tokio::time::sleep(REFUSAL_DELAY).await;
    }

    /// Charges what a call cost beyond its request.
    pub fn charge(&self, key: Key, cost: u64) {
        self.calls.charge(key, cost);
    }

    /// How long a caller that has been charged must wait for its next call.
    #[cfg(any(test, feature = "testing"))]
    pub fn wait(&self, key: Key) -> Duration {
        self.calls.wait(key)
    }

    /// Waits until a caller that has been charged may make its next call.
    pub async fn may_call(&self, key: Key) {
        loop {
            let wait = self.calls.wait(key);
            if wait.is_zero() {
                return;
            }
            tokio::time::sleep(wait).await;
        }
    }

    /// Takes the place of a stream that is already open for others; `None` if the caller has too many.
    pub fn share_stream(&self, key: Key) -> Option<Permit> {
        self.streams.try_take(key)
    }

    /// Takes memory for the next [`HISTORY_STEP`] bytes of a stream that spectators share; `None` if
    /// its caller has too much of it.
    pub fn keep_history(&self, key: Key) -> Option<Permit> {
        self.histories.try_take(key)
    }

    /// How many times a caller alone may have that memory.
    #[cfg(any(test, feature = "testing"))]
    pub fn share_of_histories(&self, key: Key) -> usize {
        self.histories.share_of(key)
    }

    /// Checks whether a caller may try a join code.
    ///
    /// # Errors
    /// It has tried too many wrong ones.
    pub fn may_try_code(&self, key: Key) -> Result<(), Refused> {
        let key = key.site();
        let own = self.wrong_codes.wait(key);
        let all = self.all_wrong_codes.wait(Key::Local);
        let wait = match self.wrong_codes.is_full(key) {
            true => own,
            false => own.max(all),
        };
        match wait.is_zero() {
            true => Ok(()),
            false => Err(Refused {
                reason: "TOO_MANY_WRONG_CODES",
                what: "too many wrong join codes; check the code",
                limit: self.wrong_codes.per_second(),
                retry_after: wait.max(REFUSAL_DELAY),
            }),
        }
    }

    /// Counts a wrong join code.
    pub fn wrong_code(&self, key: Key) {
        self.wrong_codes.charge(key.site(), 1);
        self.all_wrong_codes.charge(Key::Local, 1);
    }
}

#[cfg(test)]
mod tests {
    use futures::FutureExt as _;

    use super::*;

    fn key(last: u8) -> Key {
        Key::Address([192, 0, 2, last].into())
    }

    fn limits() -> CallLimits {
        CallLimits::new(Shares::default())
    }

    #[tokio::test(start_paused = true)]
    async fn a_caller_with_too_many_calls_waits_and_others_do_not() {
        let limits = limits();
        limits.charge(key(1), CALLS_AT_ONCE + CALLS_PER_SECOND);
        assert!(limits.admit_now(key(1), false, 1).is_none());
        assert!(limits.admit_now(key(2), false, 1).is_some());
        let begun = tokio::time::Instant::now();
        limits
            .admit(key(1), false, 1)
            .await
            .expect("after a second");
        assert_eq!(begun.elapsed().as_secs(), 1);
        limits.charge(key(1), 100 * CALLS_PER_SECOND);
        let refused = limits
            .admit(key(1), false, 1)
            .await
            .expect_err("it would take long");
        assert_eq!(refused.reason, "TOO_MANY_CALLS");
        assert!(refused.retry_after.as_secs() > 90);
        assert!(limits.admit(key(1), true, 1).await.is_err());
    }

    #[tokio::test(start_paused = true)]
    async fn a_flood_of_requests_that_are_no_calls_locks_nobody_out() {
        let limits = limits();
        let mut answered = 0;
        for _ in 0..2 * CALLS_AT_ONCE {
            let admitted = limits.admit_answer(key(1)).now_or_never();
            answered += u64::from(admitted.flatten().is_some());
        }
        assert_eq!(answered, CALLS_AT_ONCE + 1);
        let wait = limits.wait(key(1));
        assert!(wait <= MAX_WAIT + Duration::from_millis(1), "{wait:?}");
        assert!(limits.admit_answer(key(2)).now_or_never().is_some());
        tokio::time::sleep(Duration::from_millis(1)).await;
        limits.admit(key(1), false, 1).await.expect("after a while");
    }

    #[tokio::test(start_paused = true)]
    async fn unread_answers_hold_back_their_caller_alone() {
        let limits = limits();
        let unread: Vec<_> = std::iter::from_fn(|| {
            let admitted = limits.admit_now(key(1), false, 1)?;
            admitted.executed();
            Some(admitted)
        })
        .collect();
        assert_eq!(unread.len(), MAX_ANSWERS / 10);
        let refused = limits
            .admit(key(1), false, 1)
            .await
            .expect_err("none is read");
        assert_eq!(refused.reason, "TOO_MANY_UNREAD_ANSWERS");
        assert!(limits.admit_now(key(2), false, 1).is_some());
        drop(unread);
        assert!(limits.admit_now(key(1), false, 1).is_some());
    }

    #[tokio::test(start_paused = true)]
    async fn wrong_codes_are_limited_for_each_caller_and_in_all() {
        let limits = limits();
        for _ in 0..=WRONG_CODES_AT_ONCE {
            limits.may_try_code(key(1)).expect("few so far");
            limits.wrong_code(key(1));
        }
        assert!(limits.may_try_code(key(1)).is_err());
        limits.may_try_code(key(2)).expect("another caller");
        // Many callers together, each below its own limit.
        for last in 3..=255 {
            (0..ALL_WRONG_CODES_AT_ONCE / 250).for_each(|_| limits.wrong_code(key(last)));
        }
        assert!(limits.may_try_code(key(3)).is_err(), "it has just guessed");
        limits.may_try_code(key(2)).expect("it has not");
    }
}
