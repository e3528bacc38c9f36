//! Memory for messages of clients: bytes that are received, and what they are decoded into. A
//! message takes a permit of the first kind before its bytes are read, and one of the second before
//! it is decoded. Nothing that has the second kind waits for the first, so neither waits forever.

use std::sync::Arc;
use std::time::Duration;

use super::fair_semaphore::{MAX_WAIT, within};
use super::{FairSemaphore, Key, Permit, Refused, Shares};

/// Most bytes of messages that are received at a time, beyond small ones.
pub const MAX_RECEIVED: usize = 32 * 1024 * 1024;
/// Most bytes of memory that decoded messages take at a time, beyond small ones.
pub const MAX_DECODED: usize = 96 * 1024 * 1024;
/// A message of at most this many bytes is received without a permit.
pub const SMALL_MESSAGE: usize = 4 * 1024;
/// What takes at most this many bytes is decoded without a permit.
pub const SMALL_DECODED: usize = 8 * 1024;
/// How long a client may take to send one message, and the end of a call that has only one.
pub const MESSAGE_TIMEOUT: Duration = Duration::from_secs(30);
/// Bytes of one place.
const PLACE: usize = 1024;
/// How often the bytes of a message are in memory while it is received: as they were read, and in
/// the decoder's buffer.
const COPIES: usize = 2;

/// The memory for messages of all callers.
#[derive(Debug)]
pub struct Decoding {
    received: Arc<FairSemaphore>,
    decoded: Arc<FairSemaphore>,
}

impl Decoding {
    pub(super) fn new(shares: Shares) -> Self {
        Self {
            received: FairSemaphore::new(MAX_RECEIVED / PLACE, shares),
            decoded: FairSemaphore::new(MAX_DECODED / PLACE, shares),
        }
    }

    /// A permit to read a message of this many bytes.
    ///
    /// # Errors
    /// Others, or others of this caller, take too much for too long.
    pub fn receive(
        &self,
        key: Key,
        bytes: usize,
    ) -> impl Future<Output = Result<Permit, Refused>> + Send + use<> {
        permit(&self.received, key, COPIES * bytes)
    }

    /// A permit to decode a message into this many bytes.
    ///
    /// # Errors
    /// Others, or others of this caller, take too much for too long.
    pub fn decode(
        &self,
        key: Key,
        bytes: usize,
    ) -> impl Future<Output = Result<Permit, Refused>> + Send + use<> {
        permit(&self.decoded, key, bytes)
    }

    /// Bytes of all permits.
    #[cfg(any(test, feature = "testing"))]
    pub fn taken(&self) -> usize {
        (self.received.taken() + self.decoded.taken()) * PLACE
    }
}

fn permit(
    places: &Arc<FairSemaphore>,
    key: Key,
    bytes: usize,
) -> impl Future<Output = Result<Permit, Refused>> + Send + use<> {
    let places = Arc::clone(places);
    async move {
        let taken = within(places.take_many(key, bytes.div_ceil(PLACE))).await;
        taken.ok_or(Refused {
            reason: "TOO_MANY_LARGE_MESSAGES",
            what: "too many large messages at a time; send fewer, or smaller ones",
            limit: (places.share_of(key) * PLACE) as u64,
            retry_after: MAX_WAIT,
        })
    }
}
