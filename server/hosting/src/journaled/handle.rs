//! The handle of a unit: what others can read of it, and messages to its task.

use std::sync::{Arc, Mutex, MutexGuard};

use tokio::sync::{mpsc, oneshot, watch};
use tokio_util::sync::CancellationToken;

use super::{Journaled, New, UnitHeader as _};
use chefshat_admission::limits::Key;
use chefshat_room::ids::{Id, Token};

/// The task of a unit has stopped because the server ends, or another node has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stopped;

/// A unit of this server.
pub struct Handle<U: Journaled> {
    pub(crate) header: U::Header,
    pub(crate) plan: U::Plan,
    /// Who is charged for its games.
    pub(crate) charged: Key,
    pub(crate) shared: U::Shared,
    /// The state with only committed entries.
    committed: Mutex<U::State>,
    pub(crate) mailbox: mpsc::Sender<U::Message>,
    /// Cancelled when its task ends.
    pub(crate) end: CancellationToken,
    /// Counts changes.
    changes: watch::Sender<u64>,
}

impl<U: Journaled> std::fmt::Debug for Handle<U> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{} {}", U::KIND, self.id())
    }
}

impl<U: Journaled> Handle<U> {
    /// The handle of a unit whose task ends with `end`, and the messages to it.
    pub(crate) fn new(
        New { folded, shared }: New<U>,
        charged: Key,
        end: CancellationToken,
    ) -> (Arc<Self>, mpsc::Receiver<U::Message>) {
        let (mailbox, inbox) = mpsc::channel(U::MAILBOX);
        let handle = Self {
            header: folded.header,
            plan: folded.plan,
            charged,
            shared,
            committed: Mutex::new(folded.state),
            mailbox,
            end,
            changes: watch::Sender::new(0),
        };
        (Arc::new(handle), inbox)
    }

    /// Its id.
    pub fn id(&self) -> Id {
        self.header.id()
    }

    /// Whether this is its owner's token.
    pub fn is_owner(&self, token: &str) -> bool {
        let is_own =
            |token: Token| token.room == self.id() && self.header.owner().matches(&token.secret);
        Token::parse(token).is_some_and(is_own)
    }

    /// The owner token of a room of one of its games.
    pub(crate) fn room_owner(&self, room: Id) -> Token {
        Token::of_tournament_room(room, self.header.owner())
    }

    /// Whether nothing can change any more.
    pub fn is_over(&self) -> bool {
        U::is_over(&self.committed())
    }

    /// Whether its task has ended: it is over, the server ends, or another node has it.
    pub fn is_stopped(&self) -> bool {
        self.mailbox.is_closed()
    }

    /// Counts changes.
    pub fn changes(&self) -> watch::Receiver<u64> {
        self.changes.subscribe()
    }

    /// The number of the last change.
    pub(crate) fn last_change(&self) -> u64 {
        *self.changes.borrow()
    }

    /// Notifies those who wait for changes.
    pub(crate) fn notify(&self) {
        self.changes.send_modify(|count| *count += 1);
    }

    /// Shows committed entries to readers.
    pub(super) fn publish(&self, entries: &[U::Entry]) {
        let mut committed = self.committed();
        for entry in entries {
            U::apply(&mut committed, entry);
        }
    }

    /// The state with only committed entries.
    pub(crate) fn committed(&self) -> MutexGuard<'_, U::State> {
        (self.committed.lock()).expect("no code that holds this lock can panic")
    }

    /// Sends a message to the task, and waits for its answer.
    ///
    /// # Errors
    /// The task has stopped.
    pub(crate) async fn ask<T>(
        &self,
        message: impl FnOnce(oneshot::Sender<T>) -> U::Message,
    ) -> Result<T, Stopped> {
        let (reply, answer) = oneshot::channel();
        (self.mailbox.send(message(reply)).await).map_err(|_| Stopped)?;
        answer.await.map_err(|_| Stopped)
    }
}
