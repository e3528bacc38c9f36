//! Two nodes on a database in memory, under tokio's paused clock: takeover, fencing, suspension and
//! drain, of rooms and of a tournament.

use std::sync::Arc;
use std::time::Duration;

use chefshat_proto::v1;
use chefshat_room::ids::{Id, RoomId, TournamentId};
use chefshat_room::journal::ParticipantKind;
use chefshat_room::policy::{Durability, Policy};
use futures::FutureExt as _;
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep, timeout};
use tokio_util::task::{AbortOnDropHandle, TaskTracker};

use super::units::LOADS_AT_ONCE;
use super::{ClusterNode, Hosted, LEFT_ALONE, LEFT_TO_NEXT};
use crate::cluster::{FoundBy, LOOK_LIMIT, Location, NodeLease, StoreDirectory, UnitEvent};
use crate::config::ServerConfig;
use crate::room::{Handle, JoinRequest, RoomError, RoomGone, Supersedes};
use crate::rooms::{CreateError, NewRoom, Rooms};
use crate::studies::Studies;
use crate::tournaments::{Connection, Entry, TournamentHandle, Tournaments};
use chefshat_admission::limits::Key;
use chefshat_base::tasks::{LongTask, polls};
use chefshat_store::Store;
use chefshat_store::cluster::{ClusterStore, NodeInfo, Subject};
use chefshat_store::testing::{Database, FakeStore};
use chefshat_wire::convert;
use chefshat_wire::outbox::Outbox;

/// Longest time that anything takes, on the paused clock.
const SOON: Duration = Duration::from_secs(60);
/// Most rooms of a node.
const MAX_ROOMS: usize = 1_000;

/// A server without sockets.
struct TestNode {
    store: Arc<FakeStore>,
    rooms: Arc<Rooms>,
    tournaments: Arc<Tournaments>,
    node: ClusterNode,
    lease: Arc<NodeLease>,
    /// Reaches it whenever it has joined.
    reaching: Option<AbortOnDropHandle<()>>,
}

impl TestNode {
    /// Starts a node that others reach.
    async fn start(database: &Arc<Database>) -> Self {
        Self::start_for(database, MAX_ROOMS).await
    }

    /// The same for this many rooms.
    async fn start_for(database: &Arc<Database>, max_rooms: usize) -> Self {
        let mut started = Self::start_unreached_for(database, max_rooms).await;
        let lease = Arc::clone(&started.lease);
        let reaching = tokio::spawn(async move {
            loop {
                lease.joined_anew().await;
                lease.set_reached();
            }
        });
        started.reaching = Some(AbortOnDropHandle::new(reaching));
        started.serves().await;
        started
    }

    async fn start_unreached(database: &Arc<Database>) -> Self {
        Self::start_unreached_for(database, MAX_ROOMS).await
    }

    async fn start_unreached_for(database: &Arc<Database>, max_rooms: usize) -> Self {
        let store = FakeStore::new(database);
        let tracker = TaskTracker::new();
        let lease = Arc::new(NodeLease::new());
        let stored: Arc<dyn Store> = Arc::clone(&store) as Arc<dyn Store>;
        let shared: Arc<dyn ClusterStore> = Arc::clone(&store) as Arc<dyn ClusterStore>;
        let config = ServerConfig {
            max_rooms,
            ..ServerConfig::default()
        };
        let directory = StoreDirectory::new(Arc::clone(&shared), Arc::clone(&lease), config.shares);
        let directory = Arc::new(directory);
        let rooms = Rooms::of_node(
            &config,
            stored,
            directory,
            Some(Arc::clone(&lease)),
            tracker.clone(),
        );
        let rooms = rooms.expect("threads");
        let tournaments = Tournaments::new(Arc::clone(&rooms), tracker.clone());
        let studies = Studies::new(Arc::clone(&rooms), tracker);
        let info = NodeInfo {
            capacity: max_rooms as u64,
            ..NodeInfo::default()
        };
        let id = store
            .join(info.clone())
            .await
            .expect("the database is there");
        let node = ClusterNode::start(
            id,
            info,
            Duration::ZERO,
            shared,
            Hosted {
                rooms: Arc::clone(&rooms),
                tournaments: Arc::clone(&tournaments),
                studies,
            },
        );
        Self {
            store,
            rooms,
            tournaments,
            node,
            lease,
            reaching: None,
        }
    }

