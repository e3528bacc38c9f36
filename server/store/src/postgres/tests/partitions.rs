//! The partitions of the table of journals.

use super::*;

/// Removing a participant finds its name in what retention has left of a game, too.
#[tokio::test]
async fn a_name_is_removed_from_journals_of_deleted_games() {
    let database = chefshat_postgres::database();
    let store = node(&database).await;
    played(&store, 1).await;
    played(&store, 2).await;
    database.run("UPDATE journal SET entries = entries || 'Rosa'::bytea WHERE position = 0");
    prune(&store, [1]).await;
    let with_name = "SELECT count(*) FROM journal WHERE position('Rosa'::bytea IN entries) > 0";
    assert_eq!(database.run(with_name), "2");
    store
        .control
        .forget_pruned("Rosa")
        .await
        .expect("it answers");
    assert_eq!(database.run(with_name), "1");
    store.close().await;
}

/// The number of each partition, and of the games with rows in it.
fn partitions(database: &Database) -> String {
    database.run(
        "SELECT string_agg(number || ':' || games, ' ' ORDER BY number)
         FROM (SELECT substr(relname::text, 9)::bigint AS number,
                      (SELECT count(DISTINCT game) FROM journal WHERE journal.tableoid = pg_class.oid) AS games
               FROM pg_inherits JOIN pg_class ON pg_class.oid = inhrelid
               WHERE inhparent = 'journal'::regclass) AS partitions",
    )
}

/// As if this many partitions had been filled and their games deleted.
fn filled(database: &Database, partitions: u32) {
    let number = 262_144 * partitions;
    database.run(&format!("SELECT setval('games_number_seq', {number})"));
}

async fn prune<const N: usize>(store: &PostgresStore, rooms: [u8; N]) {
    let games = rooms.map(|room| durable(room).game_id);
    let pruned = store.prune(games.into()).await;
    assert_eq!(pruned.expect("committed").len(), N);
}

#[tokio::test]
async fn journals_of_deleted_games_go_with_their_partition_or_after_a_minute() {
    let database = chefshat_postgres::database();
    let store = node(&database).await;
    stop_clock(&database);
    let tidy = || async { store.tidy().await.expect("it answers") };
    tidy().await;
    assert_eq!(partitions(&database), "1:0 2:0 3:0 4:0 5:0");
    played(&store, 1).await;
    played(&store, 2).await;
    filled(&database, 1);
    played(&store, 3).await;
    filled(&database, 4);
    tidy().await;
    played(&store, 4).await;
    // Nothing is in the second one, and none of the games in the third was ever seen.
    assert_eq!(partitions(&database), "1:2 2:1 4:0 5:1 6:0 7:0");

    prune(&store, [1, 3]).await;
    assert_eq!(partitions(&database), "1:2 2:1 4:0 5:1 6:0 7:0");
    tidy().await;
    assert_eq!(partitions(&database), "1:2 4:0 5:1 6:0 7:0");
    advance(&database, 60_001);
    tidy().await;
    assert_eq!(partitions(&database), "1:1 4:0 5:1 6:0 7:0");
    assert_eq!(database.run("SELECT count(*) FROM pruned"), "0");
    for (room, is_there) in [(1, false), (2, true), (3, false), (4, true)] {
        let stored = store.finished(durable(room).game_id).await;
        assert_eq!(stored.expect("readable").is_some(), is_there, "{room}");
    }

    // All of the first partition, by and by; the newest ones stay.
    prune(&store, [2, 4]).await;
    tidy().await;
    assert_eq!(partitions(&database), "4:0 5:1 6:0 7:0");
    advance(&database, 60_001);
    tidy().await;
    assert_eq!(partitions(&database), "4:0 5:0 6:0 7:0");
    filled(&database, 7);
    tidy().await;
    assert_eq!(partitions(&database), "7:0 8:0 9:0 10:0");
    played(&store, 5).await;
    store.close().await;
}

#[tokio::test]
async fn a_partition_that_somebody_reads_is_dropped_later() {
    let database = chefshat_postgres::database();
    let store = node(&database).await;
    filled(&database, 3);
    let mut backup = connected(&database).await;
    run(&mut backup, "BEGIN").await;
    run(&mut backup, "LOCK TABLE journal IN ACCESS SHARE MODE").await;
    // Partitions are added all the same.
    store.tidy().await.expect("it answers");
    played(&store, 1).await;
    assert_eq!(partitions(&database), "1:0 2:0 3:0 4:1 5:0 6:0");
    run(&mut backup, "COMMIT").await;
    store.tidy().await.expect("it answers");
    assert_eq!(partitions(&database), "3:0 4:1 5:0 6:0");
    store.close().await;
}

#[tokio::test]
async fn nodes_add_and_drop_partitions_at_the_same_time() {
    let database = chefshat_postgres::database();
    let (first, second) = (node(&database).await, node(&database).await);
    for round in 1..=10 {
        filled(&database, 2 * round);
        let (one, other) = futures::future::join(first.tidy(), second.tidy()).await;
        one.and(other).expect("it answers");
        played(&first, u8::try_from(round).expect("few")).await;
    }
    // A lock that another one had may have left a partition to the next time.
    first.tidy().await.expect("it answers");
    let kept = partitions(&database);
    assert_eq!(
        kept.split(' ').filter(|it| it.ends_with(":1")).count(),
        10,
        "{kept}"
    );
    assert!(kept.starts_with("3:1 5:1 7:1 9:1 11:1 "), "{kept}");
    for node in [first, second] {
        node.close().await;
    }
}
