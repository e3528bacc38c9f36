//! What several nodes do to one PostgreSQL database. Behavior that all stores share is tested
//! beside this folder; `model` compares ownership with its specification.

mod claims;
mod fencing;
mod measure;
mod model;
mod opening;
mod partitions;
mod retention;
mod retrying;
mod transfer;

use std::sync::Arc;

use chefshat_postgres::Database;
use chefshat_proto::v1;
use chefshat_room::ids::SecretHash;
use chefshat_room::journal::{AbortReason, Change, Entry, GameHeader, TournamentGame};
use chefshat_room::policy::Durability;
use chefshat_room::testing::id;
use chefshat_tournament::Change as TournamentChange;
use futures::FutureExt as _;
use futures::future::BoxFuture;
use sqlx::postgres::PgConnection;

use super::*;
use crate::cluster::{ClusterStore, Epoch, Heartbeat, NodeId, NodeInfo, Subject};
use crate::testing::{self, TypedUnits as _, begin, end, ended};
use crate::tournaments::{TournamentEntry, TournamentHeader};
use crate::units::UnitKey;

/// What a node without rooms says.
const REACHED: Heartbeat = Heartbeat {
    reached: true,
    rooms: 0,
    drains: false,
    unreachable: 0,
    is_stalled: false,
};

/// A node that has just joined, whose writes wait for a lock as long as a test wants.
pub(crate) async fn node(database: &Database) -> PostgresStore {
    node_with(database, patient()).await
}

fn patient() -> PostgresOptions {
    PostgresOptions {
        lock_limit: Duration::from_secs(60),
        ..PostgresOptions::default()
    }
}

async fn node_with(database: &Database, options: PostgresOptions) -> PostgresStore {
    let store = PostgresStore::open(database.url(), options).await;
    let store = store.expect("an empty database, or one of ours");
    store.join(NodeInfo::default()).await.expect("it joins");
    store
}

/// The number of a node that has joined.
fn number_of(store: &PostgresStore) -> NodeId {
    NodeId(store.node().expect("it has joined").cast_unsigned())
}

/// Replaces the clock of a database by a number that the tests set.
fn stop_clock(database: &Database) {
    database.run(
        "CREATE TABLE test_clock (now_ms bigint);
         INSERT INTO test_clock VALUES (1000000);
         CREATE OR REPLACE FUNCTION clock_ms() RETURNS bigint VOLATILE LANGUAGE sql
             AS 'SELECT now_ms FROM test_clock'",
    );
}

/// Lets time pass for a database with a stopped clock.
fn advance(database: &Database, ms: u64) {
    database.run(&format!("UPDATE test_clock SET now_ms = now_ms + {ms}"));
}

async fn connected(database: &Database) -> PgConnection {
    let address = open::address(database.url()).expect("an address");
    open::connect(&address).await.expect("connected")
}

async fn run(connection: &mut PgConnection, sql: &'static str) {
    let done = sqlx::query(sql).execute(connection).await;
    done.expect("the database does it");
}

/// Makes the database wait where this trigger is run, until the connection is dropped or unlocks 1.
async fn hold(database: &Database, trigger: &str) -> PgConnection {
    database.run(&format!(
        "CREATE FUNCTION wait() RETURNS trigger LANGUAGE plpgsql AS $$
         BEGIN
             PERFORM pg_advisory_xact_lock(1);
             RETURN NEW;
         END $$;
         CREATE {trigger} EXECUTE FUNCTION wait()"
    ));
    let mut holder = connected(database).await;
    run(&mut holder, "SELECT pg_advisory_lock(1)").await;
    holder
}

/// Waits until a session of the same database waits for something, and returns its process.
async fn waiting(connection: &mut PgConnection, wait_event: &str) -> i32 {
    loop {
        let process = sqlx::query_scalar(
            "SELECT pid FROM pg_stat_activity
             WHERE datname = current_database() AND wait_event = $1 ORDER BY backend_start DESC",
        );
        let process = process.bind(wait_event).fetch_optional(&mut *connection);
        if let Some(process) = process.await.expect("readable") {
            return process;
        }
        tokio::task::yield_now().await;
    }
}

/// A room with the id `room`, whose game has the same id.
fn header(room: u8, tournament: Option<u8>, durability: Durability) -> Arc<GameHeader> {
    Arc::new(GameHeader {
        room_id: id(room),
        join_code: format!("ROOM{room}"),
        tournament: tournament.map(|tournament| TournamentGame {
            tournament: id(tournament),
            series: None,
        }),
        ..GameHeader::clone(&testing::header(room, durability))
    })
}

fn durable(room: u8) -> Arc<GameHeader> {
    header(room, None, Durability::Durable)
}

fn cup(tournament: u8) -> Arc<TournamentHeader> {
    Arc::new(TournamentHeader {
        id: id(tournament),
        settings: v1::TournamentSettings::default(),
        created_at_ms: 1_000,
        join_code: format!("CUP{tournament}"),
        owner: SecretHash::of(b"owner"),
        deal_secret: [6; 32],
    })
}

fn summary(room: u8) -> Box<v1::RecordSummary> {
    testing::summary(&durable(room))
}

/// The first entries of a tournament that has begun.
fn begun() -> Vec<TournamentEntry> {
    vec![TournamentEntry::Change(TournamentChange::Begun {
        rounds: 1,
    })]
}

/// An entry that says which of a test's entries it is: the journal does not care whether it makes
/// sense.
fn entry(number: u64) -> Entry {
    Entry {
        at: Duration::from_micros(number),
        change: Change::Aborted(AbortReason::TooLong),
    }
}

/// The numbers of entries; 0 for "the server was restarted".
fn numbers(entries: &[Entry]) -> Vec<u64> {
    (entries.iter())
        .map(|entry| match entry.change {
            Change::ServerRestarted => 0,
            _ => u64::try_from(entry.at.as_micros()).expect("small"),
        })
        .collect()
}

/// Creates a durable room.
async fn created(store: &PostgresStore, room: u8) -> Box<dyn Journal> {
    begin(store, &durable(room), vec![entry(1)]).await
}

/// Ends the game of a room.
async fn finish(journal: &mut Box<dyn Journal>, room: u8) {
    end(journal, summary(room)).await;
}

/// Creates and ends a game of a room, whose record has been written to a file.
async fn played(store: &PostgresStore, room: u8) {
    let mut journal = created(store, room).await;
    finish(&mut journal, room).await;
    let written = store.mark_record_written(id(room)).await;
    written.expect("committed");
}

/// Creates a tournament that has begun.
async fn create_cup(store: &PostgresStore, tournament: u8) {
    let created = store.create_tournament(cup(tournament), begun()).await;
    created.expect("created");
}

async fn append(journal: &mut Box<dyn Journal>, number: u64) -> Result<(), StoreError> {
    journal.append(&mut vec![entry(number)]).await
}

/// Number of rows of a tournament's journal.
async fn tournament_rows(store: &PostgresStore, tournament: u8) -> u64 {
    let unit = UnitKey::Tournament(id(tournament));
    let stored = store.unit(unit).await.expect("readable");
    stored.expect("it exists").rows.len() as u64
}

/// The only game of a unit.
async fn resumed(store: &PostgresStore, unit: u8, epoch: Epoch) -> ResumableGame {
    let unit = store.load(id(unit), epoch).await.expect("readable");
    let mut games = unit.expect("it is owned").games;
    assert_eq!(games.len(), 1);
    games.remove(0)
}