    /// Waits until it serves clients.
    async fn serves(&self) {
        let mut serves = self.node.serves();
        soon(serves.wait_for(|it| *it)).await.expect("it runs");
    }

    /// Whether its metrics have this line.
    fn shows(&self, line: &str) -> bool {
        self.rooms.metrics().text().lines().any(|it| it == line)
    }

    /// Creates a durable room for four.
    async fn create_room(&self) -> Handle {
        self.create(Durability::Durable).await
    }

    async fn create(&self, durability: Durability) -> Handle {
        let made = self.rooms.create(NewRoom {
            policy: Policy {
                durability,
                ..Policy::default()
            },
            ..NewRoom::for_tests()
        });
        made.await.expect("a room").handle
    }

    /// Waits until a room runs here.
    async fn has(&self, room: RoomId) -> Handle {
        found(|| self.rooms.get(room)).await
    }

    /// Waits until a room does not run here any more.
    async fn loses(&self, room: RoomId) {
        until(|| self.rooms.get(room).is_none()).await;
    }

    /// Waits until a tournament runs here.
    async fn has_tournament(&self, id: TournamentId) -> Arc<TournamentHandle> {
        found(|| self.tournaments.get(id)).await
    }
}

/// Two nodes on a database.
async fn two_nodes() -> (Arc<Database>, TestNode, TestNode) {
    let database = Database::new();
    let (first, second) = (
        TestNode::start(&database).await,
        TestNode::start(&database).await,
    );
    (database, first, second)
}

async fn soon<T>(future: impl Future<Output = T>) -> T {
    timeout(SOON, future)
        .await
        .expect("it does not take that long")
}

/// Waits until there is something.
async fn found<T>(find: impl Fn() -> Option<T>) -> T {
    let finding = async {
        loop {
            match find() {
                Some(found) => return found,
                None => sleep(Duration::from_millis(1)).await,
            }
        }
    };
    soon(finding).await
}

/// Waits until something holds.
async fn until(holds: impl Fn() -> bool) {
    found(|| holds().then_some(())).await;
}

/// Takes a seat. The answer says that this is committed.
async fn join(room: &Handle, name: &str) -> Result<(), RoomGone> {
    match room.join(JoinRequest::for_tests(name)).await {
        Err(RoomError::Gone(gone)) => Err(gone),
        joined => {
            joined.expect("a free seat");
            Ok(())
        }
    }
}

/// The names on the seats of a room.
async fn names(room: &Handle) -> Vec<String> {
    let room = room.describe().await.expect("it runs");
    let names = room.seats.into_iter().map(|seat| seat.name);
    names.filter(|name| !name.is_empty()).collect()
}

#[tokio::test(start_paused = true)]
async fn the_room_of_a_dead_node_continues_at_another() {
    let (database, first, second) = two_nodes().await;
    let room = first.create_room().await;
    soon(join(&room, "Ada")).await.expect("it runs");
    let id = room.id();
    let died = Instant::now();
    drop(first);

    let room = second.has(id).await;
    assert!(
        died.elapsed() <= Duration::from_secs(10),
        "{:?}",
        died.elapsed()
    );
    assert_eq!(names(&room).await, ["Ada"]);
    soon(join(&room, "Bo")).await.expect("it runs");
    assert_eq!(database.seated(id), ["Ada", "Bo"]);
    assert!(second.shows("chefshat_takeovers_total 1"));
}

#[tokio::test(start_paused = true)]
async fn a_node_takes_nothing_until_it_is_reached() {
    let database = Database::new();
    let first = TestNode::start(&database).await;
    let second = TestNode::start_unreached(&database).await;
    let room = first.create_room().await.id();
    drop(first);
    // Longer than a takeover takes.
    sleep(SOON).await;
    assert!(second.shows("chefshat_node_lease 1"));
    assert!(second.shows("chefshat_node_reached 0"));
    assert!(!*second.node.serves().borrow());
    assert!(second.rooms.get(room).is_none());
    let refused = second.rooms.create(NewRoom::for_tests()).await;
    assert!(matches!(refused, Err(CreateError::NotReached)));

    second.lease.set_reached();
    second.has(room).await;
    second.create_room().await;
    assert!(*second.node.serves().borrow());
    assert!(second.shows("chefshat_node_reached 1"));
}

