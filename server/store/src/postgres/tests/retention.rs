//! What retention leaves alone.

use super::*;

/// The numbers of the games that may be deleted although one is kept.
async fn prunable(store: &PostgresStore) -> Vec<u8> {
    let found = store.prunable(Keep::default(), 0, 99).await;
    let found = found.expect("readable");
    found.iter().map(|(_, game)| game.bytes()[0]).collect()
}

#[tokio::test]
async fn a_tournament_needs_its_games_at_every_node_until_it_is_over() {
    let database = chefshat_postgres::database();
    let first = node(&database).await;
    stop_clock(&database);
    let second = node(&database).await;
    create_cup(&first, 9).await;
    for (room, tournament) in [(1, Some(9)), (2, None), (3, None)] {
        let header = header(room, tournament, Durability::Durable);
        let mut journal = begin(&first, &header, vec![entry(1)]).await;
        finish(&mut journal, room).await;
        let written = first.mark_record_written(id(room));
        written.await.expect("committed");
    }
    assert_eq!(prunable(&second).await, [2]);

    // Also when the rooms have been removed.
    advance(&database, 600_001);
    first.beat(REACHED).await.expect("it answers");
    second.tidy().await.expect("it answers");
    assert_eq!(second.locate(id(2)).await, Ok(None));
    assert_eq!(prunable(&second).await, [2]);
    // Its owner does not read them all when it resumes it.
    let unit = first.load(id(9), Epoch::FIRST).await;
    let unit = unit.expect("readable").expect("it is owned");
    assert_eq!(unit.games.len(), 0);

    let end = vec![TournamentEntry::Change(TournamentChange::Closed)];
    let ended = first.append_tournament(id(9), 1, end);
    ended.await.expect("committed");
    assert_eq!(prunable(&second).await, [1, 2]);
    second.tidy().await.expect("it answers");
    assert_eq!(second.locate(id(1)).await, Ok(None));
    first.close().await;
    second.close().await;
}

#[tokio::test]
async fn a_game_with_a_damaged_id_does_not_hide_the_others() {
    let database = chefshat_postgres::database();
    let store = node(&database).await;
    for room in [1, 2, 3] {
        played(&store, room).await;
    }
    database
        .run("UPDATE games SET game_id = 'damaged' WHERE number = (SELECT min(number) FROM games)");
    let found = store.prunable(Keep::default(), 0, 1).await;
    let found = found.expect("readable").into_iter();
    assert_eq!(Vec::from_iter(found.map(|(_, game)| game)), [id(2)]);
    store.close().await;
}

#[tokio::test]
async fn a_record_takes_no_id_of_a_game_that_another_node_plays() {
    let database = chefshat_postgres::database();
    let (first, second) = (node(&database).await, node(&database).await);
    for (room, durability) in [(1, Durability::Ephemeral), (2, Durability::Durable)] {
        let played = header(room, None, durability);
        let import = || second.import(played.game_id, *summary(room), Arc::from([]));
        let mut journal = begin(&first, &played, vec![entry(1)]).await;
        assert_eq!(import().await, Ok(false));
        finish(&mut journal, room).await;
        assert_eq!(import().await, Ok(false));
        let stored = second.finished(played.game_id).await.expect("readable");
        assert!(matches!(stored, Some(StoredGame::Hosted(..))));
    }
    first.close().await;
    second.close().await;
}

/// Neither sees what the other has not committed.
#[tokio::test]
async fn a_record_and_a_game_take_one_id_only_once_at_the_same_time() {
    for (import_first, trigger) in [
        (true, "TRIGGER held BEFORE INSERT ON games FOR EACH ROW"),
        (false, "TRIGGER held BEFORE INSERT ON owned FOR EACH ROW"),
    ] {
        let database = chefshat_postgres::database();
        let (first, second) = (node(&database).await, node(&database).await);
        let mut holder = hold(&database, trigger).await;
        let played = header(1, None, Durability::Ephemeral);
        let id = played.game_id;
        let import = || async {
            let imported = second.import(id, *summary(1), Arc::from([])).await;
            imported.expect("it answers")
        };
        let create = || async {
            let created = first.create(Arc::clone(&played), vec![entry(1)]).await;
            match created {
                Ok(_) => true,
                Err(StoreError::Taken(_)) => false,
                Err(error) => panic!("{error}"),
            }
        };
        let (earlier, later): (BoxFuture<'_, bool>, BoxFuture<'_, bool>) = match import_first {
            true => (import().boxed(), create().boxed()),
            false => (create().boxed(), import().boxed()),
        };
        let later = async {
            waiting(&mut holder, "advisory").await;
            tokio::pin!(later);
            // It waits. If it does not, this is long enough for it.
            let early = tokio::time::timeout(Duration::from_secs(1), &mut later).await;
            run(&mut holder, "SELECT pg_advisory_unlock(1)").await;
            match early {
                Ok(taken) => taken,
                Err(_) => later.await,
            }
        };
        let taken = tokio::join!(earlier, later);
        assert_eq!(taken, (true, false), "import first: {import_first}");
        first.close().await;
        second.close().await;
    }
}
