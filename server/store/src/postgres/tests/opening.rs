//! Opening a database: unusable ones are refused and left unchanged.

use chefshat_postgres::Server;
use sqlx::postgres::PgConnection;
use sqlx::{Connection as _, Executor as _};

use super::retrying::Line;
use super::*;
use crate::postgres::open::{IfEmpty, NEWEST};

/// A database with the tables of an earlier version.
async fn of_version(version: i64) -> Database {
    let database = chefshat_postgres::database();
    let mut connection = connected(&database).await;
    let migrations = (open::MIGRATIONS.into_iter()).filter(|(number, ..)| *number <= version);
    let created = open::run(&migrations.collect::<Vec<_>>(), &mut connection).await;
    created.expect("an empty database");
    database
}

async fn refusal(database: &Database) -> DatabaseError {
    let opened = PostgresStore::open(database.url(), PostgresOptions::default()).await;
    opened.err().expect("it is refused")
}

#[tokio::test]
async fn only_an_empty_database_gets_tables_without_being_asked() {
    let database = chefshat_postgres::database();
    let tables = "SELECT count(*) FROM pg_tables WHERE schemaname = 'public'";
    database.run("CREATE TABLE recipes (name text)");
    let error = refusal(&database).await;
    assert!(matches!(error, DatabaseError::NotOurs), "{error}");
    let error = migrate(database.url()).await.expect_err("it is refused");
    assert!(matches!(error, DatabaseError::NotOurs), "{error}");
    assert_eq!(database.run(tables), "1");

    database.run("DROP TABLE recipes");
    let opened = PostgresStore::open_existing(database.url(), PostgresOptions::default()).await;
    let error = opened.err().expect("it is refused");
    assert!(matches!(error, DatabaseError::Empty), "{error}");
    assert_eq!(database.run(tables), "0");
    node(&database).await.close().await;
    node(&database).await.close().await;
    assert_eq!(migrate(database.url()).await.ok(), Some((NEWEST, NEWEST)));
}

#[tokio::test]
async fn an_upgrade_that_waits_for_a_backup_stops_no_node() {
    let database = of_version(3).await;
    let mut backup = PgConnection::connect(database.url())
        .await
        .expect("it answers");
    for statement in ["BEGIN", "LOCK TABLE nodes IN ACCESS SHARE MODE"] {
        backup.execute(statement).await.expect("locked");
    }

    let url = database.url().to_owned();
    let upgrade = std::thread::spawn(move || {
        let runtime = tokio::runtime::Runtime::new().expect("threads");
        runtime.block_on(migrate(&url)).ok()
    });
    let waiting = "SELECT count(*) FROM pg_stat_activity
                   WHERE wait_event_type = 'Lock' AND datname = current_database()";
    while database.run(waiting).trim() == "0" {
        assert!(!upgrade.is_finished(), "it did not wait");
    }
    database.run("SET statement_timeout = '30s'; UPDATE nodes SET beat_ms = clock_ms()");
    assert!(!upgrade.is_finished());

    backup.execute("COMMIT").await.expect("committed");
    assert_eq!(upgrade.join().expect("no panic"), Some((3, NEWEST)));
}

#[tokio::test]
async fn databases_of_earlier_versions_are_upgraded() {
    for version in 1..NEWEST {
        let database = of_version(version).await;
        // A node of that version, which runs on meanwhile and has created a game.
        database.run(
            "INSERT INTO nodes (name, peer_endpoint, client_endpoint, build, capacity, beat_ms)
             VALUES ('earlier', '', '', '', 0, clock_ms());
             INSERT INTO games (game_id, form, state) VALUES ('1', 1, 0);
             INSERT INTO journal SELECT number, 0, 1, '' FROM games",
        );
        let error = refusal(&database).await;
        assert!(matches!(error, DatabaseError::Older), "{error}");
        let upgraded = migrate(database.url()).await;
        assert_eq!(upgraded.ok(), Some((version, NEWEST)));
        node(&database).await.close().await;
        let earlier = database.run("SELECT bool_and(reached) FROM nodes WHERE name = 'earlier'");
        assert_eq!(earlier.trim(), "t", "nobody asked it");
        // It goes on.
        database.run("INSERT INTO journal SELECT number, 1, 1, '' FROM games");
        let rows = database.run("SELECT count(*) FROM journal JOIN games ON game = number");
        assert_eq!(rows.trim(), "2");
    }
}

