//! Random operations of several nodes do to the database exactly what they do to its
//! specification, `chefshat_cluster::Tables`.

use chefshat_cluster::{Created, LeaseTimes, Tables, Written};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

use super::*;
use crate::sql::integer;

/// Nodes that take part.
const NODES: usize = 3;
/// Ids of standalone rooms, of tournaments, and of rooms of the tournament before.
const ROOMS: [u8; 3] = [1, 2, 3];
const TOURNAMENTS: [u8; 2] = [10, 20];
const CASES: u32 = 16;

/// An operation; the first number of most is the node that does it.
#[derive(Debug, Clone)]
enum Operation {
    Join(usize),
    Leave(usize),
    Beat(usize),
    Wait(u64),
    Create(usize, u8),
    CreateTournament(usize, u8),
    CreateIn(usize, u8),
    Append(usize, u8),
    Finish(usize, u8),
    Claim(usize, u8, u64),
    Release(usize, u8),
}

fn operations() -> impl Strategy<Value = Vec<Operation>> {
    let node = || 0..NODES;
    let room = || prop::sample::select(ROOMS.to_vec());
    let tournament = || prop::sample::select(TOURNAMENTS.to_vec());
    // A tournament's room has the tournament's number and one or two.
    let inner = || (tournament(), 1..=2_u8).prop_map(|(tournament, room)| tournament + room);
    let any_room = move || prop_oneof![room(), inner()];
    let unit = move || prop_oneof![room(), tournament()];
    let operation = prop_oneof![
        1 => node().prop_map(Operation::Join),
        1 => node().prop_map(Operation::Leave),
        3 => node().prop_map(Operation::Beat),
        3 => prop::sample::select(vec![1_000, 4_000, 8_000]).prop_map(Operation::Wait),
        4 => (node(), room()).prop_map(|(node, room)| Operation::Create(node, room)),
        3 => (node(), tournament()).prop_map(|(node, id)| Operation::CreateTournament(node, id)),
        4 => (node(), inner()).prop_map(|(node, room)| Operation::CreateIn(node, room)),
        6 => (node(), any_room()).prop_map(|(node, room)| Operation::Append(node, room)),
        2 => (node(), any_room()).prop_map(|(node, room)| Operation::Finish(node, room)),
        6 => (node(), unit(), 0..3_u64).prop_map(|(node, unit, seen)| Operation::Claim(node, unit, seen)),
        3 => (node(), unit()).prop_map(|(node, unit)| Operation::Release(node, unit)),
    ];
    prop::collection::vec(operation, 1..60)
}

/// One node in both worlds: the journals it writes, with epoch and next position, as it knows them.
struct Server {
    store: PostgresStore,
    id: NodeId,
    journals: HashMap<u8, (Box<dyn Journal>, Epoch, u64)>,
    tournaments: HashMap<u8, Epoch>,
}

struct Worlds {
    database: Database,
    tables: Tables<UnitId, u64>,
    now_ms: u64,
    servers: Vec<Server>,
    written: u64,
}

fn tournament_of(room: u8) -> u8 {
    room - room % 10
}

impl Worlds {
    async fn new() -> Self {
        let database = chefshat_postgres::database();
        migrate(database.url()).await.expect("an empty database");
        stop_clock(&database);
        let times = LeaseTimes::new(2_000, 6_000, 8_000).expect("in order");
        let mut tables = Tables::new(times);
        let now_ms = 1_000_000;
        let mut servers = Vec::new();
        for _ in 0..NODES {
            let store = node(&database).await;
            let id = number_of(&store);
            tables.join_as(id, now_ms);
            servers.push(Server {
                store,
                id,
                journals: HashMap::new(),
                tournaments: HashMap::new(),
            });
        }
        Self {
            database,
            tables,
            now_ms,
            servers,
            written: 0,
        }
    }

    /// A new number for an entry.
    fn next_entry(&mut self) -> u64 {
        self.written += 1;
        self.written
    }

