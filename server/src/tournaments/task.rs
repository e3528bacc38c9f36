//! The task of one tournament: receives messages, lets the core decide what follows, commits it,
//! and only then acts on it. `games` acts on games and their rooms.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use chefshat_tournament::{Change, State, Tournament};
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep_until};
use tokio_util::sync::CancellationToken;
use tracing::{error, info, warn};

use super::handle::{TournamentHandle, TournamentState};
use super::message::{Call, Connection, Entry, JoinRefusal, Message};
use crate::clock::{RoomClock, since_epoch_ms};
use crate::cluster::News;
use crate::config::{TOURNAMENT_OPEN_TIME, TOURNAMENT_PAUSE};
use crate::limits::{Held, Key};
use crate::outbox::StreamEnd;
use crate::rooms::Rooms;
use crate::store::StoreError;
use crate::store::tournaments::TournamentEntry;
use chefshat_room::ids::{Id, SecretHash, Token};

/// Messages that are processed before their consequences are computed.
const MESSAGES_AT_A_TIME: usize = 64;

/// Stops the tournaments of a server.
#[derive(Debug, Clone, Default)]
pub(super) struct Stop {
    /// Cancelled when no more games are called or counted. Participants are still seated in running
    /// games.
    pub(super) no_more_games: CancellationToken,
    /// Cancelled when the tasks of tournaments end.
    pub(super) end: CancellationToken,
}

/// Runs a tournament until the server ends.
pub(super) struct Task {
    pub(super) handle: Arc<TournamentHandle>,
    pub(super) rooms: Arc<Rooms>,
    /// The state with pending changes; the handle's copy follows when they are committed.
    pub(super) state: TournamentState,
    /// Number of committed rows.
    rows: u64,
    /// Entries of the next commit.
    pub(super) pending: Vec<TournamentEntry>,
    /// Streams of participants, with their connection ids.
    pub(super) connections: BTreeMap<usize, (u64, Connection)>,
    /// Called games that have no room yet.
    pub(super) without_room: BTreeSet<usize>,
    /// Games whose rooms have existed since the server was started.
    pub(super) seen: BTreeSet<usize>,
    /// Deals whose remaining games must be checked.
    deals: BTreeSet<u32>,
    /// Whether something visible has changed that is not committed.
    pub(super) has_changed: bool,
    /// Number of participants who withdrew before the beginning, by who is charged for it, since the
    /// server was started. Bounded by the number of such withdrawals.
    pub(super) left_early: BTreeMap<Key, u32>,
    /// Participants whose seats in a game were given up, by game, since the server was started.
    pub(super) retired: BTreeSet<(usize, usize)>,
    /// When a participant last joined, or the server was started.
    joined_at: Instant,
    /// When it starts by itself.
    start_at: Option<Instant>,
    /// When it was paused, or the server was started.
    paused_at: Option<Instant>,
    /// When rooms whose creation failed are tried again.
    pub(super) retry: Option<Instant>,
    /// Answers that wait for a commit.
    pub(super) replies: Vec<Box<dyn FnOnce() + Send + Sync>>,
    /// Times of the core: a pause of the process makes no participant late.
    clock: RoomClock,
    /// Its place among its creator's tournaments.
    _place: Option<Held>,
}

impl Task {
    /// Creates the task of a tournament with this number of committed rows.
    pub(super) fn new(
        handle: Arc<TournamentHandle>,
        rooms: Arc<Rooms>,
        rows: u64,
        place: Option<Held>,
    ) -> Self {
        let state = handle.committed().clone();
        let start_in = (handle.plan.start_at_ms).map(|at| at.saturating_sub(since_epoch_ms()));
        let now = Instant::now();
        Self {
            start_at: start_in.map(|time| now + Duration::from_millis(time)),
            paused_at: state.core.is_paused().then_some(now),
            left_early: BTreeMap::new(),
            retired: BTreeSet::new(),
            state,
            handle,
            clock: RoomClock::of_age(Duration::ZERO, rooms.process_clock()),
            rooms,
            rows,
            pending: Vec::new(),
            connections: BTreeMap::new(),
            without_room: BTreeSet::new(),
            seen: BTreeSet::new(),
            deals: BTreeSet::new(),
            has_changed: false,
            joined_at: Instant::now(),
            retry: None,
            replies: Vec::new(),
            _place: place,
        }
    }

