//! Takeovers: an owner that has lost a room or tournament writes nothing any more, and nothing that
//! was acknowledged is lost.

use std::collections::BTreeMap;

use chefshat_base::metrics::Metrics;
use chefshat_postgres::Server;
use tokio::sync::watch;

use super::*;
use crate::postgres::appends::Row;
use crate::postgres::writer::Work as _;

const FIRST: Epoch = Epoch::FIRST;
const SECOND: Epoch = Epoch(2);

/// Two nodes on one database, whose first node has stopped to beat long ago when `stall` is called.
pub(super) struct Pair {
    pub(super) database: Database,
    pub(super) first: PostgresStore,
    pub(super) second: PostgresStore,
}

impl Pair {
    pub(super) async fn new() -> Self {
        let database = chefshat_postgres::database();
        let first = node(&database).await;
        stop_clock(&database);
        // The first one joined by another clock.
        first.join(NodeInfo::default()).await.expect("it joins");
        let second = node(&database).await;
        Self {
            database,
            first,
            second,
        }
    }

    /// Lets the lease of the first node expire.
    pub(super) async fn stall(&self) {
        advance(&self.database, 8_000);
        let beat = self.second.beat(REACHED).await.expect("it answers");
        assert!(beat.is_some(), "the second node is known");
    }

    pub(super) async fn close(self) {
        self.first.close().await;
        self.second.close().await;
    }
}

#[tokio::test]
async fn a_room_that_was_taken_over_is_written_by_its_new_owner_alone() {
    let pair = Pair::new().await;
    let room = id(1);
    let mut old = created(&pair.first, 1).await;
    append(&mut old, 2).await.expect("committed");
    assert_eq!(pair.second.orphans(9).await, Ok(vec![]));
    assert_eq!(
        pair.second.claim(room, FIRST).await,
        Ok(None),
        "it is alive"
    );

    pair.stall().await;
    assert_eq!(pair.second.orphans(9).await, Ok(vec![(room, FIRST)]));
    assert_eq!(pair.second.claim(room, SECOND).await, Ok(None));
    assert_eq!(pair.second.claim(room, FIRST).await, Ok(Some(SECOND)));
    assert_eq!(pair.second.claim(room, FIRST).await, Ok(None), "once");
    assert_eq!(pair.second.orphans(9).await, Ok(vec![]));

    let fenced = Err(StoreError::Fenced(room));
    assert_eq!(append(&mut old, 3).await, fenced);
    assert_eq!(append(&mut old, 4).await, fenced, "nor anything later");
    assert_eq!(old.finish(Some(summary(1)), None).await, fenced);
    assert!(
        pair.first
            .load(room, FIRST)
            .await
            .expect("readable")
            .is_none()
    );

    let mut game = resumed(&pair.second, 1, SECOND).await;
    assert!(!game.concluded);
    assert_eq!(numbers(&game.entries), [1, 2, 0]);
    append(&mut game.journal, 5).await.expect("committed");
    finish(&mut game.journal, 1).await;
    let again = game.journal.finish(Some(summary(1)), None);
    again.await.expect("it is finished already");
    assert_eq!(pair.second.finished_games().await, Ok(1));
    let stored = pair
        .first
        .finished(durable(1).game_id)
        .await
        .expect("readable");
    let Some(StoredGame::Hosted(_, entries, _)) = stored else {
        panic!("{stored:?}");
    };
    assert_eq!(numbers(&entries), [1, 2, 0, 5]);
    pair.close().await;
}

/// Makes an append wait in the database, where it has seen its epoch already.
struct Late {
    holder: PgConnection,
    append: JoinHandle<Result<(), StoreError>>,
}

impl Late {
    async fn new(database: &Database, mut journal: Box<dyn Journal>) -> Self {
        let before = "TRIGGER wait BEFORE INSERT ON journal FOR EACH ROW
                      WHEN (NEW.epoch = 1 AND NEW.entries <> '')";
        let mut holder = hold(database, before).await;
        let append = tokio::spawn(async move { append(&mut journal, 2).await });
        waiting(&mut holder, "advisory").await;
        Self { holder, append }
    }

    /// Lets the append continue.
    async fn arrive(self) -> Result<(), StoreError> {
        drop(self.holder);
        self.append.await.expect("no panic")
    }
}