#[tokio::test]
async fn a_later_schema_is_used_if_it_only_adds() {
    let database = chefshat_postgres::database();
    assert_eq!(migrate(database.url()).await.ok(), Some((0, NEWEST)));
    database.run(
        "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
         VALUES (9999, 'of the future', true, '', 0)",
    );
    node(&database).await.close().await;
    let error = migrate(database.url()).await.expect_err("it is refused");
    assert!(matches!(error, DatabaseError::Newer), "{error}");
    database.run("UPDATE schema_support SET oldest = 9999");
    let error = refusal(&database).await;
    assert!(matches!(error, DatabaseError::Newer), "{error}");
    database.run(
        "DELETE FROM _sqlx_migrations WHERE version > 1; UPDATE _sqlx_migrations SET version = 0",
    );
    let error = refusal(&database).await;
    assert!(matches!(error, DatabaseError::Older), "{error}");
    assert!(error.to_string().contains("chefshat migrate"), "{error}");
}

#[tokio::test]
async fn addresses_are_refused_without_showing_a_password() {
    for (url, advice) in [
        ("not an address", "postgres://user@host"),
        ("host=localhost password=secret", "postgres://user@host"),
        ("postgres://ada:secret@host:port/games", "port"),
        ("postgres://host:port/games?password=secret", "port"),
        (
            "postgres://ada:secret@127.0.0.1:1/games",
            "cannot be reached",
        ),
    ] {
        let opened = PostgresStore::open(url, PostgresOptions::default()).await;
        let error = opened.err().expect("it is refused").to_string();
        assert!(!error.contains("secret"), "{error}");
        assert!(error.contains(advice), "{error}");
    }
}

#[tokio::test]
async fn a_node_that_has_not_joined_creates_nothing() {
    let database = chefshat_postgres::database();
    let opened = PostgresStore::open(database.url(), PostgresOptions::default()).await;
    let store = opened.expect("an empty database");
    let refused = store.create(durable(1), vec![]).await;
    assert!(matches!(refused.err(), Some(StoreError::Failed(_))));
    store.close().await;
}

#[tokio::test]
async fn plans_of_sessions_that_write_are_not_compiled() {
    let database = chefshat_postgres::database();
    database.run("CREATE TABLE dishes (name text)");
    let address = open::address(database.url()).expect("an address");
    let writer = open::writers(open::sessions(address));
    let mut writer = open::connect_writer(&writer).await.expect("a session");
    let explain = "EXPLAIN ANALYZE SELECT * FROM dishes WHERE name = 'pizza'";
    let plan = sqlx::query_scalar::<_, String>(explain);
    let plan = plan
        .fetch_all(&mut writer)
        .await
        .expect("a plan")
        .join("\n");
    assert!(plan.contains("Seq Scan") && !plan.contains("JIT"), "{plan}");
}

#[tokio::test]
async fn connections_are_encrypted_and_certificates_checked() {
    let tls = |file: &str| {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fixtures/tls/");
        format!("{folder}{file}")
    };
    let text = |file: &str| std::fs::read_to_string(tls(file)).expect("the fixture");
    let mut server = Server::start();
    let database = server.database();
    server.stop();
    server.encrypt(&text("localhost.pem"), &text("localhost.key"));
    server.resume();
    let line = Line::to(&database).await;
    let by_name = line.url.replace("127.0.0.1", "localhost");
    let options = PostgresOptions::default;
    let root = format!("sslrootcert={}", tls("localhost.pem"));
    let checked = format!("{by_name}?sslmode=verify-full&{root}");
    let store = PostgresStore::open(&checked, options()).await;
    let store = store.expect("the certificate is trusted");
    store.join(NodeInfo::default()).await.expect("it joins");
    store.close().await;
    for refused in [
        format!("{by_name}?sslmode=disable"),
        // Nobody trusts this certificate unless asked to.
        format!("{by_name}?sslmode=verify-full"),
    ] {
        let opened = PostgresStore::open(&refused, options()).await;
        let error = opened
            .err()
            .unwrap_or_else(|| panic!("{refused} was opened"));
        assert!(matches!(error, DatabaseError::Other(_)), "{error}");
    }
}

#[tokio::test]
async fn who_finds_a_schema_that_another_node_is_creating_waits_for_it() {
    let database = chefshat_postgres::database();
    let mut creating = connected(&database).await;
    open::lock(&mut creating).await.expect("free");
    // As between two migrations, or in the middle of a look at the tables.
    database.run("CREATE TABLE half_a_schema (id bigint)");
    let address = open::address(database.url()).expect("an address");
    let completing = async {
        waiting(&mut creating, "advisory").await;
        database.run("DROP TABLE half_a_schema");
        drop(creating);
    };
    let (opened, ()) =
        futures::future::join(open::check(&address, IfEmpty::Create), completing).await;
    opened.expect("an empty database");
    assert_eq!(migrate(database.url()).await.ok(), Some((NEWEST, NEWEST)));
}

#[tokio::test]
async fn nodes_that_start_together_on_an_empty_database_all_start() {
    let database = chefshat_postgres::database();
    let address = open::address(database.url()).expect("an address");
    let opening = (0..8).map(|_| open::check(&address, IfEmpty::Create));
    for opened in futures::future::join_all(opening).await {
        opened.expect("created by one of them");
    }
}
