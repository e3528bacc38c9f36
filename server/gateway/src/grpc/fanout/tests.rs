//! What spectators who share a stream receive, and what the node keeps for them.

use std::convert::Infallible;

use bytes::{BufMut as _, BytesMut};
use futures::FutureExt as _;
use http_body::Frame;
use http_body_util::BodyExt as _;
use tokio::sync::mpsc;
use tokio::time::{Duration, advance};
use tokio_stream::StreamExt as _;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Status;

use super::*;
use crate::grpc::heartbeats::EMPTY;
use chefshat_admission::access::TokenId;
use chefshat_admission::limits::{HISTORY_STEP, Shares};
use log::{MAX_KEPT_BYTES, MAX_UNREAD};

type Sent = v1::SpectatorServiceWatchResponse;

/// The request of a spectator with these headers, from this event on.
fn request_from(
    headers: &[(&'static str, &'static str)],
    snapshot: bool,
    from_sequence: u64,
) -> Option<SameRequest> {
    let message = SpectatorServiceWatchRequest {
        room_id: "a room".into(),
        from_sequence,
        snapshot,
    };
    let mut body = vec![0; PREFIX];
    message.encode(&mut body).expect("space");
    let headers = headers.iter().map(|(name, value)| {
        let value = value.parse().expect("a value");
        (http::HeaderName::from_static(name), value)
    });
    key(WATCH, &headers.collect(), &body.into())
}

fn request(headers: &[(&'static str, &'static str)], snapshot: bool) -> Option<SameRequest> {
    request_from(headers, snapshot, 0)
}

/// An answer of another node, and where its data come from.
fn answer() -> (mpsc::Sender<Bytes>, Response<Body>) {
    let (sender, receiver) = mpsc::channel(1);
    let frames = ReceiverStream::new(receiver).map(|data| Ok::<_, Status>(Frame::data(data)));
    (sender, Response::new(Body::new(StreamBody::new(frames))))
}

fn fanout() -> Fanout {
    Fanout::new(Arc::new(CallLimits::new(Shares::default())))
}

/// The room as it is when somebody joins.
fn present() -> v1::Room {
    v1::Room {
        name: "now".into(),
        ..v1::Room::default()
    }
}

/// Tells nobody how many share a stream.
fn tell(_: watch::Receiver<u32>) {}

async fn opened_from(
    fanout: &Fanout,
    from: u64,
    caller: Key,
    open: impl FnOnce() -> Response<Body>,
) -> Body {
    let key = request_from(&[], false, from).expect("shared");
    let present = async { Some(present()) };
    let open = async { Ok::<_, Infallible>(open()) };
    let Ok(response) = fanout.answer(key, caller, present, open, tell).await;
    response.into_body()
}

async fn opened(fanout: &Fanout, open: impl FnOnce() -> Response<Body>) -> Body {
    opened_from(fanout, 0, Key::Local, open).await
}

fn not_opened() -> Response<Body> {
    panic!("it shares the stream that is there")
}

/// An encoded message.
fn framed(message: &Sent) -> Bytes {
    let mut bytes = BytesMut::new();
    bytes.put_u8(0);
    bytes.put_u32(u32::try_from(message.encoded_len()).expect("short"));
    message.encode(&mut bytes).expect("space");
    bytes.freeze()
}

/// A message with one event, that takes about this number of bytes.
fn event(sequence: u64, bytes: usize) -> Sent {
    let expression = v1::Expression {
        label: "x".repeat(bytes),
        ..v1::Expression::default()
    };
    let shown = v1::ExpressionShown {
        expression: Some(expression),
        ..v1::ExpressionShown::default()
    };
    let event = v1::GameEvent {
        sequence,
        kind: Some(v1::game_event::Kind::ExpressionShown(Box::new(shown))),
        ..v1::GameEvent::default()
    };
    Sent {
        events: vec![event],
        ..Sent::default()
    }
}

