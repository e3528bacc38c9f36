//! The task of one study: receives messages, lets the core decide what follows, commits it, and only
//! then acts on it. `games` acts on games and their rooms.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use chefshat_study::{Change, Refusal, Status, Study};
use tokio::sync::{mpsc, oneshot};
use tokio::time::{Instant, sleep_until};
use tokio_util::sync::CancellationToken;
use tracing::{error, info, warn};

use super::handle::StudyHandle;
use super::message::{Command, Message};
use crate::clock::TimeOfDay;
use crate::cluster::News;
use crate::rooms::Rooms;
use crate::store::StoreError;
use chefshat_room::ids::Id;

/// Messages that are processed before their consequences are computed.
const MESSAGES_AT_A_TIME: usize = 64;

/// Stops the studies of a server.
#[derive(Debug, Clone, Default)]
pub(super) struct Stop {
    /// Cancelled when no more games are begun or counted.
    pub(super) no_more_games: CancellationToken,
    /// Cancelled when the tasks of studies end.
    pub(super) end: CancellationToken,
}

/// Runs a study until the server ends.
pub(super) struct Task {
    pub(super) handle: Arc<StudyHandle>,
    pub(super) rooms: Arc<Rooms>,
    pub(super) now: TimeOfDay,
    /// The state with pending changes; the handle's copy follows when they are committed.
    pub(super) state: Study,
    /// Number of committed rows.
    pub(super) rows: u64,
    /// Changes of the next commit.
    pending: Vec<Change>,
    /// Answers that wait for a commit.
    replies: Vec<Box<dyn FnOnce() + Send + Sync>>,
    /// Streams of participants.
    streams: BTreeMap<u32, u64>,
    /// Participants for whom a game may be due.
    pub(super) touched: BTreeSet<u32>,
    /// Participants with a running game.
    pub(super) playing: BTreeSet<u32>,
    /// Those of them whose game has no room yet.
    pub(super) without_room: BTreeSet<u32>,
    /// Rooms that were asked to close.
    pub(super) closing: BTreeSet<Id>,
    /// When rooms whose creation failed are tried again.
    pub(super) retry: Option<Instant>,
    /// Whether something visible has changed that is not committed.
    has_changed: bool,
    /// Those who wait for the deletion of the study, once that is requested.
    deletion: Vec<oneshot::Sender<Result<usize, usize>>>,
}

impl Task {
    /// Creates the task of a study with this number of committed rows.
    pub(super) fn new(
        handle: Arc<StudyHandle>,
        rooms: Arc<Rooms>,
        now: TimeOfDay,
        rows: u64,
    ) -> Self {
        let state = handle.committed().clone();
        let participants = state.participants();
        let playing = participants
            .iter()
            .filter(|(_, it)| it.games.last().is_some_and(|game| game.ended.is_none()));
        let playing = playing.map(|(number, _)| *number).collect();
        // A server that ended in the middle of a deletion completes it.
        let deleted = participants.iter().filter(|(_, it)| it.data_deleted);
        *handle.lock_deleting() = deleted.map(|(number, _)| *number).collect();
        Self {
            handle,
            rooms,
            now,
            rows,
            pending: Vec::new(),
            replies: Vec::new(),
            streams: BTreeMap::new(),
            touched: BTreeSet::new(),
            playing,
            without_room: BTreeSet::new(),
            closing: BTreeSet::new(),
            retry: None,
            has_changed: false,
            deletion: Vec::new(),
            state,
        }
    }

    /// Runs the study until it is deleted, the server ends or its store fails.
    pub(super) async fn run(mut self, mut inbox: mpsc::Receiver<Message>, stop: Stop) {
        let rooms = Arc::clone(&self.rooms);
        let mut messages = Vec::new();
        loop {
            let changed = rooms.changed();
            tokio::pin!(changed);
            // From here on no end of a game is missed.
            changed.as_mut().enable();
            // What is deleted need not be committed before: on a full disk, the deletion that frees
            // space would wait for space.
            match self.delete_study(&mut inbox).await {
                Ok(false) => {}
                Ok(true) => return,
                Err(error) => return self.fail(&error),
            }
            if let Err(error) = self.settle(stop.no_more_games.is_cancelled()).await {
                return self.fail(&error);
            }
            match self.delete_study(&mut inbox).await {
                Ok(false) => {}
                Ok(true) => return,
                Err(error) => return self.fail(&error),
            }
            // Nothing that is due is done any more.
            let wake = self
                .wake_at()
                .filter(|_| !stop.no_more_games.is_cancelled());
            let alarm = sleep_until(wake.unwrap_or_else(Instant::now));
            tokio::select! {
                () = stop.end.cancelled() => return,
                received = inbox.recv_many(&mut messages, MESSAGES_AT_A_TIME) => {
                    if received == 0 {
                        return;
                    }
                    messages.drain(..).for_each(|message| self.receive(message));
                }
                () = changed => {}
                () = alarm, if wake.is_some() => {}
            }
        }
    }