#[tokio::test]
async fn an_append_that_is_late_finds_its_place_taken() {
    let pair = Pair::new().await;
    let old = created(&pair.first, 1).await;
    pair.stall().await;
    let late = Late::new(&pair.database, old).await;
    let room = id(1);
    assert_eq!(pair.second.claim(room, FIRST).await, Ok(Some(SECOND)));
    assert_eq!(late.arrive().await, Err(StoreError::Fenced(room)));
    let game = resumed(&pair.second, 1, SECOND).await;
    assert_eq!(numbers(&game.entries), [1, 0]);
    pair.close().await;
}

/// The row of a room that has stopped may still wait when its node has read the room again.
#[tokio::test]
async fn of_two_rows_for_one_place_in_a_batch_one_is_acknowledged() {
    let database = chefshat_postgres::database();
    let store = node(&database).await;
    created(&store, 1).await;
    let number = database.run("SELECT number FROM games");
    let row = |entry_number| {
        let owned = Owned {
            id: id(1),
            unit: id(1),
            epoch: FIRST_EPOCH,
        };
        Arc::new(Row {
            owned,
            game: number.parse().expect("a number"),
            position: 1,
            entries: form::entries_to_bytes(&mut vec![entry(entry_number)]),
        })
    };
    let mut connection = connected(&database).await;
    for again in [false, true] {
        let answers = Row::commit(&mut connection, &[row(2), row(3), row(2)], again).await;
        let fenced = Err(StoreError::Fenced(id(1)));
        let answers = answers.expect("committed");
        let entries = numbers(&resumed(&store, 1, FIRST).await.entries);
        let expected = match entries[..] {
            [1, 2] => [Ok(()), fenced, Ok(())],
            [1, 3] => [fenced.clone(), Ok(()), fenced],
            _ => panic!("{entries:?}"),
        };
        assert_eq!(answers, expected);
    }
    store.close().await;
}

#[tokio::test]
async fn an_append_that_is_late_does_not_follow_the_end_of_its_game() {
    let pair = Pair::new().await;
    let old = created(&pair.first, 1).await;
    let late = Late::new(&pair.database, old).await;
    // The same owner has read the room again, for example after its lease had expired.
    let mut game = resumed(&pair.first, 1, FIRST).await;
    finish(&mut game.journal, 1).await;
    let room = id(1);
    assert_eq!(late.arrive().await, Err(StoreError::Fenced(room)));
    let stored = pair
        .first
        .finished(durable(1).game_id)
        .await
        .expect("readable");
    let Some(StoredGame::Hosted(_, entries, _)) = stored else {
        panic!("{stored:?}");
    };
    assert_eq!(numbers(&entries), [1]);
    pair.close().await;
}

/// A backup that was put back under a running node, or a crash of a database that acknowledged too
/// early, takes rows away that the node believes to be there.
#[tokio::test]
async fn nothing_is_written_over_a_hole() {
    let database = chefshat_postgres::database();
    let store = node(&database).await;
    let mut journals = Vec::new();
    for room in 1..=3 {
        let mut journal = created(&store, room).await;
        append(&mut journal, 2).await.expect("committed");
        journals.push(journal);
    }
    let cup_id = id(9);
    create_cup(&store, 9).await;
    let appended = store.append_tournament(cup_id, 1, begun());
    appended.await.expect("committed");

    database.run("DELETE FROM journal WHERE position = 1");
    database.run("DELETE FROM tournament_entries WHERE position = 1");
    let lost = |room: u8| Err(StoreError::Lost(id(room)));
    assert_eq!(append(&mut journals[0], 3).await, lost(1));
    let finished = journals[1].finish(Some(summary(2)), None).await;
    assert_eq!(finished, lost(2));
    assert_eq!(journals[2].finish(None, None).await, lost(3));
    let appended = store.append_tournament(cup_id, 2, begun()).await;
    assert_eq!(appended, lost(9));
    let metrics = Metrics::default();
    metrics.add_store(store.metrics().expect("it has writers"));
    assert!(metrics.text().contains("chefshat_commits_lost_total 4\n"));

    // What is stored is read again, and goes on.
    for room in 1..=3 {
        let mut game = resumed(&store, room, FIRST).await;
        assert!(!game.concluded, "game {room}");
        append(&mut game.journal, 4).await.expect("committed");
        let game = resumed(&store, room, FIRST).await;
        assert_eq!(numbers(&game.entries), [1, 4]);
    }
    let appended = store.append_tournament(cup_id, 1, begun());
    appended.await.expect("committed");
    store.close().await;
}

