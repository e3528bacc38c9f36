//! Where a room rests while its task waits, and how the reader of a stream handles an answer there.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard};

use tracing::error;

/// Holds the state of a room while its task waits. Meanwhile the reader of a stream may handle an
/// answer in place, which saves a message and waking the task: a large part of the cost of a
/// decision.
pub(super) struct SharedRoom<R>(Mutex<Option<Box<R>>>);

impl<R> Default for SharedRoom<R> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<R> SharedRoom<R> {
    pub(super) fn lock(&self) -> MutexGuard<'_, Option<Box<R>>> {
        self.0
            .lock()
            .expect("nothing that holds this lock can panic")
    }

    /// Handles an input in place by `handle`, and returns what that returns: whether the task must
    /// be woken. Returns the input if the task is running, or if `may` says no.
    pub(super) fn handle<I>(
        &self,
        input: I,
        may: impl FnOnce(&R) -> bool,
        handle: impl FnOnce(&mut R, I) -> bool,
    ) -> Result<bool, I> {
        let Ok(mut shared) = self.0.try_lock() else {
            return Err(input);
        };
        let Some(mut room) = shared.take_if(|room| may(room)) else {
            return Err(input);
        };
        // A panic ends the room, but not the stream of a reader that may have seats in other rooms.
        let handled = catch_unwind(AssertUnwindSafe(move || {
            let needs_task = handle(&mut room, input);
            (room, needs_task)
        }));
        match handled {
            Ok((room, needs_task)) => {
                *shared = Some(room);
                Ok(needs_task)
            }
            Err(_) => {
                error!("a room panicked and is gone");
                Ok(true)
            }
        }
    }
}