    /// Runs the tournament until it is over, the server ends, or its store fails.
    pub(super) async fn run(mut self, mut inbox: mpsc::Receiver<Message>, stop: Stop) {
        let rooms = Arc::clone(&self.rooms);
        let mut messages = Vec::new();
        loop {
            let changed = rooms.changed();
            tokio::pin!(changed);
            // From here on no end of a game is missed.
            changed.as_mut().enable();
            if let Err(error) = self.settle(stop.no_more_games.is_cancelled()).await {
                return self.fail(&error);
            }
            if self.handle.is_over() {
                self.conclude(inbox).await;
                return;
            }
            let wake = self
                .wake_at()
                .filter(|_| !stop.no_more_games.is_cancelled());
            let alarm = sleep_until(wake.unwrap_or(self.joined_at));
            tokio::select! {
                () = stop.end.cancelled() => return self.end_streams(),
                received = inbox.recv_many(&mut messages, MESSAGES_AT_A_TIME) => {
                    if received == 0 {
                        return;
                    }
                    for message in messages.drain(..) {
                        if let Err(error) = self.receive(message).await {
                            return self.fail(&error);
                        }
                    }
                }
                () = changed => {}
                () = alarm, if wake.is_some() => self.expire(),
            }
        }
    }

    /// Handles a failure of the store: nothing uncommitted is published. The tournament resumes from
    /// its journal when the server is restarted, or at the node that owns it.
    fn fail(&mut self, error: &StoreError) {
        let tournament = self.handle.id();
        match (error, self.rooms.lease()) {
            (StoreError::Fenced(_), _) => info!(%tournament, %error, "the tournament stops here"),
            (_, Some(_)) => warn!(%tournament, %error, "the tournament stops until it is resumed"),
            (_, None) => error!(%tournament, %error, "the store failed; the tournament stops"),
        }
        if let Some(lease) = self.rooms.lease()
            && !self.handle.end.is_cancelled()
        {
            lease.report(tournament, News::Stopped);
        }
        self.end_streams();
    }