#[tokio::test]
async fn of_many_claims_one_wins() {
    let pair = Pair::new().await;
    created(&pair.first, 1).await;
    let room = id(1);
    let third = node(&pair.database).await;
    pair.first
        .release(room, FIRST, None)
        .await
        .expect("released");
    let stores = [&pair.first, &pair.second, &third];
    let claims = (stores.iter().cycle().take(9)).map(|store| store.claim(room, FIRST));
    let claims = futures::future::join_all(claims).await;
    let won = claims.iter().filter(|claim| **claim == Ok(Some(SECOND)));
    assert_eq!(won.count(), 1, "{claims:?}");
    let lost = claims.iter().filter(|claim| **claim == Ok(None));
    assert_eq!(lost.count(), 8, "{claims:?}");
    let restarts = "SELECT count(*) FROM journal WHERE epoch = 2";
    assert_eq!(pair.database.run(restarts), "1");
    third.close().await;
    pair.close().await;
}

#[tokio::test]
async fn nodes_that_look_for_a_few_orphans_find_different_ones() {
    let pair = Pair::new().await;
    for room in 1..=40 {
        created(&pair.first, room).await;
        let released = pair.first.release(id(room), FIRST, None);
        released.await.expect("released");
    }
    let first = pair.first.orphans(10).await.expect("it answers");
    let second = pair.second.orphans(10).await.expect("it answers");
    assert_eq!((first.len(), second.len()), (10, 10));
    assert_ne!(first, second);
    assert_eq!(pair.first.orphans(99).await.map(|all| all.len()), Ok(40));
    pair.close().await;
}

#[tokio::test]
async fn a_tournament_changes_hands_with_all_its_rooms() {
    let pair = Pair::new().await;
    let tournament = cup(9).id;
    let unit = tournament.unit();
    create_cup(&pair.first, 9).await;
    let room = |number| header(number, Some(9), Durability::Durable);
    let fenced = StoreError::Fenced(unit);
    let refused = pair.second.create(room(4), vec![entry(1)]).await;
    assert_eq!(refused.err(), Some(fenced.clone()), "not its tournament");
    let mut journals = Vec::new();
    for number in [1, 2] {
        let created = pair.first.create(room(number), vec![entry(1)]);
        journals.push(created.await.expect("created"));
    }
    let ephemeral = header(3, Some(9), Durability::Ephemeral);
    pair.first.create(ephemeral, vec![]).await.expect("created");
    finish(&mut journals[1], 2).await;

    pair.stall().await;
    assert_eq!(pair.second.orphans(9).await, Ok(vec![(unit, FIRST)]));
    assert_eq!(pair.second.claim(id(1), FIRST).await, Ok(None));
    assert_eq!(pair.second.claim(unit, FIRST).await, Ok(Some(SECOND)));
    let late = pair.first.append_tournament(tournament, 1, begun());
    assert_eq!(late.await, Err(fenced.clone()));
    assert_eq!(append(&mut journals[0], 2).await, Err(fenced.clone()));
    let refused = pair.first.create(room(5), vec![entry(1)]).await;
    assert_eq!(refused.err(), Some(fenced));

    let found = pair.second.load(unit, SECOND).await.expect("readable");
    let found = found.expect("it is owned");
    let (key, stored) = found.stored.expect("a tournament");
    assert_eq!(
        (key, stored.rows.len()),
        (UnitKey::Tournament(tournament), 1)
    );
    let games: Vec<_> = (found.games.iter())
        .map(|game| (game.concluded, numbers(&game.entries)))
        .collect();
    assert_eq!(games, [(false, vec![1, 0]), (true, vec![1])]);
    let appended = pair.second.append_tournament(tournament, 1, begun());
    appended.await.expect("committed");
    assert_eq!(tournament_rows(&pair.first, 9).await, 2);
    let added = pair.second.create(room(6), vec![entry(1)]);
    added
        .await
        .expect("the tournament's new owner creates rooms");
    let located = pair.first.locate(id(6)).await.expect("readable");
    let located = located.expect("known");
    assert_eq!((located.unit, located.epoch), (unit, SECOND));
    let gone = pair.first.locate(id(3)).await;
    assert_eq!(gone, Ok(None), "ephemeral rooms die with their node");
    pair.close().await;
}

