//! The error of a task.

use std::fmt;

/// The reason why a task stopped, for the person who started it.
#[derive(Debug)]
pub(crate) struct Failure(String);

impl Failure {
    /// Creates a failure with this message.
    pub(crate) fn new(message: impl Into<String>) -> Self {
        Self(message.into())
    }

    /// The failures of steps that ran whatever became of the others, if there were any.
    pub(crate) fn of_any(outcomes: impl IntoIterator<Item = Result<(), Self>>) -> Result<(), Self> {
        let failures: Vec<String> = (outcomes.into_iter())
            .filter_map(|outcome| outcome.err().map(|failure| failure.0))
            .collect();
        match failures.is_empty() {
            true => Ok(()),
            false => Err(Self(failures.join("; "))),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
