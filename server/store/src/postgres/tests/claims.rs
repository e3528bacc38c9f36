//! Units that are handed over, claimed together, or left to another version of the program.

use chefshat_cluster::Load;

use super::fencing::Pair;
use super::*;
use crate::form::FORM;
use crate::studies::StudyHeader;
use chefshat_room::ids::UnitId;

const FIRST: Epoch = Epoch::FIRST;
const SECOND: Epoch = Epoch(2);
/// How often the database is asked whether something has happened.
const LOOKS: u32 = 10_000;

async fn create(store: &PostgresStore, rooms: impl IntoIterator<Item = u8>) {
    for room in rooms {
        created(store, room).await;
    }
}

fn at(epoch: Epoch, rooms: impl IntoIterator<Item = u8>) -> Vec<(UnitId, Epoch)> {
    let rooms = rooms.into_iter();
    rooms.map(|room| (id(room), epoch)).collect()
}

#[tokio::test]
async fn several_orphans_are_claimed_together() {
    let pair = Pair::new().await;
    create(&pair.first, 1..=4).await;
    create(&pair.second, [5]).await;
    pair.stall().await;
    let claimed = pair.second.claim(id(2), FIRST).await;
    assert_eq!(claimed, Ok(Some(SECOND)));
    let orphans = at(FIRST, 1..=6);
    let claimed = pair.second.claim_all(orphans).await.expect("it answers");
    let won = Some(SECOND);
    assert_eq!(claimed, [won, None, won, won, None, None]);
    for room in 1..=4 {
        let game = resumed(&pair.second, room, SECOND).await;
        assert_eq!(numbers(&game.entries), [1, 0]);
    }
    assert_eq!(pair.second.orphans(9).await, Ok(vec![]));
    pair.close().await;
}

#[tokio::test]
async fn the_last_word_of_an_owner_costs_no_other_claim() {
    let pair = Pair::new().await;
    create(&pair.first, 1..=3).await;
    // One of them gets a row while it is claimed, again and again.
    pair.database.run(
        "CREATE FUNCTION add() RETURNS trigger LANGUAGE plpgsql AS $$
         BEGIN
             INSERT INTO journal SELECT NEW.game, NEW.position, 1, NEW.entries;
             RETURN NEW;
         END $$;
         CREATE TRIGGER add BEFORE INSERT ON journal FOR EACH ROW
             WHEN (NEW.epoch = 2 AND NEW.game = 2) EXECUTE FUNCTION add()",
    );
    pair.stall().await;
    let claimed = pair.second.claim_all(at(FIRST, 1..=3)).await;
    assert_eq!(claimed, Ok(vec![Some(SECOND), None, Some(SECOND)]));
    assert_eq!(pair.second.orphans(9).await, Ok(at(FIRST, [2])));
    pair.close().await;
}

#[tokio::test]
async fn a_released_unit_is_offered_to_another_node() {
    let pair = Pair::new().await;
    create(&pair.first, 1..=8).await;
    let info = NodeInfo {
        capacity: 1,
        ..NodeInfo::default()
    };
    let next = pair.second.join(info.clone()).await.expect("it joins");
    // It listens from the first time on.
    assert_eq!(pair.second.handed_over().now_or_never(), None);
    let mut observer = connected(&pair.database).await;
    let listens = "SELECT EXISTS (SELECT FROM pg_stat_activity
                   WHERE datname = current_database() AND query LIKE 'LISTEN%' AND state = 'idle')";
    let mut is_listening = false;
    for _ in 0..LOOKS {
        let listens = sqlx::query_scalar(listens).fetch_one(&mut observer);
        is_listening = listens.await.expect("readable");
        if is_listening {
            break;
        }
        tokio::task::yield_now().await;
    }
    assert!(is_listening);
    // Until it has been reached, nothing is offered to it.
    for (room, reached) in [(1, false), (2, true)] {
        pair.second
            .beat(Heartbeat { reached, ..REACHED })
            .await
            .expect("it answers");
        let released = pair.first.release(id(room), FIRST, None);
        released.await.expect("released");
    }
    assert_eq!(pair.second.handed_over().await, (id(2), FIRST));

    // A node that is named has it, whichever other ones there are.
    let other = node(&pair.database).await;
    other.join(info).await.expect("it joins");
    other.beat(REACHED).await.expect("it answers");
    for room in 3..=8 {
        let released = pair.first.release(id(room), FIRST, Some(next));
        released.await.expect("released");
        let unit = (id(room), FIRST);
        assert_eq!(pair.second.handed_over().await, unit);
    }
    other.close().await;
    pair.close().await;
}

