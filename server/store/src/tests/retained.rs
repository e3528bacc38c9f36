//! What retention leaves alone, in each store.

use chefshat_room::ids::{GameId, Id, StudyId, TournamentId};
use chefshat_room::journal::{GameHeader, StudyGame, TournamentGame};
use chefshat_room::testing::study_member;
use chefshat_tournament::Change as TournamentChange;

use super::*;
use crate::studies::StudyHeader;
use crate::tournaments::TournamentEntry;

const TOURNAMENT: TournamentId = TournamentId::from_bytes([7; 16]);
const STUDY: StudyId = StudyId::from_bytes([8; 16]);

/// What a game is part of.
#[derive(Clone, Copy)]
enum Of {
    Nothing,
    Tournament,
    Study,
}

fn header_of(game: u8, of: Of, durability: Durability) -> Arc<GameHeader> {
    let study = StudyGame {
        study: STUDY,
        name: "a study".into(),
        condition: "slow".into(),
        levels: Default::default(),
        members: vec![study_member(1, "P1", 0)],
        group: None,
        step: 0,
        practice: false,
        seed_index: None,
        attempt: 1,
        labels: Default::default(),
    };
    Arc::new(GameHeader {
        tournament: matches!(of, Of::Tournament).then_some(TournamentGame {
            tournament: TOURNAMENT,
            series: None,
        }),
        study: matches!(of, Of::Study).then(|| Arc::new(study)),
        ..GameHeader::clone(&header(game, durability))
    })
}

async fn play(store: &dyn Store, game: u8, of: Of, durability: Durability) {
    let header = header_of(game, of, durability);
    let created = store.create(Arc::clone(&header), vec![entry()]).await;
    let finished = created
        .expect("a new game")
        .finish(Some(summary(&header)), None)
        .await;
    finished.expect("committed");
    written(store, game).await;
}

async fn written(store: &dyn Store, game: u8) {
    let written = store.mark_record_written(Id::from_bytes([game; 16])).await;
    written.expect("committed");
}

/// Those of the first five games that are stored.
async fn stored(store: &dyn Store) -> Vec<u8> {
    let mut stored = Vec::new();
    for game in 1..=5 {
        let found = store
            .finished(Id::from_bytes([game; 16]))
            .await
            .expect("readable");
        stored.extend(found.map(|_| game));
    }
    stored
}

/// The memory of a server is not asked: it has nothing of what could not be resumed.
#[tokio::test]
async fn games_of_what_is_not_over_are_neither_offered_nor_deleted() {
    with_each_store(async |store| {
        let study = StudyHeader {
            id: STUDY,
            settings: v1::StudySettings::default(),
            created_at_ms: 1_000,
            owner: SecretHash::of(b"owner"),
            key: [8; 32],
        };
        let created = store.create_study(Arc::new(study)).await;
        created.expect("committed");
        let created = store.create_tournament(Arc::new(cup(7)), Vec::new()).await;
        created.expect("committed");
        play(store, 1, Of::Tournament, Durability::Durable).await;
        play(store, 2, Of::Study, Durability::Durable).await;
        play(store, 3, Of::Nothing, Durability::Durable).await;
        play(store, 4, Of::Nothing, Durability::Ephemeral).await;
        play(store, 5, Of::Nothing, Durability::Durable).await;
        assert_eq!(prunable(store, newest(1)).await, [3, 4]);
        // One page has no game that may go.
        let found = store.prunable(newest(1), 0, 1).await.expect("readable");
        assert_eq!(
            found
                .iter()
                .map(|(_, id)| id.bytes()[0])
                .collect::<Vec<_>>(),
            [3]
        );

        let all: Vec<GameId> = (1..=4).map(|game| Id::from_bytes([game; 16])).collect();
        let deleted = store.prune(all.clone()).await.expect("committed");
        assert_eq!(deleted, [Id::from_bytes([3; 16]), Id::from_bytes([4; 16])]);
        assert_eq!(stored(store).await, [1, 2, 5]);
        if store.outlives_server() {
            let unwritten = store.without_record_file().await.expect("readable");
            assert_eq!(unwritten, [], "their files are there");
        }

        let end = vec![TournamentEntry::Change(TournamentChange::Finished)];
        let ended = store.append_tournament(TOURNAMENT, 1, end).await;
        ended.expect("committed");
        assert_eq!(prunable(store, newest(1)).await, [1]);
        store.delete_study(STUDY).await.expect("committed");
        assert_eq!(prunable(store, newest(1)).await, [1, 2]);
        store.prune(all).await.expect("committed");
        assert_eq!(stored(store).await, [5]);
    })
    .await;
}

/// What is deleted on purpose, as a study with its games, is not held back.
#[tokio::test]
async fn a_deletion_on_purpose_asks_nobody() {
    with_each_store(async |store| {
        let created = store.create_tournament(Arc::new(cup(7)), Vec::new()).await;
        created.expect("committed");
        play(store, 1, Of::Tournament, Durability::Durable).await;
        store
            .delete(vec![Id::from_bytes([1; 16])])
            .await
            .expect("committed");
        assert_eq!(stored(store).await, [0; 0]);
    })
    .await;
}
