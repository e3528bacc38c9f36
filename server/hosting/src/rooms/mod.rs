//! The rooms of a server: finds them and shuts them down. `creation` creates and `restore` resumes
//! them, `unit` stops those that another node takes over.

mod creation;
mod restore;
mod table;
#[cfg(test)]
mod tests;
mod unit;

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Weak};
use std::time::Duration;

use chefshat_record::signature::PublicKey;
use rayon::ThreadPoolBuildError;
use tokio::sync::Notify;
use tokio::time::sleep;
use tokio_util::task::TaskTracker;

use crate::cluster::{Directory, NodeLease, SingleServer};
use crate::config::{DELETION_PAUSE, GAMES_DELETED_AT_ONCE, ServerConfig};
use crate::record_writer::RecordWriter;
use crate::room::{GameEnd, Handle, RoomWatcher, TaskContext};
use crate::signing::Signer;
use crate::webhooks::Webhooks;
use chefshat_admission::limits::{Background, FairSemaphore, Key, NotStored, Searches, Shares};
use chefshat_base::clock::ProcessClock;
use chefshat_base::lock::Lock;
use chefshat_base::metrics::Metrics;
use chefshat_room::ids::{GameId, RoomId, SeriesId, TournamentId, UnitId, normal_code};
use chefshat_room::journal::{GameHeader, TournamentGame};
use chefshat_store::samples::{Samples, Undeleted};
use chefshat_store::{Store, StoreError};
pub use creation::{Created, NewRoom, PartOf, Seating};
pub use table::CreateError;
use table::{Entry, LockedTable, Table};

/// How many join codes are tried for a room or tournament: another one of the cluster may have a code.
pub(crate) const CODES_TRIED: u32 = 3;

/// Games whose records are withheld.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Withheld {
    /// Those of a series.
    Series(SeriesId),
    /// All of a tournament.
    Tournament(TournamentId),
}

/// The rooms of a server.
pub struct Rooms {
    table: Lock<Table>,
    /// Series of games with the same deals that are not finished, and tournaments all of whose
    /// games are withheld.
    closed: Lock<BTreeSet<Withheld>>,
    /// Notified when a game has ended or a room is gone.
    changed: Notify,
    /// Notified when the creation of a room has ended.
    created: Notify,
    /// Number of deletions since the server was started, of participants' data or of old games.
    forgotten: AtomicU64,
    context: TaskContext,
    /// Where the rooms and tournaments of other nodes are.
    directory: Arc<dyn Directory>,
    max_rooms: usize,
    places: Arc<FairSemaphore>,
    shares: Shares,
    samples: Arc<Samples>,
}

impl Rooms {
    /// Creates an empty set, of a server that has no peers.
    ///
    /// # Errors
    /// The operating system cannot start the threads for games of built-in agents or their searches.
    pub fn new(
        config: &ServerConfig,
        store: Arc<dyn Store>,
        tracker: TaskTracker,
    ) -> Result<Arc<Self>, ThreadPoolBuildError> {
        Self::of_node(config, store, Arc::new(SingleServer), None, tracker)
    }

    /// Creates an empty set with the default settings, for tests.
    #[cfg(test)]
    pub(crate) fn for_tests(store: Arc<dyn Store>) -> Arc<Self> {
        let config = ServerConfig::default();
        Self::new(&config, store, TaskTracker::new()).expect("threads")
    }

    /// Creates an empty set, of a node of a cluster. `directory` knows the other nodes' rooms. If
    /// rooms can be taken over by other nodes, they publish while `lease` holds.
    ///
    /// # Errors
    /// See [`Rooms::new`].
    pub fn of_node(
        config: &ServerConfig,
        store: Arc<dyn Store>,
        directory: Arc<dyn Directory>,
        lease: Option<Arc<NodeLease>>,
        tracker: TaskTracker,
    ) -> Result<Arc<Self>, ThreadPoolBuildError> {
        // The database of a cluster has all records.
        let record_dir = config.data_dir.clone().filter(|_| lease.is_none());
        let samples = Arc::new(Samples::new(record_dir.clone()));
        let metrics = Arc::new(Metrics::default());
        if let Some(store) = store.metrics() {
            metrics.add_store(store);
        }
        let background = Background::new(config.shares, config.built_in_decisions_per_second)?;
        let background = Arc::new(background);
        let searches = Arc::new(Searches::new(Arc::clone(&metrics))?);
        let webhooks = (config.webhooks.clone())
            .map(|settings| Webhooks::new(settings, Arc::clone(&metrics)))
            .unwrap_or_default();
        Ok(Arc::new_cyclic(|rooms: &Weak<Self>| Self {
            table: Lock::default(),
            closed: Lock::default(),
            changed: Notify::new(),
            created: Notify::new(),
            forgotten: AtomicU64::new(0),
            context: TaskContext {
                record_writer: RecordWriter::new(
                    Arc::clone(&store),
                    record_dir,
                    tracker.clone(),
                    Arc::clone(&background),
                ),
                store,
                signer: Signer::new(config.signing_key.clone()),
                retention: config.retention,
                connections: Arc::new(AtomicU64::new(1)),
                tracker,
                metrics,
                watcher: Arc::new(Watcher(Weak::clone(rooms))),
                background,
                searches,
                lease,
                webhooks,
                owner: Key::Resumed,
                creator: None,
                stored: Arc::default(),
                shares: config.shares,
                process_clock: Arc::default(),
            },
            directory,
            max_rooms: config.max_rooms,
            places: FairSemaphore::new(config.max_rooms, config.shares),
            shares: config.shares,
            samples,
        }))
    }

