//! All rooms of a server: making them, finding them, closing them down.

use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, MutexGuard, Weak};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use chefshat_engine::RuleSet;
use chefshat_records::seeds::SeedPlan;
use tokio::sync::Notify;
use tokio_util::task::TaskTracker;

use crate::config::ServerConfig;
use crate::ids::{Id, Token, join_code, normal_code, random_bytes};
use crate::room::policy::Policy;
use crate::room::{Handle, RoomWatcher, TaskContext, start};
use crate::store::journal::{AbortReason, Fill, GameHeader};
use crate::store::{KeptGame, Store, StoreError};

/// What a new room is to be.
#[derive(Debug)]
pub struct NewRoom {
    /// Name to show.
    pub name: String,
    /// The rules.
    pub rules: RuleSet,
    /// The policy.
    pub policy: Policy,
    /// What fills each seat.
    pub fills: Vec<Fill>,
    /// The game seed, if its creator fixes it.
    pub game_seed: Option<[u8; 32]>,
}

/// A room that was made, with its secrets.
#[derive(Debug)]
pub struct Created {
    /// How to reach it.
    pub handle: Handle,
    /// The join code.
    pub join_code: String,
    /// The owner's token.
    pub owner: Token,
}

/// Why no room was made.
#[derive(Debug, thiserror::Error)]
pub enum CreateError {
    /// The limit of rooms is reached.
    #[error("the server holds {0} rooms already; close one or try later")]
    TooMany(usize),
    /// The server takes no new rooms.
    #[error("the server is shutting down and takes no new rooms")]
    ShuttingDown,
    /// The store refused.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// The rooms of a server.
pub struct Rooms {
    table: Mutex<Table>,
    /// Notified when a game has ended or a room has gone.
    changed: Notify,
    context: TaskContext,
    max_rooms: usize,
}

#[derive(Default)]
struct Table {
    next_number: u64,
    /// In the order in which they were made.
    by_number: BTreeMap<u64, Entry>,
    numbers: HashMap<Id, u64>,
    codes: HashMap<String, u64>,
    shutting_down: bool,
}

struct Entry {
    handle: Handle,
    game_id: Id,
    join_code: String,
    over: bool,
}

impl Rooms {
    /// No rooms yet.
    pub fn new(config: &ServerConfig, store: Arc<dyn Store>, tracker: TaskTracker) -> Arc<Self> {
        Arc::new_cyclic(|rooms: &Weak<Self>| Self {
            table: Mutex::default(),
            changed: Notify::new(),
            context: TaskContext {
                store,
                data_dir: config.data_dir.clone(),
                retention: config.retention,
                connections: Arc::new(AtomicU64::new(1)),
                tracker,
                watcher: Arc::new(Watcher(Weak::clone(rooms))),
            },
            max_rooms: config.max_rooms,
        })
    }

    /// Makes a room.
    ///
    /// # Errors
    /// The limit of rooms, a shutdown, or the store.
    pub async fn create(&self, new: NewRoom) -> Result<Created, CreateError> {
        self.lock().check_may_create(self.max_rooms)?;
        let room_id = Id::random();
        let owner = Token::random(room_id);
        let header = Arc::new(GameHeader {
            room_id,
            game_id: Id::random(),
            name: new.name,
            rules: new.rules,
            policy: new.policy,
            fills: new.fills,
            seed: match new.game_seed {
                Some(game_seed) => SeedPlan::Fixed { game_seed },
                None => SeedPlan::Committed {
                    server_seed: random_bytes(),
                    nonce: random_bytes(),
                },
            },
            created_at_ms: since_epoch_ms(),
            join_code: join_code(),
            owner: owner.hash(),
        });
        let journal = self.context.store.create(Arc::clone(&header)).await?;
        let join_code = header.join_code.clone();
        // Checked and entered under one lock, so that a shutdown cannot slip in between and miss the room.
        let mut table = self.lock();
        table.check_may_create(self.max_rooms)?;
        table.make_space(self.max_rooms);
        let game_id = header.game_id;
        let handle = start(header, journal, self.context.clone());
        let number = table.next_number;
        table.next_number += 1;
        table.numbers.insert(room_id, number);
        table.codes.insert(join_code.clone(), number);
        table.by_number.insert(
            number,
            Entry {
                handle: handle.clone(),
                game_id,
                join_code: join_code.clone(),
                over: false,
            },
        );
        Ok(Created {
            handle,
            join_code,
            owner,
        })
    }

    /// A room by its id.
    pub fn get(&self, id: Id) -> Option<Handle> {
        let table = self.lock();
        let number = table.numbers.get(&id)?;
        table
            .by_number
            .get(number)
            .map(|entry| entry.handle.clone())
    }

    /// A room by its join code.
    pub fn by_code(&self, code: &str) -> Option<Handle> {
        let table = self.lock();
        let number = table.codes.get(&normal_code(code))?;
        table
            .by_number
            .get(number)
            .map(|entry| entry.handle.clone())
    }

