//! The task of one tournament: what its entries bring about. `games` acts on games and their rooms.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use chefshat_tournament::{Change, SettingsProblem, State, Tournament};
use tokio::sync::mpsc;
use tokio::time::Instant;
use tracing::info;

use super::message::{Call, Connection, Entry, JoinRefusal, Message};
use super::state::{Common, TournamentShared, TournamentState};
use crate::config::MAX_TOURNAMENTS;
use crate::journaled::{Folded, Handle, Journaled, Unit, UnitHeader};
use crate::rooms::{Rooms, Withheld};
use chefshat_admission::limits::{Key, Refused};
use chefshat_base::clock::{RoomClock, TimeOfDay, millis};
use chefshat_base::tasks::LongTask;
use chefshat_room::ids::{self, RoomId, SecretHash, TournamentId, TournamentToken};
use chefshat_store::StoreError;
use chefshat_store::tournaments::{StoredTournament, TournamentEntry, TournamentHeader};
use chefshat_store::units::StoredUnit;
use chefshat_wire::convert::{self, TournamentPlan};
use chefshat_wire::outbox::StreamEnd;

/// Messages that may wait for one tournament.
const TOURNAMENT_MAILBOX: usize = 256;
/// How long a tournament stays open if nobody joins or starts it.
const TOURNAMENT_OPEN_TIME: Duration = Duration::from_secs(7 * 24 * 3_600);
/// How long a tournament stays paused.
pub(super) const TOURNAMENT_PAUSE: Duration = Duration::from_secs(7 * 24 * 3_600);

/// When it is worth trying again to create a tournament.
const RETRY_TOURNAMENTS: Duration = Duration::from_secs(60);
/// How often a tournament that waits for a time of day looks whether it has come: the clock may be
/// set meanwhile, or the machine sleep.
const CLOCK_CHECK: Duration = Duration::from_secs(60);

impl UnitHeader for TournamentHeader {
    type Kind = ids::Tournament;

    fn id(&self) -> TournamentId {
        self.id
    }

    fn owner(&self) -> &SecretHash {
        &self.owner
    }

    fn created_at_ms(&self) -> u64 {
        self.created_at_ms
    }

    fn join_code(&self) -> Option<&str> {
        Some(&self.join_code)
    }
}

/// Runs a tournament.
pub struct TournamentTask {
    pub(super) unit: Unit<Self>,
    /// Streams of participants, with their connection ids.
    pub(super) connections: BTreeMap<usize, (u64, Connection)>,
    /// Called games that have no room yet.
    pub(super) without_room: BTreeSet<usize>,
    /// Games whose rooms have existed since the server was started.
    pub(super) seen: BTreeSet<usize>,
    /// Deals whose remaining games must be checked.
    deals: BTreeSet<u32>,
    /// Number of participants who withdrew before the beginning, by who is charged for it, since the
    /// server was started. Bounded by the number of such withdrawals.
    pub(super) left_early: BTreeMap<Key, u32>,
    /// Participants whose seats in a game were given up, by game, since the server was started.
    pub(super) retired: BTreeSet<(usize, usize)>,
    /// When a participant last joined, or the server was started.
    joined_at: Instant,
    now: TimeOfDay,
    /// When it was paused, or the server was started.
    paused_at: Option<Instant>,
    /// Times of the core: a pause of the process makes no participant late.
    clock: RoomClock,
}

impl Journaled for TournamentTask {
    type Kind = ids::Tournament;
    type Header = TournamentHeader;
    type Plan = TournamentPlan;
    type State = TournamentState;
    type Entry = TournamentEntry;
    type Message = Message;
    type Shared = TournamentShared;
    type Common = Common;
    type SettingsProblem = SettingsProblem;

    const TASK: LongTask = LongTask::Tournament;
    const MAILBOX: usize = TOURNAMENT_MAILBOX;
    const MOST: usize = MAX_TOURNAMENTS;

    fn header_to_bytes(header: &TournamentHeader) -> Vec<u8> {
        header.to_bytes()
    }

    fn row_to_bytes(entries: &[TournamentEntry]) -> Vec<u8> {
        TournamentEntry::to_bytes(entries)
    }

    fn fold(id: TournamentId, stored: &StoredUnit) -> Result<Folded<Self>, String> {
        let stored = StoredTournament::decode(id, stored).map_err(|problem| problem.to_string())?;
        let plan = convert::tournament_plan(&stored.header.settings, [0; 32])
            .map_err(|problem| problem.to_string())?;
        let core = Tournament::new(plan.core.clone()).map_err(|problem| problem.to_string())?;
        let mut state = TournamentState::new(core);
        stored.entries.iter().for_each(|entry| state.apply(entry));
        Ok(Folded {
            header: stored.header,
            plan,
            state,
            rows: stored.rows,
        })
    }

    fn share(_: &Common, _: &Folded<Self>) -> TournamentShared {
        TournamentShared::default()
    }

    /// The deals that it would withhold are unknown.
    fn set_unreadable(id: TournamentId, rooms: &Rooms) {
        rooms.withhold(Withheld::Tournament(id), true);
    }

