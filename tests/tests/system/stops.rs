//! A server that stops, and a store that fails.

use std::sync::Arc;
use std::time::Duration;

use chefshat_proto::v1::room_service_client::RoomServiceClient;
use chefshat_proto::v1::{self, game_event::Kind, seat_update::Update};
use chefshat_server::store::MemoryStore;
use chefshat_server::store::testing::FailingStore;
use chefshat_tests::{
    TestServer, attach_all, first_legal, narrow_spectator, one_shift, patiently, play_on, play_out,
    room_of_four,
};
use tonic::Code;
use tonic_health::pb::health_client::HealthClient;
use tonic_health::pb::{HealthCheckRequest, health_check_response::ServingStatus};
use tonic_types::StatusExt as _;

#[tokio::test]
async fn a_shutdown_aborts_a_running_game() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (created, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let game_id = created.room.expect("a room").game_id;
    let mut seats = attach_all(&server, &tickets).await;
    server.request_stop();
    for seat in &mut seats {
        let reason = loop {
            match seat.next().await {
                Update::Detached(detached) => break detached.reason(),
                Update::Decision(_) | Update::Result(_) => {}
                other => panic!("unexpected {other:?}"),
            }
        };
        assert_eq!(reason, v1::DetachReason::GameOver);
        let last = seat.events.last().and_then(|event| event.kind.clone());
        let Some(Kind::GameAborted(aborted)) = last else {
            panic!("not aborted, but {last:?}");
        };
        assert_eq!(aborted.reason(), v1::AbortReason::Shutdown);
        assert!(aborted.reveal.is_some(), "the deals can be checked even so");
        // The server ends the stream on its own.
        assert!(seat.next_or_end().await.expect("a clean end").is_none());
    }
    let data = server.stop().await;
    let path = chefshat_record::jsonl::path_of(data.path(), &game_id);
    let record = chefshat_record::jsonl::read(&path).expect("an aborted game has a record");
    let replayed = chefshat_record::replay::replay(&record).expect("a valid record");
    assert_eq!(replayed.state, v1::RoomState::Aborted);
}

#[tokio::test]
async fn a_running_game_gets_its_grace_and_no_new_rooms_are_created() {
    let server = TestServer::with(
        |config| config.grace = Duration::from_secs(3600),
        Arc::new(MemoryStore::default()),
    )
    .await;
    let client = server.client().await;
    let (_, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let (waiting, _) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let mut seats = attach_all(&server, &tickets).await;
    let mut health = HealthClient::new(server.channel().await);
    let status = health
        .check(HealthCheckRequest::default())
        .await
        .expect("health is answered")
        .into_inner();
    assert_eq!(status.status(), ServingStatus::Serving);
    server.request_stop();
    // The waiting room is aborted at once; from then on the shutdown is in progress.
    let waiting = waiting.room.expect("a room").room_id;
    while client
        .get_room(&waiting)
        .await
        .expect("still listed")
        .state()
        != v1::RoomState::Aborted
    {
        tokio::task::yield_now().await;
    }
    // The SDK would repeat the call until the server is back.
    let refused = RoomServiceClient::new(server.channel().await)
        .create_room(v1::CreateRoomRequest::default())
        .await
        .expect_err("no new rooms");
    let info = refused.get_details_error_info().expect("error info");
    assert_eq!(info.reason, "SHUTTING_DOWN");
    let status = health
        .check(HealthCheckRequest::default())
        .await
        .expect("health is answered")
        .into_inner();
    assert_eq!(status.status(), ServingStatus::NotServing);
    let reasons = futures::future::join_all(seats.iter_mut().map(play_on)).await;
    assert_eq!(reasons, [v1::DetachReason::GameOver; 4]);
    for seat in &seats {
        let last = seat.events.last().and_then(|event| event.kind.as_ref());
        assert!(
            matches!(last, Some(Kind::GameEnded(_))),
            "played to its end"
        );
    }
    server.stop().await;
}

#[tokio::test]
async fn a_client_that_does_not_read_cannot_delay_a_shutdown() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let rules = v1::RuleSet {
        stop: Some(v1::rule_set::Stop::TargetShifts(40)),
        ..v1::RuleSet::default()
    };
    let (created, tickets) = room_of_four(&client, rules, v1::RoomPolicy::default()).await;
    // It answers pings but never reads its stream: data fills its window and then the server's
    // outbox.
    let room_id = created.room.expect("a room").room_id;
    let not_reading = narrow_spectator(&server, room_id).await;
    play_out(&server, tickets).await;
    server.request_stop();
    server.stop().await;
    drop(not_reading);
}

#[tokio::test]
async fn a_failing_store_ends_the_server_and_the_decision_is_not_published() {
    // Four joins and the start are committed, then ten decisions; the next is not.
    let server = TestServer::with(|_| {}, Arc::new(FailingStore::after(15))).await;
    let client = server.client().await;
    let (_, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let mut seats = attach_all(&server, &tickets).await;
    let ends = futures::future::join_all(seats.iter_mut().map(async |seat| {
        loop {
            match seat.next_or_end().await {
                Ok(Some(Update::Decision(decision))) => {
                    let action = first_legal(&decision);
                    seat.answer(decision.decision_id, action).await;
                }
                Ok(Some(Update::Result(_))) => {}
                Ok(other) => panic!("unexpected {other:?}"),
                Err(status) => return status,
            }
        }
    }))
    .await;
    for status in ends {
        // The code after which SDKs retry until the server is back.
        assert_eq!(status.code(), Code::Unavailable, "{status}");
        let reason = status.get_details_error_info().map(|info| info.reason);
        assert_eq!(reason.as_deref(), Some("STORE_FAILED"));
    }
    for seat in &seats {
        let turns = seat
            .events
            .iter()
            .filter(|event| matches!(event.kind, Some(Kind::Play(_) | Kind::Pass(_))))
            .count();
        assert!(
            turns <= 10,
            "{turns} decisions were published, ten were committed"
        );
    }
    let failure = patiently("the server to end", server.ended()).await;
    let failure = failure.expect_err("it cannot continue").to_string();
    assert!(
        failure.contains("started again"),
        "it gives advice: {failure}"
    );
}
