//! Heartbeats: a stream on which nothing is sent for a while carries an empty message, so that its
//! client knows that it is alive. The services know nothing of them. `proto/README.md` describes the
//! header.

use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use bytes::Bytes;
use futures::future::{BoxFuture, Either, TryFutureExt as _};
use http::{HeaderMap, Request, Response};
use http_body::{Body as HttpBody, Frame, SizeHint};
use smallvec::SmallVec;
use tokio::time::{Instant, Sleep, sleep_until};
use tonic::Status;
use tonic::body::Body;
use tower::Service;

use crate::front::Front;
use chefshat_admission::access::Call;

/// Interval of heartbeats on an idle stream, unless its client asks for another.
const HEARTBEAT: Duration = Duration::from_secs(15);

/// Seconds between the heartbeats of a call, if not as many as by default.
const HEADER: &str = "chefshat-heartbeat";
/// Fewest and most of them.
const SECONDS: [u64; 2] = [1, 60];
/// Bytes before a message: whether it is compressed, and its length.
pub(super) const PREFIX: usize = 5;
/// A message without anything.
pub(super) const EMPTY: Bytes = Bytes::from_static(&[0; PREFIX]);

/// Sends heartbeats on the streams of the services.
#[derive(Debug, Clone, Copy)]
pub struct HeartbeatLayer;

impl<S, B> Front<S, B> for HeartbeatLayer
where
    S: Service<Request<B>, Response = Response<Body>>,
    S::Future: Send + 'static,
    S::Error: 'static,
{
    type Answering = Either<S::Future, BoxFuture<'static, Result<Response<Body>, S::Error>>>;

    fn answer(&self, services: &mut S, request: Request<B>) -> Self::Answering {
        let has_heartbeats = Call::find(request.uri().path()).is_some_and(|call| call.heartbeats);
        let interval = interval(request.headers());
        let answering = services.call(request);
        if !has_heartbeats {
            return Either::Left(answering);
        }
        Either::Right(Box::pin(answering.map_ok(move |response| {
            response.map(|messages| Body::new(Beating::new(messages, interval)))
        })))
    }
}

/// The time between heartbeats that a request asks for, as near as it may be.
fn interval(headers: &HeaderMap) -> Duration {
    let asked = headers.get(HEADER).and_then(|it| it.to_str().ok());
    let seconds = asked.and_then(|it| it.parse::<u64>().ok());
    seconds.map_or(HEARTBEAT, |seconds| {
        let [fewest, most] = SECONDS;
        Duration::from_secs(seconds.clamp(fewest, most))
    })
}

/// The messages of a stream, with heartbeats between them.
struct Beating {
    messages: Body,
    position: Position,
    interval: Duration,
    /// When something was sent last.
    sent: Instant,
    /// Ends when a heartbeat may be due.
    due: Pin<Box<Sleep>>,
}

impl Beating {
    fn new(messages: Body, interval: Duration) -> Self {
        let sent = Instant::now();
        Self {
            messages,
            position: Position::default(),
            interval,
            sent,
            due: Box::pin(sleep_until(sent + interval)),
        }
    }
}

impl HttpBody for Beating {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        if let Poll::Ready(frame) = Pin::new(&mut self.messages).poll_frame(context) {
            self.sent = Instant::now();
            if let Some(data) = frame.as_ref().and_then(|it| it.as_ref().ok()?.data_ref()) {
                self.position.advance(data);
            }
            return Poll::Ready(frame);
        }
        while self.position.is_between_messages() && self.due.as_mut().poll(context).is_ready() {
            let now = Instant::now();
            let is_due = self.sent + self.interval <= now;
            if is_due {
                self.sent = now;
            }
            let next = self.sent + self.interval;
            self.due.as_mut().reset(next);
            if is_due {
                return Poll::Ready(Some(Ok(Frame::data(EMPTY))));
            }
        }
        Poll::Pending
    }

    fn is_end_stream(&self) -> bool {
        self.messages.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::default()
    }
}

/// How far the data of a stream have come in its messages.
#[derive(Debug, Default)]
struct Position {
    /// What has come of the bytes before a message.
    prefix: SmallVec<[u8; PREFIX]>,
    /// Bytes of the message that are still to come.
    left: usize,
}

impl Position {
    fn advance(&mut self, mut data: &[u8]) {
        while !data.is_empty() {
            let of_message = data.len().min(self.left);
            self.left -= of_message;
            data = &data[of_message..];
            let of_prefix = data.len().min(PREFIX - self.prefix.len());
            self.prefix.extend_from_slice(&data[..of_prefix]);
            data = &data[of_prefix..];
            if let [_, length @ ..] = self.prefix.as_slice()
                && let Ok(length) = <[u8; 4]>::try_from(length)
            {
                self.left = usize::try_from(u32::from_be_bytes(length)).unwrap_or(usize::MAX);
                self.prefix.clear();
            }
        }
    }