    fn key_of(id: TournamentId) -> Key {
        Key::Tournament(id)
    }

    fn too_many(limit: u64) -> Refused {
        Refused {
            reason: "TOO_MANY_TOURNAMENTS",
            what: "too many tournaments that are not over; close one, or try later",
            limit,
            retry_after: RETRY_TOURNAMENTS,
        }
    }

    fn apply(state: &mut TournamentState, entry: &TournamentEntry) {
        state.apply(entry);
    }

    fn is_over(state: &TournamentState) -> bool {
        state.core.state().is_over()
    }

    /// Withholds records that clients could request otherwise, and closes what still runs and is not
    /// needed.
    fn enter(handle: &Handle<Self>, rooms: &Arc<Rooms>) {
        let deals = handle.committed().deals();
        handle.withhold(&deals, rooms);
        handle.close_rooms(rooms);
    }

    fn new(unit: Unit<Self>, common: &Common) -> Self {
        let now = Instant::now();
        Self {
            now: common.now,
            connections: BTreeMap::new(),
            without_room: BTreeSet::new(),
            seen: BTreeSet::new(),
            deals: BTreeSet::new(),
            left_early: BTreeMap::new(),
            retired: BTreeSet::new(),
            joined_at: now,
            paused_at: unit.state.core.is_paused().then_some(now),
            clock: RoomClock::of_age(Duration::ZERO, unit.rooms.process_clock()),
            unit,
        }
    }

    fn unit(&self) -> &Unit<Self> {
        &self.unit
    }

    fn unit_mut(&mut self) -> &mut Unit<Self> {
        &mut self.unit
    }

    async fn receive(&mut self, message: Message) -> Result<(), StoreError> {
        match message {
            Message::Join(entry, reply) => {
                let joined = self.join(entry);
                self.unit.reply(reply, joined);
            }
            Message::Begin(reply) => {
                let started = self.off_thread(|core| core.begin()).await?;
                let started = started.map(|changes| self.fold_all(changes));
                self.unit.reply(reply, started);
            }
            Message::ByHand(what, reply) => {
                let changed = self.change_by_hand(what);
                self.unit.reply(reply, changed);
            }
            Message::Close(reply) => {
                self.close();
                self.unit.reply(reply, ());
            }
            Message::Enter(participant, ticket, number, connection) => {
                self.enter(participant, &ticket, number, connection);
            }
            Message::Left(participant, number) => self.left(participant, number),
        }
        Ok(())
    }

    async fn follow(&mut self) -> Result<(), StoreError> {
        self.expire();
        self.count_ended_games().await?;
        self.advance().await
    }

    /// Announces that the tournament has started or is over, and releases what is withheld no longer.
    fn announce(&mut self, entries: &[TournamentEntry]) {
        let handle = &self.unit.handle;
        let (id, name) = (handle.id(), &handle.header.settings.name);
        let webhooks = self.unit.rooms.webhooks();
        let state = self.unit.state.core.state();
        let has_begun = |entry| matches!(entry, &TournamentEntry::Change(Change::Begun { .. }));
        if state != State::Closed && entries.iter().any(has_begun) {
            let participants = self.unit.state.core.participants().len();
            webhooks.tournament_started(id, name, participants);
        }
        if entries.iter().any(TournamentEntry::is_end) {
            webhooks.tournament_ended(id, name, state == State::Finished);
        }
        let deals = std::mem::take(&mut self.deals);
        handle.withhold(&deals, &self.unit.rooms);
    }

    async fn act(&mut self) -> Result<(), StoreError> {
        self.make_rooms().await?;
        self.retire_seats();
        Ok(())
    }

    /// Closes running rooms and notifies all participants once the end is committed. Later messages
    /// are answered from the committed state.
    async fn conclude(&mut self, inbox: &mut mpsc::Receiver<Message>) -> Result<bool, StoreError> {
        if !self.unit.handle.is_over() {
            return Ok(false);
        }
        self.unit.handle.close_rooms(&self.unit.rooms);
        for (_, connection) in std::mem::take(&mut self.connections).into_values() {
            connection.call(Call::Over);
        }
        inbox.close();
        while let Some(message) = inbox.recv().await {
            if let Message::Enter(_, _, _, connection) = message {
                connection.call(Call::Over);
            }
        }
        Ok(true)
    }

    fn wake_at(&self) -> Option<Instant> {
        let core = self.unit.state.core.wake_at();
        let core = core.map(|ms| self.clock.instant(Duration::from_millis(ms)));
        let start = (self.unit.handle.plan.start_at_ms).map(|at_ms| self.look_at(at_ms));
        core.into_iter()
            .chain(self.unit.retry.at())
            .chain(self.open_until())
            .chain(start.filter(|_| self.unit.state.core.can_begin()))
            .chain(self.paused_until())
            .min()
    }

    /// It resumes here or at another node, which does not know the stream.
    fn abandon(&mut self, message: Message) {
        if let Message::Enter(_, _, _, connection) = message {
            connection.outbox.end(StreamEnd::RoomGone);
        }
    }

