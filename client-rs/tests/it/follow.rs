//! A seat that is followed, whose stream breaks.

use std::time::Duration;

use chefshat_client::v1::{self, game_event::Kind, seat_update::Update};
use chefshat_client::{Backoff, PlayError, SeatFollower};
use tonic::Status;

use crate::fake::{Fake, event};

fn events(numbers: impl IntoIterator<Item = u64>) -> Update {
    let events = numbers.into_iter().map(event).collect();
    Update::Events(v1::EventBatch { events })
}

fn ending(sequence: u64) -> Update {
    let end = Kind::GameEnded(Box::default());
    let events = vec![v1::GameEvent {
        kind: Some(end),
        ..event(sequence)
    }];
    Update::Events(v1::EventBatch { events })
}

fn decision(decision_id: u64) -> Update {
    Update::Decision(v1::DecisionRequest {
        decision_id,
        ..v1::DecisionRequest::default()
    })
}

fn attached() -> Update {
    Update::Attached(v1::Attached::default())
}

fn detached(reason: v1::DetachReason) -> Update {
    let reason = reason.into();
    Update::Detached(v1::Detached { reason })
}

async fn follower(fake: &Fake) -> SeatFollower {
    let backoff = Backoff {
        first: Duration::from_millis(1),
        max: Duration::from_millis(10),
        ..Backoff::default()
    };
    let client = fake.start().await;
    client.follow_seat("ticket").with_backoff(backoff)
}

#[tokio::test]
async fn events_come_once_and_open_decisions_again_across_lost_streams() {
    let fake = Fake::default();
    fake.follow(vec![
        Ok(vec![attached(), events([1, 2])]),
        Ok(vec![]),
        Ok(vec![decision(1)]),
        Err(Status::unavailable("lost")),
    ]);
    // It stops in an orderly manner.
    fake.follow(vec![
        Ok(vec![attached(), events([2, 3]), decision(1)]),
        Ok(vec![detached(v1::DetachReason::ServerStopping)]),
    ]);
    fake.follow(vec![
        Ok(vec![attached(), events([3])]),
        Ok(vec![ending(4), detached(v1::DetachReason::GameOver)]),
    ]);
    let mut seat = follower(&fake).await;
    let mut updates = Vec::new();
    while let Some(update) = seat.next().await.unwrap() {
        updates.push(update);
    }
    let expected = [
        attached(),
        events([1, 2]),
        decision(1),
        attached(),
        events([3]),
        decision(1),
        attached(),
        ending(4),
    ];
    assert_eq!(updates, expected);
    assert!(fake.is_done());
    let asked = fake.attached();
    let from: Vec<u64> = asked.iter().map(|it| it.from_sequence).collect();
    assert_eq!(from, [1, 3, 4]);
    // The contribution to the seed is the same on every connection.
    assert_eq!(asked[0].entropy.len(), 32);
    assert!(asked.iter().all(|it| it.entropy == asked[0].entropy));
}

#[tokio::test]
async fn events_that_a_snapshot_stands_for_are_not_asked_for_again() {
    let fake = Fake::default();
    let snapshot = Update::Snapshot(Box::new(v1::Snapshot {
        next_sequence: 5_000,
        ..v1::Snapshot::default()
    }));
    fake.follow(vec![
        Ok(vec![attached(), snapshot.clone()]),
        Err(Status::unavailable("lost")),
    ]);
    fake.follow(vec![Ok(vec![
        attached(),
        ending(5_000),
        detached(v1::DetachReason::GameOver),
    ])]);
    let mut seat = follower(&fake).await;
    assert_eq!(seat.next().await.unwrap(), Some(attached()));
    assert_eq!(seat.next().await.unwrap(), Some(snapshot));
    while seat.next().await.unwrap().is_some() {}
    let from: Vec<u64> = (fake.attached().iter())
        .map(|it| it.from_sequence)
        .collect();
    assert_eq!(from, [1, 5_000]);
}

#[tokio::test]
async fn a_seat_that_is_lost_says_why_after_what_came_before() {
    let refused = Update::Refused(v1::Refused {
        reason: "TICKET_UNKNOWN".to_owned(),
        ..v1::Refused::default()
    });
    let table = [
        (detached(v1::DetachReason::Superseded), "SUPERSEDED"),
        (detached(v1::DetachReason::Requested), "DETACHED"),
        (detached(v1::DetachReason::GameOver), "ENDING_UNKNOWN"),
        (refused, "TICKET_UNKNOWN"),
    ];
    for (last, reason) in table {
        let fake = Fake::default();
        fake.follow(vec![Ok(vec![attached(), events([1]), last])]);
        let mut seat = follower(&fake).await;
        assert_eq!(seat.next().await.unwrap(), Some(attached()));
        assert_eq!(seat.next().await.unwrap(), Some(events([1])));
        let failure: PlayError = seat.next().await.unwrap_err();
        assert_eq!(failure.reason(), Some(reason));
        assert_eq!(seat.next().await.unwrap(), None);
    }
}

#[tokio::test]
async fn a_stream_that_breaks_after_the_end_of_the_game_is_not_opened_again() {
    let fake = Fake::default();
    fake.follow(vec![
        Ok(vec![attached(), ending(1)]),
        Err(Status::unavailable("lost")),
    ]);
    let mut seat = follower(&fake).await;
    assert_eq!(seat.next().await.unwrap(), Some(attached()));
    assert_eq!(seat.next().await.unwrap(), Some(ending(1)));
    assert_eq!(seat.next().await.unwrap(), None);
    assert_eq!(fake.attached().len(), 1);
}
