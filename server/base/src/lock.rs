//! A lock that is never poisoned.

use std::sync::{Mutex, MutexGuard};

/// A value that one thread at a time has. Nothing panics while it has it, so the value is never
/// changed half.
#[derive(Debug, Default)]
pub struct Lock<T>(Mutex<T>);

impl<T> Lock<T> {
    /// Protects a value.
    pub const fn new(value: T) -> Self {
        Self(Mutex::new(value))
    }

    /// Waits until no other thread has the value.
    pub fn lock(&self) -> MutexGuard<'_, T> {
        (self.0.lock()).expect("no code that holds this lock can panic")
    }
}