#[tokio::test]
async fn rooms_and_tournaments_are_found_by_id_and_join_code() {
    let pair = Pair::new().await;
    let mut journal = created(&pair.first, 1).await;
    let created = pair.second.create_tournament(cup(9), vec![]);
    created.await.expect("created");
    let (room, cup) = (durable(1).room_id, cup(9).id);
    let of_room = Subject::Room(room);
    let of_cup = Subject::Unit(UnitKey::Tournament(cup));
    for (code, id, subject, node) in [
        ("ROOM1", room.unit(), of_room, number_of(&pair.first)),
        ("CUP9", cup.unit(), of_cup, number_of(&pair.second)),
    ] {
        let by_id = pair.first.locate(id).await.expect("readable");
        let by_code = pair.first.locate_code(code).await.expect("readable");
        assert_eq!(by_id, by_code);
        let found = by_id.expect("known");
        assert_eq!((found.subject, found.node), (subject, Some(node)));
    }
    assert_eq!(pair.first.locate(id(7)).await, Ok(None));
    assert_eq!(pair.first.locate_code("NOTHING").await, Ok(None));
    let game = durable(1).game_id;
    let by_game = pair.second.locate_game(game).await.expect("readable");
    assert_eq!(by_game.expect("it runs").subject, of_room);

    finish(&mut journal, 1).await;
    let found = pair.second.locate_code("ROOM1").await.expect("readable");
    assert!(found.expect("known").over);
    assert_eq!(pair.second.locate_game(game).await, Ok(None));
    let shown = pair.second.ended_room(id(1)).await.expect("readable");
    assert!(shown.expect("stored").concluded);
    // Another room may have the code from now on.
    let next = GameHeader {
        join_code: "ROOM1".into(),
        ..GameHeader::clone(&durable(2))
    };
    let created = pair.second.create(Arc::new(next), vec![entry(1)]);
    created.await.expect("created");
    let found = pair.first.locate_code("ROOM1").await.expect("readable");
    assert_eq!(
        found.expect("known").subject,
        Subject::Room(durable(2).room_id)
    );
    // In the end nothing is left of the first room but its record.
    advance(&pair.database, 600_001);
    pair.first.tidy().await.expect("it answers");
    assert_eq!(pair.first.locate(id(1)).await, Ok(None));
    assert!(matches!(pair.first.ended_room(id(1)).await, Ok(None)));
    assert_eq!(pair.first.finished_games().await, Ok(1));
    pair.close().await;
}

#[tokio::test]
async fn no_two_processes_are_the_same_node_even_after_a_backup_was_put_back() {
    let database = chefshat_postgres::database();
    let before = node(&database).await;
    // Of before the node joined.
    database.run("DELETE FROM nodes; ALTER TABLE nodes ALTER COLUMN node RESTART");
    let after = node(&database).await;
    let mut journal = created(&after, 1).await;
    assert_eq!(
        before.beat(REACHED).await,
        Ok(None),
        "it is no node any more"
    );
    assert_eq!(before.claim(id(1), FIRST).await, Ok(None));
    assert_eq!(before.leave().await, Ok(false));
    let beat = after.beat(REACHED).await.expect("it answers");
    assert_eq!(beat.expect("it is known").owned, [(id(1), FIRST)]);
    append(&mut journal, 2).await.expect("committed");
    drop(journal);
    for store in [before, after] {
        store.close().await;
    }
}

#[tokio::test]
async fn a_node_that_died_before_the_clock_was_set_back_is_survived() {
    let pair = Pair::new().await;
    created(&pair.first, 1).await;
    pair.database
        .run("UPDATE test_clock SET now_ms = now_ms - 900000");
    for orphans in [vec![], vec![(id(1), FIRST)]] {
        pair.second.beat(REACHED).await.expect("it answers");
        assert_eq!(pair.second.orphans(9).await, Ok(orphans));
        pair.second.tidy().await.expect("it answers");
        advance(&pair.database, 8_000);
    }
    pair.close().await;
}