    fn fail(&self, error: &StoreError) {
        let study = self.handle.id();
        match (error, self.rooms.lease()) {
            (StoreError::Fenced(_), _) => info!(%study, %error, "the study stops here"),
            (_, Some(_)) => warn!(%study, %error, "the study stops until it is resumed"),
            (_, None) => error!(%study, %error, "the store failed; the study stops"),
        }
        if let Some(lease) = self.rooms.lease()
            && !self.handle.end.is_cancelled()
        {
            lease.report(study, News::Stopped);
        }
    }

    /// The result of a write, once this server may publish it.
    async fn published<T>(
        &self,
        written: impl Future<Output = Result<T, StoreError>>,
    ) -> Result<T, StoreError> {
        let handle = &self.handle;
        match self.rooms.lease() {
            Some(lease) => lease.published(handle.id(), &handle.end, written).await,
            None => written.await,
        }
    }

    fn wake_at(&self) -> Option<Instant> {
        let by_core = self.state.wake_at().map(|at_ms| {
            let wait = at_ms.saturating_sub((self.now)());
            Instant::now() + Duration::from_millis(wait)
        });
        by_core.into_iter().chain(self.retry).min()
    }

    fn receive(&mut self, message: Message) {
        match message {
            Message::Command(command, reply) => {
                let executed = self.execute(command);
                self.replies.push(Box::new(move || {
                    // The caller may have gone.
                    let _ = reply.send(executed);
                }));
            }
            Message::Delete { force, reply } => {
                let participants = self.state.participants().iter();
                let active = participants.filter(|(_, it)| it.status == Status::Active);
                let active: Vec<u32> = active.map(|(number, _)| *number).collect();
                if !active.is_empty() && !force {
                    // The caller may have gone.
                    let _ = reply.send(Err(active.len()));
                    return;
                }
                let at_ms = (self.now)();
                for number in active {
                    self.fold(Change::Removed { number, at_ms });
                }
                if let Some(change) = self.state.close() {
                    self.fold(change);
                }
                self.deletion.push(reply);
            }
            Message::Present {
                number,
                session,
                stream,
            } => {
                let newest = self.state.participant(number).map(|it| it.session);
                if newest == Some(session) {
                    self.streams.insert(number, stream);
                    self.set_connected(number, true);
                }
            }
            Message::Gone { number, stream } => {
                if self.streams.get(&number) == Some(&stream) {
                    self.streams.remove(&number);
                    self.set_connected(number, false);
                }
            }
        }
    }

    fn execute(&mut self, command: Command) -> Result<u32, Refusal> {
        if !self.deletion.is_empty() {
            return Err(Refusal::Closed);
        }
        let (changes, number) = command(&self.state, (self.now)())?;
        changes.into_iter().for_each(|change| self.fold(change));
        Ok(number)
    }

    fn set_connected(&mut self, number: u32, connected: bool) {
        let now_ms = (self.now)();
        self.state.set_connected(number, connected, now_ms);
        (self.handle.committed()).set_connected(number, connected, now_ms);
        self.touched.insert(number);
        self.has_changed = true;
    }

    /// Applies a change and adds it to the next commit.
    pub(super) fn fold(&mut self, change: Change) {
        self.state.fold(&change);
        match &change {
            Change::Placed { number, .. } => {
                self.playing.insert(*number);
                self.without_room.insert(*number);
            }
            Change::GameEnded { number, .. } => {
                self.playing.remove(number);
                self.without_room.remove(number);
            }
            Change::Opened { number, .. } => {
                // The stream of the earlier session ends.
                self.streams.remove(number);
                let now_ms = (self.now)();
                self.state.set_connected(*number, false, now_ms);
                (self.handle.committed()).set_connected(*number, false, now_ms);
            }
            Change::Withdrew {
                number,
                delete_data: true,
                ..
            } => {
                self.handle.lock_deleting().insert(*number);
            }
            _ => {}
        }
        self.touched.extend(change.number());
        self.pending.push(change);
    }

