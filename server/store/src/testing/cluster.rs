//! A database of a cluster in memory, made from the reference of the core, and the store of each
//! node on it. A node can be cut off from it, or its beats alone.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use async_trait::async_trait;
use chefshat_cluster::{Created, LeaseTimes, Load, Tables, Written};
use chefshat_proto::v1;
use chefshat_room::ids::{GameId, RoomId, StudyId, UnitId};
use chefshat_room::journal::{Change, Entry, GameHeader};
use chefshat_room::policy::Durability;
use futures::future::pending;
use tokio::sync::{Mutex as AsyncMutex, broadcast, watch};
use tokio::time::{Instant, sleep};

use crate::cluster::{
    Beat, ClusterStore, Epoch, Heartbeat, LivingNode, LoadedUnit, Location, NodeId, NodeInfo,
    NodeStatus, Subject,
};
use crate::form;
use crate::units::{StoredTraces, StoredUnit, UnitKey, UnitKind, UnitWrite};
use crate::{Journal, Listed, MemoryStore, Part, ResumableGame, Store, StoreError, StoredGame};

/// Encoded entries.
#[derive(Clone, PartialEq)]
enum Row {
    Game(Vec<u8>),
    /// Of a tournament.
    Unit(Vec<u8>),
}

impl Row {
    fn of_game(entries: &[Entry]) -> Self {
        Self::Game(form::entries_to_bytes(&mut entries.to_vec()))
    }

    /// The entries of a game.
    fn entries(&self) -> Vec<Entry> {
        let mut entries = Vec::new();
        if let Self::Game(bytes) = self {
            form::read_entries(bytes, &mut entries).expect("it was encoded here");
        }
        entries
    }
}

/// A unit that a node has released.
#[derive(Clone, Copy)]
struct Released {
    by: NodeId,
    unit: (UnitId, Epoch),
    next: Option<NodeId>,
}

/// What all nodes share.
pub struct Database {
    began: Instant,
    tables: Mutex<Tables<UnitId, Row>>,
    games: Mutex<BTreeMap<UnitId, Arc<GameHeader>>>,
    /// The tournaments with their headers.
    tournaments: Mutex<BTreeMap<UnitId, (UnitKey, Vec<u8>)>>,
    /// With what each has said last.
    nodes: Mutex<BTreeMap<NodeId, (NodeInfo, Heartbeat)>>,
    drain: Mutex<Option<NodeId>>,
    /// Units that nodes have released, for the next owner if one is named, otherwise for all others.
    released: broadcast::Sender<Released>,
    finished: Arc<MemoryStore>,
}

impl Database {
    /// An empty one.
    pub fn new() -> Arc<Self> {
        Arc::new(Self {
            began: Instant::now(),
            tables: Mutex::new(Tables::new(LeaseTimes::DEFAULT)),
            games: Mutex::default(),
            tournaments: Mutex::default(),
            nodes: Mutex::default(),
            drain: Mutex::default(),
            released: broadcast::Sender::new(64),
            finished: Arc::default(),
        })
    }

    fn now_ms(&self) -> u64 {
        u64::try_from(self.began.elapsed().as_millis()).expect("not that long")
    }

    fn orphans(&self) -> Vec<(UnitId, Epoch)> {
        self.tables().orphans(self.now_ms(), usize::MAX)
    }

    fn is_ephemeral(&self, id: UnitId) -> bool {
        let games = self.games.lock().expect("no test panics here");
        let header = games.get(&id);
        header.is_some_and(|it| it.policy.durability == Durability::Ephemeral)
    }

    /// Makes a room one of another version of the rules.
    pub fn make_foreign(&self, room: RoomId) {
        let mut games = self.games.lock().expect("no test panics here");
        let header = games.get_mut(&room.unit()).expect("it exists");
        Arc::make_mut(header).rules_version += 1;
    }

    /// Makes a room one of this version again.
    pub fn make_native(&self, room: RoomId) {
        let mut games = self.games.lock().expect("no test panics here");
        let header = games.get_mut(&room.unit()).expect("it exists");
        Arc::make_mut(header).rules_version -= 1;
    }