    fn is_between_messages(&self) -> bool {
        self.left == 0 && self.prefix.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use futures::StreamExt as _;
    use http_body_util::{BodyExt as _, StreamBody};
    use tokio::sync::mpsc;
    use tokio_stream::wrappers::ReceiverStream;
    use tower::{Layer as _, ServiceExt as _, service_fn};

    use super::*;
    use crate::front::InFront;

    const WATCH: &str = "/chefshat.v1.SpectatorService/Watch";

    /// A stream on this path, whose request has this header, and what sends its data.
    async fn stream_of(path: &str, header: Option<&str>) -> (mpsc::Sender<Vec<u8>>, Body) {
        let (sender, data) = mpsc::channel(8);
        let data = ReceiverStream::new(data);
        let frames = data.map(|data| Ok::<_, Status>(Frame::data(Bytes::from(data))));
        let mut answer = Some(Body::new(StreamBody::new(frames)));
        let services = service_fn(move |_: Request<()>| {
            let answer = answer.take().expect("one call");
            async { Ok::<_, Infallible>(Response::new(answer)) }
        });
        let mut request = Request::builder().uri(path);
        if let Some(seconds) = header {
            request = request.header(HEADER, seconds);
        }
        let request = request.body(()).unwrap();
        let services = InFront(HeartbeatLayer).layer(services);
        let Ok(answer) = services.oneshot(request).await;
        (sender, answer.into_body())
    }

    /// The next data, and after how many seconds they came.
    async fn next(body: &mut Body) -> (Vec<u8>, u64) {
        let begun = Instant::now();
        let frame = body.frame().await.unwrap().unwrap();
        (
            frame.into_data().unwrap().to_vec(),
            begun.elapsed().as_secs(),
        )
    }

    #[tokio::test(start_paused = true)]
    async fn a_silent_stream_carries_empty_messages_as_often_as_it_was_asked() {
        for (header, seconds) in [
            (None, 15),
            (Some("3"), 3),
            (Some("0"), 1),
            (Some("100000"), 60),
            (Some("soon"), 15),
        ] {
            let (_sender, mut body) = stream_of(WATCH, header).await;
            for _ in 0..3 {
                assert_eq!(
                    next(&mut body).await,
                    (vec![0; PREFIX], seconds),
                    "{header:?}"
                );
            }
        }
    }

    #[tokio::test(start_paused = true)]
    async fn none_is_sent_within_a_message_or_soon_after_one() {
        let (sender, mut body) = stream_of(WATCH, Some("3")).await;
        // A message whose prefix and content come in parts, with a long pause at each.
        let message = [0, 0, 0, 0, 2, 7, 8];
        let sent = tokio::spawn(async move {
            for byte in message {
                sender.send(vec![byte]).await.unwrap();
                tokio::time::sleep(Duration::from_secs(10)).await;
            }
            sender
        });
        let mut received = Vec::new();
        while received.len() < message.len() {
            received.extend(next(&mut body).await.0);
        }
        assert_eq!(received, message);
        assert_eq!(next(&mut body).await, (vec![0; PREFIX], 3));
        drop(sent.await.unwrap());
    }

    #[tokio::test(start_paused = true)]
    async fn streams_without_heartbeats_stay_silent_and_ended_ones_end() {
        let path = "/chefshat.v1.PlayService/Play";
        let (_sender, mut body) = stream_of(path, Some("3")).await;
        let silent = tokio::time::timeout(Duration::from_secs(100), body.frame()).await;
        assert!(silent.is_err());

        let (sender, mut body) = stream_of(WATCH, Some("3")).await;
        drop(sender);
        assert!(body.frame().await.is_none());
    }

    #[test]
    fn positions_are_found_however_the_data_are_cut() {
        let messages = [&[0, 0, 0, 0, 0][..], &[1, 0, 0, 0, 3, 1, 2, 3]].concat();
        for cut in 1..=messages.len() {
            let mut position = Position::default();
            for part in messages.chunks(cut) {
                position.advance(part);
            }
            assert!(position.is_between_messages(), "{cut}");
        }
        let mut position = Position::default();
        position.advance(&messages[..messages.len() - 1]);
        assert!(!position.is_between_messages());
    }

    #[test]
    fn every_stream_whose_comment_names_heartbeats_has_them() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../proto/chefshat/v1");
        let mut named = Vec::new();
        for entry in std::fs::read_dir(folder).unwrap() {
            let text = std::fs::read_to_string(entry.unwrap().path()).unwrap();
            let (mut service, mut comment) = (String::new(), String::new());
            for line in text.lines().map(str::trim) {
                let words: Vec<&str> = line.split([' ', '(']).collect();
                match *words.as_slice() {
                    ["service", name, ..] => service = name.to_owned(),
                    ["//", ..] => comment.push_str(line),
                    ["rpc", method, ..] => {
                        if comment.contains("heartbeat") {
                            named.push(format!("/chefshat.v1.{service}/{method}"));
                        }
                        comment.clear();
                    }
                    _ => comment.clear(),
                }
            }
        }
        let with = Call::all().filter(|call| call.heartbeats);
        let mut with: Vec<_> = with.map(|call| call.path.to_owned()).collect();
        named.sort();
        with.sort();
        assert_eq!(with, named);
        assert!(!with.is_empty());
    }
}