#[tokio::test(start_paused = true)]
async fn a_node_that_joins_gets_its_share_of_the_rooms() {
    let database = Database::new();
    let first = TestNode::start(&database).await;
    let mut rooms = Vec::new();
    for number in 0..30 {
        let room = first.create_room().await;
        let name = format!("player {number}");
        soon(join(&room, &name)).await.expect("it runs");
        rooms.push((room.id(), name));
    }
    let ephemeral = first.create(Durability::Ephemeral).await.id();
    assert_eq!(first.rooms.place().await, None, "it is alone");

    let second = TestNode::start(&database).await;
    // What is new is created by the emptier one.
    let placed = async {
        while first.rooms.place().await.is_none() {
            sleep(Duration::from_millis(10)).await;
        }
    };
    soon(placed).await;
    assert_eq!(second.rooms.place().await, None);
    let peer = first.rooms.place().await.expect("it is emptier");
    first.rooms.directory().avoid(&peer);
    assert_eq!(first.rooms.place().await, None, "it cannot be reached");

    until(|| second.rooms.open_count() >= 15 && first.rooms.open_count() <= 16).await;
    assert!(first.shows("chefshat_handovers_total 15"));
    // Nothing is handed over any more, and nothing was lost.
    sleep(SOON).await;
    assert_eq!(second.rooms.open_count(), 15);
    for (id, name) in rooms {
        let node = match database.owner(id) == Some(first.store.node()) {
            true => &first,
            false => &second,
        };
        assert_eq!(names(&node.has(id).await).await, [name]);
    }
    assert!(first.rooms.get(ephemeral).is_some(), "it would be lost");
}

#[tokio::test(start_paused = true)]
async fn rooms_that_were_handed_over_come_back_at_once_from_a_node_that_leaves() {
    let (_database, first, mut second) = two_nodes().await;
    for _ in 0..20 {
        first.create_room().await;
    }
    until(|| second.rooms.open_count() >= 10 && first.rooms.open_count() <= 10).await;
    let asked = Instant::now();
    soon(second.node.drain()).await;
    until(|| first.rooms.open_count() >= 20).await;
    assert!(asked.elapsed() < LEFT_TO_NEXT, "{:?}", asked.elapsed());
}

#[tokio::test(start_paused = true)]
async fn a_full_node_takes_over_what_nobody_else_does() {
    let database = Database::new();
    let first = TestNode::start(&database).await;
    let (full, free) = (
        TestNode::start_for(&database, 2).await,
        TestNode::start(&database).await,
    );
    let new = || NewRoom {
        charged: Key::Proxies,
        ..NewRoom::for_tests()
    };
    for _ in 0..2 {
        full.rooms.create(new()).await.expect("a room");
    }
    assert!(full.rooms.create(new()).await.is_err(), "it is full");
    let room = first.create_room().await.id();
    drop(first);
    free.has(room).await;
    assert_eq!(full.rooms.open_count(), 2, "another one has space");
    drop(free);
    full.has(room).await;
    assert_eq!(full.rooms.open_count(), 3);
}

#[tokio::test(start_paused = true)]
async fn the_many_rooms_of_a_dead_node_are_read_a_few_at_a_time() {
    let (database, first, second) = two_nodes().await;
    let mut rooms = Vec::new();
    for _ in 0..3 * LOADS_AT_ONCE {
        rooms.push(first.create_room().await.id());
    }
    second.store.loads_held.send_replace(true);
    drop(first);
    let node = Some(second.store.node());
    until(|| rooms.iter().all(|room| database.owner(*room) == node)).await;
    // Until everything waits for the store.
    sleep(Duration::from_millis(1)).await;
    assert_eq!(*second.store.loads.borrow() as usize, LOADS_AT_ONCE);
    second.store.loads_held.send_replace(false);
    for room in rooms {
        second.has(room).await;
    }
}

#[tokio::test(start_paused = true)]
async fn a_node_that_returns_too_late_publishes_nothing() {
    let (database, first, second) = two_nodes().await;
    let old = first.create_room().await;
    let id = old.id();
    first.store.cut_off.send_replace(true);
    let late = tokio::spawn({
        let old = old.clone();
        async move { join(&old, "Ada").await }
    });

    let new = second.has(id).await;
    soon(join(&new, "Bo")).await.expect("it runs");
    // Its clients reconnect before it reaches the database again.
    let late = soon(late).await.expect("no panic");
    assert_eq!(late, Err(RoomGone));
    first.store.cut_off.send_replace(false);
    first.loses(id).await;
    first.serves().await;
    assert_eq!(database.seated(id), ["Bo"]);
    assert_eq!(names(&new).await, ["Bo"]);
}