    /// Most rooms that wait or play at a time.
    pub fn max_rooms(&self) -> usize {
        self.max_rooms
    }

    /// Charges a caller for something of this size that is stored, but that no game needs.
    ///
    /// # Errors
    /// It must not be stored.
    pub fn may_store(&self, key: Key, bytes: usize) -> Result<(), NotStored> {
        self.context.may_store(key, bytes)
    }

    /// Deletes finished games from the store, with the samples of their seats. Those whose samples the
    /// file system keeps stay, and are returned: doing it again completes it.
    ///
    /// # Errors
    /// The store failed; doing it again completes it.
    pub async fn delete_games(&self, mut games: Vec<GameId>) -> Result<Undeleted, StoreError> {
        let undeleted = self.delete_samples(&games).await?;
        games.retain(|game| !undeleted.contains_key(game));
        for (number, games) in games.chunks(GAMES_DELETED_AT_ONCE).enumerate() {
            if number > 0 {
                sleep(DELETION_PAUSE).await;
            }
            self.context.store.delete(games.to_vec()).await?;
        }
        Ok(undeleted)
    }

    /// Deletes those of these finished games that no tournament or study needs, and then the samples
    /// of their seats. Returns them, and those of which the file system keeps some.
    ///
    /// # Errors
    /// The store failed; doing it again completes it.
    pub async fn prune_games(
        &self,
        games: Vec<GameId>,
    ) -> Result<(Vec<GameId>, Undeleted), StoreError> {
        let deleted = self.context.store.prune(games).await?;
        let undeleted = self.delete_samples(&deleted).await?;
        Ok((deleted, undeleted))
    }

    async fn delete_samples(&self, games: &[GameId]) -> Result<Undeleted, StoreError> {
        let deleting = self.samples.delete(games.to_vec()).await;
        deleting.map_err(|error| StoreError::Failed(format!("deleting samples: {error}")))
    }

    /// The samples of seats.
    pub fn samples(&self) -> &Arc<Samples> {
        &self.samples
    }

    /// What announces rooms, games and tournaments.
    pub fn webhooks(&self) -> &Webhooks {
        &self.context.webhooks
    }

    /// What signs records.
    pub fn signer(&self) -> &Signer {
        &self.context.signer
    }

    /// The public key that signs records, if the server has one.
    pub fn signing_key(&self) -> Option<PublicKey> {
        self.context.signer.public()
    }

    /// The room with this id.
    pub fn get(&self, id: RoomId) -> Option<Handle> {
        self.by_unit(id.unit())
    }

    /// The room with this id, if it is one.
    pub fn by_unit(&self, id: UnitId) -> Option<Handle> {
        Some(self.lock().by_unit(id)?.handle.clone())
    }

    /// The room with this join code.
    pub fn by_code(&self, code: &str) -> Option<Handle> {
        let table = self.lock();
        let number = table.codes.get(&normal_code(code))?;
        table
            .by_number
            .get(number)
            .map(|entry| entry.handle.clone())
    }

    /// The newest `count` rooms, only those created before number `before` if set, with their
    /// numbers, newest first: those whose games are over, those whose are not, or all.
    pub fn newest(
        &self,
        before: Option<u64>,
        over: Option<bool>,
        count: usize,
    ) -> Vec<(u64, Handle)> {
        self.lock()
            .by_number
            .range(..before.unwrap_or(u64::MAX))
            .rev()
            .filter(|(_, entry)| entry.listed && over.is_none_or(|over| entry.over == over))
            .take(count)
            .map(|(number, entry)| (*number, entry.handle.clone()))
            .collect()
    }

    /// All rooms whose games are over, or all whose are not and that are not suspended.
    pub fn all(&self, over: bool) -> Vec<Handle> {
        let table = self.lock();
        let wanted = |entry: &&Entry| entry.over == over && (over || !entry.suspended);
        (table.by_number.values().filter(wanted))
            .map(|entry| entry.handle.clone())
            .collect()
    }

