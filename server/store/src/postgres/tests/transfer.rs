//! Moving a data directory here: everything arrives, and what was not over resumes.

use std::path::Path;

use chefshat_record::replay;

use super::*;
use crate::testing::folded;
use crate::tournaments::StoredTournament;
use crate::{DATABASE_FILE, OpenError, SqliteStore};
use chefshat_room::Core;
use chefshat_room::ids::Id;

/// A folder with the database that an earlier version wrote.
fn earlier_version() -> tempfile::TempDir {
    let fixture = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/fixtures/database/games.sqlite3"
    );
    let folder = tempfile::tempdir().expect("a folder");
    let database = folder.path().join(DATABASE_FILE);
    std::fs::copy(fixture, database).expect("copied");
    folder
}

async fn sqlite(folder: &Path) -> SqliteStore {
    SqliteStore::open(folder).await.expect("a usable folder")
}

/// Everything that a store says about games that are over and tournaments.
async fn shown(store: &dyn Store) -> String {
    let filter = v1::RecordFilter::default();
    let listed = store.list(&filter, Part::FROM_OLDEST, 99).await;
    let listed = listed.expect("readable");
    let mut games = Vec::new();
    for listed in &listed {
        let id = Id::parse(&listed.summary.as_ref().expect("readable").game_id).expect("an id");
        let stored = store.finished(id).await.expect("readable");
        games.push(stored.expect("it is listed"));
    }
    let count = store.finished_games().await.expect("readable");
    let files = store.without_record_file().await.expect("readable");
    format!("{listed:?}{games:?}{count}{files:?}")
}

#[tokio::test]
async fn a_database_of_an_earlier_version_moves_with_everything_in_it() {
    let folder = earlier_version();
    let source = sqlite(folder.path()).await;
    let before = shown(&source).await;
    let mut unfinished = source.resumable_games(u64::MAX).await.expect("readable");
    let tournaments = source.tournaments(99).await.expect("readable");

    let database = chefshat_postgres::database();
    let in_use = transfer(folder.path(), database.url(), |_, _| {}).await;
    let error = in_use.expect_err("a server uses the folder");
    assert!(matches!(error, TransferError::Folder(_)), "{error}");
    source.close().await;
    drop(source);

    let mut progress = Vec::new();
    let moved = transfer(folder.path(), database.url(), |moved, all| {
        progress.push((moved, all));
    });
    let moved = moved.await.expect("it moves");
    assert_eq!(moved.unfinished, unfinished.len() as u64);
    assert_eq!(moved.tournaments, tournaments.len() as u64);
    assert_eq!(moved.unreadable, 0);
    let all = moved.finished + moved.unfinished;
    assert_eq!(progress.last(), Some(&(all, all)));
    let store = node(&database).await;
    assert_eq!(shown(&store).await, before);

    // Every game that is over replays; every other one resumes where it was.
    let filter = v1::RecordFilter::default();
    let listed = store.list(&filter, Part::FROM_OLDEST, 99).await;
    for listed in listed.expect("readable") {
        let id = Id::parse(&listed.summary.as_ref().expect("readable").game_id).expect("an id");
        let stored = store.finished(id).await.expect("readable");
        let lines = stored.expect("it is listed").lines().into_owned();
        let replayed = replay::replay(&lines);
        replayed.unwrap_or_else(|error| panic!("{id}: {error}"));
    }
    let mut resumed = Vec::new();
    let mut resumed_tournaments = Vec::new();
    for (id, epoch) in store.orphans(99).await.expect("readable") {
        let epoch = store.claim(id, epoch).await.expect("it answers");
        let epoch = epoch.expect("nobody owns it");
        let unit = store.load(id, epoch).await.expect("readable");
        let unit = unit.expect("it is owned");
        resumed.extend(unit.games);
        if let Some((UnitKey::Tournament(id), stored)) = unit.stored {
            let stored = StoredTournament::decode(id, &stored);
            resumed_tournaments.push(stored.expect("readable"));
        }
    }
    let by_id = |game: &ResumableGame| game.header.game_id;
    resumed.sort_by_key(by_id);
    unfinished.sort_by_key(by_id);
    assert_eq!(resumed.len(), unfinished.len());
    for (old, mut new) in unfinished.into_iter().zip(resumed) {
        let last = new.entries.pop().expect("the takeover wrote an entry");
        assert!(matches!(last.change, Change::ServerRestarted));
        assert_eq!(format!("{:?}", old.entries), format!("{:?}", new.entries));
        assert_eq!(format!("{:?}", old.header), format!("{:?}", new.header));
        let header = Arc::new(new.header);
        Core::revived(header, &new.entries, last.at).expect("a consistent journal");
        let appended = new.journal.append(&mut vec![last]).await;
        appended.expect("its new owner writes");
    }
    let over = store.tournaments(99).await.expect("readable");
    assert_eq!(over.len(), tournaments.len());
    assert_eq!(format!("{over:?}"), format!("{tournaments:?}"));
    for tournament in &resumed_tournaments {
        folded(tournament).unwrap_or_else(|problem| panic!("{problem}"));
    }
    assert!(!resumed_tournaments.is_empty(), "one continues");

    // What comes next is numbered after what was moved.
    let last = store.list(&filter, Part::FROM_NEWEST, 1).await;
    let last = last.expect("readable").remove(0).number;
    let created = store.create(durable(1), vec![entry(1)]).await;
    let finished = created
        .expect("created")
        .finish(Some(summary(1)), None)
        .await;
    finished.expect("committed");
    let next = store.list(&filter, Part::FROM_NEWEST, 1).await;
    assert_eq!(next.expect("readable").remove(0).number, last + 1);

    let again = transfer(folder.path(), database.url(), |_, _| {}).await;
    let error = again.expect_err("it has games");
    assert!(matches!(error, TransferError::NotEmpty), "{error}");
    let elsewhere = chefshat_postgres::database();
    let twice = transfer(folder.path(), elsewhere.url(), |_, _| {}).await;
    let error = twice.expect_err("its games would go on twice");
    let is_moved_already = matches!(error, TransferError::Folder(OpenError::Moved(..)));
    assert!(is_moved_already, "{error}");
    assert!(is_moved(folder.path()).await);
    let kept = SqliteStore::open_for_deletion(folder.path()).await;
    kept.expect("its data can be deleted").close().await;
    store.close().await;
}