    fn tables(&self) -> MutexGuard<'_, Tables<UnitId, Row>> {
        self.tables.lock().expect("no test panics here")
    }

    /// The owner of a unit.
    pub fn owner(&self, unit: impl Into<UnitId>) -> Option<NodeId> {
        self.tables().owner(unit.into())
    }

    /// Gives a unit to another node although its owner has a lease.
    pub fn take_away(&self, unit: impl Into<UnitId>, node: NodeId) {
        let unit = unit.into();
        let mut tables = self.tables();
        let epoch = tables.epoch(unit).expect("it exists");
        tables.release(unit, epoch);
        let now_ms = self.now_ms();
        (tables.claim(unit, epoch, node, now_ms, |_| None)).expect("it was released");
    }

    /// Removes the nodes whose leases have expired, once they own nothing.
    pub fn remove_expired(&self) {
        self.tables().remove_expired(self.now_ms());
    }

    /// Asks a node to hand over what it owns, with its next beat.
    pub fn ask_to_drain(&self, node: NodeId) {
        *self.drain.lock().expect("no test panics here") = Some(node);
    }

    /// Whether a node has joined and has not left.
    pub fn knows(&self, node: NodeId) -> bool {
        self.tables().last_beat(node).is_some()
    }

    /// The names of those seated by the journal of a room, in order.
    pub fn seated(&self, room: RoomId) -> Vec<String> {
        let tables = self.tables();
        let rows = tables.journal(room.unit()).iter();
        let entries = rows.flat_map(|row| row.entries.entries());
        let names = entries.filter_map(|entry| match entry.change {
            Change::Seated { participant, .. } => Some(participant.name),
            _ => None,
        });
        names.collect()
    }
}

/// The store of one node.
pub struct FakeStore {
    database: Arc<Database>,
    node: Mutex<NodeId>,
    /// The epochs of the tournaments of this node.
    epochs: Mutex<BTreeMap<UnitId, Epoch>>,
    /// Whether the database cannot be reached.
    pub cut_off: watch::Sender<bool>,
    /// Whether beats do not reach it.
    pub beats_lost: watch::Sender<bool>,
    /// How many of the next beats are never answered.
    pub beats_unanswered: watch::Sender<u32>,
    /// How often a unit was read.
    pub loads: watch::Sender<u32>,
    /// Whether reading a unit takes until this is over.
    pub loads_held: watch::Sender<bool>,
    /// Whether new rooms are written but no answer comes.
    pub creations_unanswered: watch::Sender<bool>,
    /// Whether the ends of games are written but no answer comes.
    pub ends_unanswered: watch::Sender<bool>,
    /// How often the end of a game was read.
    pub ends_read: watch::Sender<u32>,
    /// Whether reading the end of a game fails.
    pub ends_unreadable: watch::Sender<bool>,
    /// The next request of this kind to the database panics.
    pub panics_at: watch::Sender<&'static str>,
    /// The join codes of new rooms that are refused, until as many have been tried.
    pub codes_taken: Mutex<(usize, Vec<String>)>,
    released: AsyncMutex<broadcast::Receiver<Released>>,
}

impl FakeStore {
    /// The store of a new node.
    pub fn new(database: &Arc<Database>) -> Arc<Self> {
        Arc::new(Self {
            database: Arc::clone(database),
            node: Mutex::new(NodeId(0)),
            epochs: Mutex::default(),
            cut_off: watch::Sender::new(false),
            beats_lost: watch::Sender::new(false),
            beats_unanswered: watch::Sender::new(0),
            loads: watch::Sender::new(0),
            loads_held: watch::Sender::new(false),
            creations_unanswered: watch::Sender::new(false),
            ends_unanswered: watch::Sender::new(false),
            ends_read: watch::Sender::new(0),
            ends_unreadable: watch::Sender::new(false),
            panics_at: watch::Sender::new(""),
            codes_taken: Mutex::default(),
            released: AsyncMutex::new(database.released.subscribe()),
        })
    }

    /// The node.
    pub fn node(&self) -> NodeId {
        *self.node.lock().expect("no test panics here")
    }

