//! A spectator whose stream breaks.

use std::time::Duration;

use chefshat_client::{Backoff, Watched, v1};
use futures::TryStreamExt as _;
use tonic::{Code, Status};

use crate::fake::{Fake, event};

fn part(
    numbers: impl IntoIterator<Item = u64>,
) -> Result<v1::SpectatorServiceWatchResponse, Status> {
    Ok(v1::SpectatorServiceWatchResponse {
        events: numbers.into_iter().map(event).collect(),
        ..Default::default()
    })
}

fn quick() -> Backoff {
    Backoff {
        first: Duration::from_millis(1),
        max: Duration::from_millis(10),
        ..Backoff::default()
    }
}

#[tokio::test]
async fn events_come_once_and_in_order_across_lost_streams() {
    let fake = Fake::default();
    fake.watch(vec![
        part(1..=2),
        part([]),
        Err(Status::resource_exhausted("too slow")),
    ]);
    fake.watch(vec![Err(Status::unavailable("not now"))]);
    fake.watch(vec![part(2..=4), part([5])]);
    let client = fake.start().await;
    let spectator = client.spectate("room", 0).with_backoff(quick());
    let events: Vec<_> = spectator.into_stream().try_collect().await.unwrap();
    let numbers: Vec<_> = events.iter().map(|event| event.sequence).collect();
    assert_eq!(numbers, [1, 2, 3, 4, 5]);
    assert_eq!(fake.watched_from(), [0, 3, 3]);
    assert!(fake.is_done());
}

#[tokio::test]
async fn whom_the_game_waits_for_comes_between_the_events() {
    let awaited = |seat| v1::Awaited {
        seat,
        ..v1::Awaited::default()
    };
    let with = |numbers: Vec<u64>, awaited| {
        let response: v1::SpectatorServiceWatchResponse = part(numbers)?;
        Ok(v1::SpectatorServiceWatchResponse {
            awaited,
            ..response
        })
    };
    let fake = Fake::default();
    fake.watch(vec![
        with(vec![1], vec![awaited(Some(2)), awaited(Some(0))]),
        with(vec![2], vec![]),
        with(vec![], vec![awaited(None)]),
        with(vec![3], vec![awaited(Some(1))]),
        Err(Status::unavailable("lost")),
    ]);
    // Nobody is awaited at first on the next connection.
    fake.watch(vec![part([4])]);
    let client = fake.start().await;
    let mut spectator = client.spectate("room", 0).with_backoff(quick());
    let mut watched = Vec::new();
    while let Some(next) = spectator.next_watched().await.unwrap() {
        watched.push(match next {
            Watched::Event(event) => (event.sequence, None),
            Watched::Awaited(awaited) => (0, Some(awaited.seat)),
            Watched::Snapshot(_) => panic!("there is none"),
        });
    }
    let nobody = (0, Some(None));
    let waiting = (0, Some(Some(0)));
    let again = (0, Some(Some(1)));
    assert_eq!(
        watched,
        [
            (1, None),
            waiting,
            (2, None),
            nobody,
            (3, None),
            again,
            nobody,
            (4, None)
        ]
    );
}

#[tokio::test]
async fn a_snapshot_stands_for_events_that_are_gone() {
    let fake = Fake::default();
    let snapshot = v1::Snapshot {
        next_sequence: 5_000,
        ..v1::Snapshot::default()
    };
    let first = v1::SpectatorServiceWatchResponse {
        snapshot: Some(snapshot.clone()),
        ..v1::SpectatorServiceWatchResponse::default()
    };
    fake.watch(vec![Ok(first), Err(Status::unavailable("lost"))]);
    fake.watch(vec![part([5_000])]);
    let client = fake.start().await;
    let mut spectator = client.spectate("room", 0).with_backoff(quick());
    let watched = spectator.next_watched().await.unwrap();
    assert_eq!(watched, Some(Watched::Snapshot(Box::new(snapshot))));
    // The next connection asks for what follows.
    assert_eq!(spectator.next_sequence(), 5_000);
    let event = spectator.next().await.unwrap().unwrap();
    assert_eq!(event.sequence, 5_000);
    assert_eq!(fake.watched_from(), [0, 5_000]);
}

#[tokio::test]
async fn a_refusal_ends_the_watching() {
    let fake = Fake::default();
    fake.watch(vec![Err(Status::not_found("no such room"))]);
    fake.watch(vec![part([1])]);
    let client = fake.start().await;
    let mut spectator = client.spectate("room", 5).with_backoff(quick());
    assert_eq!(spectator.next_sequence(), 5);
    assert_eq!(spectator.next().await.unwrap_err().code(), Code::NotFound);
    assert_eq!(spectator.next().await.unwrap(), None);
    assert!(!fake.is_done());
}

/// The state that comes with every connection does not show that the connection holds.
#[tokio::test]
async fn a_table_whose_streams_all_break_is_given_up() {
    let client = Fake::default().start().await;
    let backoff = Backoff {
        first: Duration::from_millis(1),
        max: Duration::from_secs(60),
        give_up_after: Duration::from_millis(300),
        ..Backoff::default()
    };
    let mut table = client.follow_table("ticket").with_backoff(backoff);
    let mut states = 0;
    let error = loop {
        match table.next().await {
            Ok(state) => {
                assert_eq!(state, Some(v1::TableState::default()));
                states += 1;
                assert!(states < 100, "never given up");
            }
            Err(error) => break error,
        }
    };
    assert_eq!(error.message(), "the server ended the stream");
    assert!(states > 1, "not followed across lost streams");
    assert_eq!(table.next().await.unwrap(), None);
}
