//! Taking somebody out of the database. What becomes of whole games and their files is tested with the command line.

use chefshat_record::pseudonym::Pseudonym;

use super::*;
use crate::store::Forgetting;

#[tokio::test]
async fn who_sat_down_is_known_whether_they_stayed_or_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = opened(folder.path()).await;
    let header = Arc::new(header(1, Durability::Durable));
    let seated = |name: &str| Entry {
        at: Duration::ZERO,
        change: Change::Seated {
            seat: Seat::new(1),
            participant: Box::new(SeatedParticipant {
                name: name.into(),
                kind: ParticipantKind::Human,
                ticket: SecretHash::of(b"ticket"),
            }),
        },
    };
    let left = Entry {
        at: Duration::ZERO,
        change: Change::Vacated(Seat::new(1)),
    };
    let created = store.create(Arc::clone(&header), vec![seated("Ana"), left]);
    let mut journal = created.await.expect("kept");
    journal.append(&mut vec![seated("Bo")]).await.expect("kept");
    journal.finish(Some(summary(&header))).await.expect("kept");
    drop(journal);
    store.close().await;
    drop(store);

    let mut database = Forgetting::open(folder.path()).await.expect("free");
    let sat_down = database.sat_down(header.game_id).await.expect("readable");
    assert_eq!(sat_down, ["Ana", "Bo"]);
    let who = Pseudonym {
        name: "Ana".into(),
        pseudonym: "X".into(),
    };
    assert_eq!(database.forget(&who).await.expect("over").games, 1);
    let sat_down = database.sat_down(header.game_id).await.expect("readable");
    assert_eq!(sat_down, ["X", "Bo"]);
    let nowhere = database.sat_down(Id([9; 16])).await.expect("readable");
    assert!(nowhere.is_empty());
}
