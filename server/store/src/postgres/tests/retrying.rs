//! Work that is tried again because no answer came: what an earlier attempt has committed, or still
//! commits, counts as done once it is safe; and a connection that hangs is replaced.

use std::future::pending;
use std::pin::pin;

use chefshat_postgres::Server;
use sqlx::Connection as _;
use tokio::io::copy_bidirectional;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{oneshot, watch};

use super::*;

/// What happens to the connections of a [`Line`].
#[derive(Clone, Copy)]
enum Fault {
    /// The node's ends are closed; the database notices nothing.
    Cut,
    /// Nothing passes any more, and nobody notices.
    Hang,
}

/// What is between a node and its database.
pub(super) struct Line {
    pub(super) url: String,
    faults: watch::Sender<Fault>,
}

impl Line {
    pub(super) async fn to(database: &Database) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
        let own = listener.local_addr().expect("it is bound").to_string();
        let address = open::address(database.url()).expect("an address");
        let address = format!("{}:{}", address.get_host(), address.get_port());
        let url = database.url().replacen(&address, &own, 1);
        let faults = watch::Sender::new(Fault::Cut);
        let line = faults.clone();
        tokio::spawn(async move {
            while let Ok((node, _)) = listener.accept().await {
                let database = TcpStream::connect(&address).await;
                let database = database.expect("the database listens");
                tokio::spawn(carry(node, database, line.subscribe()));
            }
        });
        Self { url, faults }
    }

    async fn node(&self) -> Arc<PostgresStore> {
        let store = PostgresStore::open(&self.url, patient()).await;
        let store = store.expect("an empty database, or one of ours");
        store.join(NodeInfo::default()).await.expect("it joins");
        Arc::new(store)
    }

    /// Does this to the connections that there are.
    fn fail(&self, fault: Fault) {
        self.faults.send_replace(fault);
    }
}

/// Carries one connection until it ends or fails; what fails stays open at the database.
async fn carry(mut node: TcpStream, mut database: TcpStream, mut faults: watch::Receiver<Fault>) {
    tokio::select! {
        _ = copy_bidirectional(&mut node, &mut database) => return,
        changed = faults.changed() => changed.expect("the line exists"),
    }
    if matches!(*faults.borrow(), Fault::Cut) {
        drop(node);
    }
    pending::<()>().await;
}

/// Loses the connection of some work whose commit waits in the database, and lets it continue there
/// when the next attempt waits for it.
async fn overtake(line: &Line, holder: &mut PgConnection) {
    waiting(holder, "advisory").await;
    line.fail(Fault::Cut);
    waiting(holder, "transactionid").await;
    run(holder, "SELECT pg_advisory_unlock(1)").await;
}

#[tokio::test]
async fn what_an_earlier_attempt_still_commits_counts_as_done() {
    let database = chefshat_postgres::database();
    let line = Line::to(&database).await;
    let store = line.node().await;
    let at_commit = "CONSTRAINT TRIGGER wait AFTER INSERT ON tournament_entries
                     DEFERRABLE INITIALLY DEFERRED FOR EACH ROW";
    let mut holder = hold(&database, at_commit).await;
    let created = store.create_tournament(cup(9), begun());
    let (created, ()) = futures::join!(created, overtake(&line, &mut holder));
    assert_eq!(created, Ok(()));
    run(&mut holder, "SELECT pg_advisory_lock(1)").await;
    let appended = store.append_tournament(id(9), 1, begun());
    let (appended, ()) = futures::join!(appended, overtake(&line, &mut holder));
    assert_eq!(appended, Ok(()));
    assert_eq!(tournament_rows(&store, 9).await, 2);
    store.close().await;
}

#[tokio::test]
async fn connections_that_hang_do_not_keep_their_places() {
    let database = chefshat_postgres::database();
    let line = Line::to(&database).await;
    let store = line.node().await;
    let (mut holder, mut observer) = (connected(&database).await, connected(&database).await);
    run(&mut holder, "BEGIN").await;
    run(&mut holder, "LOCK nodes").await;
    let beats: Vec<_> = (0..BEATERS)
        .map(|_| {
            let store = Arc::clone(&store);
            tokio::spawn(async move { store.beat(REACHED).await })
        })
        .collect();
    let all = "SELECT count(*) = $1 FROM pg_stat_activity
               WHERE datname = current_database() AND wait_event = 'relation'";
    let mut wait = false;
    while !wait {
        let all = sqlx::query_scalar(all).bind(i64::from(BEATERS));
        wait = all.fetch_one(&mut observer).await.expect("readable");
    }
    line.fail(Fault::Hang);
    run(&mut holder, "ROLLBACK").await;
    // The node gives up waiting.
    beats.iter().for_each(JoinHandle::abort);
    let beating = async { while store.beat(REACHED).await.is_err() {} };
    let beats = tokio::time::timeout(Duration::from_secs(60), beating).await;
    assert_eq!(beats, Ok(()), "the database can be reached");
    store.close().await;
}

