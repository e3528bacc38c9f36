//! Opening a data folder: unusable ones are refused and left unchanged, obsolete data is removed.

use super::*;

#[tokio::test]
async fn unusable_files_are_refused_and_left_unchanged() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join(DATABASE_FILE);
    let refusal = async |what: &str| {
        let before = std::fs::read(&file).expect("the file exists");
        let refused = SqliteStore::open(folder.path()).await;
        let error = refused.err().unwrap_or_else(|| panic!("{what} was opened"));
        assert_eq!(
            std::fs::read(&file).expect("the file still exists"),
            before,
            "{what}"
        );
        error
    };

    std::fs::write(
        &file,
        "not a database at all, but as long as one".repeat(13),
    )
    .expect("written");
    let error = refusal("a text").await;
    assert!(matches!(error, OpenError::NotOurs(_)), "{error}");
    std::fs::remove_file(&file).expect("removed");

    edit(folder.path(), "CREATE TABLE recipes (name TEXT)").await;
    let error = refusal("another program's database").await;
    assert!(matches!(error, OpenError::NotOurs(_)), "{error}");
    std::fs::remove_file(&file).expect("removed");

    opened(folder.path()).await.close().await;
    let migrated =
        "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
         VALUES (9999, 'of the future', 1, x'00', 0)";
    edit(folder.path(), migrated).await;
    let error = refusal("a database of a newer version").await;
    assert!(matches!(error, OpenError::Newer(_)), "{error}");
    assert!(error.to_string().contains("newer version"), "{error}");

    // The first page is intact, so the file is recognised; the pages it refers to are missing.
    let mut bytes = std::fs::read(&file).expect("readable");
    bytes.truncate(4_096);
    bytes.resize(8 * 4_096, 0xa5);
    std::fs::write(&file, bytes).expect("written");
    let error = refusal("a damaged database").await;
    assert!(matches!(error, OpenError::Damaged(..)), "{error}");
}

#[tokio::test]
async fn a_database_with_only_its_log_left_is_not_recreated() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = opened(folder.path()).await;
    let header = Arc::new(header(1, Durability::Durable));
    let mut journal = begin(&store, &header, Vec::new()).await;
    journal.append(&mut entries()).await.expect("committed");
    // The process dies with most of its data in the write-ahead log.
    let copy = tempfile::tempdir().expect("a folder");
    for name in ["games.sqlite3", "games.sqlite3-wal"] {
        std::fs::copy(folder.path().join(name), copy.path().join(name)).expect("copied");
    }
    std::fs::write(copy.path().join(DATABASE_FILE), "").expect("cut off");
    let log = std::fs::read(copy.path().join("games.sqlite3-wal")).expect("there");
    assert!(!log.is_empty());
    let refused = SqliteStore::open(copy.path()).await;
    let error = refused.err().expect("a damaged database");
    assert!(matches!(error, OpenError::Damaged(..)), "{error}");
    let left = std::fs::read(copy.path().join("games.sqlite3-wal")).expect("there");
    assert_eq!(left, log);
}

/// What a folder has besides its database, and whether that shows a lost one.
#[tokio::test]
async fn a_lost_database_is_not_replaced_by_an_empty_one() {
    let files: [(&[(&str, &str)], bool); 10] = [
        (&[], false),
        (&[("records/", "")], false),
        (&[("signing-key", "a key"), ("tokens.json", "{}")], false),
        (&[("games.lock", "")], false),
        (&[("games.lock", ""), ("signing-key", "a key")], false),
        (&[("records/a.jsonl", "{}")], false),
        (&[("records/a.jsonl.part", "{}"), ("games.lock", "")], false),
        (&[("records/a.jsonl", "{}"), ("games.lock", "")], true),
        (&[("samples/a.0.samples", ""), ("games.lock", "")], true),
        (&[("games.lock", "games.sqlite3 exists\n")], true),
    ];
    for empty in [None, Some(())] {
        for (files, is_lost) in files {
            let folder = tempfile::tempdir().expect("a folder");
            for (name, text) in files {
                let path = folder.path().join(name);
                let parent = path.parent().expect("the folder");
                std::fs::create_dir_all(parent).expect("created");
                match name.ends_with('/') {
                    true => std::fs::create_dir_all(path).expect("created"),
                    false => std::fs::write(path, text).expect("written"),
                }
            }
            let file = folder.path().join(DATABASE_FILE);
            if empty.is_some() {
                std::fs::write(&file, "").expect("written");
            }
            let opened = SqliteStore::open(folder.path()).await;
            match (opened, is_lost) {
                (Ok(store), false) => store.close().await,
                (Err(OpenError::Gone(..)), true) => {
                    let length = file.metadata().map_or(0, |about| about.len());
                    assert_eq!((file.exists(), length), (empty.is_some(), 0));
                    let store = SqliteStore::open_or_new(folder.path()).await;
                    store.expect("wanted").close().await;
                    let store = SqliteStore::open(folder.path()).await;
                    store.expect("there is one now").close().await;
                }
                (opened, _) => panic!("{files:?}: {:?}", opened.err()),
            }
        }
    }
}

