//! Creation of rooms.

use std::collections::BTreeMap;

use futures::FutureExt as _;

use super::*;
use chefshat_admission::limits::Shares;
use chefshat_room::ids::{Id, SecretHash, Token};
use chefshat_room::journal::{
    AbortReason, Change, Entry, Fill, ParticipantKind, SeatedParticipant,
};
use chefshat_store::testing::FailingStore;
use chefshat_store::{MemoryStore, ResumableGame};

#[tokio::test]
async fn participants_of_a_tournament_are_committed_with_their_room() {
    // It stores new games, but no further entries.
    let store = Arc::new(FailingStore::after(0));
    let rooms = Rooms::for_tests(store);
    let fill = Fill::Open {
        reserved_for: Some(ParticipantKind::Agent),
    };
    let seated = |name: &str| SeatedParticipant {
        name: name.into(),
        name_fingerprint: String::new(),
        kind: ParticipantKind::Agent,
        ticket: SecretHash::of(name.as_bytes()),
    };
    let made = rooms.create(NewRoom {
        name: "a game of a tournament".into(),
        fills: vec![fill; 4],
        seating: Some(Seating {
            part_of: PartOf::Tournament(TournamentGame {
                tournament: Id::from_bytes([1; 16]),
                series: None,
            }),
            owner: Token::random(Id::from_bytes([2; 16])),
            game_id: Id::from_bytes([3; 16]),
            participants: BTreeMap::from([(0, seated("Ada")), (2, seated("Bo"))]),
            server_seed: None,
        }),
        ..NewRoom::for_tests()
    });
    let made = made.await.expect("the first commit succeeds");
    let room = made.handle.describe().await.expect("the room exists");
    let names: Vec<&str> = room.seats.iter().map(|seat| seat.name.as_str()).collect();
    assert_eq!(names, ["Ada", "", "Bo", ""]);
}

#[tokio::test]
async fn a_room_that_is_over_takes_no_join_code_from_an_open_one() {
    let store = Arc::new(MemoryStore::default());
    let rooms = Rooms::for_tests(Arc::clone(&store) as _);
    let made = rooms.create(NewRoom::for_tests());
    let open = made.await.expect("a room").handle.id();
    let header = rooms.header(open).expect("it exists");
    // Its code was that of a room that another node had.
    let former = GameHeader {
        room_id: Id::from_bytes([8; 16]),
        game_id: Id::from_bytes([9; 16]),
        ..(*header).clone()
    };
    let entries = vec![Entry {
        at: Duration::ZERO,
        change: Change::Aborted(AbortReason::Closed),
    }];
    let journal = store.create(Arc::new(former.clone()), entries.clone());
    rooms
        .show_ended(ResumableGame {
            header: former,
            entries,
            journal: journal.await.expect("memory"),
            concluded: true,
        })
        .await;
    assert!(rooms.get(Id::from_bytes([8; 16])).is_some(), "it is shown");
    let found = rooms.by_code(&header.join_code).expect("it is open");
    assert_eq!(found.id(), open);
}

#[tokio::test]
async fn the_room_of_a_game_is_found_until_the_game_is_over() {
    let store = Arc::new(MemoryStore::default());
    let rooms = Rooms::for_tests(store);
    let mut made = Vec::new();
    for _ in 0..3 {
        let room = rooms.create(NewRoom::for_tests()).await.expect("a room");
        let game = rooms.header(room.handle.id()).expect("listed").game_id;
        made.push((room.handle.id(), game));
    }
    for (room, game) in &made {
        assert_eq!(rooms.room_of(*game), Some(*room));
    }
    assert_eq!(rooms.room_of(Id::from_bytes([0; 16])), None);
    let [(first, ended), (_, removed), (third, other)] = made[..] else {
        unreachable!("three were made");
    };
    {
        let mut table = rooms.lock();
        let number = table.numbers[&first.unit()];
        table.by_number.get_mut(&number).expect("listed").over = true;
    }
    assert_eq!(rooms.room_of(ended), None);
    let number = rooms.lock().numbers[&made[1].0.unit()];
    rooms.lock().remove(number);
    assert_eq!(rooms.room_of(removed), None);
    assert_eq!(rooms.room_of(other), Some(third));
}

/// A room that ends looks into the table, so it must not end while the table is locked.
#[test]
fn a_room_may_end_with_the_handle_that_the_table_removes() {
    let runtime = tokio::runtime::Runtime::new().expect("threads");
    let (rooms, room) = runtime.block_on(async {
        let store = Arc::new(MemoryStore::default());
        let rooms = Rooms::for_tests(store);
        let made = rooms.create(NewRoom::for_tests()).await.expect("a room");
        let room = made.handle.id();
        (rooms, room)
    });
    // Its task is gone; the table has the last handle.
    drop(runtime);
    assert!(rooms.header(room).is_some());
    {
        let mut table = rooms.lock();
        let entries = table.by_number.values_mut();
        entries.for_each(|entry| entry.over = true);
        table.remove_over();
    }
    assert!(rooms.header(room).is_none());
}