    /// Panics once if that was planted for this kind of request.
    fn may_panic(&self, what: &str) {
        let planted =
            (self.panics_at).send_if_modified(|at| *at == what && std::mem::take(at) == what);
        assert!(!planted, "planted in {what}");
    }

    async fn reached(&self) {
        let mut cut_off = self.cut_off.subscribe();
        (cut_off.wait_for(|cut_off| !cut_off).await).expect("the sender is here");
    }

    fn journal(
        &self,
        header: &Arc<GameHeader>,
        epoch: Epoch,
        rows: u64,
        entries: Vec<Entry>,
    ) -> Box<dyn Journal> {
        Box::new(FakeJournal {
            database: Arc::clone(&self.database),
            header: Arc::clone(header),
            epoch,
            rows,
            entries,
            cut_off: self.cut_off.subscribe(),
            unanswered: self.ends_unanswered.subscribe(),
        })
    }
}

struct FakeJournal {
    database: Arc<Database>,
    header: Arc<GameHeader>,
    epoch: Epoch,
    rows: u64,
    entries: Vec<Entry>,
    cut_off: watch::Receiver<bool>,
    unanswered: watch::Receiver<bool>,
}

impl FakeJournal {
    async fn reached(&mut self) {
        if self.cut_off.wait_for(|cut_off| !cut_off).await.is_err() {
            pending().await
        }
    }

    fn written(&self, written: Written) -> Result<(), StoreError> {
        match written {
            Written::Committed => Ok(()),
            Written::Refused => Err(StoreError::Fenced(self.header.room_id.unit())),
        }
    }
}

#[async_trait]
impl Journal for FakeJournal {
    async fn append(&mut self, entries: &mut Vec<Entry>) -> Result<(), StoreError> {
        self.reached().await;
        let row = Row::of_game(entries);
        let room = self.header.room_id.unit();
        let written = (self.database.tables()).append(room, self.epoch, self.rows, row);
        self.written(written)?;
        self.rows += 1;
        self.entries.append(entries);
        Ok(())
    }

    async fn entries(&mut self) -> Result<Vec<Entry>, StoreError> {
        Ok(self.entries.clone())
    }

    async fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<v1::RecordSignature>,
    ) -> Result<(), StoreError> {
        self.reached().await;
        let room = self.header.room_id.unit();
        let written = (self.database.tables()).finish(room, self.epoch, self.rows);
        self.written(written)?;
        let finished = &self.database.finished;
        let game = finished.create(Arc::clone(&self.header), self.entries.clone());
        game.await?.finish(summary, signature).await?;
        if self.unanswered.wait_for(|it| !it).await.is_err() {
            pending().await
        }
        Ok(())
    }
}

fn created(created: Created, id: UnitId) -> Result<(), StoreError> {
    match created {
        Created::Created => Ok(()),
        Created::Taken => Err(StoreError::Taken(id.to_string())),
        Created::Refused => Err(StoreError::Fenced(id)),
    }
}

#[async_trait]
impl Store for FakeStore {
    fn outlives_server(&self) -> bool {
        true
    }

    async fn create(
        &self,
        header: Arc<GameHeader>,
        entries: Vec<Entry>,
    ) -> Result<Box<dyn Journal>, StoreError> {
        self.reached().await;
        let room = header.room_id.unit();
        {
            let mut taken = self.codes_taken.lock().expect("no test panics here");
            if taken.1.len() < taken.0 {
                taken.1.push(header.join_code.clone());
                return Err(StoreError::Taken(header.game_id.to_string()));
            }
        }
        let row = Row::of_game(&entries);
        let epoch = match header.tournament {
            None => {
                let made = (self.database.tables()).create(room, self.node(), row);
                created(made, room)?;
                Epoch::FIRST
            }
            Some(game) => {
                let unit = game.tournament.unit();
                let epochs = self.epochs.lock().expect("no test panics here");
                let epoch = epochs.get(&unit).copied();
                let epoch = epoch.ok_or(StoreError::Fenced(room))?;
                let made = (self.database.tables()).create_in(unit, epoch, room, row);
                created(made, room)?;
                epoch
            }
        };
        {
            let mut games = self.database.games.lock().expect("no test panics here");
            games.insert(room, Arc::clone(&header));
        }
        let mut unanswered = self.creations_unanswered.subscribe();
        (unanswered.wait_for(|it| !it).await).expect("the sender is here");
        Ok(self.journal(&header, epoch, 1, entries))
    }

