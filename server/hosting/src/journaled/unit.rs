//! A unit, as everything here knows it: what each kind decides, its value as stored and in memory, its
//! handle, and what its task has.

use std::sync::{Arc, MutexGuard};
use std::time::Duration;

use tokio::sync::{Notify, mpsc, oneshot, watch};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tracing::warn;

use crate::rooms::{CreateError, Rooms};
use chefshat_admission::limits::{Key, Permit, Refused};
use chefshat_base::lock::Lock;
use chefshat_base::tasks::LongTask;
use chefshat_room::ids::{Id, RoomId, RoomToken, SecretHash, Token};
use chefshat_store::StoreError;
use chefshat_store::units::{StoredKind, StoredUnit, UnitKind, UnitRow, UnitWrite};

/// When rooms that could not be created are tried again.
const CREATION_RETRY: Duration = Duration::from_secs(1);

/// What a unit is from its creation on.
pub trait UnitHeader: Send + Sync {
    /// The kind of its id.
    type Kind: StoredKind;

    /// The unit.
    fn id(&self) -> Id<Self::Kind>;
    /// The hash of the owner token.
    fn owner(&self) -> &SecretHash;
    /// When it was created, milliseconds since the Unix epoch.
    fn created_at_ms(&self) -> u64;
    /// Its join code in its normal form, if it has one.
    fn join_code(&self) -> Option<&str> {
        None
    }
}

/// A kind of unit, and the effects that its entries have. The actor decides when each method is
/// called. Until the server stops, that is the order in which they stand here;
/// `conclude` is also asked first.
pub trait Journaled: Sized + Send + Sync + 'static {
    /// The kind of its id.
    type Kind: StoredKind;
    /// What does not change.
    type Header: UnitHeader<Kind = Self::Kind>;
    /// The settings, prepared.
    type Plan: Send + Sync;
    /// The value that changes.
    type State: Clone + Send + Sync;
    /// An entry of the journal.
    type Entry: Clone + Send + Sync;
    /// What a handle sends to the task.
    type Message: Send;
    /// What readers of one unit share besides its state.
    type Shared: Send + Sync;
    /// What all units of the kind share.
    type Common: Send + Sync;
    /// Why settings are refused.
    type SettingsProblem: std::error::Error + Send + 'static;

    /// The kind.
    const KIND: UnitKind = Self::Kind::KIND;
    /// Its task.
    const TASK: LongTask;
    /// Messages that wait for the task, at most.
    const MAILBOX: usize;
    /// Most units of the kind that are not over.
    const MOST: usize;

    /// The encoding of a header.
    fn header_to_bytes(header: &Self::Header) -> Vec<u8>;
    /// The encoding of entries, a row of the journal.
    fn row_to_bytes(entries: &[Self::Entry]) -> Vec<u8>;
    /// Folds what is stored of a unit. This may take long.
    ///
    /// # Errors
    /// Why this version cannot read it.
    fn fold(id: Id<Self::Kind>, stored: &StoredUnit) -> Result<Folded<Self>, String>;
    /// What readers of a unit that was in the store share.
    fn share(common: &Self::Common, folded: &Folded<Self>) -> Self::Shared;
    /// Handles a unit that cannot be read.
    fn set_unreadable(_id: Id<Self::Kind>, _rooms: &Rooms) {}
    /// Who is charged for the games of a unit whose creator is unknown.
    fn key_of(id: Id<Self::Kind>) -> Key;
    /// The refusal of a unit whose creator, or the server, has this number already.
    fn too_many(limit: u64) -> Refused;
    /// Applies an entry.
    fn apply(state: &mut Self::State, entry: &Self::Entry);
    /// Whether nothing can change any more. Such a unit has no task, and makes room for others.
    fn is_over(state: &Self::State) -> bool;
    /// Prepares what others may see of a unit before they can find it.
    fn enter(_handle: &Handle<Self>, _rooms: &Arc<Rooms>) {}
    /// Creates the task of a unit.
    fn new(unit: Unit<Self>, common: &Self::Common) -> Self;
    /// What every unit has.
    fn unit(&self) -> &Unit<Self>;
    /// What every unit has.
    fn unit_mut(&mut self) -> &mut Unit<Self>;

    /// Processes a message.
    fn receive(
        &mut self,
        message: Self::Message,
    ) -> impl Future<Output = Result<(), StoreError>> + Send;
    /// Gives up what a message brings that comes when the task has ended. By default, dropping it does.
    fn abandon(&mut self, _message: Self::Message) {}

    /// Adds the entries that follow now by themselves. Not called once the server stops.
    fn follow(&mut self) -> impl Future<Output = Result<(), StoreError>> + Send;
    /// Announces committed entries, which the handle shows by now.
    fn announce(&mut self, entries: &[Self::Entry]);
    /// Acts on what is committed. Not called once the server stops.
    fn act(&mut self) -> impl Future<Output = Result<(), StoreError>> + Send;
    /// Deletes what is to be deleted, if nothing is pending.
    fn delete(&mut self) -> impl Future<Output = Result<(), StoreError>> + Send {
        std::future::ready(Ok(()))
    }
    /// Whether the task ends because the unit is over or deleted, after its last messages have been
    /// answered.
    fn conclude(
        &mut self,
        inbox: &mut mpsc::Receiver<Self::Message>,
    ) -> impl Future<Output = Result<bool, StoreError>> + Send;
    /// When something is due by itself.
    fn wake_at(&self) -> Option<Instant>;
    /// Ends the streams of participants, which may reconnect, because the unit stops here and the server
    /// does not.
    fn end_streams(&mut self) {}
}