fn awaited(seat: u32, waited_ms: u32, left_ms: u32) -> Vec<v1::Awaited> {
    vec![v1::Awaited {
        seat: Some(seat),
        away: true,
        waited_ms,
        left_ms: Some(left_ms),
    }]
}

async fn send(sender: &mpsc::Sender<Bytes>, message: &Sent) {
    sender.send(framed(message)).await.expect("it is received");
}

async fn read(body: &mut Body) -> Option<Result<Sent, Status>> {
    let frame = body.frame().await?;
    Some(frame.map(|frame| {
        let data = frame.into_data().expect("no trailers");
        Sent::decode(&data[PREFIX..]).expect("readable")
    }))
}

async fn message(body: &mut Body) -> Sent {
    read(body).await.expect("open").expect("a message")
}

#[test]
fn only_the_same_request_of_the_same_caller_is_shared() {
    let bare = request(&[], false);
    assert!(bare.is_some());
    assert_eq!(request(&[("x-forwarded-for", "192.0.2.7")], false), bare);
    assert_ne!(request(&[("authorization", "Bearer a")], false), bare);
    assert_eq!(request(&[], true), None);
    assert_eq!(request(&[("grpc-timeout", "5S")], false), None);
    let message = bare.expect("just seen").message;
    let others = key(
        "/chefshat.v1.RoomService/GetRoom",
        &HeaderMap::new(),
        &message,
    );
    assert_eq!(others, None);
}

#[tokio::test]
async fn spectators_share_a_stream_from_its_first_message_on() {
    let fanout = fanout();
    let (sender, response) = answer();
    let mut first = opened(&fanout, || response).await;
    // However it is divided on its way, and with heartbeats.
    let bytes = [framed(&event(1, 10)), EMPTY, framed(&event(2, 10))].concat();
    for byte in bytes {
        let data = Bytes::copy_from_slice(&[byte]);
        sender.send(data).await.expect("it is received");
    }
    assert_eq!(message(&mut first).await, event(1, 10));
    let mut second = opened(&fanout, not_opened).await;
    assert_eq!(message(&mut first).await, event(2, 10));
    send(&sender, &event(3, 10)).await;
    drop(sender);
    for sequence in 1..=3 {
        assert_eq!(message(&mut second).await, event(sequence, 10));
    }
    assert_eq!(message(&mut first).await, event(3, 10));
    assert!(read(&mut first).await.is_none() && read(&mut second).await.is_none());
}

#[tokio::test(start_paused = true)]
async fn one_who_comes_later_learns_of_the_present() {
    let fanout = fanout();
    let (sender, response) = answer();
    let mut first = opened(&fanout, || response).await;
    let room = v1::Room {
        name: "then".into(),
        ..v1::Room::default()
    };
    let began = Sent {
        room: Some(room),
        ..event(1, 10)
    };
    let away = Sent {
        awaited: awaited(2, 0, 60_000),
        ..Sent::default()
    };
    let last = Sent {
        awaited: awaited(3, 500, 20_000),
        ..event(2, 10)
    };
    for sent in [&began, &away, &last] {
        send(&sender, sent).await;
        assert_eq!(message(&mut first).await, *sent);
    }
    advance(Duration::from_secs(15)).await;
    let mut second = opened(&fanout, not_opened).await;
    let expected = Sent {
        room: Some(present()),
        ..began
    };
    assert_eq!(message(&mut second).await, expected);
    let expected = Sent {
        awaited: awaited(3, 15_500, 5_000),
        ..last
    };
    assert_eq!(
        message(&mut second).await,
        expected,
        "without the seat that was away"
    );
}

#[tokio::test]
async fn a_stream_that_nobody_reads_is_ended() {
    let fanout = fanout();
    let (sender, response) = answer();
    let first = opened(&fanout, || response).await;
    let second = opened(&fanout, not_opened).await;
    drop(first);
    assert!(!sender.is_closed());
    drop(second);
    sender.closed().await;
}