    fn end_streams(&mut self) {
        for (_, connection) in std::mem::take(&mut self.connections).into_values() {
            connection.outbox.end(StreamEnd::RoomGone);
        }
    }
}

impl TournamentTask {
    /// Whether it starts by itself now.
    fn is_due_to_start(&self) -> bool {
        let start_at_ms = self.unit.handle.plan.start_at_ms;
        let is_time = start_at_ms.is_some_and(|at_ms| at_ms <= (self.now)());
        is_time && self.unit.state.core.can_begin()
    }

    /// When it is to be looked whether this time of day has come, [`CLOCK_CHECK`] from now at most.
    fn look_at(&self, at_ms: u64) -> Instant {
        let left = Duration::from_millis(at_ms.saturating_sub((self.now)()));
        Instant::now() + left.min(CLOCK_CHECK)
    }

    /// When a paused tournament resumes by itself.
    fn paused_until(&self) -> Option<Instant> {
        let paused_at = self.paused_at.filter(|_| self.unit.state.core.is_paused());
        Some(paused_at? + TOURNAMENT_PAUSE)
    }

    /// When a tournament that nobody starts or joins is closed.
    fn open_until(&self) -> Option<Instant> {
        let is_open = self.unit.state.core.state() == State::Open;
        let start_at_ms = self.unit.handle.plan.start_at_ms;
        let by_start = start_at_ms
            .map(|at_ms| self.look_at(at_ms.saturating_add(millis(TOURNAMENT_OPEN_TIME))));
        let by_entry = self.joined_at + TOURNAMENT_OPEN_TIME;
        is_open.then(|| by_start.map_or(by_entry, |at| at.max(by_entry)))
    }

    /// Closes a tournament that nobody starts or joins, and resumes one that was paused for long.
    fn expire(&mut self) {
        if (self.open_until()).is_some_and(|until| until <= Instant::now()) {
            self.close();
        }
        if (self.paused_until()).is_some_and(|until| until <= Instant::now())
            && let Ok(Some(change)) = self.unit.state.core.set_paused(false)
        {
            self.fold(change);
        }
    }

    fn now_ms(&self) -> u64 {
        millis(self.clock.now())
    }

    fn join(&mut self, entry: Entry) -> Result<(usize, TournamentToken), JoinRefusal> {
        let token = self.unit.handle.ticket_of(&entry);
        if let Some(answer) = self.unit.state.joined_before(&entry, token) {
            return answer;
        }
        let change = self.unit.state.core.join(entry.entrant())?;
        let participant = self.unit.state.core.next_number();
        self.fold(change);
        self.joined_at = Instant::now();
        let ticket = token.hash();
        self.unit.push(TournamentEntry::Ticket {
            participant,
            ticket,
        });
        Ok((participant, token))
    }

    /// Closes the tournament; the rooms of its games are closed once that is committed.
    fn close(&mut self) {
        if let Some(change) = self.unit.state.core.close() {
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
        if self.unit.state.participant_of(ticket) != Some(participant) {
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
        if self.unit.handle.is_over() || self.unit.state.core.is_withdrawn(participant) {
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
        self.unit.state.set_connection(participant, connection);
        (self.unit.handle.committed()).set_connection(participant, connection);
        self.unit.has_changed = true;
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
    fn rooms_of(&self, participant: usize) -> Vec<RoomId> {
        let state = &self.unit.state;
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
                self.deals.extend(self.unit.state.core.games()[*game].deal);
            }
            Change::Finished | Change::Closed => self.deals = self.unit.state.deals(),
            Change::Paused => self.paused_at = Some(Instant::now()),
            _ => {}
        }
        self.unit.push(TournamentEntry::Change(change));
        if let Some(game) = placed {
            self.place(game);
        }
    }

    pub(super) fn fold_all(&mut self, changes: Vec<Change>) {
        for change in changes {
            self.fold(change);
        }
    }

    /// Adds what the core says comes next. A draw of a round runs on another thread.
    async fn advance(&mut self) -> Result<(), StoreError> {
        if self.is_due_to_start() {
            let begun = self.off_thread(|core| core.begin()).await?;
            self.fold_all(begun.unwrap_or_default());
        }
        let now_ms = self.now_ms();
        loop {
            if self.unit.state.core.is_draw_due() {
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
            let next = self.unit.state.core.next(now_ms);
            let Some(change) = next else { return Ok(()) };
            self.fold(change);
        }
    }

    /// Runs `work` on the tournament's core, on a blocking thread. It cannot change meanwhile.
    async fn off_thread<T: Send + 'static>(
        &self,
        work: impl FnOnce(Tournament) -> T + Send + 'static,
    ) -> Result<T, StoreError> {
        let core = self.unit.state.core.clone();
        let working = tokio::task::spawn_blocking(move || work(core));
        (working.await)
            .map_err(|error| StoreError::Failed(format!("drawing a round failed: {error}")))
    }
}

impl Drop for TournamentTask {
    fn drop(&mut self) {
        let handle = &self.unit.handle;
        let state = handle.read(Tournament::state);
        info!(tournament = %handle.id(), ?state, "the tournament's task has ended");
    }
}
