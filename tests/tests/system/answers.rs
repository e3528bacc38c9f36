//! Answers that are late, illegal, repeated, or for another decision.

use chefshat_proto::Timestamp;
use chefshat_proto::v1::{self, game_event::Kind, seat_command::Command, seat_update::Update};
use chefshat_tests::{
    StreamSeat, TestServer, attach_all, first_legal, first_update, is_legal, one_shift, play_on,
    room_of_four,
};

/// Attaches all seats; returns the seat with the first open decision, that decision, and the
/// others.
async fn first_to_act(
    server: &TestServer,
    policy: v1::RoomPolicy,
) -> (StreamSeat, v1::DecisionRequest, Vec<StreamSeat>) {
    let client = server.client().await;
    let (_, tickets) = room_of_four(&client, one_shift(), policy).await;
    let mut seats = attach_all(server, &tickets).await;
    // Events come with decisions: only the seat that is asked receives anything.
    let (update, index) = first_update(&mut seats).await;
    let Update::Decision(decision) = update else {
        panic!("no decision, but {update:?}");
    };
    let first = seats.remove(index);
    (first, decision, seats)
}

fn illegal(decision: &v1::DecisionRequest) -> u32 {
    (0..300)
        .find(|action| !is_legal(decision, *action))
        .expect("some action is illegal")
}

async fn finish(mut seats: Vec<StreamSeat>) -> Vec<StreamSeat> {
    let reasons = futures::future::join_all(seats.iter_mut().map(play_on)).await;
    assert_eq!(reasons, [v1::DetachReason::GameOver; 4]);
    seats
}

fn sources(seat: &StreamSeat) -> Vec<v1::DecisionSource> {
    seat.events
        .iter()
        .filter_map(|event| match event.kind.as_ref()? {
            Kind::Play(play) => Some(play.source()),
            Kind::Pass(pass) => Some(pass.source()),
            _ => None,
        })
        .collect()
}

#[tokio::test]
async fn a_passed_deadline_takes_the_default_and_reports_it() {
    let server = TestServer::start().await;
    let policy = v1::RoomPolicy {
        decision_time_ms: Some(10),
        bank_ms: Some(0),
        max_timeouts: Some(1000),
        ..v1::RoomPolicy::default()
    };
    let (mut late, decision, others) = first_to_act(&server, policy).await;
    // The seat does not answer until its next decision: the default was taken for the first.
    let next = late.decision().await;
    assert_eq!(next.decision_id, decision.decision_id + 1);
    assert_eq!(sources(&late)[0], v1::DecisionSource::Timeout);
    late.answer(decision.decision_id, first_legal(&decision))
        .await;
    let result = loop {
        match late.next().await {
            Update::Result(result) => break result,
            Update::Decision(_) => {}
            other => panic!("unexpected {other:?}"),
        }
    };
    assert_eq!(result.status(), v1::AnswerStatus::Closed);
    assert_eq!(result.invalid_attempts_left, None, "not an invalid attempt");
    drop((late, others));
}

#[tokio::test]
async fn ten_invalid_answers_take_the_default() {
    let server = TestServer::start().await;
    let (mut wrong, decision, mut others) = first_to_act(&server, v1::RoomPolicy::default()).await;
    assert_eq!(decision.invalid_attempts_left, Some(10));
    for left in (0..10).rev() {
        wrong.answer(decision.decision_id, illegal(&decision)).await;
        let result = wrong.result().await;
        assert_eq!(result.status(), v1::AnswerStatus::Invalid);
        assert_eq!(result.invalid_attempts_left, Some(left));
        assert!(!result.detail.is_empty(), "it gives a reason");
    }
    others.push(wrong);
    let seats = finish(others).await;
    assert_eq!(sources(&seats[3])[0], v1::DecisionSource::Invalid);
    let rest = sources(&seats[3]);
    assert!(
        rest[1..]
            .iter()
            .all(|source| *source == v1::DecisionSource::Agent)
    );
}

#[tokio::test]
async fn a_repeated_answer_counts_once() {
    let server = TestServer::start().await;
    let (mut seat, decision, mut others) = first_to_act(&server, v1::RoomPolicy::default()).await;
    let action = first_legal(&decision);
    for _ in 0..3 {
        seat.answer(decision.decision_id, action).await;
    }
    seat.answer(decision.decision_id, 199).await;
    seat.answer(decision.decision_id + 1, action).await;
    let mut results = Vec::new();
    for _ in 0..5 {
        results.push(seat.result().await);
    }
    assert_eq!(results[0], results[1], "the same acknowledgement");
    assert_eq!(results[0], results[2]);
    let statuses: Vec<_> = results.iter().map(v1::AnswerResult::status).collect();
    assert_eq!(
        statuses,
        [
            v1::AnswerStatus::Accepted,
            v1::AnswerStatus::Accepted,
            v1::AnswerStatus::Accepted,
            v1::AnswerStatus::Closed,
            v1::AnswerStatus::UnknownDecision,
        ]
    );
    others.push(seat);
    let seats = finish(others).await;
    let plays = sources(&seats[3]);
    assert!(
        plays
            .iter()
            .all(|source| *source == v1::DecisionSource::Agent)
    );
}

#[tokio::test]
async fn bad_annotations_and_expressions_do_not_spoil_the_record() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (created, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let mut seats = attach_all(&server, &tickets).await;
    let (update, index) = first_update(&mut seats).await;
    let Update::Decision(decision) = update else {
        panic!("no decision, but {update:?}");
    };
    let seat = &mut seats[index];
    for seconds in [i64::MAX, -70_000_000_000] {
        seat.send(Command::Express(v1::Expression {
            label: "joy".into(),
            taken_at: Some(Timestamp { seconds, nanos: 0 }),
            ..v1::Expression::default()
        }))
        .await;
        match seat.next().await {
            Update::Refused(refused) => assert_eq!(refused.reason, "EXPRESSION_REFUSED"),
            other => panic!("not refused, but {other:?}"),
        }
    }
    seat.send(Command::Answer(v1::Answer {
        decision_id: decision.decision_id,
        action: first_legal(&decision),
        annotations: Some(v1::Annotations {
            action_scores: vec![f32::NEG_INFINITY, 1.0],
            ..v1::Annotations::default()
        }),
    }))
    .await;
    // A repetition is acknowledged at once, with the same result.
    seat.answer(decision.decision_id, first_legal(&decision))
        .await;
    let first = seat.result().await;
    assert_eq!(first.status(), v1::AnswerStatus::Accepted);
    assert!(first.annotations_dropped);
    assert_eq!(seat.result().await, first);
    finish(seats).await;
    let game_id = created.room.expect("a room").game_id;
    let data = server.stop().await;
    let path = chefshat_record::jsonl::path_of(data.path(), &game_id);
    let record = chefshat_record::jsonl::read(&path).expect("a readable record");
    chefshat_record::replay::replay(&record).expect("a valid record");
}
