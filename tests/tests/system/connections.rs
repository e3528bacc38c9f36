//! Connections that are lost, re-established or duplicated.

use chefshat_proto::v1::{
    self, game_event::Kind, play_service_client::PlayServiceClient, seat_command::Command,
    seat_update::Update,
};
use chefshat_tests::{
    StreamSeat, TestServer, attach_all, first_legal, first_update, one_shift, patiently, play_on,
    room_of_four,
};

/// Plays until `seat` has a decision open, which it leaves unanswered.
async fn until_asked(seats: &mut [StreamSeat], seat: usize) -> v1::DecisionRequest {
    loop {
        let (update, index) = first_update(seats).await;
        match update {
            Update::Decision(decision) if index == seat => return decision,
            Update::Decision(decision) => {
                let action = first_legal(&decision);
                seats[index].answer(decision.decision_id, action).await;
            }
            Update::Result(_) => {}
            other => panic!("unexpected {other:?}"),
        }
    }
}

#[tokio::test]
async fn a_reconnected_seat_receives_missed_events_and_its_open_decision() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (created, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let mut seats = attach_all(&server, &tickets).await;
    let decision = until_asked(&mut seats, 2).await;
    let gone = seats.remove(2);
    let seen = gone.last_event;
    let first_half = gone.events.clone();
    drop(gone);

    // All seats learn of it, and a spectator that starts now.
    let mut watching = client.spectate(room_id(&created), 0);
    while let Some(event) = watching.next().await.expect("a watched room") {
        if matches!(
            event.kind,
            Some(Kind::Disconnected(v1::Disconnected { seat: 2, .. }))
        ) {
            break;
        }
    }
    let mut back = StreamSeat::attached_from(server.channel().await, &tickets[2], seen + 1).await;
    let again = back.decision().await;
    assert_eq!(again.decision_id, decision.decision_id);
    assert_eq!(again.observation, decision.observation);
    assert_eq!(again.action_mask, decision.action_mask);
    assert!(
        again.time_left_ms <= decision.time_left_ms,
        "the clock kept running"
    );
    let action = first_legal(&again);
    back.answer(again.decision_id, action).await;
    seats.push(back);
    let reasons = futures::future::join_all(seats.iter_mut().map(play_on)).await;
    assert_eq!(reasons, [v1::DetachReason::GameOver; 4]);

    // The events in two parts equal those of another seat in one, except for private fields.
    let back = seats.pop().expect("the reconnected seat");
    let all: Vec<u64> = first_half
        .iter()
        .chain(&back.events)
        .map(|event| event.sequence)
        .collect();
    let other: Vec<u64> = seats[0].events.iter().map(|event| event.sequence).collect();
    assert_eq!(all, other);
    assert!(
        back.events
            .iter()
            .any(|event| matches!(event.kind, Some(Kind::Returned(_))))
    );
}

#[tokio::test]
async fn the_newest_connection_wins_and_the_older_is_detached() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (_, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let mut seats = attach_all(&server, &tickets).await;
    let decision = until_asked(&mut seats, 1).await;
    let mut older = seats.remove(1);
    let mut newer = StreamSeat::attached(server.channel().await, &tickets[1]).await;
    match older.next().await {
        Update::Detached(detached) => {
            assert_eq!(detached.reason(), v1::DetachReason::Superseded);
        }
        other => panic!("not detached, but {other:?}"),
    }
    // Messages of the older one are ignored: this would be an invalid attempt, or the answer.
    older.answer(decision.decision_id, 9999).await;
    let again = newer.decision().await;
    assert_eq!(again.decision_id, decision.decision_id);
    assert_eq!(again.invalid_attempts_left, decision.invalid_attempts_left);
    newer.answer(again.decision_id, first_legal(&again)).await;
    seats.push(newer);
    let reasons = futures::future::join_all(seats.iter_mut().map(play_on)).await;
    assert_eq!(reasons, [v1::DetachReason::GameOver; 4]);
    drop(older);
}

#[tokio::test]
async fn detaching_and_half_closing_end_the_right_things() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (_, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let mut seat = StreamSeat::attached(server.channel().await, &tickets[0]).await;
    seat.send(Command::Detach(v1::Detach {})).await;
    match seat.next().await {
        Update::Detached(detached) => assert_eq!(detached.reason(), v1::DetachReason::Requested),
        other => panic!("not detached, but {other:?}"),
    }
    // The handle is no longer valid; the stream continues.
    seat.answer(1, 0).await;
    match seat.next().await {
        Update::Refused(refused) => assert_eq!(refused.reason, "HANDLE_UNKNOWN"),
        other => panic!("not refused, but {other:?}"),
    }
    seat.half_close();
    assert!(seat.next_or_end().await.expect("a clean end").is_none());
}

#[tokio::test]
async fn a_snapshot_replaces_the_past_events() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (_, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let mut seats = attach_all(&server, &tickets).await;
    let decision = until_asked(&mut seats, 3).await;
    seats.remove(3);
    let mut back = StreamSeat::open(server.channel().await).await;
    back.attach(v1::Attach {
        ticket: tickets[3].clone(),
        snapshot: true,
        ..v1::Attach::default()
    })
    .await;
    let Update::Attached(attached) = back.next().await else {
        panic!("not attached");
    };
    let Update::Snapshot(snapshot) = back.next().await else {
        panic!("no snapshot");
    };
    assert_eq!(snapshot.next_sequence, attached.next_sequence);
    assert!(snapshot.game_started.is_some());
    back.last_event = snapshot.next_sequence - 1;
    let again = back.decision().await;
    assert_eq!(again.observation, decision.observation);
    assert_eq!(again.observation, snapshot.observation);
    back.answer(again.decision_id, first_legal(&again)).await;
    seats.push(back);
    futures::future::join_all(seats.iter_mut().map(play_on)).await;
}

fn room_id(created: &v1::CreateRoomResponse) -> String {
    created.room.as_ref().expect("a new room").room_id.clone()
}

#[tokio::test]
async fn watching_with_an_unknown_ticket_ends() {
    let server = TestServer::start().await;
    let mut service = PlayServiceClient::new(server.channel().await);
    let attach = v1::Attach {
        ticket: "unknown".into(),
        ..v1::Attach::default()
    };
    let request = v1::PlayServiceWatchRequest {
        seats: vec![attach],
    };
    let mut responses = service.watch(request).await.expect("a stream").into_inner();
    let mut updates = Vec::new();
    while let Some(response) = patiently("the end", responses.message())
        .await
        .expect("no error")
    {
        updates.extend(response.updates);
    }
    let [update] = updates.as_slice() else {
        panic!("not one update: {updates:?}");
    };
    assert!(matches!(update.update, Some(Update::Refused(_))));
}