#[tokio::test]
async fn the_end_of_a_game_wakes_only_its_own_unit() {
    let store = Arc::new(MemoryStore::default());
    let rooms = Rooms::for_tests(store);
    let created = async || {
        rooms
            .create(NewRoom::for_tests())
            .await
            .expect("a room")
            .handle
    };
    let (ending, other) = (created().await, created().await);
    let woken = rooms.notify_of_games(ending.id().unit());
    let asleep = rooms.notify_of_games(other.id().unit());
    ending.close_without_token().await;
    // The notification is kept until the task waits.
    woken.notified().await;
    assert!(matches!(rooms.end_of(ending.id()), Some(GameEnd::NotDealt)));
    assert!(asleep.notified().now_or_never().is_none());
    assert!(rooms.end_of(other.id()).is_none());

    // A task that has been replaced takes nothing from the one that waits.
    let unit = other.id().unit();
    let next = rooms.notify_of_games(unit);
    rooms.stop_notifying(unit, &asleep);
    other.close_without_token().await;
    next.notified().await;
    rooms.stop_notifying(unit, &next);
    assert!(!rooms.notifies(unit));
}

/// What the table keeps for whom asks often is what a look at each room would find.
fn check(rooms: &Rooms) {
    let table = rooms.lock();
    let entries = table.by_number.values();
    let open = entries.clone().filter(|entry| entry.is_open()).count();
    assert_eq!(table.open_count(), open);
    for entry in entries {
        let unit = entry.header.unit();
        let is_of = |(_, entry): &(&u64, &super::table::Entry)| entry.header.unit() == unit;
        let expected: Vec<u64> = (table.by_number.iter().filter(is_of))
            .map(|(number, _)| *number)
            .collect();
        let found: Vec<u64> = table.of_unit(unit).map(|(number, _)| number).collect();
        assert_eq!(found, expected);
    }
}

#[tokio::test]
async fn rooms_are_found_by_unit_and_counted_while_they_come_and_go() {
    let config = ServerConfig {
        max_rooms: 3,
        shares: Shares::ALL,
        ..ServerConfig::default()
    };
    let store = Arc::new(MemoryStore::default());
    let rooms = Rooms::new(&config, store, TaskTracker::new()).expect("threads");
    let create = async || {
        let created = rooms.create(NewRoom::for_tests()).await;
        check(&rooms);
        created
    };
    let mut made = Vec::new();
    for _ in 0..3 {
        made.push(create().await.expect("a room").handle);
    }
    assert!(create().await.is_err(), "it is full");
    for ending in [&made[0], &made[2]] {
        ending.close_without_token().await;
        rooms.until_ended(ending.id()).await;
    }
    check(&rooms);
    assert_eq!(rooms.open_count(), 1);
    // Those that are over make space, the oldest first.
    create().await.expect("a room");
    assert!(rooms.get(made[0].id()).is_none() && rooms.get(made[2].id()).is_some());
    rooms.stop_unit(made[1].id().unit()).await;
    check(&rooms);
    assert!(rooms.get(made[1].id()).is_none());
    assert_eq!(rooms.open_count(), 1);
    create().await.expect("a room");
    rooms.shut_down(Duration::ZERO).await;
    check(&rooms);
    assert_eq!(rooms.open_count(), 0);
}

#[tokio::test]
async fn who_creates_one_room_too_many_is_first_told_that_the_server_stops() {
    let config = ServerConfig {
        max_rooms: 1,
        ..ServerConfig::default()
    };
    let store = Arc::new(MemoryStore::default());
    let rooms = Rooms::new(&config, store, TaskTracker::new()).expect("threads");
    let _made = rooms.create(NewRoom::for_tests()).await.expect("a room");
    let refused = rooms.create(NewRoom::for_tests()).await;
    assert!(matches!(refused, Err(CreateError::Refused(_))));
    rooms.refuse_new();
    let refused = rooms.create(NewRoom::for_tests()).await;
    assert!(matches!(refused, Err(CreateError::ShuttingDown)));
}

#[tokio::test]
async fn a_room_that_fails_takes_no_place_and_its_unit_learns_of_it() {
    let store = Arc::new(FailingStore::after(u64::MAX));
    let panics = Arc::clone(&store.journals_panic);
    let rooms = Rooms::for_tests(store);
    let handle = (rooms.create(NewRoom::for_tests()).await)
        .expect("a room")
        .handle;
    let room = handle.id();
    let woken = rooms.notify_of_games(room.unit());
    assert!(rooms.is_unfinished(room));
    assert_eq!(rooms.places.taken(), 1);
    panics.store(true, std::sync::atomic::Ordering::Relaxed);
    handle.close_without_token().await;
    woken.notified().await;
    assert!(matches!(rooms.end_of(room), Some(GameEnd::Failed)));
    assert!(!rooms.is_unfinished(room));
    assert_eq!((rooms.places.taken(), rooms.open_count()), (0, 0));
    check(&rooms);
}