/// A unit as its journal has it.
pub struct Folded<U: Journaled> {
    pub(crate) header: U::Header,
    pub(crate) plan: U::Plan,
    pub(crate) state: U::State,
    /// Number of rows of the journal.
    pub(crate) rows: u64,
}

/// A unit that is in the store and about to run.
pub(crate) struct New<U: Journaled> {
    pub(crate) folded: Folded<U>,
    pub(crate) shared: U::Shared,
}

/// The task of a unit has stopped because the server ends, its store failed, or another node has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("it has stopped here: the server ends, its store failed, or another node has it")]
pub struct Stopped;

/// A unit of this server.
pub struct Handle<U: Journaled> {
    pub(crate) header: U::Header,
    pub(crate) plan: U::Plan,
    /// Who is charged for its games.
    pub(crate) charged: Key,
    pub(crate) shared: U::Shared,
    /// The state with only committed entries.
    committed: Lock<U::State>,
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
            committed: Lock::new(folded.state),
            mailbox,
            end,
            changes: watch::Sender::new(0),
        };
        (Arc::new(handle), inbox)
    }

    /// Its id.
    pub fn id(&self) -> Id<U::Kind> {
        self.header.id()
    }

    /// Whether this is its owner's token.
    pub fn is_owner(&self, token: &str) -> bool {
        let is_own = |token: Token<U::Kind>| {
            token.subject == self.id() && self.header.owner().matches(&token.secret)
        };
        Token::parse(token).is_some_and(is_own)
    }

    /// The owner token of a room of one of its games.
    pub(crate) fn room_owner(&self, room: RoomId) -> RoomToken {
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

    /// Waits until its task has ended.
    pub async fn stopped(&self) {
        self.mailbox.closed().await;
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
        self.committed.lock()
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

/// What the task of every unit has: the state with what is not committed yet, and who waits for that.
pub struct Unit<U: Journaled> {
    pub(crate) handle: Arc<Handle<U>>,
    pub(crate) rooms: Arc<Rooms>,
    /// The state with pending entries; the handle's copy follows when they are committed.
    pub(crate) state: U::State,
    /// Number of committed rows.
    pub(crate) rows: u64,
    /// Whether something visible has changed that is not an entry.
    pub(crate) has_changed: bool,
    /// Entries of the next commit.
    pub(super) pending: Vec<U::Entry>,
    /// What is done after the next commit.
    replies: Vec<Box<dyn FnOnce() + Send + Sync>>,
    /// Notified when one of its games has ended or a room of it has stopped.
    pub(super) games: Arc<Notify>,
    /// When rooms of its games whose creation failed are tried again.
    pub(crate) retry: Retry,
    /// Its place among its creator's units.
    _place: Permit,
}

impl<U: Journaled> Unit<U> {
    pub(super) fn new(handle: Arc<Handle<U>>, rooms: Arc<Rooms>, rows: u64, place: Permit) -> Self {
        let state = handle.committed().clone();
        let games = rooms.notify_of_games(handle.id().unit());
        Self {
            handle,
            rooms,
            state,
            rows,
            has_changed: false,
            pending: Vec::new(),
            replies: Vec::new(),
            games,
            retry: Retry::default(),
            _place: place,
        }
    }

    /// Applies an entry and adds it to the next commit.
    pub(crate) fn push(&mut self, entry: U::Entry) {
        U::apply(&mut self.state, &entry);
        self.pending.push(entry);
    }

    /// Whether entries wait for the next commit.
    pub(crate) fn is_pending(&self) -> bool {
        !self.pending.is_empty()
    }

    /// Does something after the next commit.
    pub(crate) fn after_commit(&mut self, reply: impl FnOnce() + Send + Sync + 'static) {
        self.replies.push(Box::new(reply));
    }

    /// Answers a caller after the next commit.
    pub(crate) fn reply<T: Send + Sync + 'static>(&mut self, reply: oneshot::Sender<T>, answer: T) {
        self.after_commit(move || {
            // The caller may have gone.
            let _ = reply.send(answer);
        });
    }

    /// Does what waited for the commit.
    pub(crate) fn send_replies(&mut self) {
        self.replies.drain(..).for_each(|reply| reply());
    }

    /// Adds a row to the journal in the store. Returns once this server may publish it.
    pub(super) async fn append(&self, entries: &[U::Entry]) -> Result<(), StoreError> {
        let id = self.id();
        let row = UnitRow {
            position: self.rows,
            entries: U::row_to_bytes(entries),
            over: U::is_over(&self.state),
        };
        let store = self.rooms.store();
        let written = store.write_unit(U::Kind::key(id), UnitWrite::Append(row));
        match self.rooms.lease() {
            Some(lease) => lease.published(id.unit(), &self.handle.end, written).await,
            None => written.await,
        }
    }

    pub(super) fn id(&self) -> Id<U::Kind> {
        self.handle.id()
    }
}

impl<U: Journaled> Drop for Unit<U> {
    fn drop(&mut self) {
        self.rooms.stop_notifying(self.id().unit(), &self.games);
    }
}

/// When rooms that a unit needs and could not create are tried again.
#[derive(Debug, Default)]
pub(crate) struct Retry {
    at: Option<Instant>,
    /// Whether the log says that games wait.
    is_known: bool,
}

impl Retry {
    /// When that is, if rooms wait for it.
    pub(crate) fn at(&self) -> Option<Instant> {
        self.at
    }

    /// Returns whether rooms are to be created now: some are `needed`, and none waits. Forgets what waits
    /// if none is needed any more.
    pub(crate) fn take(&mut self, needed: bool) -> bool {
        if !needed {
            *self = Self::default();
            return false;
        }
        let is_due = self.at.is_none_or(|at| at <= Instant::now());
        if is_due {
            self.at = None;
        }
        is_due
    }

    /// Notes that a room could not be created. Says so once, unless the server stops: the game gets its
    /// room when it has restarted.
    pub(super) fn again(&mut self, of: UnitKind, id: impl std::fmt::Display, error: &CreateError) {
        self.at = Some(Instant::now() + CREATION_RETRY);
        if !matches!(error, CreateError::ShuttingDown)
            && !std::mem::replace(&mut self.is_known, true)
        {
            warn!(%of, %id, %error, "games wait for rooms");
        }
    }
}