/// A database with a synchronous standby, which is away while a test wants it.
struct Primary {
    database: Database,
    admin: PgConnection,
    /// Processes that have waited for the standby since it was lost.
    known: Vec<i32>,
    _server: Server,
}

impl Primary {
    async fn new() -> Self {
        let server = Server::start();
        let database = server.database();
        Self {
            admin: connected(&database).await,
            database,
            known: Vec::new(),
            _server: server,
        }
    }

    /// From now on no commit is answered.
    async fn lose_standby(&mut self) {
        (self.database).run("ALTER SYSTEM SET synchronous_standby_names = 'nobody'");
        self.database.run("SELECT pg_reload_conf()");
        // The server reads its settings when it likes.
        let mut probe = connected(&self.database).await;
        let probing = async {
            let write = "SELECT pg_logical_emit_message(true, '', '')";
            while sqlx::query(write).execute(&mut probe).await.is_ok() {}
        };
        let ending = async {
            let process = self.wait().await;
            self.end(process).await;
        };
        futures::join!(probing, ending);
    }

    /// Answers what waits and what comes.
    fn regain_standby(&mut self) {
        self.known.clear();
        (self.database).run("ALTER SYSTEM RESET synchronous_standby_names");
        self.database.run("SELECT pg_reload_conf()");
    }

    /// Waits until one more process waits for the standby.
    async fn wait(&mut self) -> i32 {
        loop {
            let process = waiting(&mut self.admin, "SyncRep").await;
            if !self.known.contains(&process) {
                self.known.push(process);
                return process;
            }
        }
    }

    /// Ends a process that waits for the standby. What it has committed is visible then.
    async fn end(&mut self, process: i32) {
        let ended = sqlx::query("SELECT pg_terminate_backend($1, 60000)").bind(process);
        ended.execute(&mut self.admin).await.expect("it ends");
    }
}