#[tokio::test(start_paused = true)]
async fn a_fenced_room_stops_alone() {
    let database = Database::new();
    let first = TestNode::start(&database).await;
    let second = FakeStore::new(&database);
    let other = second.join(NodeInfo::default()).await.expect("it joins");
    let (taken, kept) = (first.create_room().await, first.create_room().await);
    database.take_away(taken.id(), other);

    assert_eq!(soon(join(&taken, "Ada")).await, Err(RoomGone));
    first.loses(taken.id()).await;
    soon(join(&kept, "Bo")).await.expect("it runs");
    assert_eq!(database.seated(taken.id()), [""; 0]);
    assert_eq!(database.owner(kept.id()), Some(first.store.node()));
}

#[tokio::test(start_paused = true)]
async fn without_a_lease_nothing_is_published_until_it_is_back() {
    let database = Database::new();
    let first = TestNode::start(&database).await;
    let room = first.create_room().await;
    let mut serves = first.node.serves();
    first.store.beats_lost.send_replace(true);
    soon(serves.wait_for(|it| !it)).await.expect("it runs");
    assert!(first.shows("chefshat_node_lease 0"));

    let joining = join(&room, "Ada");
    tokio::pin!(joining);
    let mut committed = false;
    while !committed {
        assert_eq!(joining.as_mut().now_or_never(), None, "it is not published");
        sleep(Duration::from_millis(1)).await;
        committed = database.seated(room.id()) == ["Ada"];
    }
    for _ in 0..100 {
        assert_eq!(joining.as_mut().now_or_never(), None, "it is not published");
        sleep(Duration::from_millis(1)).await;
    }
    first.store.beats_lost.send_replace(false);
    soon(joining).await.expect("the room continues");
    assert_eq!(names(&room).await, ["Ada"]);
    assert!(first.shows("chefshat_node_lease 1"));
    assert!(first.shows("chefshat_takeovers_total 0"));
}

#[tokio::test(start_paused = true)]
async fn a_beat_without_an_answer_costs_no_lease() {
    let database = Database::new();
    let first = TestNode::start(&database).await;
    let room = first.create_room().await;
    let mut serves = first.node.serves();
    first.store.beats_unanswered.send_replace(1);
    let suspended = timeout(SOON, serves.wait_for(|it| !it));
    assert!(suspended.await.is_err(), "the node keeps its lease");
    assert_eq!(*first.store.beats_unanswered.borrow(), 0, "a beat was lost");
    soon(join(&room, "Ada")).await.expect("it runs");
}

#[tokio::test(start_paused = true)]
async fn a_unit_whose_room_stops_while_others_are_resumed_runs_after_the_next_beat() {
    let (_database, first, second) = two_nodes().await;
    let room = first.create_room().await.id();
    second.store.loads_held.send_replace(true);
    drop(first);
    let mut loads = second.store.loads.subscribe();
    soon(loads.wait_for(|loads| *loads == 1))
        .await
        .expect("the store is here");
    let lease = second.rooms.lease().expect("a node");
    lease.report(room.unit(), UnitEvent::Stopped);
    // Until everything waits for the store.
    sleep(Duration::from_millis(1)).await;
    second.store.loads_held.send_replace(false);

    soon(loads.wait_for(|loads| *loads == 2))
        .await
        .expect("it is resumed again");
    let room = second.has(room).await;
    soon(join(&room, "Ada")).await.expect("it runs");
}

#[tokio::test(start_paused = true)]
async fn a_room_whose_creation_is_answered_after_the_lease_has_ended_runs_when_it_is_back() {
    let database = Database::new();
    let first = TestNode::start(&database).await;
    first.store.creations_unanswered.send_replace(true);
    let creating = first.create_room();
    tokio::pin!(creating);
    // Beats say meanwhile that the node owns it.
    let beaten = timeout(Duration::from_secs(10), creating.as_mut());
    assert!(beaten.await.is_err(), "no answer comes");
    first.store.beats_lost.send_replace(true);
    let expired = timeout(Duration::from_secs(20), creating.as_mut());
    assert!(expired.await.is_err(), "no answer comes");
    first.store.creations_unanswered.send_replace(false);
    let room = soon(creating).await.id();
    first.loses(room).await;
    first.store.beats_lost.send_replace(false);

    let resumed = first.has(room).await;
    soon(join(&resumed, "Ada")).await.expect("it runs");
}