/// A server that ran once, even without a game, leaves a note.
#[tokio::test]
async fn a_database_that_is_lost_between_two_starts_is_missed() {
    let tables_lost =
        "PRAGMA application_id = 0; PRAGMA writable_schema = ON; DELETE FROM sqlite_schema";
    for lose in ["remove", "empty", tables_lost] {
        let folder = tempfile::tempdir().expect("a folder");
        opened(folder.path()).await.close().await;
        let file = folder.path().join(DATABASE_FILE);
        match lose {
            "remove" => std::fs::remove_file(&file).expect("removed"),
            "empty" => std::fs::write(&file, "").expect("emptied"),
            statement => edit(folder.path(), statement).await,
        }
        let refused = SqliteStore::open(folder.path()).await;
        let error = refused.err().expect("it is missed");
        assert!(matches!(error, OpenError::Gone(..)), "{lose}: {error}");
        assert!(error.to_string().contains("--new"), "{error}");
    }
}

#[tokio::test]
async fn games_abandoned_before_the_deal_leave_nothing_behind() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = opened(folder.path()).await;
    for game in 1..=2 {
        let header = Arc::new(header(game, Durability::Durable));
        let mut journal = begin(&store, &header, Vec::new()).await;
        journal.append(&mut entries()).await.expect("committed");
        if game == 1 {
            journal.finish(None, None).await.expect("committed");
        }
    }
    store.close().await;
    drop(store);
    opened(folder.path()).await.close().await;
    let mut connection = connected(folder.path()).await;
    for table in ["games", "journal"] {
        let count = format!("SELECT count(*) FROM {table}");
        let rows: i64 = sqlx::query_scalar(sqlx::AssertSqlSafe(count))
            .fetch_one(&mut connection)
            .await
            .expect("readable");
        assert_eq!(rows, 1, "{table}");
    }
}

#[tokio::test]
async fn only_one_server_can_use_a_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = opened(folder.path()).await;
    let second = SqliteStore::open(folder.path()).await;
    let error = second.err().expect("the folder is in use");
    assert!(matches!(error, OpenError::InUse(_)), "{error}");
    first.close().await;
    drop(first);
    opened(folder.path()).await.close().await;
}

#[tokio::test]
async fn a_process_that_is_just_starting_does_not_keep_a_folder_locked() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = opened(folder.path()).await;
    let inherited = first._lock.0.try_clone().expect("a second descriptor");
    first.close().await;
    drop(first);
    opened(folder.path()).await.close().await;
    drop(inherited);
}

#[tokio::test]
async fn the_copy_of_every_database_can_shrink() {
    let vacuum = async |folder: &Path, text: &'static str| -> i64 {
        let mut database = connected(folder).await;
        database.execute(text).await.expect("done");
        let mode = sqlx::query_scalar("PRAGMA auto_vacuum")
            .fetch_one(&mut database)
            .await;
        database.close().await.expect("closed");
        mode.expect("a number")
    };
    let incremental = 2;
    let as_earlier_versions = "PRAGMA auto_vacuum = NONE; VACUUM";
    for (text, mode) in [("", incremental), (as_earlier_versions, 0)] {
        let (folder, copy) = (tempfile::tempdir(), tempfile::tempdir());
        let (folder, copy) = (folder.expect("a folder"), copy.expect("another"));
        opened(folder.path()).await.close().await;
        assert_eq!(vacuum(folder.path(), text).await, mode, "{text}");
        let copied = super::super::copy_database(folder.path(), copy.path()).await;
        copied.expect("copied");
        assert_eq!(vacuum(copy.path(), "").await, incremental, "{text}");
    }
}