#[tokio::test]
async fn nodes_that_live_are_listed_first() {
    let database = chefshat_postgres::database();
    let lost = node(&database).await;
    database.run("UPDATE nodes SET beat_ms = beat_ms - 3600000");
    let living = [node(&database).await, node(&database).await];
    let nodes = living[0].nodes().await.expect("readable");
    created(&lost, 1).await;
    let created = living[0].create_tournament(cup(9), vec![]);
    created.await.expect("created");
    let of_nobody = living[1].without_node().await.expect("readable");
    assert_eq!((of_nobody.rooms, of_nobody.tournaments), (1, 0));
    let expired: Vec<bool> = nodes.iter().map(|node| node.expired).collect();
    assert_eq!(expired, [false, false, true]);
    assert_eq!(nodes[2].id, number_of(&lost));
    for store in living.into_iter().chain([lost]) {
        store.close().await;
    }
}

#[tokio::test]
async fn a_node_is_listed_drained_and_leaves() {
    let pair = Pair::new().await;
    let node = number_of(&pair.first);
    created(&pair.first, 1).await;
    assert_eq!(pair.first.leave().await, Ok(false), "it owns a room");
    assert_eq!(pair.second.request_drain(node).await, Ok(true));
    assert_eq!(pair.second.request_drain(NodeId(99)).await, Ok(false));
    let beat = pair.first.beat(REACHED).await.expect("it answers");
    let beat = beat.expect("it is known");
    assert!(beat.drain);
    assert_eq!(beat.owned, [(id(1), FIRST)]);
    let nodes = pair.second.nodes().await.expect("readable");
    let listed: Vec<_> = (nodes.iter())
        .map(|node| (node.id, node.rooms, node.drain, node.expired))
        .collect();
    assert!(listed.contains(&(node, 1, true, false)), "{listed:?}");
    assert!(listed.contains(&(number_of(&pair.second), 0, false, false)));
    let alive = async || {
        let alive = pair.second.alive().await.expect("readable");
        let reached = alive.iter().map(|node| (node.id, node.reached));
        reached.collect::<BTreeMap<_, _>>()
    };
    assert!(alive().await[&node], "its beat has said so");
    assert!(
        !alive().await[&number_of(&pair.second)],
        "it has just joined"
    );
    assert!(nodes.iter().all(|it| it.reached == (it.id == node)));
    let released = pair.first.release(id(1), FIRST, None);
    released.await.expect("released");
    assert_eq!(pair.first.leave().await, Ok(true));
    assert_eq!(pair.first.beat(REACHED).await, Ok(None));
    let refused = pair.first.create(durable(2), vec![entry(1)]).await;
    assert_eq!(refused.err(), Some(StoreError::Fenced(id(2))));
    let claimed = pair.first.claim(id(1), FIRST).await;
    assert_eq!(claimed, Ok(None), "it is no node any more");
    pair.close().await;
}

#[tokio::test]
async fn broken_connections_lose_and_double_nothing() {
    const ROOMS: u8 = 8;
    const APPENDS: u64 = 60;
    let database = chefshat_postgres::database();
    let store = Arc::new(node(&database).await);
    // No room gets so far ahead that nothing is left to append when a connection is broken.
    let (allowed, up_to) = watch::channel(10);
    let playing: Vec<_> = (1..=ROOMS)
        .map(|room| {
            let (store, mut up_to) = (Arc::clone(&store), up_to.clone());
            tokio::spawn(async move {
                let mut journal = created(&store, room).await;
                for number in 2..=APPENDS {
                    let allowed = up_to.wait_for(|up_to| number <= *up_to);
                    allowed.await.expect("the test goes on");
                    append(&mut journal, number).await.expect("committed");
                }
                finish(&mut journal, room).await;
            })
        })
        .collect();
    let address = open::address(database.url()).expect("an address");
    let killer = address.application_name("killer");
    let mut killer = open::connect(&killer).await.expect("connected");
    let mut killed = 0;
    for round in 1..=10_i64 {
        let mut rows = 0;
        while rows < round * 40 {
            let count = sqlx::query_scalar("SELECT count(*) FROM journal");
            rows = count.fetch_one(&mut killer).await.expect("readable");
        }
        let kill = "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity
                    WHERE datname = current_database() AND application_name = 'chefshat'";
        // There is none while the store connects again.
        while killed < round {
            let terminated: i64 =
                (sqlx::query_scalar(kill).fetch_one(&mut killer).await).expect("done");
            killed += terminated;
        }
        allowed.send_modify(|up_to| *up_to += 5);
    }
    for done in playing {
        done.await.expect("every append is acknowledged");
    }
    let all: Vec<u64> = (1..=APPENDS).collect();
    for room in 1..=ROOMS {
        assert_eq!(numbers(&ended(&*store, id(room)).await), all);
    }
    let listed = "SELECT string_agg(listed::text, ' ' ORDER BY listed) FROM games";
    assert_eq!(database.run(listed), "1 2 3 4 5 6 7 8");
    store.close().await;
}

