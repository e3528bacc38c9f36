//! Stored tournaments, in each database.

use chefshat_tournament::Change;

use super::*;
use crate::sqlite::tests::tournaments::every_entry;
use crate::tournaments::{TournamentEntry, TournamentHeader};

/// A tournament with a join code of its own.
fn numbered(number: u8) -> Arc<TournamentHeader> {
    Arc::new(TournamentHeader {
        join_code: format!("CUP{number:05}"),
        ..cup(number)
    })
}

#[tokio::test]
async fn stored_tournaments_are_read_back_in_order() {
    with_each_database(async |store| {
        let entries = every_entry();
        let (first, rest) = entries.split_at(5);
        for (number, begins_with) in [(7, &[][..]), (3, first)] {
            let made = store.create_tournament(numbered(number), begins_with.to_vec());
            made.await.expect("committed");
        }
        let taken = store.create_tournament(numbered(3), Vec::new()).await;
        assert_eq!(taken, Err(StoreError::Taken(numbered(3).id.to_string())));
        let stored = store.append_tournament(id(3), 1, rest.to_vec());
        stored.await.expect("committed");
        let found = store.tournaments(9).await.expect("readable");
        assert_eq!(found.len(), 2);
        let shown = |value: &dyn std::fmt::Debug| format!("{value:?}");
        assert_eq!(shown(&found[0].header), shown(&numbered(7)));
        assert_eq!((found[0].rows, found[0].entries.len()), (1, 0));
        assert_eq!(shown(&found[1].header), shown(&numbered(3)));
        assert_eq!(found[1].rows, 2);
        assert_eq!(shown(&found[1].entries), shown(&entries));
    })
    .await;
}

#[tokio::test]
async fn only_the_newest_ended_tournaments_are_read() {
    with_each_database(newest).await;
}

async fn newest(store: &dyn Store) {
    let change = TournamentEntry::Change;
    let ends = [
        (1, Some(Change::Finished)),
        (2, None),
        (3, Some(Change::Closed)),
        (4, Some(Change::Finished)),
        (5, None),
    ];
    for (number, end) in ends {
        let id = id(number);
        let header = numbered(number);
        let begun = vec![change(Change::Begun { rounds: 1 })];
        let made = store.create_tournament(header, begun);
        made.await.expect("committed");
        // The end is not the last entry of its commit.
        let last = end.into_iter().chain([Change::Voided { game: 0 }]);
        let stored = store.append_tournament(id, 1, last.map(change).collect());
        stored.await.expect("committed");
    }
    for (newest_over, expected) in [
        (0, &[2, 5][..]),
        (1, &[2, 4, 5]),
        (2, &[2, 3, 4, 5]),
        (9, &[1, 2, 3, 4, 5]),
        (usize::MAX, &[1, 2, 3, 4, 5]),
    ] {
        let found = store.tournaments(newest_over).await.expect("readable");
        let numbers: Vec<u8> = found
            .iter()
            .map(|stored| stored.header.id.bytes()[0])
            .collect();
        assert_eq!(numbers, expected, "{newest_over}");
        assert!(found.iter().all(|stored| stored.rows == 2));
    }
}
