//! Lost streams, lost seats, and many seats on one stream.

use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

use chefshat_client::v1::{self, game_event::Kind, seat_update::Update};
use chefshat_client::{ActionId, Agent, Backoff, PlayError, PlayOptions};
use tonic::Status;

use crate::fake::{Fake, Line, connect, event, listen};

/// Answers every decision with ten times its number, and reports all calls.
struct Tens(Sender<String>);

impl Tens {
    fn note(&self, line: String) {
        // Tests that do not read the notes have dropped the receiver.
        let _sent = self.0.send(line);
    }
}

impl Agent for Tens {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        self.note(format!("decide {}", request.decision_id));
        ActionId(10 * u32::try_from(request.decision_id).unwrap())
    }
    fn on_event(&mut self, event: &v1::GameEvent) {
        self.note(format!("event {}", event.sequence));
    }
}

pub(crate) fn quick() -> PlayOptions {
    PlayOptions {
        backoff: Backoff {
            first: Duration::from_millis(1),
            max: Duration::from_millis(10),
            ..Backoff::default()
        },
        ..PlayOptions::default()
    }
}

fn decision(decision_id: u64) -> Update {
    Update::Decision(v1::DecisionRequest {
        decision_id,
        ..Default::default()
    })
}

fn events(numbers: impl IntoIterator<Item = u64>) -> Update {
    Update::Events(v1::EventBatch {
        events: numbers.into_iter().map(event).collect(),
    })
}

fn accepted(decision_id: u64, action: u32) -> Update {
    Update::Result(v1::AnswerResult {
        decision_id,
        action,
        status: v1::AnswerStatus::Accepted.into(),
        ..Default::default()
    })
}

/// Ends the game with event `sequence`, and the seats with these handles; then waits for the client
/// to leave.
pub(crate) async fn ends(mut line: Line, handles: &[u32], sequence: u64) {
    let standing = |&seat: &u32| v1::Standing {
        seat,
        points: 15,
        place: seat + 1,
    };
    let mut end = event(sequence);
    end.kind = Some(Kind::GameEnded(Box::new(v1::GameEnded {
        standings: handles.iter().map(standing).collect(),
        reveal: None,
    })));
    let mut updates = Vec::new();
    for &handle in handles {
        let events = vec![end.clone()];
        updates.push((handle, Update::Events(v1::EventBatch { events })));
        let reason = v1::DetachReason::GameOver.into();
        updates.push((handle, Update::Detached(v1::Detached { reason })));
    }
    line.says(updates).await;
    assert!(line.heard().await.is_empty(), "the client half-closes");
}

#[tokio::test]
async fn a_stream_lost_during_a_decision_resumes_with_the_same_answer() {
    let fake = Fake::default();
    fake.play(async |mut line: Line| {
        let attach = line.attaches().await;
        assert_eq!((attach.from_sequence, attach.entropy.len()), (1, 32));
        line.says(vec![(0, events(1..=3)), (0, decision(1))]).await;
        assert_eq!(line.answers().await, [(0, 1, 10)]);
        // The acknowledgement is lost with the stream.
        line.fails(Status::unavailable("going down")).await;
    });
    fake.play(async |_line: Line| { /* Ends at once, without a word. */ });
    fake.play(async |mut line: Line| {
        let attach = line.attaches().await;
        assert_eq!(attach.from_sequence, 4);
        line.says(vec![(0, events(4..=5)), (0, decision(1))]).await;
        assert_eq!(line.answers().await, [(0, 1, 10)]);
        line.says(vec![(0, accepted(1, 10)), (0, decision(2))])
            .await;
        assert_eq!(line.answers().await, [(0, 2, 20)]);
        ends(line, &[0], 6).await;
    });
    let client = fake.start().await;
    let (notes, noted) = channel();
    let playing = async move { client.play_with("ticket", Tens(notes), &quick()).await };
    let outcome = tokio::spawn(playing).await.unwrap().unwrap();
    assert_eq!(outcome.answers, 2, "repeating an answer is not deciding");
    assert_eq!(outcome.standing().map(|line| line.points), Some(15));
    let lines: Vec<String> = noted.iter().collect();
    let expected = [
        "event 1", "event 2", "event 3", "decide 1", "event 4", "event 5", "decide 2", "event 6",
    ];
    assert_eq!(lines, expected);
    assert!(fake.is_done());
}