    async fn resumable_games(&self, _: u64) -> Result<Vec<ResumableGame>, StoreError> {
        unreachable!("a node resumes units")
    }

    async fn summary(&self, game: GameId) -> Result<Option<v1::RecordSummary>, StoreError> {
        self.database.finished.summary(game).await
    }

    async fn finished(&self, game: GameId) -> Result<Option<StoredGame>, StoreError> {
        self.database.finished.finished(game).await
    }

    async fn list(
        &self,
        filter: &v1::RecordFilter,
        part: Part,
        count: usize,
    ) -> Result<Vec<Listed>, StoreError> {
        self.database.finished.list(filter, part, count).await
    }

    async fn import(
        &self,
        game: GameId,
        summary: v1::RecordSummary,
        lines: Arc<[v1::RecordLine]>,
    ) -> Result<bool, StoreError> {
        self.database.finished.import(game, summary, lines).await
    }

    async fn finished_games(&self) -> Result<u64, StoreError> {
        self.database.finished.finished_games().await
    }

    async fn without_record_file(&self) -> Result<Vec<GameId>, StoreError> {
        self.database.finished.without_record_file().await
    }

    async fn mark_record_written(&self, game: GameId) -> Result<(), StoreError> {
        self.database.finished.mark_record_written(game).await
    }

    async fn write_unit(&self, unit: UnitKey, write: UnitWrite) -> Result<(), StoreError> {
        assert_eq!(unit.kind(), UnitKind::Tournament, "tests have no studies");
        self.reached().await;
        let id = unit.id();
        let mut epochs = self.epochs.lock().expect("no test panics here");
        match write {
            UnitWrite::Create { header, first, .. } => {
                let first = first.expect("a tournament begins with a row");
                let row = Row::Unit(first.entries);
                created(self.database.tables().create(id, self.node(), row), id)?;
                epochs.insert(id, Epoch::FIRST);
                let mut all = (self.database.tournaments.lock()).expect("no test panics here");
                all.insert(id, (unit, header));
                Ok(())
            }
            UnitWrite::Append(row) => {
                let fenced = StoreError::Fenced(id);
                let epoch = *epochs.get(&id).ok_or(fenced.clone())?;
                let mut tables = self.database.tables();
                let entries = Row::Unit(row.entries);
                match tables.append(id, epoch, row.position, entries) {
                    Written::Committed if row.over => {
                        tables.finish(id, epoch, row.position + 1);
                        Ok(())
                    }
                    Written::Committed => Ok(()),
                    Written::Refused => Err(fenced),
                }
            }
            _ => unreachable!("a tournament is not rewritten"),
        }
    }

    async fn unit(&self, _: UnitKey) -> Result<Option<StoredUnit>, StoreError> {
        Ok(None)
    }

    /// None is over, and a node resumes units.
    async fn units(&self, _: UnitKind, _: usize) -> Result<Vec<UnitKey>, StoreError> {
        Ok(Vec::new())
    }

    async fn traces(&self, _: StudyId) -> Result<Vec<StoredTraces>, StoreError> {
        Ok(Vec::new())
    }

    async fn failed(&self) -> StoreError {
        pending().await
    }

    async fn close(&self) {
        self.reached().await
    }
}

#[async_trait]
impl ClusterStore for FakeStore {
    fn lease(&self) -> LeaseTimes {
        LeaseTimes::DEFAULT
    }

    async fn join(&self, info: NodeInfo) -> Result<NodeId, StoreError> {
        self.reached().await;
        let node = self.database.tables().join(self.database.now_ms());
        *self.node.lock().expect("no test panics here") = node;
        let mut nodes = self.database.nodes.lock().expect("no test panics here");
        nodes.insert(node, (info, Heartbeat::default()));
        Ok(node)
    }

