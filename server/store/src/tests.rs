//! Behavior that all stores share. Each test runs with games in memory, in SQLite and in PostgreSQL.

mod forget;
mod lists;
mod retained;
mod studies;
mod tournaments;

use std::path::Path;

use chefshat_room::journal::{Change, Fill};
use chefshat_room::policy::Durability;
use chefshat_room::testing::id;
use futures::FutureExt as _;

use super::*;
use crate::testing::{TypedUnits as _, begin, cup, end, header, summary};

/// Runs a check with a new store of each kind.
async fn with_each_store(check: impl AsyncFn(&dyn Store)) {
    check(&MemoryStore::default()).await;
    with_each_database(check).await;
}

/// Runs a check with a new database of each kind.
async fn with_each_database(check: impl AsyncFn(&dyn Store)) {
    with_each_tables(async |store, _| check(store).await).await;
}

/// The tables below a store.
enum Tables<'a> {
    Sqlite(&'a Path),
    Postgres(&'a chefshat_postgres::Database),
}

impl Tables<'_> {
    /// Executes a statement that both databases know.
    async fn edit(&self, statement: &str) {
        match self {
            Self::Sqlite(folder) => sqlite::tests::edit(folder, statement).await,
            Self::Postgres(database) => drop(database.run(statement)),
        }
    }
}