#[test]
fn the_client_reconnects_to_a_restarted_server() {
    let runtime = || {
        let mut builder = tokio::runtime::Builder::new_multi_thread();
        builder.worker_threads(1).enable_all().build().unwrap()
    };
    let listener = listen();
    let again = listener.try_clone().unwrap();
    let address = listener.local_addr().unwrap();
    let (answered, hears) = channel();

    let first = Fake::default();
    first.play(async move |mut line: Line| {
        line.attaches().await;
        line.says(vec![(0, events(1..=2)), (0, decision(1))]).await;
        line.answers().await;
        answered.send(()).unwrap();
        std::future::pending().await
    });
    let second = Fake::default();
    second.play(async |mut line: Line| {
        assert_eq!(line.attaches().await.from_sequence, 3);
        line.says(vec![(0, decision(1))]).await;
        assert_eq!(line.answers().await, [(0, 1, 10)]);
        ends(line, &[0], 3).await;
    });

    let (server, clients) = (runtime(), runtime());
    server.spawn(first.serve(listener));
    let playing = clients.spawn(async move {
        let client = connect(address).await;
        client
            .play_with("ticket", Tens(channel().0), &quick())
            .await
    });
    hears.recv().unwrap();
    // Dropping the runtime closes all its connections.
    server.shutdown_background();
    let server = runtime();
    server.spawn(second.clone().serve(again));
    let outcome = clients.block_on(playing).unwrap().unwrap();
    assert_eq!(outcome.answers, 1);
    assert!(second.is_done());
}

#[tokio::test]
async fn many_seats_answer_in_one_request() {
    const SEATS: u32 = 300;
    let fake = Fake::default();
    fake.play(async |mut line: Line| {
        let mut attached = 0;
        while attached < SEATS {
            for command in line.heard().await {
                let update = Update::Attached(v1::Attached {
                    request_id: attached + 1,
                    seat: attached,
                    ..Default::default()
                });
                assert!(command.command.is_some());
                line.says(vec![(attached, update)]).await;
                attached += 1;
            }
        }
        line.says((0..SEATS).map(|handle| (handle, decision(7))).collect())
            .await;
        let expected: Vec<_> = (0..SEATS).map(|handle| (handle, 7, 70)).collect();
        assert_eq!(line.answers().await, expected);
        ends(line, &(0..SEATS).collect::<Vec<_>>(), 1).await;
    });
    let client = fake.start().await;
    let seat = |seat| {
        let agent: Box<dyn Agent> = Box::new(Tens(channel().0));
        (format!("ticket {seat}"), agent)
    };
    let outcomes = client.play_many_with((0..SEATS).map(seat), &quick()).await;
    let seats: Vec<_> = outcomes.into_iter().map(|it| it.unwrap().seat).collect();
    assert_eq!(seats, (0..SEATS).collect::<Vec<_>>());
    assert!(fake.is_done());
}

#[tokio::test]
async fn a_superseded_seat_does_not_reconnect() {
    let fake = Fake::default();
    fake.play(async |mut line: Line| {
        line.attaches().await;
        let reason = v1::DetachReason::Superseded.into();
        line.says(vec![(0, Update::Detached(v1::Detached { reason }))])
            .await;
        assert!(line.heard().await.is_empty());
    });
    let client = fake.start().await;
    let (notes, noted) = channel();
    let mut agent = Tens(notes);
    let error = client.play("ticket", &mut agent).await.unwrap_err();
    assert!(matches!(error, PlayError::Superseded));
    agent.note("given back".to_owned());
    assert_eq!(noted.recv().unwrap(), "given back");
}

#[tokio::test]
async fn a_permanent_refusal_is_not_retried() {
    let fake = Fake::default();
    fake.play(async |line: Line| line.fails(Status::unauthenticated("who are you")).await);
    fake.play(async |_line: Line| panic!("there is no second stream"));
    let client = fake.start().await;
    let played = client
        .play_with("ticket", Tens(channel().0), &quick())
        .await;
    let Err(PlayError::Refused(error)) = played else {
        panic!("not refused: {played:?}");
    };
    assert_eq!(
        (error.code(), error.message()),
        (tonic::Code::Unauthenticated, "who are you")
    );
}

#[tokio::test]
async fn the_client_gives_up_after_a_long_outage() {
    let fake = Fake::default();
    let client = fake.start().await;
    for _ in 0..1000 {
        fake.play(async |line: Line| line.fails(Status::unavailable("no")).await);
    }
    let mut options = quick();
    options.backoff.max = Duration::from_secs(10);
    options.backoff.give_up_after = Duration::from_millis(300);
    let played = client
        .play_with("ticket", Tens(channel().0), &options)
        .await;
    let Err(PlayError::ConnectionLost { outage, last }) = played else {
        panic!("not given up: {played:?}");
    };
    assert!(!outage.is_zero() && !fake.is_done());
    assert_eq!(last.message(), "no");
}

#[tokio::test]
async fn invalid_addresses_are_reported() {
    let table = [
        ("not an address", "ADDRESS_REFUSED"),
        ("grpc://localhost:50051", "ADDRESS_REFUSED"),
        ("localhost", "ADDRESS_REFUSED"),
        ("127.0.0.1:1", "CONNECT_FAILED"),
    ];
    for (url, reason) in table {
        let error = chefshat_client::Client::connect(url).await.unwrap_err();
        assert_eq!(error.reason(), Some(reason), "{url}: {error}");
        assert!(error.message().contains(url));
    }
}