#[tokio::test]
async fn what_stands_is_acknowledged_when_the_standby_has_it() {
    let mut primary = Primary::new().await;
    let store = node(&primary.database).await;
    let mut journals = Vec::new();
    for room in [1, 2, 3] {
        let durability = [Durability::Durable, Durability::Ephemeral][usize::from(room == 3)];
        let created = store.create(header(room, None, durability), vec![entry(1)]);
        journals.push(created.await.expect("created"));
    }
    let [appending, finishing, ephemeral] = &mut journals[..] else {
        unreachable!("there are three");
    };
    create_cup(&store, 9).await;
    let importing = store.import(id(7), *summary(7), Arc::from([]));
    let works: [(_, BoxFuture<'_, Result<(), StoreError>>); 7] = [
        ("a row", append(appending, 2).boxed()),
        ("an end", finishing.finish(Some(summary(2)), None)),
        ("a whole game", ephemeral.finish(Some(summary(3)), None)),
        (
            "a room",
            async { store.create(durable(4), vec![]).await.map(drop) }.boxed(),
        ),
        ("a tournament", store.create_tournament(cup(8), begun())),
        (
            "a tournament's row",
            store.append_tournament(id(9), 1, begun()),
        ),
        (
            "an import",
            async { importing.await.map(|new| assert!(new)) }.boxed(),
        ),
    ];
    for (what, mut work) in works {
        primary.lose_standby().await;
        let tried_again = async {
            let process = primary.wait().await;
            primary.end(process).await;
            primary.wait().await;
        };
        tokio::select! {
            answer = &mut work => panic!("the standby does not have {what}: {answer:?}"),
            _ = tried_again => {}
        }
        primary.regain_standby();
        assert_eq!(work.await, Ok(()), "{what}");
    }
    store.close().await;
}

/// Whatever a database is set to, by whom and when: `off` would lose what was acknowledged in a
/// crash, and `local` with the primary.
#[tokio::test]
async fn commits_wait_for_the_standby_whatever_the_database_is_set_to() {
    for setting in ["off", "local"] {
        let mut primary = Primary::new().await;
        let name = primary.database.run("SELECT current_database()");
        let before = format!("ALTER DATABASE {name} SET synchronous_commit = {setting}");
        primary.database.run(&before);
        let store = node(&primary.database).await;
        let mut journal = created(&store, 1).await;
        primary
            .database
            .run(&format!("ALTER DATABASE {name} RESET ALL"));
        primary.lose_standby().await;
        let later = format!("ALTER SYSTEM SET synchronous_commit = {setting}");
        primary.database.run(&later);
        primary.database.run("SELECT pg_reload_conf()");
        {
            let mut appending = append(&mut journal, 2).boxed();
            tokio::select! {
                answer = &mut appending => panic!("{setting}: the standby does not have it: {answer:?}"),
                _ = primary.wait() => {}
            }
            primary.regain_standby();
            assert_eq!(appending.await, Ok(()), "{setting}");
        }
        store.close().await;
    }
}

#[tokio::test]
async fn a_move_waits_for_the_standby_whatever_the_database_is_set_to() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = crate::SqliteStore::open(folder.path()).await;
    let source = source.expect("a store");
    let created = source.create(durable(1), vec![entry(1)]).await;
    drop(created.expect("created"));
    source.close().await;
    drop(source);
    let mut primary = Primary::new().await;
    migrate(primary.database.url()).await.expect("it is empty");
    primary.lose_standby().await;
    let off = "ALTER SYSTEM SET synchronous_commit = off";
    primary.database.run(off);
    primary.database.run("SELECT pg_reload_conf()");
    let url = primary.database.url().to_owned();
    let mut moving = pin!(transfer(folder.path(), &url, |_, _| {}));
    tokio::select! {
        moved = &mut moving => panic!("the standby does not have it: {moved:?}"),
        _ = primary.wait() => {}
    }
    primary.regain_standby();
    assert!(moving.await.is_ok_and(|moved| moved.unfinished == 1));
}

#[tokio::test]
async fn what_stands_does_not_fail_with_what_is_refused_beside_it() {
    let mut primary = Primary::new().await;
    let store = node(&primary.database).await;
    primary.database.run(
        "CREATE TABLE refusing ();
         CREATE FUNCTION refuse() RETURNS trigger LANGUAGE plpgsql AS $$
         BEGIN
             IF EXISTS (SELECT FROM refusing) THEN RAISE 'refused'; END IF;
             RETURN NEW;
         END $$;
         CREATE TRIGGER refuse BEFORE INSERT ON owned FOR EACH ROW
             WHEN (NEW.join_code = 'CUP2') EXECUTE FUNCTION refuse()",
    );
    primary.lose_standby().await;
    // Both in one transaction.
    let created = futures::future::join(
        store.create_tournament(cup(1), begun()),
        store.create_tournament(cup(2), begun()),
    );
    let mut created = pin!(created);
    let refusing = async {
        let process = primary.wait().await;
        let refuse = "SET synchronous_commit = local; INSERT INTO refusing DEFAULT VALUES";
        primary.database.run(refuse);
        primary.end(process).await;
        primary.regain_standby();
    };
    tokio::select! {
        created = &mut created => panic!("the standby does not have them: {created:?}"),
        () = refusing => {}
    }
    let (stands, refused) = created.await;
    assert_eq!(stands, Ok(()));
    assert!(matches!(refused, Err(StoreError::Failed(_))), "{refused:?}");
    store.close().await;
}

#[tokio::test]
async fn one_row_that_cannot_be_written_does_not_hold_up_others() {
    const ROOMS: u8 = 8;
    let database = chefshat_postgres::database();
    let store = node(&database).await;
    let mut journals = Vec::new();
    for room in 1..=ROOMS {
        journals.push(created(&store, room).await);
    }
    // As on a damaged page.
    database.run(
        "CREATE FUNCTION damaged() RETURNS trigger LANGUAGE plpgsql AS $$
         BEGIN
             RAISE 'damaged' USING ERRCODE = 'XX001';
         END $$;
         CREATE TRIGGER damaged BEFORE INSERT ON journal FOR EACH ROW
             WHEN (NEW.game = 5) EXECUTE FUNCTION damaged()",
    );
    let mut damaged = journals.remove(4);
    // All of them wait for the two writers.
    let mut late = pin!(append(&mut damaged, 2));
    assert_eq!(late.as_mut().now_or_never(), None);
    let others = journals.iter_mut().map(|journal| append(journal, 2));
    let others = futures::future::join_all(others);
    tokio::select! {
        biased;
        written = &mut late => panic!("{written:?}"),
        others = others => assert!(others.iter().all(Result::is_ok), "{others:?}"),
    }
    database.run("DROP TRIGGER damaged ON journal");
    assert_eq!(late.await, Ok(()));
    store.close().await;
}