/// Runs a check with a new database of each kind and its tables.
async fn with_each_tables(check: impl AsyncFn(&dyn Store, Tables<'_>)) {
    let folder = tempfile::tempdir().expect("a folder");
    let store = SqliteStore::open(folder.path()).await.expect("a store");
    check(&store, Tables::Sqlite(folder.path())).await;
    store.close().await;
    let database = chefshat_postgres::database();
    let store = postgres::tests::node(&database).await;
    check(&store, Tables::Postgres(&database)).await;
    store.close().await;
}

fn entry() -> Entry {
    Entry {
        at: std::time::Duration::ZERO,
        change: Change::ServerRestarted,
    }
}

async fn created(store: &dyn Store, game: u8, durability: Durability) -> Box<dyn Journal> {
    begin(store, &header(game, durability), vec![entry()]).await
}

async fn finish(journal: &mut Box<dyn Journal>, game: u8) {
    end(journal, summary(&header(game, Durability::Durable))).await;
}

/// Names and numbers of the finished games after a number.
async fn listed(store: &dyn Store, after: u64) -> Vec<(String, u64)> {
    let all = v1::RecordFilter::default();
    let listed = store.list(&all, Part::After(after), 9).await;
    let listed = listed.expect("readable").into_iter();
    listed
        .map(|it| (it.summary.expect("readable").room_name, it.number))
        .collect()
}

#[tokio::test]
async fn a_cursor_reaches_every_game_that_finishes_later() {
    with_each_store(async |store| {
        for durability in [Durability::Durable, Durability::Ephemeral] {
            let base = if durability == Durability::Durable {
                1
            } else {
                4
            };
            let listed_before = listed(store, 0).await;
            let before = listed_before.last().map_or(0, |(_, number)| *number);
            let mut first = created(store, base, durability).await;
            let mut second = created(store, base + 1, durability).await;
            finish(&mut second, base + 1).await;
            let page = listed(store, before).await;
            let [(name, cursor)] = page.as_slice() else {
                panic!("not exactly one: {page:?}");
            };
            assert_eq!(*name, format!("game {}", base + 1));
            finish(&mut first, base).await;
            let page = listed(store, *cursor).await;
            let [(name, number)] = page.as_slice() else {
                panic!("not exactly one: {page:?}");
            };
            assert_eq!(*name, format!("game {base}"));
            assert!(number > cursor);
        }
    })
    .await;
}

#[tokio::test]
async fn a_signature_is_stored_with_the_end_of_its_game() {
    with_each_store(async |store| {
        for (game, durability) in [(1, Durability::Durable), (2, Durability::Ephemeral)] {
            let signature = v1::RecordSignature {
                text_version: 1,
                public_key: vec![game; 32],
                signature: vec![game; 64],
            };
            let mut journal = created(store, game, durability).await;
            let entries = journal.entries().await.expect("readable");
            assert_eq!(entries.len(), 1, "what is signed can be read back");
            let header = header(game, durability);
            let finished = journal.finish(Some(summary(&header)), Some(signature.clone()));
            finished.await.expect("committed");
            let stored = store.finished(header.game_id).await.expect("readable");
            let Some(StoredGame::Hosted(_, _, Some(stored))) = stored else {
                panic!("{stored:?}");
            };
            assert_eq!(*stored, signature);
        }
    })
    .await;
}

async fn written(store: &dyn Store, game: u8) {
    let written = store.mark_record_written(id(game)).await;
    written.expect("committed");
}

/// Ids of the games that need not be kept, as their first bytes.
async fn prunable(store: &dyn Store, keep: Keep) -> Vec<u8> {
    let found = store.prunable(keep, 0, 9).await.expect("readable");
    found.into_iter().map(|(_, id)| id.bytes()[0]).collect()
}

fn newest(count: u64) -> Keep {
    Keep {
        newest: Some(count),
        ..Keep::default()
    }
}

fn since(ended_since_ms: u64) -> Keep {
    Keep {
        ended_since_ms: Some(ended_since_ms),
        ..Keep::default()
    }
}

#[tokio::test]
async fn the_newest_games_are_those_that_ended_last() {
    with_each_store(async |store| {
        let mut first = created(store, 1, Durability::Durable).await;
        for game in [2, 3, 4] {
            let mut journal = created(store, game, Durability::Durable).await;
            finish(&mut journal, game).await;
            written(store, game).await;
        }
        finish(&mut first, 1).await;
        written(store, 1).await;
        assert_eq!(prunable(store, newest(1)).await, [2, 3, 4]);
        assert_eq!(prunable(store, newest(2)).await, [2, 3]);
        assert_eq!(prunable(store, newest(4)).await, [0; 0]);
        // The newest game stays, because later ones are numbered after it.
        assert_eq!(prunable(store, since(u64::MAX)).await, [2, 3, 4]);
        assert_eq!(prunable(store, since(2_000)).await, [0; 0]);
        let both = Keep {
            newest: Some(3),
            ..since(u64::MAX)
        };
        assert_eq!(prunable(store, both).await, [2]);

        let found = store.prunable(newest(1), 0, 1).await.expect("readable");
        let after = store.prunable(newest(1), found[0].0, 9).await;
        assert_eq!(after.expect("readable").len(), 2, "{found:?}");
        let deleted = [2, 3, 4].map(id).into();
        store.delete(deleted).await.expect("committed");
        let left = listed(store, 0).await;
        assert_eq!(left, [("game 1".into(), 4)]);
    })
    .await;
}

#[tokio::test]
async fn an_import_is_kept_from_the_time_of_its_import() {
    with_each_store(async |store| {
        let last_year = header(1, Durability::Durable);
        let import = store.import(last_year.game_id, *summary(&last_year), Arc::from([]));
        assert_eq!(import.await, Ok(true));
        let mut newer = created(store, 2, Durability::Durable).await;
        finish(&mut newer, 2).await;
        written(store, 2).await;
        if store.outlives_server() {
            assert_eq!(prunable(store, newest(1)).await, [0; 0], "no record yet");
            written(store, 1).await;
        }
        assert_eq!(prunable(store, newest(1)).await, [1]);
        assert_eq!(prunable(store, since(3_000)).await, [0; 0], "just imported");
        assert_eq!(prunable(store, since(u64::MAX)).await, [1]);
    })
    .await;
}

#[tokio::test]
async fn a_taken_game_id_is_refused_and_the_store_keeps_working() {
    with_each_store(async |store| {
        let forged = header(1, Durability::Durable);
        let import = || store.import(forged.game_id, *summary(&forged), Arc::from([]));
        assert_eq!(import().await, Ok(true));
        assert_eq!(import().await, Ok(false));
        let refused = store.create(header(1, Durability::Durable), vec![entry()]);
        assert!(refused.await.is_err(), "the id is taken");
        assert!(store.failed().now_or_never().is_none(), "no failure");

        // Commands in the same transaction as the refused one are committed.
        let others = (2..9).map(|game| created(store, game, Durability::Durable));
        let refused = store.create(header(1, Durability::Durable), vec![entry()]);
        let (mut journals, refused) = futures::join!(futures::future::join_all(others), refused);
        assert!(refused.is_err());
        finish(&mut journals[0], 2).await;
        let game = store.finished(id(2)).await.expect("readable");
        assert!(game.is_some(), "the store keeps working");
        assert_eq!(import().await, Ok(false));
        let taken = store.import(id(2), *summary(&forged), Arc::from([]));
        assert_eq!(taken.await, Ok(false));
        assert!(store.failed().now_or_never().is_none(), "no failure");
    })
    .await;
}

/// Somebody who watches a game knows its id, and could import a record under it before its end.
#[tokio::test]
async fn an_import_does_not_take_the_id_of_a_running_game() {
    with_each_store(async |store| {
        for (game, durability) in [(1, Durability::Ephemeral), (2, Durability::Durable)] {
            let played = header(game, durability);
            let import = || {
                let forged = summary(&played);
                store.import(played.game_id, *forged, Arc::from([]))
            };
            let mut journal = created(store, game, durability).await;
            assert_eq!(import().await, Ok(false), "it runs");
            finish(&mut journal, game).await;
            assert_eq!(import().await, Ok(false), "it is stored");
            drop(journal);
            assert_eq!(import().await, Ok(false), "it is stored");
            let stored = store.finished(played.game_id).await;
            let stored = stored.expect("readable").expect("stored");
            assert!(matches!(stored, StoredGame::Hosted(..)), "{stored:?}");
        }
        // The other way round, the record that is there stays.
        let imported = header(3, Durability::Ephemeral);
        let import = store.import(imported.game_id, *summary(&imported), Arc::from([]));
        assert_eq!(import.await, Ok(true));
        let taken = imported.game_id.to_string();
        let refused = store.create(imported, vec![entry()]).await;
        assert_eq!(refused.err(), Some(StoreError::Taken(taken)));
        // A game that ended without a record leaves its id.
        let mut journal = created(store, 4, Durability::Ephemeral).await;
        journal.finish(None, None).await.expect("committed");
        drop(journal);
        let abandoned = header(4, Durability::Ephemeral);
        let import = store.import(abandoned.game_id, *summary(&abandoned), Arc::from([]));
        assert_eq!(import.await, Ok(true));
        assert!(store.failed().now_or_never().is_none(), "no failure");
    })
    .await;
}

#[tokio::test]
async fn a_text_that_no_database_can_search_for_is_stored() {
    with_each_store(async |store| {
        let strange = Arc::new(GameHeader {
            name: "nothing\0behind".into(),
            ..GameHeader::clone(&header(1, Durability::Durable))
        });
        let mut journal = begin(store, &strange, vec![entry()]).await;
        end(&mut journal, summary(&strange)).await;
        let by_name = v1::RecordFilter {
            room_name: strange.name.clone(),
            ..v1::RecordFilter::default()
        };
        let found = store.list(&by_name, Part::FROM_OLDEST, 9).await;
        let mut found = found.expect("readable");
        assert_eq!(found.len(), 1);
        let summary = found.remove(0).summary.expect("readable");
        assert_eq!(summary.room_name, strange.name);
    })
    .await;
}
