//! The task of one unit: receives messages, lets the unit decide what follows, commits it, and only
//! then publishes it and acts on it.

use std::sync::Arc;

use tokio::sync::{mpsc, oneshot};
use tokio::time::{Instant, sleep_until};
use tokio_util::sync::CancellationToken;
use tracing::{error, info, warn};

use super::{Handle, Journaled};
use crate::cluster::News;
use crate::rooms::Rooms;
use chefshat_admission::limits::Held;
use chefshat_room::ids::Id;
use chefshat_store::StoreError;
use chefshat_store::units::{UnitRow, UnitWrite};

/// Messages that are processed before their consequences are computed.
const MESSAGES_AT_A_TIME: usize = 64;

/// Stops the units of a server.
#[derive(Debug, Clone, Default)]
pub(super) struct Stop {
    /// Cancelled when no more games are begun or counted. Participants are still seated in running
    /// games.
    pub(super) no_more_games: CancellationToken,
    /// Cancelled when the tasks end.
    pub(super) end: CancellationToken,
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
    pending: Vec<U::Entry>,
    /// What is done after the next commit.
    replies: Vec<Box<dyn FnOnce() + Send + Sync>>,
    /// Its place among its creator's units.
    _place: Held,
}

impl<U: Journaled> Unit<U> {
    pub(super) fn new(handle: Arc<Handle<U>>, rooms: Arc<Rooms>, rows: u64, place: Held) -> Self {
        let state = handle.committed().clone();
        Self {
            handle,
            rooms,
            state,
            rows,
            has_changed: false,
            pending: Vec::new(),
            replies: Vec::new(),
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
    async fn append(&self, entries: &[U::Entry]) -> Result<(), StoreError> {
        let id = self.id();
        let row = UnitRow {
            position: self.rows,
            entries: U::row_to_bytes(entries),
            over: U::is_over(&self.state),
        };
        let store = self.rooms.store();
        let written = store.write_unit(U::KIND.id(id), UnitWrite::Append(row));
        match self.rooms.lease() {
            Some(lease) => lease.published(id, &self.handle.end, written).await,
            None => written.await,
        }
    }

    fn id(&self) -> Id {
        self.handle.id()
    }
}

/// Runs a unit until it is over or deleted, the server ends, or its store fails.
pub(super) async fn run<U: Journaled>(
    mut unit: U,
    mut inbox: mpsc::Receiver<U::Message>,
    stop: Stop,
) {
    if let Err(error) = run_on(&mut unit, &mut inbox, stop).await {
        fail(&mut unit, &error);
    }
}

async fn run_on<U: Journaled>(
    unit: &mut U,
    inbox: &mut mpsc::Receiver<U::Message>,
    stop: Stop,
) -> Result<(), StoreError> {
    let rooms = Arc::clone(&unit.unit().rooms);
    let mut messages = Vec::new();
    loop {
        let changed = rooms.changed();
        tokio::pin!(changed);
        // From here on no end of a game is missed.
        changed.as_mut().enable();
        // What is deleted need not be committed before: on a full disk, the deletion that frees
        // space would wait for space.
        if unit.conclude(inbox).await? {
            return Ok(());
        }
        settle(unit, stop.no_more_games.is_cancelled()).await?;
        if unit.conclude(inbox).await? {
            return Ok(());
        }
        // Nothing that is due is done any more once the server stops.
        let is_stopping = stop.no_more_games.is_cancelled();
        let wake = unit.wake_at().filter(|_| !is_stopping);
        let alarm = sleep_until(wake.unwrap_or_else(Instant::now));
        tokio::select! {
            () = stop.end.cancelled() => {
                unit.end_streams();
                return Ok(());
            }
            received = inbox.recv_many(&mut messages, MESSAGES_AT_A_TIME) => {
                if received == 0 {
                    return Ok(());
                }
                for message in messages.drain(..) {
                    unit.receive(message).await?;
                }
            }
            () = changed => {}
            () = alarm, if wake.is_some() => {}
        }
    }
}

/// Computes what follows, commits it and acts on it, until nothing follows. With `no_more_games` only
/// pending entries are committed.
async fn settle<U: Journaled>(unit: &mut U, no_more_games: bool) -> Result<(), StoreError> {
    loop {
        if !no_more_games {
            unit.follow().await?;
        }
        let entries = std::mem::take(&mut unit.unit_mut().pending);
        let has_entries = !entries.is_empty();
        if has_entries {
            unit.unit().append(&entries).await?;
            let core = unit.unit_mut();
            core.rows += 1;
            core.handle.publish(&entries);
            unit.announce(&entries);
        }
        unit.unit_mut().send_replies();
        if !no_more_games {
            unit.act().await?;
        }
        if !unit.unit().is_pending() {
            unit.delete().await?;
        }
        let core = unit.unit_mut();
        if std::mem::take(&mut core.has_changed) || has_entries {
            core.handle.notify();
        }
        if !has_entries && !core.is_pending() {
            return Ok(());
        }
    }
}

/// Handles a failure of the store: nothing uncommitted is published. The unit resumes from its journal
/// when the server is restarted, or at the node that owns it.
fn fail<U: Journaled>(unit: &mut U, error: &StoreError) {
    let (core, name) = (unit.unit(), U::KIND);
    let id = core.id();
    match (error, core.rooms.lease()) {
        (StoreError::Fenced(_), _) => info!(%id, %error, "the {name} stops here"),
        (_, Some(_)) => warn!(%id, %error, "the {name} stops until it is resumed"),
        (_, None) => error!(%id, %error, "the store failed; the {name} stops"),
    }
    if let Some(lease) = core.rooms.lease()
        && !core.handle.end.is_cancelled()
    {
        lease.report(id, News::Stopped);
    }
    unit.end_streams();
}
