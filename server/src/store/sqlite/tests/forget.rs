//! Removing a participant from the database. The tests of the command line cover whole games and
//! their files.

use chefshat_record::pseudonym::Pseudonym;

use super::*;
use crate::store::Forgetting;

#[tokio::test]
async fn participants_who_sat_down_are_listed_whether_they_stayed_or_not() {
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
    let mut journal = created.await.expect("committed");
    journal
        .append(&mut vec![seated("Bo")])
        .await
        .expect("committed");
    journal
        .finish(Some(summary(&header)), None)
        .await
        .expect("committed");
    drop(journal);
    store.close().await;
    drop(store);

    let mut database = Forgetting::open(folder.path()).await.expect("free");
    let seated_names = database
        .seated_names(header.game_id)
        .await
        .expect("readable");
    assert_eq!(seated_names, ["Ana", "Bo"]);
    let who = Pseudonym {
        name: "Ana".into(),
        pseudonym: "X".into(),
    };
    assert_eq!(database.forget(&who).await.expect("over").games, 1);
    let seated_names = database
        .seated_names(header.game_id)
        .await
        .expect("readable");
    assert_eq!(seated_names, ["X", "Bo"]);
    let nowhere = database.seated_names(Id([9; 16])).await.expect("readable");
    assert!(nowhere.is_empty());
}
