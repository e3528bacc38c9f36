//! What retention leaves alone, in each store.

use chefshat_room::ids::{StudyId, TournamentId};
use chefshat_room::journal::{SeatLabels, StudyGame, TournamentGame};
use chefshat_room::testing::study_game;
use chefshat_tournament::Change as TournamentChange;

use super::*;
use crate::studies::StudyHeader;
use crate::tournaments::TournamentEntry;

const TOURNAMENT: TournamentId = id(7);
const STUDY: StudyId = id(8);

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
        ..study_game(SeatLabels::default())
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
    let mut journal = begin(store, &header, vec![entry()]).await;
    end(&mut journal, summary(&header)).await;
    written(store, game).await;
}

/// Those of the first five games that are stored.
async fn stored(store: &dyn Store) -> Vec<u8> {
    let mut stored = Vec::new();
    for game in 1..=5 {
        let found = store.finished(id(game)).await;
        stored.extend(found.expect("readable").map(|_| game));
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
        assert_eq!((found.len(), found[0].1), (1, id(3)));

        let all = [1, 2, 3, 4].map(id).to_vec();
        let deleted = store.prune(all.clone()).await;
        assert_eq!(deleted, Ok(vec![id(3), id(4)]));
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
        store.delete(vec![id(1)]).await.expect("committed");
        assert_eq!(stored(store).await, [0; 0]);
    })
    .await;
}

#[tokio::test]
async fn games_of_what_cannot_be_read_are_kept() {
    for (damage, kept) in [
        ("SELECT 1", false),
        ("UPDATE tournaments SET form = 99", true),
        // Half of an entry, and of a field.
        (
            "UPDATE tournament_entries SET entries = substr(entries, 1, 1)",
            true,
        ),
        ("UPDATE games SET header = substr(header, 1, 1)", true),
        ("UPDATE games SET form = 99", true),
    ] {
        with_each_tables(async |store, tables| {
            let change = |change| vec![TournamentEntry::Change(change)];
            let begun = change(TournamentChange::Begun { rounds: 1 });
            let created = store.create_tournament(Arc::new(cup(7)), begun).await;
            created.expect("committed");
            for game in [1, 2] {
                play(store, game, Of::Tournament, Durability::Durable).await;
            }
            let closed = change(TournamentChange::Closed);
            let ended = store.append_tournament(TOURNAMENT, 1, closed).await;
            ended.expect("committed");
            tables.edit(damage).await;
            let found = prunable(store, Keep::default()).await;
            assert_eq!(found.is_empty(), kept, "{damage}");
            store.prune(vec![id(1)]).await.expect("committed");
            let left = store.finished_games().await;
            assert_eq!(left, Ok(1 + u64::from(kept)), "{damage}");
        })
        .await;
    }
}
