//! A server whose process is stopped for a while: nobody is charged for that time.

use std::time::Duration;

use chefshat_client::Client;
use chefshat_proto::v1::{self, record_line::Line};
use chefshat_tests::{Launch, StreamSeat, first_legal, one_shift, patiently, play_on};
use tonic::transport::Endpoint;

use crate::played::built_in;

/// Longer than a busy machine takes to stop the server.
const DECISION_TIME_MS: u32 = 5_000;
const PAUSE: Duration = Duration::from_secs(8);

/// Whether a process is stopped, as the system shows it.
fn is_stopped(process: u32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).expect("it runs");
    status.lines().any(|line| line.starts_with("State:\tT"))
}

#[tokio::test]
async fn an_answer_that_waits_for_a_stopped_server_is_in_time() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(folder.path());
    let server = launch.start().await.expect("it starts");
    // A client that probed the connection would close it.
    let endpoint = Endpoint::from_shared(launch.url()).expect("an address");
    let client = Client::from_channel(endpoint.connect().await.expect("it listens"));
    let created = client
        .create_room(v1::CreateRoomRequest {
            rules: Some(one_shift()),
            policy: Some(v1::RoomPolicy {
                decision_time_ms: Some(DECISION_TIME_MS),
                bank_ms: Some(0),
                pace_ms: Some(0),
                ..v1::RoomPolicy::default()
            }),
            seats: vec![
                v1::SeatConfig::default(),
                built_in("greedy"),
                built_in("greedy"),
                built_in("greedy"),
            ],
            ..v1::CreateRoomRequest::default()
        })
        .await
        .expect("a new room");
    let joined = client
        .join(v1::JoinRoomRequest {
            join_code: created.join_code,
            name: "agent".to_owned(),
            ..v1::JoinRoomRequest::default()
        })
        .await
        .expect("a free seat");
    let mut seat = StreamSeat::attached(client.channel(), &joined.ticket).await;

    let decision = seat.decision().await;
    server.freeze().await;
    patiently("the server to stop", async {
        while !is_stopped(server.id()) {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    })
    .await;
    seat.answer(decision.decision_id, first_legal(&decision))
        .await;
    tokio::time::sleep(PAUSE).await;
    server.thaw().await;
    let result = seat.result().await;
    assert_eq!(result.status(), v1::AnswerStatus::Accepted, "{result:?}");

    assert_eq!(play_on(&mut seat).await, v1::DetachReason::GameOver);
    let game_id = created.room.expect("a room").game_id;
    let record = client.record(&game_id).await.expect("a stored record");
    let of_decision = |line: v1::RecordLine| match line.line {
        Some(Line::Decision(it)) if it.seat == 0 => Some(it),
        _ => None,
    };
    let first = record.into_iter().find_map(of_decision);
    let first = first.expect("the seat decided");
    assert_eq!(first.decision_id, decision.decision_id);
    assert_eq!(first.source(), v1::DecisionSource::Agent);
    assert!(first.decision_time_us < u64::from(DECISION_TIME_MS) * 1_000);
    let ended = server.stop().await;
    assert!(
        ended.said.contains("the process did not run"),
        "{}",
        ended.said
    );
}