#[tokio::test(start_paused = true)]
async fn a_database_that_was_away_for_long_ends_no_node() {
    let database = Database::new();
    let first = TestNode::start(&database).await;
    let room = first.create_room().await;
    soon(join(&room, "Ada")).await.expect("it runs");
    first.store.cut_off.send_replace(true);
    sleep(Duration::from_secs(300)).await;
    assert!(
        first.rooms.get(room.id()).is_none(),
        "its clients reconnect"
    );
    first.store.cut_off.send_replace(false);

    let room = first.has(room.id()).await;
    assert_eq!(names(&room).await, ["Ada"]);
    soon(join(&room, "Bo")).await.expect("it runs");
}

#[tokio::test(start_paused = true)]
async fn ephemeral_rooms_outlive_an_outage_of_the_database_but_not_of_their_node() {
    let (_database, first, second) = two_nodes().await;
    let room = second.create(Durability::Ephemeral).await;
    first.store.cut_off.send_replace(true);
    second.store.cut_off.send_replace(true);
    sleep(Duration::from_secs(300)).await;
    first.store.cut_off.send_replace(false);
    first.serves().await;
    // Within the time that is left to the other nodes.
    sleep(Duration::from_secs(3)).await;
    second.store.cut_off.send_replace(false);
    soon(join(&room, "Ada")).await.expect("it continues");
    second.serves().await;
    soon(join(&room, "Bo")).await.expect("it continues");

    // The other node continues, so it removes the room.
    second.store.cut_off.send_replace(true);
    sleep(Duration::from_secs(300)).await;
    second.store.cut_off.send_replace(false);
    second.loses(room.id()).await;
    assert_eq!(soon(join(&room, "Cy")).await, Err(RoomGone));
}

#[tokio::test(start_paused = true)]
async fn a_node_that_was_removed_joins_again() {
    let (database, first, second) = two_nodes().await;
    let room = first.create_room().await.id();
    let before = first.store.node();
    first.store.cut_off.send_replace(true);
    second.has(room).await;
    database.remove_expired();
    assert!(!database.knows(before));
    first.store.cut_off.send_replace(false);

    first.serves().await;
    assert_ne!(first.store.node(), before);
    let created = first.create_room().await.id();
    assert_eq!(database.owner(created), Some(first.store.node()));
}

/// What a node waits for comes also if its work panics: no claim, release or beat stays open.
#[tokio::test(start_paused = true)]
async fn a_node_whose_work_panics_goes_on() {
    let database = Database::new();
    for what in ["orphans", "claim", "load", "tidy", "beat"] {
        let first = TestNode::start(&database).await;
        let room = first.create_room().await.id();
        let second = TestNode::start(&database).await;
        second.store.panics_at.send_replace(what);
        drop(first);
        let mut planted = second.store.panics_at.subscribe();
        let seen = soon(planted.wait_for(|at| at.is_empty())).await;
        drop(seen.expect("the sender is here"));
        second.has(room).await;
        let serves = second.node.serves();
        let beats = async {
            // Longer than a lease holds without a beat.
            sleep(SOON / 2).await;
            *serves.borrow()
        };
        assert!(soon(beats).await, "{what}");
    }
    for what in ["release", "leave"] {
        let mut first = TestNode::start(&database).await;
        let second = TestNode::start(&database).await;
        let room = first.create_room().await.id();
        first.store.panics_at.send_replace(what);
        first.rooms.refuse_new();
        soon(first.node.drain()).await;
        assert_eq!(*first.store.panics_at.borrow(), "", "{what}");
        second.has(room).await;
    }
}

#[tokio::test(start_paused = true)]
async fn a_node_that_is_removed_while_it_hands_over_has_left() {
    let (database, mut first, second) = two_nodes().await;
    let room = first.create_room().await.id();
    first.store.cut_off.send_replace(true);
    second.has(room).await;
    database.remove_expired();
    let drained = async {
        let drained = first.node.drain();
        tokio::pin!(drained);
        // It is away from the database.
        let hour = Duration::from_secs(3_600);
        assert!(timeout(hour, &mut drained).await.is_err());
        first.store.cut_off.send_replace(false);
        soon(drained).await;
    };
    drained.await;
    let (nodes, per_second) = (2, 10);
    assert!(
        polls()[&LongTask::Node] < 3_600 * nodes * per_second,
        "{:?}",
        polls()
    );
}

