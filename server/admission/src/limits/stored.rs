//! What one caller may have written to the disk besides what games need: annotations, expressions,
//! markers, samples, interface traces, answers to questionnaires and imported records. Its rate is bounded, and when the disk is
//! nearly full there is none of it, so that decisions are still committed.

use std::time::Duration;

use super::{Key, Rate, Refused};

/// Bytes of one caller in a second, and at once.
pub(super) const STORED_BYTES_PER_SECOND: u64 = 2 * 1024 * 1024;
pub(super) const STORED_BYTES_AT_ONCE: u64 = 64 * 1024 * 1024;
/// Bytes that everything that is stored takes besides its content.
const OVERHEAD: u64 = 64;

/// The bytes of all callers.
#[derive(Debug)]
pub struct StoredBytes(Rate);

/// Why something is not stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NotStored {
    /// The disk has no space for it.
    #[error("the disk of the server is nearly full; the rest is reserved for running games")]
    DiskNearlyFull,
    /// The caller has too much written.
    #[error(transparent)]
    TooFast(Refused),
}

impl Default for StoredBytes {
    fn default() -> Self {
        Self(Rate::new(STORED_BYTES_PER_SECOND, STORED_BYTES_AT_ONCE))
    }
}

impl StoredBytes {
    /// Charges a caller for something of this size that is written to the disk. `has_space` says
    /// whether the disk has space besides its reserve.
    ///
    /// # Errors
    /// It must not be stored; nothing is charged.
    pub fn admit(&self, key: Key, bytes: usize, has_space: bool) -> Result<(), NotStored> {
        if !has_space {
            return Err(NotStored::DiskNearlyFull);
        }
        let wait = self.0.wait(key);
        if !wait.is_zero() {
            return Err(NotStored::TooFast(Refused {
                reason: "TOO_MANY_CALLS",
                what: "too many bytes to store in a second; send fewer",
                limit: self.0.per_second(),
                retry_after: wait.max(Duration::from_secs(1)),
            }));
        }
        let bytes = u64::try_from(bytes).unwrap_or(u64::MAX);
        self.0.charge(key, bytes.saturating_add(OVERHEAD));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_caller_stores_no_faster_than_its_rate_and_holds_back_nobody_else() {
        let stored = StoredBytes::default();
        let key = |last| Key::Address([192, 0, 2, last].into());
        let piece = 64 * 1024;
        let flood = |stored: &StoredBytes| {
            let admitted = || stored.admit(key(1), piece, true);
            std::iter::from_fn(|| admitted().ok()).count() as u64
        };
        let at_once = flood(&stored) * piece as u64;
        assert!(at_once <= STORED_BYTES_AT_ONCE + piece as u64, "{at_once}");
        assert!(matches!(
            stored.admit(key(1), 1, true),
            Err(NotStored::TooFast(refused)) if refused.retry_after >= Duration::from_secs(1)
        ));
        stored.admit(key(2), piece, true).expect("another caller");
        tokio::time::advance(Duration::from_secs(10)).await;
        let later = flood(&stored) * piece as u64;
        assert!(
            later <= 10 * STORED_BYTES_PER_SECOND + piece as u64,
            "{later}"
        );
        assert!(later > 9 * STORED_BYTES_PER_SECOND, "{later}");
    }

    #[tokio::test(start_paused = true)]
    async fn on_a_disk_that_is_nearly_full_nothing_but_games_is_stored() {
        let stored = StoredBytes::default();
        let refused = stored.admit(Key::Local, 1, false);
        assert_eq!(refused, Err(NotStored::DiskNearlyFull));
    }
}