    /// What was fixed about the game of a room before it started.
    pub fn header(&self, id: RoomId) -> Option<Arc<GameHeader>> {
        Some(Arc::clone(&self.lock().get(id)?.header))
    }

    /// The room in which a game is running or waiting to start.
    pub fn room_of(&self, game: GameId) -> Option<RoomId> {
        Some(self.lock().of_game(game)?.handle.id())
    }

    /// Whether a game is running or waiting to start here.
    pub fn is_running(&self, game: GameId) -> bool {
        self.room_of(game).is_some()
    }

    /// Whether a game of a unit is not over: its room plays, or has stopped and will be resumed, in a
    /// cluster perhaps by another node.
    pub(crate) fn is_unfinished(&self, id: RoomId) -> bool {
        let table = self.lock();
        table
            .get(id)
            .is_some_and(|entry| !entry.over && entry.end.is_none())
    }

    /// Whether the game of a room is over; `None` if the room is unknown or suspended.
    pub fn is_over(&self, id: RoomId) -> Option<bool> {
        let table = self.lock();
        let entry = table.get(id)?;
        (!entry.suspended).then_some(entry.over)
    }

    /// Removes a room whose game is over: it shows a participant whose data are deleted.
    pub fn forget(&self, id: RoomId) {
        let mut table = self.lock();
        let over = table.get(id).is_some_and(|entry| entry.over);
        if let Some(number) = table.number_of(id).filter(|_| over) {
            table.remove(number);
        }
    }

    /// How the game of a room has ended, if it did so since the server was started.
    pub(crate) fn end_of(&self, id: RoomId) -> Option<GameEnd> {
        self.lock().get(id)?.end.clone()
    }

    /// Returns what is notified when a game of a unit has ended or a room of it has stopped, until
    /// [`Rooms::stop_notifying`]. It keeps a notification until somebody waits.
    pub(crate) fn notify_of_games(&self, unit: UnitId) -> Arc<Notify> {
        let waiting = Arc::default();
        (self.lock().waiting).insert(unit, Arc::clone(&waiting));
        waiting
    }

    /// Ends [`Rooms::notify_of_games`], unless another task of the unit waits by now.
    pub(crate) fn stop_notifying(&self, unit: UnitId, waiting: &Arc<Notify>) {
        let mut table = self.lock();
        let own = (table.waiting.get(&unit)).is_some_and(|it| Arc::ptr_eq(it, waiting));
        if own {
            table.waiting.remove(&unit);
        }
    }

    /// Whether a task is notified of the games of a unit.
    #[cfg(test)]
    pub(crate) fn notifies(&self, unit: UnitId) -> bool {
        self.lock().waiting.contains_key(&unit)
    }

    /// Number of deletions, of participants' data or of old games: what was computed before shows
    /// them.
    pub fn forgotten(&self) -> u64 {
        self.forgotten.load(Ordering::Acquire)
    }

    /// Counts a deletion of a participant's data or of old games.
    pub fn count_forgotten(&self) {
        self.forgotten.fetch_add(1, Ordering::AcqRel);
    }

    /// Withholds the records of a series, or of all games of a tournament, or releases them once
    /// all have ended.
    pub fn withhold(&self, games: Withheld, withheld: bool) {
        let mut closed = self.closed.lock();
        if withheld {
            closed.insert(games);
        } else {
            closed.remove(&games);
        }
    }

    /// Whether the record of a game is withheld.
    pub fn is_withheld(&self, game: TournamentGame) -> bool {
        let closed = self.closed.lock();
        let series = game.series.map(Withheld::Series);
        closed.contains(&Withheld::Tournament(game.tournament))
            || series.is_some_and(|series| closed.contains(&series))
    }

    /// Number of rooms in which a game is running or waiting to start.
    pub fn open_count(&self) -> usize {
        self.lock().open_count()
    }

    /// What lets this node publish; `None` in a single server.
    pub fn lease(&self) -> Option<&Arc<NodeLease>> {
        self.context.lease.as_ref()
    }

    /// Accepts no new rooms from here on.
    pub fn refuse_new(&self) {
        self.lock().shutting_down = true;
    }

    /// Whether the server accepts no new rooms.
    pub fn is_shutting_down(&self) -> bool {
        self.lock().shutting_down
    }

    /// Whether this server, if it is a node, has been reached since it joined. Until then it accepts
    /// nothing new.
    pub(crate) fn is_reached(&self) -> bool {
        self.lease().is_none_or(|lease| lease.is_reached())
    }

    /// Where the rooms and tournaments of other nodes are.
    pub fn directory(&self) -> &Arc<dyn Directory> {
        &self.directory
    }