    /// Computes what follows, commits it and acts on it, until nothing follows.
    async fn settle(&mut self, no_more_games: bool) -> Result<(), StoreError> {
        loop {
            if !no_more_games {
                self.read_ended_games().await?;
                let now_ms = (self.now)();
                while let Some(change) = self.state.next(now_ms) {
                    self.fold(change);
                }
                self.place_due_games();
            }
            let has_pending = !self.pending.is_empty();
            if has_pending {
                let changes = std::mem::take(&mut self.pending);
                let id = self.handle.id();
                let store = self.rooms.store();
                self.published(store.append_study(id, self.rows, changes.clone()))
                    .await?;
                self.rows += 1;
                self.handle.publish(&changes);
            }
            self.replies.drain(..).for_each(|reply| reply());
            let mut made = false;
            if !no_more_games {
                made = self.make_rooms().await?;
                self.close_rooms();
            }
            let deleted = self.delete_data().await?;
            if std::mem::take(&mut self.has_changed) || has_pending || made || deleted {
                self.handle.changes.send_modify(|count| *count += 1);
            }
            if !has_pending && self.pending.is_empty() {
                return Ok(());
            }
        }
    }

    /// Deletes the data of participants who want it, once their games are over: of all of them
    /// together, because each time the whole journal is read and written. Returns whether there were
    /// any.
    async fn delete_data(&mut self) -> Result<bool, StoreError> {
        // A commit comes first: the journal is read from the store.
        if !self.pending.is_empty() {
            return Ok(false);
        }
        let mut due = self.handle.lock_deleting().clone();
        due.retain(|number| !self.playing.contains(number));
        if due.is_empty() {
            return Ok(false);
        }
        let handle = Arc::clone(&self.handle);
        let mut counts = handle.traces.lock().await;
        let store = self.rooms.store();
        let Some(stored) = store.study(handle.id()).await? else {
            return Ok(false);
        };
        let mut changes = stored.changes;
        let mut is_changed = false;
        for change in &mut changes {
            for number in &due {
                is_changed |= change.forget(*number);
            }
        }
        // Everybody has a pseudonym to forget, so an unchanged journal was written before, by a
        // server that ended before its games were deleted. Traces were deleted with it.
        if is_changed {
            let forgotten = due.iter().copied().collect();
            store.rewrite_study(handle.id(), changes, forgotten).await?;
            self.rows = 1;
        }
        let played = due
            .iter()
            .filter_map(|number| self.state.participant(*number));
        let games: Vec<_> = played.flat_map(|it| &it.games).collect();
        let ids: Vec<Id> = games.iter().map(|game| Id(game.placed.game)).collect();
        for game in &ids {
            counts.remove(game);
        }
        for game in &games {
            self.rooms.forget(Id(game.placed.room));
        }
        let count = ids.len();
        self.rooms.delete_games(ids).await?;
        for number in &due {
            handle.data.forget_answers(*number);
        }
        handle.lock_deleting().retain(|it| !due.contains(it));
        if is_changed {
            info!(study = %handle.id(), participants = due.len(), games = count, "the data of participants were deleted");
        }
        Ok(true)
    }

    /// Deletes the study if that was requested and no game runs any more. Returns whether it did.
    async fn delete_study(
        &mut self,
        inbox: &mut mpsc::Receiver<Message>,
    ) -> Result<bool, StoreError> {
        if self.deletion.is_empty() || !self.playing.is_empty() {
            return Ok(false);
        }
        let participants = self.state.participants().values();
        let played: Vec<_> = participants.flat_map(|it| &it.games).collect();
        for game in &played {
            self.rooms.forget(Id(game.placed.room));
        }
        let games: Vec<Id> = played.iter().map(|game| Id(game.placed.game)).collect();
        let count = games.len();
        let store = self.rooms.store();
        // The games first: a repetition completes what was interrupted in between.
        self.rooms.delete_games(games).await?;
        store.delete_study(self.handle.id()).await?;
        info!(study = %self.handle.id(), games = count, "a study was deleted");
        // Those who asked while it was deleted get the same answer.
        inbox.close();
        while let Ok(message) = inbox.try_recv() {
            if let Message::Delete { reply, .. } = message {
                self.deletion.push(reply);
            }
        }
        self.replies.drain(..).for_each(|reply| reply());
        for reply in self.deletion.drain(..) {
            // The caller may have gone.
            let _ = reply.send(Ok(count));
        }
        Ok(true)
    }

    /// Whether a participant is in the middle of the study.
    pub(super) fn is_active(&self, number: u32) -> bool {
        let participant = self.state.participant(number);
        participant.is_some_and(|it| it.status == Status::Active)
    }
}
