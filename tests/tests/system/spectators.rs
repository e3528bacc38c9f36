//! Spectators: live, late, delayed, and not admitted.

use chefshat_proto::v1::{
    self, SpectatorServiceWatchRequest, game_event::Kind,
    spectator_service_client::SpectatorServiceClient,
};
use chefshat_tests::{
    TestServer, narrow_spectator, one_shift, patiently, play_out, room_of_four, until_watched_by,
    watched,
};
use tonic::Code;
use tonic_types::StatusExt as _;

#[tokio::test]
async fn a_spectator_that_stops_reading_is_disconnected_and_the_game_continues() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let rules = v1::RuleSet {
        stop: Some(v1::rule_set::Stop::TargetShifts(40)),
        ..v1::RuleSet::default()
    };
    let (created, tickets) = room_of_four(&client, rules, v1::RoomPolicy::default()).await;
    let room_id = created.room.expect("a room").room_id;
    let mut not_reading = narrow_spectator(&server, room_id).await;
    // It does not read while forty Shifts are played.
    play_out(&server, tickets).await;
    let mut events = 0;
    let status = loop {
        match patiently("the end of the stream", not_reading.message()).await {
            Ok(Some(message)) => events += message.events.len(),
            Ok(None) => panic!("it received all {events} events without reading"),
            Err(status) => break status,
        }
    };
    assert_eq!(status.code(), Code::ResourceExhausted);
    assert_eq!(
        status.get_details_error_info().map(|info| info.reason),
        Some("SPECTATOR_TOO_SLOW".into())
    );
}

#[tokio::test]
async fn spectators_receive_all_public_events_from_the_requested_one() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (created, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let room_id = created.room.expect("a room").room_id;
    play_out(&server, tickets).await;
    let mut all = Vec::new();
    let mut watching = client.spectate(&room_id, 0);
    while let Some(event) = watching.next().await.expect("a watched room") {
        all.push(event);
    }
    let numbers: Vec<u64> = all.iter().map(|event| event.sequence).collect();
    let expected: Vec<u64> = (1..).take(all.len()).collect();
    assert_eq!(numbers, expected);
    assert!(matches!(
        all.last().and_then(|event| event.kind.as_ref()),
        Some(Kind::GameEnded(_))
    ));
    let mut late = client.spectate(&room_id, 20);
    let first = late.next().await.expect("a watched room");
    assert_eq!(first.as_ref(), all.get(19));
}

#[tokio::test]
async fn spectators_are_counted_until_they_leave() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (created, _) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let room_id = created.room.expect("a room").room_id;
    let mut watching = Vec::new();
    for count in 1..=3 {
        watching.push(watched(&client, &room_id));
        until_watched_by(&client, &room_id, count).await;
    }
    while let Some(spectator) = watching.pop() {
        spectator.abort();
        until_watched_by(&client, &room_id, watching.len()).await;
    }
}

#[tokio::test]
async fn a_policy_can_refuse_or_delay_spectators() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let watch = |room: v1::CreateRoomResponse, snapshot| {
        let channel = client.channel();
        async move {
            SpectatorServiceClient::new(channel)
                .watch(SpectatorServiceWatchRequest {
                    room_id: room.room.expect("a room").room_id,
                    snapshot,
                    ..SpectatorServiceWatchRequest::default()
                })
                .await
                .expect_err("spectators are refused")
                .get_details_error_info()
                .expect("a reason")
                .reason
        }
    };
    let policy = v1::RoomPolicy {
        spectators: Some(false),
        ..v1::RoomPolicy::default()
    };
    let (closed, _) = room_of_four(&client, one_shift(), policy).await;
    assert_eq!(watch(closed, false).await, "SPECTATORS_NOT_ADMITTED");
    let policy = v1::RoomPolicy {
        spectator_delay_decisions: Some(5),
        ..v1::RoomPolicy::default()
    };
    let (delayed, _) = room_of_four(&client, one_shift(), policy).await;
    assert_eq!(watch(delayed, true).await, "SNAPSHOT_DELAYED");
}