/// Whether no server starts on a folder, because its games have moved.
async fn is_moved(folder: &Path) -> bool {
    for opened in [
        SqliteStore::open(folder).await,
        SqliteStore::open_or_new(folder).await,
    ] {
        match opened {
            Ok(store) => {
                store.close().await;
                return false;
            }
            Err(OpenError::Moved(_, address)) => assert!(
                address.starts_with("postgres://127.") && !address.contains('@'),
                "{address}"
            ),
            Err(error) => panic!("{error}"),
        }
    }
    true
}

#[tokio::test]
async fn a_folder_whose_move_has_no_answer_is_used_by_no_server() {
    for (at_the_end, unknown) in [
        ("RAISE EXCEPTION ''refused''", false),
        ("PERFORM pg_terminate_backend(pg_backend_pid())", true),
    ] {
        let folder = earlier_version();
        let database = chefshat_postgres::database();
        migrate(database.url()).await.expect("an empty database");
        database.run(&format!(
            "CREATE FUNCTION at_the_end() RETURNS trigger LANGUAGE plpgsql AS 'BEGIN {at_the_end}; RETURN NULL; END';
             CREATE CONSTRAINT TRIGGER at_the_end AFTER INSERT ON games DEFERRABLE INITIALLY DEFERRED
                 FOR EACH ROW EXECUTE FUNCTION at_the_end()"
        ));
        let error = transfer(folder.path(), database.url(), |_, _| {}).await;
        let error = error.expect_err("it does not end");
        let is_unknown = matches!(error, TransferError::Unknown(_));
        assert_eq!(is_unknown, unknown, "{error}");
        assert_eq!(is_moved(folder.path()).await, unknown);
        database.run("DROP TRIGGER at_the_end ON games");
        let moved = transfer(folder.path(), database.url(), |_, _| {}).await;
        assert!(moved.is_ok_and(|moved| moved.finished > 0));
        assert!(is_moved(folder.path()).await);
    }
}

#[tokio::test]
async fn a_name_that_no_index_takes_does_not_prevent_a_move() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = sqlite(folder.path()).await;
    let long = v1::RecordSummary {
        seats: vec![v1::Participant {
            name: hex::encode(random_bytes::<8_192>()),
            ..v1::Participant::default()
        }],
        ..*summary(1)
    };
    let imported = source.import(id(1), long, Arc::from([]));
    assert_eq!(imported.await, Ok(true));
    source.close().await;
    drop(source);
    let database = chefshat_postgres::database();
    let moved = transfer(folder.path(), database.url(), |_, _| {}).await;
    assert_eq!(moved.expect("it moves").finished, 1);
}

#[tokio::test]
async fn a_move_that_fails_moves_nothing() {
    let folder = earlier_version();
    let database = chefshat_postgres::database();
    migrate(database.url()).await.expect("an empty database");
    database.run("ALTER TABLE participants ADD CHECK (seat < 3)");
    let failed = transfer(folder.path(), database.url(), |_, _| {}).await;
    let error = failed.expect_err("a row is refused");
    assert!(error.to_string().contains("nothing was moved"), "{error}");
    for table in ["games", "journal", "tournaments", "owned", "participants"] {
        let rows = database.run(&format!("SELECT count(*) FROM {table}"));
        assert_eq!(rows, "0", "{table}");
    }
    assert!(!is_moved(folder.path()).await);
    database.run("ALTER TABLE participants DROP CONSTRAINT participants_seat_check");
    let moved = transfer(folder.path(), database.url(), |_, _| {}).await;
    assert!(moved.is_ok_and(|moved| moved.finished > 0));
    let empty = tempfile::tempdir().expect("a folder");
    let missing = transfer(empty.path(), database.url(), |_, _| {}).await;
    let error = missing.expect_err("there is nothing to move");
    assert!(matches!(error, TransferError::Missing(_)), "{error}");
}