#[tokio::test(start_paused = true)]
async fn a_drained_node_hands_over_and_leaves() {
    let (database, mut first, second) = two_nodes().await;
    let mut rooms = Vec::new();
    for _ in 0..20 {
        let room = first.create_room().await;
        soon(join(&room, "Ada")).await.expect("it runs");
        rooms.push(room);
    }
    database.ask_to_drain(first.store.node());
    soon(first.node.asked_to_drain()).await;
    let began = Instant::now();
    first.rooms.refuse_new();
    soon(first.node.drain()).await;

    assert!(!database.knows(first.store.node()), "it has left");
    for old in rooms {
        assert_eq!(old.describe().await.err(), Some(RoomGone));
        let new = second.has(old.id()).await;
        assert_eq!(names(&new).await, ["Ada"]);
        soon(join(&new, "Bo")).await.expect("it runs");
    }
    // Nobody had to search for them, let alone to wait for the end of a lease.
    assert!(
        began.elapsed() < Duration::from_millis(400),
        "{:?}",
        began.elapsed()
    );
}

#[tokio::test(start_paused = true)]
async fn a_room_that_a_node_cannot_resume_is_left_to_others() {
    let (database, first, second) = two_nodes().await;
    let room = first.create_room().await.id();
    database.make_foreign(room);
    drop(first);
    let mut loads = second.store.loads.subscribe();
    soon(loads.wait_for(|loads| *loads == 1))
        .await
        .expect("the store is here");
    sleep(SOON).await;
    assert_eq!(database.owner(room), None);
    assert_eq!(*loads.borrow(), 1, "it does not try again");
    assert!(second.shows("chefshat_not_resumed_total 1"));
    let other = second.create_room().await;
    soon(join(&other, "Ada")).await.expect("it runs");
    // What prevented it has passed.
    database.make_native(room);
    sleep(LEFT_ALONE).await;
    let resumed = second.has(room).await;
    soon(join(&resumed, "Bo")).await.expect("it runs");
}

#[tokio::test(start_paused = true)]
async fn looking_for_rooms_takes_no_longer_if_the_database_hangs_and_many_look() {
    let database = Database::new();
    let node = TestNode::start(&database).await;
    node.store.cut_off.send_replace(true);
    let began = Instant::now();
    let rooms: Vec<_> = (0..100)
        .map(|number| FoundBy::Id(Id::from_bytes([number; 16])))
        .collect();
    let looks = (rooms.iter()).map(|room| node.rooms.directory().locate(room, Key::Local));
    for location in futures::future::join_all(looks).await {
        assert_eq!(location, Location::Unknown);
    }
    assert!(began.elapsed() < 2 * LOOK_LIMIT, "{:?}", began.elapsed());
}

fn entry(name: &str, at_table: bool) -> Entry {
    Entry {
        name: name.into(),
        name_fingerprint: String::new(),
        kind: ParticipantKind::Human,
        max_games: 1,
        stateless: false,
        at_table,
        request_id: None,
    }
}

#[tokio::test(start_paused = true)]
async fn a_tournament_changes_hands_with_its_rooms() {
    let (_database, first, second) = two_nodes().await;
    let settings = v1::TournamentSettings {
        format: v1::TournamentFormat::Swiss.into(),
        rounds: 1,
        physical_tables: 1,
        ..Default::default()
    };
    let plan = convert::tournament_plan(&settings, [7; 32]).expect("valid settings");
    let made = (first.tournaments).create("Coppa", plan, None, Key::Local);
    let (old, _) = made.await.expect("made");
    for name in ["Ada", "Bo", "Cy", "Di"] {
        soon(old.join(entry(name, true))).await.expect("joined");
    }
    soon(old.begin()).await.expect("begun");
    until(|| first.rooms.open_count() > 0).await;
    let room = first.rooms.newest(None, None, 1)[0].1.id();
    first.store.cut_off.send_replace(true);

    let new = second.has_tournament(old.id()).await;
    assert_eq!(new.describe().participants.len(), 4);
    let taken = second.has(room).await;
    assert_eq!(names(&taken).await.len(), 4);
    first.store.cut_off.send_replace(false);
    first.loses(room).await;
    assert!(first.tournaments.get(old.id()).is_none());
    assert_eq!(second.rooms.open_count(), 1, "no game is played twice");
}

