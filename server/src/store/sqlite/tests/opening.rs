//! Opening a data folder: what cannot be used is refused and left as it is, what is not wanted any more goes.

use super::*;

#[tokio::test]
async fn what_cannot_be_used_is_refused_and_left_as_it_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join(super::super::errors::FILE);
    let refusal = async |what: &str| {
        let before = std::fs::read(&file).expect("it is there");
        let refused = SqliteStore::open(folder.path()).await;
        let error = refused.err().unwrap_or_else(|| panic!("{what} was taken"));
        assert_eq!(std::fs::read(&file).expect("still there"), before, "{what}");
        error
    };

    std::fs::write(
        &file,
        "no database at all, and long enough to be taken for one".repeat(9),
    )
    .expect("written");
    let error = refusal("a text").await;
    assert!(matches!(error, OpenError::NotOurs(_)), "{error}");
    std::fs::remove_file(&file).expect("removed");

    let options = SqliteConnectOptions::new()
        .filename(&file)
        .create_if_missing(true);
    let mut other = SqliteConnection::connect_with(&options)
        .await
        .expect("made");
    other
        .execute("CREATE TABLE recipes (name TEXT)")
        .await
        .expect("done");
    other.close().await.expect("closed");
    let error = refusal("another program's database").await;
    assert!(matches!(error, OpenError::NotOurs(_)), "{error}");
    std::fs::remove_file(&file).expect("removed");

    opened(folder.path()).await.close().await;
    let mut connection = SqliteConnection::connect_with(&options)
        .await
        .expect("ours");
    connection
        .execute(
            "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
             VALUES (9999, 'of the future', 1, x'00', 0)",
        )
        .await
        .expect("done");
    connection.close().await.expect("closed");
    let error = refusal("a database of a newer version").await;
    assert!(matches!(error, OpenError::Newer(_)), "{error}");
    assert!(error.to_string().contains("newer version"), "{error}");

    // The first page is whole, so that it is known as ours; what it points to is not there.
    let mut bytes = std::fs::read(&file).expect("readable");
    bytes.truncate(4_096);
    bytes.resize(8 * 4_096, 0xa5);
    std::fs::write(&file, bytes).expect("written");
    let error = refusal("a damaged database").await;
    assert!(matches!(error, OpenError::Damaged(..)), "{error}");
}

#[tokio::test]
async fn a_database_of_which_only_the_log_is_left_is_not_begun_anew() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = opened(folder.path()).await;
    let header = Arc::new(header(1, Durability::Durable));
    let mut journal = store.create(header, Vec::new()).await.expect("kept");
    journal.append(&mut entries()).await.expect("kept");
    // The process dies with most of what it kept in the log of writes.
    let copy = tempfile::tempdir().expect("a folder");
    for name in ["games.sqlite3", "games.sqlite3-wal"] {
        std::fs::copy(folder.path().join(name), copy.path().join(name)).expect("copied");
    }
    std::fs::write(copy.path().join(super::super::errors::FILE), "").expect("cut off");
    let log = std::fs::read(copy.path().join("games.sqlite3-wal")).expect("there");
    assert!(!log.is_empty());
    let refused = SqliteStore::open(copy.path()).await;
    let error = refused.err().expect("it is damaged");
    assert!(matches!(error, OpenError::Damaged(..)), "{error}");
    let left = std::fs::read(copy.path().join("games.sqlite3-wal")).expect("there");
    assert_eq!(left, log);
}

#[tokio::test]
async fn what_was_given_up_before_a_deal_leaves_nothing_behind() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = opened(folder.path()).await;
    for game in 1..=2 {
        let header = Arc::new(header(game, Durability::Durable));
        let mut journal = store.create(header, Vec::new()).await.expect("kept");
        journal.append(&mut entries()).await.expect("kept");
        if game == 1 {
            journal.finish(None).await.expect("kept");
        }
    }
    store.close().await;
    drop(store);
    opened(folder.path()).await.close().await;
    let options =
        SqliteConnectOptions::new().filename(folder.path().join(super::super::errors::FILE));
    let mut connection = SqliteConnection::connect_with(&options)
        .await
        .expect("ours");
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
async fn one_server_has_a_folder_at_a_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = opened(folder.path()).await;
    let second = SqliteStore::open(folder.path()).await;
    let error = second.err().expect("it is in use");
    assert!(matches!(error, OpenError::InUse(_)), "{error}");
    first.close().await;
    drop(first);
    opened(folder.path()).await.close().await;
}