    async fn beat(&self, heartbeat: Heartbeat) -> Result<Option<Beat>, StoreError> {
        self.may_panic("beat");
        self.reached().await;
        let mut lost = self.beats_lost.subscribe();
        (lost.wait_for(|lost| !lost).await).expect("the sender is here");
        let is_unanswered = self.beats_unanswered.send_if_modified(|left| {
            let is_any = *left > 0;
            *left = left.saturating_sub(1);
            is_any
        });
        if is_unanswered {
            return pending().await;
        }
        // So that it is seen when a node has no lease until the answer.
        sleep(Duration::from_millis(1)).await;
        let mut tables = self.database.tables();
        let node = self.node();
        if !tables.beat(node, self.database.now_ms()) {
            return Ok(None);
        }
        let mut nodes = self.database.nodes.lock().expect("no test panics here");
        nodes.entry(node).and_modify(|(_, said)| *said = heartbeat);
        let drain = *self.database.drain.lock().expect("no test panics here");
        Ok(Some(Beat {
            owned: tables.owned_by(node),
            drain: drain == Some(node),
        }))
    }

    async fn orphans(&self, count: usize) -> Result<Vec<(UnitId, Epoch)>, StoreError> {
        self.may_panic("orphans");
        self.reached().await;
        let mut orphans = self.database.orphans();
        orphans.retain(|(id, _)| !self.database.is_ephemeral(*id));
        orphans.truncate(count);
        Ok(orphans)
    }

    async fn handed_over(&self) -> (UnitId, Epoch) {
        let mut released = self.released.lock().await;
        loop {
            let Released { by, unit, next } =
                (released.recv().await).expect("a test releases few units");
            if by != self.node() && next.is_none_or(|next| next == self.node()) {
                return unit;
            }
        }
    }

    async fn tidy(&self) -> Result<(), StoreError> {
        self.may_panic("tidy");
        self.reached().await;
        let mut orphans = self.database.orphans();
        orphans.retain(|(id, _)| self.database.is_ephemeral(*id));
        let mut tables = self.database.tables();
        for (id, epoch) in orphans {
            let rows = tables.journal(id).len() as u64;
            tables.finish(id, epoch, rows);
        }
        Ok(())
    }

    async fn claim_all(
        &self,
        orphans: Vec<(UnitId, Epoch)>,
    ) -> Result<Vec<Option<Epoch>>, StoreError> {
        self.may_panic("claim");
        self.reached().await;
        let games = self.database.games.lock().expect("no test panics here");
        let restarted = |id| {
            let at = Duration::ZERO;
            let change = Change::ServerRestarted;
            games
                .get(&id)
                .map(|_| Row::of_game(&[Entry { at, change }]))
        };
        let now_ms = self.database.now_ms();
        let mut tables = self.database.tables();
        let claim = |(unit, seen)| tables.claim(unit, seen, self.node(), now_ms, restarted);
        Ok(orphans.into_iter().map(claim).collect())
    }

    async fn load(&self, unit: UnitId, epoch: Epoch) -> Result<Option<LoadedUnit>, StoreError> {
        self.may_panic("load");
        self.reached().await;
        self.loads.send_modify(|loads| *loads += 1);
        let mut held = self.loads_held.subscribe();
        (held.wait_for(|held| !held).await).expect("the sender is here");
        let tables = self.database.tables();
        if tables.owner(unit) != Some(self.node()) || tables.epoch(unit) != Some(epoch) {
            return Ok(None);
        }
        let (mut games, mut stored) = (Vec::new(), None);
        let headers = self.database.games.lock().expect("no test panics here");
        for id in tables.open_items(unit) {
            let journal = tables.journal(id);
            let rows = journal.len() as u64;
            if let Some(header) = headers.get(&id) {
                let entries = journal.iter().flat_map(|row| row.entries.entries());
                let entries: Vec<_> = entries.collect();
                games.push(ResumableGame {
                    header: GameHeader::clone(header),
                    journal: self.journal(header, epoch, rows, entries.clone()),
                    entries,
                    concluded: false,
                });
                continue;
            }
            let mut epochs = self.epochs.lock().expect("no test panics here");
            epochs.insert(id, epoch);
            let rows = journal.iter().filter_map(|row| match &row.entries {
                Row::Unit(entries) => Some(entries.clone()),
                Row::Game(_) => None,
            });
            let all = (self.database.tournaments.lock()).expect("no test panics here");
            let (unit, header) = all[&id].clone();
            stored = Some((unit, StoredUnit::new(header, rows.collect())));
        }
        Ok(Some(LoadedUnit { stored, games }))
    }