#[tokio::test(start_paused = true)]
async fn a_participant_who_comes_when_its_tournament_stops_reconnects() {
    let (_database, first, second) = two_nodes().await;
    let settings = v1::TournamentSettings {
        format: v1::TournamentFormat::Swiss.into(),
        ..Default::default()
    };
    let plan = convert::tournament_plan(&settings, [7; 32]).expect("valid settings");
    let made = (first.tournaments).create("Coppa", plan, None, Key::Local);
    let (old, _) = made.await.expect("made");
    let (ada, ticket) = soon(old.join(entry("Ada", false))).await.expect("joined");
    // Its task waits for a commit, and reads nothing more.
    first.store.cut_off.send_replace(true);
    let late = tokio::spawn({
        let (old, entry) = (Arc::clone(&old), entry("Bo", false));
        async move { old.join(entry).await.is_ok() }
    });
    tokio::task::yield_now().await;
    let (outbox, _updates) = Outbox::new();
    let (calls, _called) = mpsc::channel(1);
    let connection = Connection {
        handle: 0,
        calls,
        outbox: Arc::clone(&outbox),
        supersedes: Supersedes::Any,
    };
    soon(old.enter(ada, &ticket, 1, connection)).await;

    let new = second.has_tournament(old.id()).await;
    assert_eq!(new.describe().participants.len(), 1);
    first.store.cut_off.send_replace(false);
    assert!(!soon(late).await.expect("no panic"));
    until(|| !outbox.is_open()).await;
}

#[tokio::test(start_paused = true)]
async fn the_end_of_a_game_is_shown_although_its_answer_comes_after_the_next_beats() {
    let database = Database::new();
    let first = TestNode::start(&database).await;
    let room = first.create_room().await;
    soon(join(&room, "Ada")).await.expect("it runs");
    first.store.ends_unanswered.send_replace(true);
    room.close_without_token().await;
    // Beats say that the node does not own it any more.
    sleep(Duration::from_secs(10)).await;
    assert_eq!(database.owner(room.id()), None);
    first.store.ends_unanswered.send_replace(false);

    let shown = soon(room.describe()).await.expect("it is shown");
    assert_eq!(shown.state(), v1::RoomState::Aborted);
}

#[tokio::test(start_paused = true)]
async fn the_end_of_a_game_is_read_once_for_all_who_ask_when_its_node_is_gone() {
    let (_database, first, second) = two_nodes().await;
    let room = first.create_room().await;
    soon(join(&room, "Ada")).await.expect("it runs");
    room.close_without_token().await;
    until(|| first.rooms.is_over(room.id()) == Some(true)).await;
    drop(first);

    second.store.ends_unreadable.send_replace(true);
    let asked = second.tournaments.show_ended(Subject::Room(room.id()));
    soon(asked).await.expect_err("it cannot be read now");
    second.store.ends_unreadable.send_replace(false);
    second.store.ends_read.send_replace(0);
    let asked = (0..10).map(|_| second.tournaments.show_ended(Subject::Room(room.id())));
    for shown in soon(futures::future::join_all(asked)).await {
        shown.expect("readable");
    }
    assert_eq!(*second.store.ends_read.borrow(), 1);
    let shown = second.rooms.get(room.id()).expect("it is shown");
    assert_eq!(names(&shown).await, ["Ada"]);
    let shown = soon(shown.describe()).await.expect("it is shown");
    assert_eq!(shown.state(), v1::RoomState::Aborted);
    let listed = second.rooms.newest(None, None, 9);
    assert!(listed.is_empty(), "others may list it");
}

#[tokio::test(start_paused = true)]
async fn a_room_whose_join_code_is_taken_gets_another_one() {
    let database = Database::new();
    let node = TestNode::start(&database).await;
    node.store.codes_taken.lock().expect("no panic").0 = 2;
    let room = node.create_room().await;
    let code = node
        .rooms
        .header(room.id())
        .expect("a room")
        .join_code
        .clone();
    let taken = node.store.codes_taken.lock().expect("no panic").1.clone();
    assert_eq!(taken.len(), 2);
    assert!(!taken.contains(&code) && taken[0] != taken[1]);
}