#[tokio::test]
async fn one_who_reads_slowly_delays_a_stream_of_its_own_and_is_not_cut_off() {
    let fanout = fanout();
    let (sender, response) = answer();
    let mut slow = opened(&fanout, || response).await;
    let size = MAX_UNREAD / 2;
    let total = 2 * MAX_KEPT_BYTES / size;
    let sending = tokio::spawn(async move {
        let mut sent = 0;
        for sequence in 0..total {
            send(&sender, &event(sequence as u64, size)).await;
            sent += 1;
        }
        sent
    });
    // Nobody reads, so that no more than a few are received.
    for _ in 0..10 * total {
        tokio::task::yield_now().await;
    }
    assert!(!sending.is_finished());
    for sequence in 0..total {
        assert_eq!(message(&mut slow).await, event(sequence as u64, size));
    }
    assert_eq!(sending.await.expect("it ends"), total);
}

#[tokio::test]
async fn one_who_falls_far_behind_others_is_cut_off_and_who_comes_too_late_has_a_stream_alone() {
    let fanout = fanout();
    let (sender, response) = answer();
    let mut slow = opened(&fanout, || response).await;
    let mut reading = opened(&fanout, not_opened).await;
    let half = event(1, MAX_KEPT_BYTES / 2 + 1);
    for _ in 0..2 {
        send(&sender, &half).await;
        assert_eq!(message(&mut reading).await, half);
    }
    assert!(read(&mut slow).await.expect("an end").is_err());
    let (_other, response) = answer();
    opened(&fanout, || response).await;
}

#[tokio::test]
async fn one_caller_takes_no_more_memory_than_its_share() {
    let fanout = fanout();
    let caller = Key::Address([192, 0, 2, 1].into());
    let share = fanout.limits.share_of_histories(caller);
    let mut streams = Vec::new();
    // Each of them would take two steps beyond its first one.
    let messages = 3;
    for from in 0..share as u64 {
        let (sender, response) = answer();
        let mut body = opened_from(&fanout, from, caller, || response).await;
        for sequence in 0..messages {
            send(&sender, &event(sequence, HISTORY_STEP - 1024)).await;
            message(&mut body).await;
        }
        streams.push((sender, body));
    }
    let left = std::iter::from_fn(|| fanout.limits.keep_history(caller));
    let left: Vec<_> = left.collect();
    assert!(left.len() < 2, "not enough for another stream");
    drop(left);
    let other = Key::Token(TokenId([1; 4]));
    assert!(fanout.limits.keep_history(other).is_some());
    // The last one is not kept, and continues.
    let (sender, body) = streams.last_mut().expect("many");
    let from = share as u64 - 1;
    let (_second, response) = answer();
    let _alone = opened_from(&fanout, from, caller, || response).await;
    send(sender, &event(9, 10)).await;
    assert_eq!(message(body).await, event(9, 10));
    drop(streams);
    tokio::task::yield_now().await;
    assert!(
        fanout.limits.keep_history(caller).is_some(),
        "it is free again"
    );
}

#[tokio::test]
async fn a_stream_that_is_refused_is_shared_by_nobody() {
    let fanout = fanout();
    let refused = async { Err::<Response<Body>, _>(()) };
    let key = request(&[], false).expect("shared");
    let present = || async { Some(present()) };
    let mut waiting = Box::pin(async {
        let open = std::future::pending::<Result<Response<Body>, ()>>();
        fanout
            .answer(key.clone(), Key::Local, present(), open, tell)
            .await
    });
    assert!((&mut waiting).now_or_never().is_none());
    let mut second = Box::pin(fanout.answer(key.clone(), Key::Local, present(), refused, tell));
    assert!(
        (&mut second).now_or_never().is_none(),
        "it waits for the first"
    );
    // The client of the first one has gone.
    drop(waiting);
    assert!(second.await.is_err());
}