#[tokio::test]
async fn a_cursor_misses_no_game_that_nodes_finish_at_the_same_time() {
    let database = chefshat_postgres::database();
    let (first, second) = (node(&database).await, node(&database).await);
    let mut finishing = Vec::new();
    for room in 1..=40 {
        let store = [&first, &second][usize::from(room % 2)];
        let mut journal = created(store, room).await;
        finishing.push(tokio::spawn(async move {
            journal.finish(Some(summary(room)), None).await
        }));
    }
    let mut seen: Vec<u64> = Vec::new();
    loop {
        let done = finishing.iter().all(tokio::task::JoinHandle::is_finished);
        let after = Part::After(seen.last().copied().unwrap_or(0));
        let page = first.list(&v1::RecordFilter::default(), after, 3).await;
        let page = page.expect("readable");
        if done && page.is_empty() {
            break;
        }
        seen.extend(page.iter().map(|listed| listed.number));
    }
    assert_eq!(seen, (1..=40).collect::<Vec<u64>>());
    first.close().await;
    second.close().await;
}

/// A journal with two rows, whose database has just stopped.
async fn stopped(retry_for: Duration) -> (Server, PostgresStore, Box<dyn Journal>) {
    let mut server = Server::start();
    let options = PostgresOptions {
        retry_for,
        ..PostgresOptions::default()
    };
    let store = node_with(&server.database(), options).await;
    let mut journal = created(&store, 1).await;
    append(&mut journal, 2).await.expect("committed");
    server.stop();
    assert!(store.beat(REACHED).await.is_err(), "nobody answers");
    (server, store, journal)
}

#[tokio::test]
async fn a_database_that_restarts_is_waited_for() {
    let (mut server, store, mut journal) = stopped(Duration::from_secs(300)).await;
    let cancelled = append(&mut journal, 3).now_or_never();
    assert_eq!(cancelled, None, "it is on its way");
    let resuming = tokio::task::spawn_blocking(move || {
        server.resume();
        server
    });
    let (appended, server) = futures::join!(append(&mut journal, 4), resuming);
    assert_eq!(appended, Ok(()));
    let entries = journal.entries().await.expect("readable");
    assert_eq!(numbers(&entries), [1, 2, 3, 4]);
    store.close().await;
    drop(server);
}

#[tokio::test]
async fn a_row_without_an_answer_is_settled_before_the_next_one() {
    let (mut server, store, mut journal) = stopped(Duration::ZERO).await;
    let metrics = Metrics::default();
    metrics.add_store(store.metrics().expect("it has writers"));
    assert!(metrics.text().contains("chefshat_commit_retries_total 0\n"));
    let failed = append(&mut journal, 3).await;
    assert!(matches!(failed, Err(StoreError::Failed(_))), "{failed:?}");
    let failed = append(&mut journal, 4).await;
    assert!(matches!(failed, Err(StoreError::Failed(_))), "{failed:?}");
    assert!(!metrics.text().contains("chefshat_commit_retries_total 0\n"));
    server.resume();
    append(&mut journal, 5).await.expect("the database is back");
    let entries = journal.entries().await.expect("readable");
    // The row of 4 was never sent: the one before it had no answer.
    assert_eq!(numbers(&entries), [1, 2, 3, 5]);
    store.close().await;
}
