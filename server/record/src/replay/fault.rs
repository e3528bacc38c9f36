//! A wrong line of a record.

/// The first wrong line of a record.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct ReplayError {
    /// Number of the line, from 1; one past the last line if the end is missing.
    pub line: usize,
    /// A description for people.
    pub problem: String,
}

/// A problem, with its line if that is not the current one.
#[derive(Debug)]
pub(super) struct Fault {
    pub(super) line: Option<usize>,
    pub(super) problem: String,
}

impl From<String> for Fault {
    fn from(problem: String) -> Self {
        Self {
            line: None,
            problem,
        }
    }
}

impl From<&str> for Fault {
    fn from(problem: &str) -> Self {
        problem.to_owned().into()
    }
}
