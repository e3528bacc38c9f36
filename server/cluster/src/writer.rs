//! One journal as its owner sees it. A row is published only when it certainly stands in the journal. If an append
//! has no answer (the connection broke), it may have been committed or not, or be committed later: the owner reads the position again, and
//! an equal row of its own epoch there is its row.

use crate::{Epoch, Written};

/// What the owner does next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Step {
    /// The row is committed: publish it.
    Publish,
    /// Read the row at [`Writer::position`].
    Read,
    /// Append the same row again at [`Writer::position`].
    Append,
    /// Another node owns it: stop, and publish nothing.
    Stop,
}

/// Appends rows one after another at one epoch.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Writer {
    epoch: Epoch,
    position: u64,
    /// Whether an append of the present row has had no answer.
    uncertain: bool,
}

impl Writer {
    /// A writer behind `rows` rows.
    pub fn new(epoch: Epoch, rows: u64) -> Self {
        Self {
            epoch,
            position: rows,
            uncertain: false,
        }
    }

    /// The epoch of its rows.
    pub fn epoch(&self) -> Epoch {
        self.epoch
    }

    /// Where the present row belongs, from 0.
    pub fn position(&self) -> u64 {
        self.position
    }

    /// An append was answered; `None` if the answer never came. A refusal after that may mean that the row stands there already.
    pub fn appended(&mut self, answer: Option<Written>) -> Step {
        match answer {
            Some(Written::Committed) => self.publish(),
            Some(Written::Refused) if !self.uncertain => Step::Stop,
            Some(Written::Refused) | None => {
                self.uncertain = true;
                Step::Read
            }
        }
    }

    /// The position was read: `None` if nothing stands there, else whether it is the present row, written at this epoch.
    /// `fenced` says whether the epoch is no longer the present one, or the item is over: then nothing can arrive later.
    pub fn read(&mut self, row_is_ours: Option<bool>, fenced: bool) -> Step {
        match row_is_ours {
            Some(true) => self.publish(),
            Some(false) => Step::Stop,
            None if fenced => Step::Stop,
            None => Step::Append,
        }
    }

    fn publish(&mut self) -> Step {
        self.position += 1;
        self.uncertain = false;
        Step::Publish
    }
}