    async fn release(
        &self,
        unit: UnitId,
        epoch: Epoch,
        next: Option<NodeId>,
    ) -> Result<(), StoreError> {
        self.may_panic("release");
        self.reached().await;
        self.database.tables().release(unit, epoch);
        // Nobody may listen.
        let _ = (self.database.released).send(Released {
            by: self.node(),
            unit: (unit, epoch),
            next,
        });
        Ok(())
    }

    async fn leave(&self) -> Result<bool, StoreError> {
        self.may_panic("leave");
        self.reached().await;
        self.database.tables().leave(self.node());
        Ok(!self.database.knows(self.node()))
    }

    async fn locate(&self, id: UnitId) -> Result<Option<Location>, StoreError> {
        self.reached().await;
        let tables = self.database.tables();
        let games = self.database.games.lock().expect("no test panics here");
        let units = (self.database.tournaments.lock()).expect("no test panics here");
        let subject = match games.get(&id) {
            Some(header) => Some(Subject::Room(header.room_id)),
            None => units.get(&id).map(|(unit, _)| Subject::Unit(*unit)),
        };
        Ok(
            (tables.epoch(id).zip(subject)).map(|(epoch, subject)| Location {
                subject,
                unit: id,
                node: tables.owner(id),
                epoch,
                over: false,
            }),
        )
    }

    async fn locate_code(&self, _join_code: &str) -> Result<Option<Location>, StoreError> {
        Ok(None)
    }

    async fn locate_game(&self, _: GameId) -> Result<Option<Location>, StoreError> {
        Ok(None)
    }

    async fn ended_room(&self, room: RoomId) -> Result<Option<ResumableGame>, StoreError> {
        self.reached().await;
        self.ends_read.send_modify(|count| *count += 1);
        // As a query takes its time.
        sleep(Duration::from_millis(1)).await;
        if *self.ends_unreadable.borrow() {
            return Err(StoreError::Failed("as the test wants it".into()));
        }
        let tables = self.database.tables();
        let games = self.database.games.lock().expect("no test panics here");
        let Some(header) = games.get(&room.unit()) else {
            return Ok(None);
        };
        let rows = tables.journal(room.unit());
        let entries = rows.iter().flat_map(|row| row.entries.entries());
        let entries: Vec<_> = entries.collect();
        let count = rows.len() as u64;
        Ok(Some(ResumableGame {
            header: GameHeader::clone(header),
            journal: self.journal(header, Epoch::FIRST, count, entries.clone()),
            entries,
            concluded: true,
        }))
    }

    async fn alive(&self) -> Result<Vec<LivingNode>, StoreError> {
        self.reached().await;
        let tables = self.database.tables();
        let now_ms = self.database.now_ms();
        let nodes = self.database.nodes.lock().expect("no test panics here");
        let living = nodes.iter().filter(|(id, _)| {
            (tables.last_beat(**id)).is_some_and(|beat| !LeaseTimes::DEFAULT.expired(beat, now_ms))
        });
        let living = living.map(|(id, (info, said))| LivingNode {
            id: *id,
            info: info.clone(),
            reached: said.reached,
            load: (said.reached && !said.drains).then_some(Load {
                rooms: said.rooms,
                capacity: info.capacity,
            }),
        });
        Ok(living.collect())
    }

    async fn nodes(&self) -> Result<Vec<NodeStatus>, StoreError> {
        Ok(Vec::new())
    }

    async fn request_drain(&self, node: NodeId) -> Result<bool, StoreError> {
        self.database.ask_to_drain(node);
        Ok(self.database.knows(node))
    }
}