    async fn run(&mut self, operation: &Operation) {
        match *operation {
            Operation::Join(node) => {
                let server = &mut self.servers[node];
                let joined = server.store.join(NodeInfo::default()).await;
                server.id = joined.expect("it answers");
                self.tables.join_as(server.id, self.now_ms);
            }
            Operation::Leave(node) => {
                let server = &self.servers[node];
                let known = self.tables.last_beat(server.id).is_some();
                self.tables.leave(server.id);
                let left = known && self.tables.last_beat(server.id).is_none();
                assert_eq!(server.store.leave().await, Ok(left));
            }
            Operation::Beat(node) => {
                let server = &self.servers[node];
                let known = self.tables.beat(server.id, self.now_ms);
                let beat = server.store.beat(REACHED).await.expect("it answers");
                assert_eq!(beat.is_some(), known);
                if let Some(beat) = beat {
                    let mut owned = beat.owned;
                    owned.sort();
                    assert_eq!(owned, self.tables.owned_by(server.id));
                }
            }
            Operation::Wait(ms) => {
                self.now_ms += ms;
                advance(&self.database, ms);
            }
            Operation::Create(node, room) => {
                let number = self.next_entry();
                let server = &mut self.servers[node];
                let expected = self.tables.create(id(room), server.id, number);
                let created = server.store.create(durable(room), vec![entry(number)]);
                let created = created.await;
                assert_eq!(outcome(&created), expected);
                if let Ok(journal) = created {
                    server.journals.insert(room, (journal, Epoch::FIRST, 1));
                }
            }
            Operation::CreateTournament(node, tournament) => {
                let server = &mut self.servers[node];
                let expected = self.tables.create(id(tournament), server.id, 0);
                let created = server.store.create_tournament(cup(tournament), vec![]);
                let created = created.await;
                assert_eq!(outcome(&created), expected);
                if created.is_ok() {
                    server.tournaments.insert(tournament, Epoch::FIRST);
                }
            }
            Operation::CreateIn(node, room) => {
                let number = self.next_entry();
                let server = &mut self.servers[node];
                let tournament = tournament_of(room);
                let header = header(room, Some(tournament), Durability::Durable);
                let created = server.store.create(header, vec![entry(number)]).await;
                let Some(epoch) = server.tournaments.get(&tournament).copied() else {
                    let fenced = StoreError::Fenced(id(tournament));
                    assert_eq!(created.err(), Some(fenced), "never its own");
                    return;
                };
                let expected = self
                    .tables
                    .create_in(id(tournament), epoch, id(room), number);
                assert_eq!(outcome(&created), expected);
                if let Ok(journal) = created {
                    server.journals.insert(room, (journal, epoch, 1));
                }
            }
            Operation::Append(node, room) => {
                let number = self.next_entry();
                let server = &mut self.servers[node];
                let Some((journal, epoch, position)) = server.journals.get_mut(&room) else {
                    return;
                };
                let written = self.tables.append(id(room), *epoch, *position, number);
                let appended = append(journal, number).await;
                assert_eq!(
                    appended.is_ok(),
                    written == Written::Committed,
                    "{appended:?}"
                );
                match appended {
                    Ok(()) => *position += 1,
                    // Its owner stops.
                    Err(_) => drop(server.journals.remove(&room)),
                }
            }
            Operation::Finish(node, room) => {
                let server = &mut self.servers[node];
                let Some((journal, epoch, rows)) = server.journals.get_mut(&room) else {
                    return;
                };
                let written = self.tables.finish(id(room), *epoch, *rows);
                let finished = journal.finish(Some(summary(room)), None).await;
                assert_eq!(
                    finished.is_ok(),
                    written == Written::Committed,
                    "{finished:?}"
                );
            }
            Operation::Claim(node, unit, lag) => self.claim(node, unit, lag).await,
            Operation::Release(node, unit) => {
                let server = &self.servers[node];
                // Nobody releases what it does not own.
                let owned = self.tables.owned_by(server.id);
                let Some((_, epoch)) = owned.into_iter().find(|(owned, _)| *owned == id(unit))
                else {
                    return;
                };
                self.tables.release(id(unit), epoch);
                let released = server.store.release(id(unit), epoch, None).await;
                released.expect("released");
            }
        }
    }

