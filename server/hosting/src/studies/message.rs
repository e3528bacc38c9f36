//! Messages to the task of a study.

use chefshat_study::{Change, Refusal, Study};
use tokio::sync::oneshot;

use crate::journaled::Stopped;

/// What a researcher or participant asks for: decides on the state that includes pending changes,
/// at a time in milliseconds since the Unix epoch, and returns the changes that follow and a number
/// for the caller.
pub(super) type Command =
    Box<dyn FnOnce(&Study, u64) -> Result<(Vec<Change>, u32), Refusal> + Send + Sync>;

/// Why a study is not deleted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NotDeleted {
    /// This number of participants is in the middle of it.
    #[error("{0} participants are in the middle of the study")]
    Running(usize),
    /// The file system keeps samples of this number of games.
    #[error("samples of {0} games cannot be deleted")]
    Files(usize),
    /// It has stopped.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// A message to the task of a study.
pub enum Message {
    /// Executes a command; answers once its changes are committed.
    Command(Command, oneshot::Sender<Result<u32, Refusal>>),
    /// Deletes the study; answers with the number of its games once all is deleted. Refused while
    /// somebody is in the middle of it, unless `force` is set.
    Delete {
        /// Whether to remove them.
        force: bool,
        /// The answer.
        reply: oneshot::Sender<Result<usize, NotDeleted>>,
    },
    /// A stream shows the study to a participant.
    Connected {
        /// The participant.
        number: u32,
        /// Its session.
        session: u32,
        /// Number of the stream.
        stream: u64,
    },
    /// A stream has ended.
    Disconnected {
        /// The participant.
        number: u32,
        /// Number of the stream.
        stream: u64,
    },
}