#[tokio::test]
async fn nodes_say_how_full_they_are() {
    let pair = Pair::new().await;
    let info = NodeInfo {
        capacity: 9,
        ..NodeInfo::default()
    };
    let node = pair.second.join(info).await.expect("it joins");
    let load = async || {
        let alive = pair.first.alive().await.expect("readable");
        let living = alive.iter().find(|it| it.id == node);
        living.expect("it has a lease").load
    };
    for (reached, rooms) in [(true, 3), (true, 4), (false, 4)] {
        let said = Heartbeat {
            reached,
            rooms,
            ..REACHED
        };
        let beat = pair.second.beat(said);
        beat.await.expect("it answers");
        let said = Load { rooms, capacity: 9 };
        assert_eq!(load().await, reached.then_some(said));
    }
    pair.second.beat(REACHED).await.expect("it answers");
    assert_eq!(load().await.map(|load| load.rooms), Some(0));
    let troubled = Heartbeat {
        unreachable: 2,
        is_stalled: true,
        ..REACHED
    };
    for (said, expected) in [(troubled, (2, true)), (REACHED, (0, false))] {
        pair.second.beat(said).await.expect("it answers");
        let nodes = pair.first.nodes().await.expect("readable");
        let status = nodes.iter().find(|it| it.id == node).expect("it lives");
        assert_eq!((status.unreachable, status.is_stalled), expected);
    }
    let leaves = Heartbeat {
        drains: true,
        ..REACHED
    };
    pair.second.beat(leaves).await.expect("it answers");
    assert_eq!(load().await, None, "it takes nothing");
    pair.database.run("UPDATE nodes SET drain = false");
    pair.first.request_drain(node).await.expect("it answers");
    assert_eq!(load().await, None, "it takes nothing");
    // A node of an earlier version.
    pair.database
        .run("UPDATE nodes SET drain = false, rooms = NULL");
    assert_eq!(load().await, None, "it says nothing");
    pair.close().await;
}

#[tokio::test]
async fn a_room_of_a_newer_form_is_left_to_newer_nodes() {
    let pair = Pair::new().await;
    create(&pair.first, 1..=2).await;
    pair.database
        .run("UPDATE owned SET form = form + 1 WHERE game_id = (SELECT game_id FROM games WHERE number = 1)");
    pair.stall().await;
    assert_eq!(pair.second.orphans(9).await, Ok(at(FIRST, [2])));
    let claimed = pair.second.claim_all(at(FIRST, 1..=2)).await;
    assert_eq!(claimed, Ok(vec![None, Some(SECOND)]));
    pair.close().await;
}

#[tokio::test]
async fn what_is_claimed_has_the_form_of_its_new_owner() {
    let pair = Pair::new().await;
    create(&pair.first, [1]).await;
    let first = &pair.first;
    for number in [2, 3] {
        create_cup(first, number).await;
        let study = StudyHeader {
            id: id(number + 2),
            settings: v1::StudySettings::default(),
            created_at_ms: 1_000,
            owner: SecretHash::of(b"owner"),
            key: [7; 32],
        };
        let created = first.create_study(Arc::new(study));
        created.await.expect("created");
    }
    // An earlier version has stored all of it.
    for table in ["owned", "games", "tournaments", "studies"] {
        pair.database.run(&format!("UPDATE {table} SET form = 1"));
    }
    pair.stall().await;
    let claimed = pair.second.claim_all(at(FIRST, [1, 2, 4])).await;
    assert_eq!(claimed, Ok(vec![Some(SECOND); 3]));
    let stored = "SELECT form FROM games UNION ALL
                  (SELECT form FROM tournaments ORDER BY number) UNION ALL
                  (SELECT form FROM studies ORDER BY number)";
    let forms = [FORM, FORM, 1, FORM, 1].map(|form| form.to_string());
    assert_eq!(pair.database.run(stored), forms.join("\n"));
    pair.close().await;
}