#[tokio::test]
async fn a_transaction_that_is_given_up_when_it_begins_does_not_stay_open() {
    let database = chefshat_postgres::database();
    let store = node(&database).await;
    let pool = &store.beats.pool;
    let mut others = Vec::new();
    for _ in 1..BEATERS {
        others.push(pool.acquire().await.expect("the database answers"));
    }
    let (sent, is_sent) = oneshot::channel();
    let given_up = store.beats.read::<()>(move |connection| {
        async move {
            // An answer usually takes a moment.
            while let Some(begun) = connection.begin().now_or_never() {
                let begun = begun.expect("the database answers");
                begun.rollback().await.expect("the database answers");
            }
            sent.send(()).expect("the test waits");
            pending().await
        }
        .boxed()
    });
    tokio::select! {
        _ = given_up => unreachable!("it never ends"),
        sent = is_sent => sent.expect("it is sent"),
    }
    // The pool has one connection, so this uses the same.
    let transaction = || {
        store.beats.read(|connection| {
            sqlx::query_scalar::<_, String>("SELECT pg_current_xact_id()::text")
                .fetch_one(connection)
                .boxed()
        })
    };
    let first = transaction().await.expect("it answers");
    let second = transaction().await.expect("it answers");
    assert_ne!(first, second, "each by itself");
    drop(others);
    store.close().await;
}

/// Six rooms in a database. Another session has locked the journals of the first two.
async fn locked(options: PostgresOptions) -> (Database, PostgresStore, Journals, PgConnection) {
    let database = chefshat_postgres::database();
    let store = node_with(&database, options).await;
    let mut journals = Vec::new();
    for room in 1..=6 {
        journals.push(created(&store, room).await);
    }
    let locked = "TRIGGER wait BEFORE INSERT ON journal FOR EACH ROW WHEN (NEW.game <= 2)";
    let holder = hold(&database, locked).await;
    (database, store, journals, holder)
}

type Journals = Vec<Box<dyn Journal>>;

fn appending(mut journal: Box<dyn Journal>) -> JoinHandle<Result<(), StoreError>> {
    tokio::spawn(async move { append(&mut journal, 2).await })
}

#[tokio::test]
async fn what_is_locked_delays_nothing_else() {
    let (database, store, mut journals, mut holder) = locked(PostgresOptions::default()).await;
    let mut others = journals.split_off(2);
    let mut delayed = Vec::new();
    for journal in journals {
        delayed.push(appending(journal));
        waiting(&mut holder, "advisory").await;
    }
    let append_to_others = async {
        for number in 2..6 {
            for journal in &mut others {
                append(journal, number).await.expect("nobody has locked it");
            }
        }
    };
    let appended = tokio::time::timeout(Duration::from_secs(60), append_to_others).await;
    appended.expect("no room waits for another");
    assert!(delayed.iter().all(|room| !room.is_finished()));
    run(&mut holder, "SELECT pg_advisory_unlock(1)").await;
    for room in delayed {
        assert_eq!(room.await.expect("no panic"), Ok(()));
    }
    assert_eq!(database.run("SELECT count(*) FROM journal"), "24");
    store.close().await;
}

#[tokio::test]
async fn what_is_locked_fails_alone_in_its_batch_when_the_store_is_closed() {
    let (database, store, journals, _holder) = locked(PostgresOptions::default()).await;
    // All at once, so that they share batches.
    let mut appended: Vec<_> = journals.into_iter().map(appending).collect();
    for room in appended.split_off(2) {
        assert_eq!(room.await.expect("no panic"), Ok(()));
    }
    let closed = tokio::time::timeout(Duration::from_secs(60), store.close()).await;
    closed.expect("it does not wait for the lock");
    for room in appended {
        let failed = room.await.expect("no panic");
        assert!(matches!(failed, Err(StoreError::Failed(_))), "{failed:?}");
    }
    assert_eq!(database.run("SELECT count(*) FROM journal"), "10");
}