    /// Claims a unit at its present epoch or, with a lag, at one before.
    async fn claim(&mut self, node: usize, unit: u8, lag: u64) {
        let server = &mut self.servers[node];
        let open = self.tables.open_items(id(unit));
        let present = open.first().and_then(|item| self.tables.epoch(*item));
        let seen = Epoch(present.unwrap_or(Epoch::FIRST).0.saturating_sub(lag));
        // 0 stands for "the server was restarted"; a tournament has no such entry.
        let restarted = |item: UnitId| (!TOURNAMENTS.contains(&item.bytes()[0])).then_some(0);
        let expected = (self.tables).claim(id(unit), seen, server.id, self.now_ms, restarted);
        let claimed = server.store.claim(id(unit), seen).await;
        assert_eq!(claimed, Ok(expected));
        let Some(epoch) = expected else { return };
        let loaded = server.store.load(id(unit), epoch).await.expect("readable");
        let loaded = loaded.expect("it has just been claimed");
        for game in loaded.games {
            let rows = self.tables.journal(game.header.room_id.unit());
            let expected: Vec<u64> = rows.iter().map(|row| row.entries).collect();
            assert_eq!(numbers(&game.entries), expected);
            if !game.concluded {
                let position = rows.len() as u64;
                let room = game.header.room_id.bytes()[0];
                (server.journals).insert(room, (game.journal, epoch, position));
            }
        }
        if TOURNAMENTS.contains(&unit) {
            server.tournaments.insert(unit, epoch);
        }
    }

    /// Both worlds show the same.
    async fn compare(&self) {
        let store = &self.servers[0].store;
        let mut orphans = store.orphans(99).await.expect("it answers");
        orphans.sort();
        assert_eq!(orphans, self.tables.orphans(self.now_ms, 99));
        let rows = store.reader.read(|connection| {
            sqlx::query_as("SELECT id, epoch, CASE WHEN NOT over THEN node END FROM owned")
                .fetch_all(connection)
                .boxed()
        });
        let rows: Vec<(Vec<u8>, i64, Option<i64>)> = rows.await.expect("readable");
        let located: HashMap<u8, _> = (rows.into_iter())
            .map(|(id, epoch, node)| (id[0], (epoch, node)))
            .collect();
        let inner = TOURNAMENTS.into_iter().flat_map(|it| [it, it + 1, it + 2]);
        for number in ROOMS.into_iter().chain(inner) {
            let id = id(number);
            let owner = self.tables.owner(id).map(|node| integer(node.0));
            let expected = (self.tables.epoch(id)).map(|epoch| (integer(epoch.0), owner));
            assert_eq!(located.get(&number).copied(), expected, "{number}");
        }
    }
}

fn outcome<T>(created: &Result<T, StoreError>) -> Created {
    match created {
        Ok(_) => Created::Created,
        Err(StoreError::Taken(_)) => Created::Taken,
        Err(StoreError::Fenced(_)) => Created::Refused,
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn the_database_does_what_its_specification_says() {
    let runtime = tokio::runtime::Runtime::new().expect("threads");
    let config = Config {
        cases: CASES,
        failure_persistence: None,
        ..Config::default()
    };
    let result = TestRunner::new(config).run(&operations(), |operations| {
        runtime.block_on(async {
            let mut worlds = Worlds::new().await;
            for operation in &operations {
                worlds.run(operation).await;
                worlds.compare().await;
            }
            for server in worlds.servers {
                server.store.close().await;
            }
        });
        Ok(())
    });
    result.unwrap_or_else(|failure| panic!("{failure}"));
}