    /// Ends the streams of all participants, which may reconnect, unless the whole server ends.
    fn end_streams(&mut self) {
        if self.rooms.lease().is_none() {
            return;
        }
        for (_, connection) in std::mem::take(&mut self.connections).into_values() {
            connection.outbox.end(StreamEnd::RoomGone);
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
        let core = self.state.core.wake_at();
        let core = core.map(|ms| self.clock.instant(Duration::from_millis(ms)));
        core.into_iter()
            .chain(self.retry)
            .chain(self.open_until())
            .chain(self.start_at.filter(|_| self.state.core.can_begin()))
            .chain(self.paused_until())
            .min()
    }

    /// Whether it starts by itself now.
    fn is_due_to_start(&self) -> bool {
        let is_time = self.start_at.is_some_and(|at| at <= Instant::now());
        is_time && self.state.core.can_begin()
    }

    /// When a paused tournament resumes by itself.
    fn paused_until(&self) -> Option<Instant> {
        let paused_at = self.paused_at.filter(|_| self.state.core.is_paused());
        Some(paused_at? + TOURNAMENT_PAUSE)
    }

    /// When a tournament that nobody starts or joins is closed.
    fn open_until(&self) -> Option<Instant> {
        let is_open = self.state.core.state() == State::Open;
        let since = self.start_at.unwrap_or(self.joined_at).max(self.joined_at);
        is_open.then(|| since + TOURNAMENT_OPEN_TIME)
    }

    fn expire(&mut self) {
        if (self.open_until()).is_some_and(|until| until <= Instant::now()) {
            self.close();
        }
        if (self.paused_until()).is_some_and(|until| until <= Instant::now())
            && let Ok(Some(change)) = self.state.core.set_paused(false)
        {
            self.fold(change);
        }
    }

    /// Runs once the end of the tournament is committed: closes running rooms and notifies all
    /// participants. Later messages are answered from the committed state.
    async fn conclude(&mut self, mut inbox: mpsc::Receiver<Message>) {
        self.handle.close_rooms(&self.rooms);
        for (_, connection) in std::mem::take(&mut self.connections).into_values() {
            connection.call(Call::Over);
        }
        inbox.close();
        while let Some(message) = inbox.recv().await {
            if let Message::Enter(_, _, _, connection) = message {
                connection.call(Call::Over);
            }
        }
    }

    fn now_ms(&self) -> u64 {
        u64::try_from(self.clock.now().as_millis()).unwrap_or(u64::MAX)
    }

    async fn receive(&mut self, message: Message) -> Result<(), StoreError> {
        match message {
            Message::Join(entry, reply) => {
                let joined = self.join(entry);
                self.replies.push(Box::new(move || {
                    let _ = reply.send(joined);
                }));
            }
            Message::Begin(reply) => {
                let started = self.off_thread(|core| core.begin()).await?;
                let started = started.map(|changes| self.fold_all(changes));
                self.replies.push(Box::new(move || {
                    // The caller may have gone.
                    let _ = reply.send(started);
                }));
            }
            Message::ByHand(what, reply) => {
                let changed = self.change_by_hand(what);
                self.replies.push(Box::new(move || {
                    let _ = reply.send(changed);
                }));
            }
            Message::Close(reply) => {
                self.close();
                self.replies.push(Box::new(move || {
                    let _ = reply.send(());
                }));
            }
            Message::Enter(participant, ticket, number, connection) => {
                self.enter(participant, &ticket, number, connection);
            }
            Message::Left(participant, number) => self.left(participant, number),
        }
        Ok(())
    }

    fn join(&mut self, entry: Entry) -> Result<(usize, Token), JoinRefusal> {
        let token = self.handle.ticket_of(&entry);
        if let Some(answer) = self.state.joined_before(&entry, token) {
            return answer;
        }
        let change = self.state.core.join(entry.entrant())?;
        let participant = self.state.core.next_number();
        self.fold(change);
        self.joined_at = Instant::now();
        let ticket = token.hash();
        self.push(TournamentEntry::Ticket {
            participant,
            ticket,
        });
        Ok((participant, token))
    }

    /// Closes the tournament; the rooms of its games are closed once that is committed.
    fn close(&mut self) {
        if let Some(change) = self.state.core.close() {
            self.fold(change);
            self.without_room.clear();
        }
    }

    fn enter(
        &mut self,
        participant: usize,
        ticket: &SecretHash,
        number: u64,
        connection: Connection,
    ) {
        if !connection.outbox.is_open() {
            return;
        }
        if self.state.participant_of(ticket) != Some(participant) {
            // The ticket has ended meanwhile: somebody else may have the place.
            connection.call(Call::Over);
            return;
        }
        let holder = self.connections.get(&participant).map(|(held, _)| *held);
        if let Some(holder) = connection.supersedes.kept_by(holder) {
            connection.call(Call::HeldBy(holder));
            return;
        }
        if let Some((_, older)) = self.connections.remove(&participant) {
            older.call(Call::Superseded);
        }
        if self.handle.is_over() || self.state.core.is_withdrawn(participant) {
            connection.call(Call::Over);
            return;
        }
        // Set before it is called: only the newest stream may take a seat.
        self.set_connection(participant, Some(number));
        let mut rooms = self.rooms_of(participant).into_iter();
        let reached = rooms.all(|room| connection.call(Call::Seat(room)));
        self.connections.insert(participant, (number, connection));
        if !reached {
            self.disconnected(participant);
        }
    }

    pub(super) fn set_connection(&mut self, participant: usize, connection: Option<u64>) {
        self.state.set_connection(participant, connection);
        (self.handle.committed()).set_connection(participant, connection);
        self.has_changed = true;
    }

    fn left(&mut self, participant: usize, number: u64) {
        if (self.connections.get(&participant)).is_some_and(|(newest, _)| *newest == number) {
            self.disconnected(participant);
        }
    }

    /// Handles a participant whose stream is gone.
    pub(super) fn disconnected(&mut self, participant: usize) {
        self.connections.remove(&participant);
        self.set_connection(participant, None);
    }

    /// Rooms in which a participant has a seat now.
    fn rooms_of(&self, participant: usize) -> Vec<Id> {
        let state = &self.state;
        let games = state.core.playing().filter(|number| {
            let game = &state.core.games()[*number];
            !self.without_room.contains(number) && game.is_played_by(participant)
        });
        games
            .filter_map(|number| state.placed.get(&number).map(|(room, _)| *room))
            .collect()
    }

    /// Applies a change and adds it to the next commit.
    pub(super) fn fold(&mut self, change: Change) {
        let placed = match &change {
            Change::Called { game, .. } => Some(*game),
            _ => None,
        };
        match &change {
            Change::Rescheduled { game, .. }
            | Change::Counted { game, .. }
            | Change::Recalled { game }
            | Change::Voided { game } => {
                self.deals.extend(self.state.core.games()[*game].deal);
            }
            Change::Finished | Change::Closed => self.deals = self.state.deals(),
            Change::Paused => self.paused_at = Some(Instant::now()),
            _ => {}
        }
        self.push(TournamentEntry::Change(change));
        if let Some(game) = placed {
            self.place(game);
        }
    }

    /// Applies an entry and adds it to the next commit.
    pub(super) fn push(&mut self, entry: TournamentEntry) {
        self.state.apply(&entry);
        self.pending.push(entry);
    }

    pub(super) fn fold_all(&mut self, changes: Vec<Change>) {
        for change in changes {
            self.fold(change);
        }
    }

    /// Computes and commits everything that follows now. With `no_more_games` only pending entries
    /// are committed.
    async fn settle(&mut self, no_more_games: bool) -> Result<(), StoreError> {
        loop {
            if !no_more_games {
                self.read_ended_games().await?;
                self.advance().await?;
            }
            let has_entries = !self.pending.is_empty();
            if has_entries {
                let entries = std::mem::take(&mut self.pending);
                let store = self.rooms.store();
                let id = self.handle.id();
                let appended = store.append_tournament(id, self.rows, entries.clone());
                self.published(appended).await?;
                self.rows += 1;
                let before = self.handle.committed().core.state();
                self.handle.publish(&entries);
                self.announce(before);
            }
            for reply in self.replies.drain(..) {
                reply();
            }
            if has_entries {
                let deals = std::mem::take(&mut self.deals);
                self.handle.withhold(&deals, &self.rooms);
            }
            if !no_more_games {
                self.make_rooms().await?;
                self.retire_seats();
            }
            if std::mem::take(&mut self.has_changed) || has_entries {
                self.handle.changes.send_modify(|count| *count += 1);
            }
            if !has_entries && self.pending.is_empty() {
                return Ok(());
            }
        }
    }

    /// Announces that the tournament has started or is over, unless it was before.
    fn announce(&self, before: State) {
        let after = self.handle.committed().core.state();
        let (id, name) = (self.handle.id(), &self.handle.header.settings.name);
        let webhooks = self.rooms.webhooks();
        if before == State::Open && matches!(after, State::Playing | State::Finished) {
            let participants = self.handle.committed().core.participants().len();
            webhooks.tournament_started(id, name, participants);
        }
        let is_over = |state| matches!(state, State::Finished | State::Closed);
        if is_over(after) && !is_over(before) {
            webhooks.tournament_ended(id, name, after == State::Finished);
        }
    }

    /// Computes what follows now. A draw of a round runs on another thread.
    async fn advance(&mut self) -> Result<(), StoreError> {
        if self.is_due_to_start() {
            let begun = self.off_thread(|core| core.begin()).await?;
            self.fold_all(begun.unwrap_or_default());
        }
        let now_ms = self.now_ms();
        // If no game is running, a round may be due, which takes a while to draw.
        let core = &self.state.core;
        let may_draw = match core.state() {
            State::Open => core.settings().start_when_joined.is_some(),
            State::Playing => core.playing().next().is_none(),
            State::Finished | State::Closed => false,
        };
        if may_draw {
            let following = move |mut core: Tournament| {
                let mut changes = Vec::new();
                while let Some(change) = core.next(now_ms) {
                    core.fold(&change);
                    changes.push(change);
                }
                changes
            };
            let changes = self.off_thread(following).await?;
            self.fold_all(changes);
        }
        loop {
            let next = self.state.core.next(now_ms);
            let Some(change) = next else { return Ok(()) };
            self.fold(change);
        }
    }

    /// Runs `work` on the tournament's core, on a blocking thread. It cannot change meanwhile.
    async fn off_thread<T: Send + 'static>(
        &self,
        work: impl FnOnce(Tournament) -> T + Send + 'static,
    ) -> Result<T, StoreError> {
        let core = self.state.core.clone();
        let working = tokio::task::spawn_blocking(move || work(core));
        (working.await)
            .map_err(|error| StoreError::Failed(format!("drawing a round failed: {error}")))
    }
}

impl Drop for Task {
    fn drop(&mut self) {
        let state = self.handle.read(|core| core.state());
        info!(tournament = %self.handle.id(), ?state, "the tournament's task has ended");
    }
}