    /// The store of games.
    pub fn store(&self) -> &Arc<dyn Store> {
        &self.context.store
    }

    /// What the server counts.
    pub fn metrics(&self) -> &Arc<Metrics> {
        &self.context.metrics
    }

    /// The time that the process has run, by which all times of participants are measured.
    pub fn process_clock(&self) -> &Arc<ProcessClock> {
        &self.context.process_clock
    }

    /// Number of messages in the mailbox of each room.
    pub fn mailbox_depths(&self) -> Vec<usize> {
        let table = self.lock();
        let handles = table.by_number.values().map(|entry| &entry.handle);
        handles.map(Handle::mailbox_depth).collect()
    }

    /// How much of each limit one caller may use.
    pub fn shares(&self) -> Shares {
        self.shares
    }

    /// Plays the games of built-in agents, and does other work that nobody waits for.
    pub fn background(&self) -> &Arc<Background> {
        &self.context.background
    }

    /// Writes records to files.
    pub fn record_writer(&self) -> &RecordWriter {
        &self.context.record_writer
    }

    /// Accepts no new rooms and lets running games continue for `grace`. The remaining ones are
    /// then suspended until the server is restarted, or aborted if they cannot resume. Returns when
    /// no game is open any more.
    pub async fn shut_down(&self, grace: Duration) {
        self.refuse_new();
        let mut playing = Vec::new();
        for (handle, durable) in self.open() {
            let waits = match handle.describe().await {
                Ok(room) => room.state() == chefshat_proto::v1::RoomState::Waiting,
                Err(_) => continue,
            };
            // Games that have not started are not waited for. Ephemeral ones are aborted at once;
            // agents of durable ones stay connected as long as the server runs.
            match (waits, durable) {
                (false, _) => playing.push(handle.id()),
                (true, false) => handle.end(durable).await,
                (true, true) => {}
            }
        }
        // Both waits end: within the grace, or because every room obeys.
        let over = async {
            for room in playing {
                self.until_ended(room).await;
            }
        };
        let _ = tokio::time::timeout(grace, over).await;
        // Ephemeral games first: suspending a room ends streams on which other seats may still
        // receive the end of theirs.
        for durable in [false, true] {
            let mut open = self.open();
            open.retain(|(_, it)| *it == durable);
            for (handle, durable) in &open {
                handle.end(*durable).await;
            }
            for (handle, _) in &open {
                self.until_ended(handle.id()).await;
            }
        }
        // Dropping the handles ends the rooms that still show their games, and the tracker's tasks
        // with them.
        self.lock().remove_over();
    }

    /// The rooms whose games are not over, and whether they are durable.
    fn open(&self) -> Vec<(Handle, bool)> {
        (self.lock().by_number.values())
            .filter(|entry| entry.is_open())
            .map(|entry| (entry.handle.clone(), entry.durable))
            .collect()
    }

    /// Waits until a room is not open any more.
    async fn until_ended(&self, room: RoomId) {
        self.until(|table| !table.get(room).is_some_and(Entry::is_open))
            .await;
    }

    /// Waits until the table meets a condition.
    async fn until(&self, wanted: impl Fn(&Table) -> bool) {
        loop {
            let changed = self.changed.notified();
            if wanted(&self.lock()) {
                return;
            }
            changed.await;
        }
    }

    fn lock(&self) -> LockedTable<'_> {
        LockedTable::new(&self.table)
    }
}

impl std::fmt::Debug for Rooms {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Rooms").finish_non_exhaustive()
    }
}

struct Watcher(Weak<Rooms>);

impl RoomWatcher for Watcher {
    fn game_over(&self, room: RoomId, end: GameEnd) {
        self.change(room, |table, number| {
            table.end(number, |entry| {
                entry.over = true;
                entry.end = Some(end);
                entry.place = None;
            })
        });
    }

    fn gone(&self, room: RoomId, has_failed: bool) {
        self.change(room, |table, number| {
            if table.by_number[&number].over {
                table.remove(number);
                return None;
            }
            table.end(number, |entry| {
                entry.suspended = true;
                if has_failed {
                    entry.end = Some(GameEnd::Failed);
                    entry.place = None;
                }
            })
        });
    }
}

impl Watcher {
    /// Changes what the table says of a room. `change` returns whom to notify besides those who wait
    /// for any change, once the table is unlocked.
    fn change(&self, room: RoomId, change: impl FnOnce(&mut Table, u64) -> Option<Arc<Notify>>) {
        let Some(rooms) = self.0.upgrade() else {
            return;
        };
        let waiting = {
            let mut table = rooms.lock();
            let number = table.number_of(room);
            number.and_then(|number| change(&mut table, number))
        };
        rooms.changed.notify_waiters();
        if let Some(waiting) = waiting {
            waiting.notify_one();
        }
    }
}