    /// Whether `code` is the join code of a room.
    pub fn code_is(&self, id: Id, code: &str) -> bool {
        self.by_code(code).is_some_and(|handle| handle.id() == id)
    }

    /// At most `count` rooms made after the one numbered `after`, with their numbers.
    pub fn list(&self, after: Option<u64>, count: usize) -> Vec<(u64, Handle)> {
        let first = after.map_or(0, |number| number.saturating_add(1));
        self.lock()
            .by_number
            .range(first..)
            .take(count)
            .map(|(number, entry)| (*number, entry.handle.clone()))
            .collect()
    }

    /// Whether a game is being played or awaited here.
    pub fn is_running(&self, game: Id) -> bool {
        self.lock()
            .by_number
            .values()
            .any(|entry| entry.game_id == game && !entry.over)
    }

    /// Rooms in which a game is being played or awaited.
    pub fn open_count(&self) -> usize {
        self.lock()
            .by_number
            .values()
            .filter(|entry| !entry.over)
            .count()
    }

    /// Whether the server takes no new rooms.
    pub fn is_shutting_down(&self) -> bool {
        self.lock().shutting_down
    }

    /// A finished game from the store.
    ///
    /// # Errors
    /// The store's.
    pub async fn finished(&self, game: Id) -> Result<Option<KeptGame>, StoreError> {
        self.context.store.finished(game).await
    }

    /// Takes no new rooms, lets running games go on for `grace`, then aborts what is left. Returns when no game is open any more.
    pub async fn shut_down(&self, grace: Duration) {
        let waiting: Vec<Handle> = {
            let mut table = self.lock();
            table.shutting_down = true;
            table
                .by_number
                .values()
                .filter(|entry| !entry.over)
                .map(|entry| entry.handle.clone())
                .collect()
        };
        for handle in waiting {
            // A game that has not begun will not begin any more.
            if let Ok(room) = handle.describe().await
                && room.state() == chefshat_proto::v1::RoomState::Waiting
            {
                handle.abort(AbortReason::Shutdown).await;
            }
        }
        // Both waits end: within the grace, or because every room answers its abort.
        let _ = tokio::time::timeout(grace, self.none_open()).await;
        let running: Vec<Handle> = self
            .lock()
            .by_number
            .values()
            .filter(|entry| !entry.over)
            .map(|entry| entry.handle.clone())
            .collect();
        for handle in running {
            handle.abort(AbortReason::Shutdown).await;
        }
        self.none_open().await;
        // With their handles gone, the rooms end and the tracker's tasks with them.
        let mut table = self.lock();
        table.by_number.clear();
        table.numbers.clear();
        table.codes.clear();
    }

    async fn none_open(&self) {
        loop {
            let changed = self.changed.notified();
            if self.open_count() == 0 {
                return;
            }
            changed.await;
        }
    }

    fn lock(&self) -> MutexGuard<'_, Table> {
        self.table
            .lock()
            .expect("nothing that holds this lock can panic")
    }
}

impl std::fmt::Debug for Rooms {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Rooms").finish_non_exhaustive()
    }
}

impl Table {
    fn check_may_create(&self, max_rooms: usize) -> Result<(), CreateError> {
        if self.shutting_down {
            return Err(CreateError::ShuttingDown);
        }
        let full = self.by_number.len() >= max_rooms;
        if full && !self.by_number.values().any(|entry| entry.over) {
            return Err(CreateError::TooMany(max_rooms));
        }
        Ok(())
    }

    /// Ended rooms are shown only as long as there is space for them.
    fn make_space(&mut self, max_rooms: usize) {
        while self.by_number.len() >= max_rooms
            && let Some(number) = self
                .by_number
                .iter()
                .find(|(_, entry)| entry.over)
                .map(|(number, _)| *number)
        {
            self.remove(number);
        }
    }

    fn remove(&mut self, number: u64) {
        if let Some(entry) = self.by_number.remove(&number) {
            self.numbers.remove(&entry.handle.id());
            self.codes.remove(&entry.join_code);
        }
    }
}

struct Watcher(Weak<Rooms>);

impl RoomWatcher for Watcher {
    fn game_over(&self, room: Id) {
        if let Some(rooms) = self.0.upgrade() {
            let mut table = rooms.lock();
            if let Some(number) = table.numbers.get(&room).copied()
                && let Some(entry) = table.by_number.get_mut(&number)
            {
                entry.over = true;
            }
            drop(table);
            rooms.changed.notify_waiters();
        }
    }

    fn gone(&self, room: Id) {
        if let Some(rooms) = self.0.upgrade() {
            let mut table = rooms.lock();
            if let Some(number) = table.numbers.get(&room).copied() {
                table.remove(number);
            }
            drop(table);
            rooms.changed.notify_waiters();
        }
    }
}

fn since_epoch_ms() -> u64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |time| {
            u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
        })
}
