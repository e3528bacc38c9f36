//! Leases. The database remembers when a node last beat, on its own clock; the node remembers when it sent that beat, on its
//! own clock. As a beat cannot arrive before it is sent, a node that counts from sending, and for a shorter time, stops before
//! the database takes anything away from it, however slow the network is. Only the rates of the two clocks must agree.

/// The times of all leases of a cluster, in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct LeaseTimes {
    beat_every_ms: u64,
    serve_for_ms: u64,
    expire_after_ms: u64,
}

/// Times with which no cluster works.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a node must beat more often than it stops serving, and stop before its lease expires")]
pub struct WrongTimes;

impl LeaseTimes {
    /// A beat every 2 s; served for 6 s after sending one; expired 8 s after one.
    pub const DEFAULT: Self = Self {
        beat_every_ms: 2_000,
        serve_for_ms: 6_000,
        expire_after_ms: 8_000,
    };

    /// # Errors
    /// If `0 < beat_every_ms < serve_for_ms < expire_after_ms` does not hold.
    pub fn new(
        beat_every_ms: u64,
        serve_for_ms: u64,
        expire_after_ms: u64,
    ) -> Result<Self, WrongTimes> {
        let ordered = 0 < beat_every_ms && beat_every_ms < serve_for_ms;
        match ordered && serve_for_ms < expire_after_ms {
            true => Ok(Self {
                beat_every_ms,
                serve_for_ms,
                expire_after_ms,
            }),
            false => Err(WrongTimes),
        }
    }

    /// From one beat to the next.
    pub fn beat_every_ms(self) -> u64 {
        self.beat_every_ms
    }

    /// How long a node serves after sending a beat.
    pub(crate) fn serve_for_ms(self) -> u64 {
        self.serve_for_ms
    }

    /// From a beat to the end of the lease.
    pub fn expire_after_ms(self) -> u64 {
        self.expire_after_ms
    }

    /// From the end of the time for which a node serves after a beat to the end of its lease.
    pub(crate) fn margin_ms(self) -> u64 {
        self.expire_after_ms - self.serve_for_ms
    }

    /// Whether a lease has expired, on the clock of the database.
    pub fn expired(self, beat_ms: u64, now_ms: u64) -> bool {
        now_ms.saturating_sub(beat_ms) >= self.expire_after_ms
    }
}

/// The lease of this node, on its own clock, which must not go back.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Lease {
    times: LeaseTimes,
    serves_until_ms: u64,
}

impl Lease {
    /// No lease yet.
    pub fn new(times: LeaseTimes) -> Self {
        Self {
            times,
            serves_until_ms: 0,
        }
    }

    /// A beat sent at this time was committed. Answers may arrive in any order.
    pub fn beaten(&mut self, sent_ms: u64) {
        self.serves_until_ms = self.serves_until_ms.max(sent_ms + self.times.serve_for_ms);
    }

    /// Whether the node may serve.
    pub fn holds(&self, now_ms: u64) -> bool {
        now_ms < self.serves_until_ms
    }

    /// When it ends if no further beat is committed.
    pub fn ends_ms(&self) -> u64 {
        self.serves_until_ms
    }

    /// The times of all leases.
    pub fn times(&self) -> LeaseTimes {
        self.times
    }
}
