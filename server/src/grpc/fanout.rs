//! Spectators of a room of another node: those of this node who send the same request share one
//! stream. Its messages are kept as the other node has encoded them, so a spectator who comes later
//! receives all of them too.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, Weak};

use bytes::Bytes;
use chefshat_proto::v1::SpectatorServiceWatchRequest;
use futures::stream::unfold;
use http::{HeaderMap, Response, StatusCode};
use http_body::Frame;
use http_body_util::{BodyExt as _, StreamBody};
use prost::Message as _;
use tokio::sync::watch;
use tonic::body::Body;

use super::status::{room_gone, spectator_too_slow};
use crate::limits::{CallLimits, Held, Key};
use crate::proxies::FORWARDED_FOR;

/// The call whose streams are shared.
const WATCH: &str = "/chefshat.v1.SpectatorService/Watch";
/// Most bytes of a stream that are kept for those who read slowly or come later.
const MAX_KEPT_BYTES: usize = 1024 * 1024;
/// The header with the status of a refusal.
const STATUS: &str = "grpc-status";
/// Bytes before a message: whether it is compressed, and its length.
const PREFIX: usize = 5;

/// What requests have in common that get the same answer: the message and who sends it.
type SameRequest = (Bytes, Vec<(String, Bytes)>);

/// The streams of other nodes that spectators of this node share.
#[derive(Debug)]
pub(super) struct Fanout {
    limits: Arc<CallLimits>,
    streams: Mutex<HashMap<SameRequest, Weak<watch::Sender<Log>>>>,
}

/// A stream so far.
#[derive(Debug, Default)]
struct Log {
    /// `None` until the other node has answered.
    head: Option<(StatusCode, HeaderMap)>,
    /// The number of the first piece that is kept.
    first: usize,
    pieces: VecDeque<Piece>,
    /// Bytes of the pieces.
    kept: usize,
    is_over: bool,
}

#[derive(Debug, Clone)]
enum Piece {
    Data(Bytes),
    Trailers(HeaderMap),
}

impl Log {
    fn add(&mut self, frame: Frame<Bytes>) {
        let piece = match frame.into_data() {
            Ok(data) => {
                self.kept += data.len();
                Piece::Data(data)
            }
            Err(frame) => Piece::Trailers(frame.into_trailers().unwrap_or_default()),
        };
        self.pieces.push_back(piece);
        while self.kept > MAX_KEPT_BYTES
            && let Some(dropped) = self.pieces.pop_front()
        {
            self.first += 1;
            if let Piece::Data(data) = dropped {
                self.kept -= data.len();
            }
        }
    }
}

/// The key of a request, if its stream may be shared. A snapshot is of the moment, and a deadline is
/// the client's own.
pub(super) fn key(path: &str, headers: &HeaderMap, body: &Bytes) -> Option<SameRequest> {
    let message = body
        .get(PREFIX..)
        .filter(|_| path == WATCH && body[0] == 0)?;
    let request = SpectatorServiceWatchRequest::decode(message).ok()?;
    if request.snapshot || headers.contains_key("grpc-timeout") {
        return None;
    }
    let irrelevant = [FORWARDED_FOR, "user-agent"];
    let headers = (headers.iter()).filter(|(name, _)| !irrelevant.contains(&name.as_str()));
    let headers = headers.map(|(name, value)| {
        let value = Bytes::copy_from_slice(value.as_bytes());
        (name.as_str().to_owned(), value)
    });
    let mut headers: Vec<_> = headers.collect();
    headers.sort();
    Some((body.clone(), headers))
}

impl Fanout {
    /// No streams yet. Each spectator that shares one counts among the streams of its address.
    pub(super) fn new(limits: Arc<CallLimits>) -> Self {
        Self {
            limits,
            streams: Mutex::default(),
        }
    }

    /// Answers a request with the stream of others who have sent the same, or else with what `open`
    /// answers, which others may then share. The other node counts that stream.
    pub(super) async fn answer<E>(
        &self,
        key: SameRequest,
        caller: Key,
        open: impl Future<Output = Result<Response<Body>, E>>,
    ) -> Result<Response<Body>, E> {
        if let Some(shared) = self.join(&key)
            && let Some(place) = self.limits.share_stream(caller)
            && let Some(response) = response(shared, Some(place)).await
        {
            return Ok(response);
        }
        let (sender, own) = watch::channel(Log::default());
        let sender = Arc::new(sender);
        {
            let mut streams = self.streams.lock().expect("nothing panics under this lock");
            streams.retain(|_, stream| stream.strong_count() > 0);
            streams.insert(key, Arc::downgrade(&sender));
        }
        let answer = open.await?;
        // A refusal has its status in its headers.
        if answer.headers().contains_key(STATUS) {
            return Ok(answer);
        }
        let (parts, body) = answer.into_parts();
        let head = Some((parts.status, parts.headers));
        sender.send_modify(|log| log.head = head);
        tokio::spawn(receive(body, sender));
        let answer = response(own, None).await;
        Ok(answer.unwrap_or_else(|| room_gone().into_http()))
    }

    /// A stream that still has everything from its first message on.
    fn join(&self, key: &SameRequest) -> Option<watch::Receiver<Log>> {
        let streams = self.streams.lock().expect("nothing panics under this lock");
        let stream = streams.get(key)?.upgrade()?;
        let is_whole = stream.borrow().first == 0;
        is_whole.then(|| stream.subscribe())
    }
}

/// Receives a stream while somebody reads it.
async fn receive(mut body: Body, log: Arc<watch::Sender<Log>>) {
    loop {
        tokio::select! {
            () = log.closed() => return,
            frame = body.frame() => match frame {
                Some(Ok(frame)) => log.send_modify(|log| log.add(frame)),
                // Readers notice that the sender is gone.
                Some(Err(_)) => return,
                None => {
                    log.send_modify(|log| log.is_over = true);
                    return;
                }
            }
        }
    }
}

/// The answer of another node for one spectator; `None` if that node has refused the stream.
async fn response(mut log: watch::Receiver<Log>, place: Option<Held>) -> Option<Response<Body>> {
    let (status, headers) = {
        let answered = log.wait_for(|log| log.head.is_some()).await.ok()?;
        answered.head.clone()?
    };
    let frames = unfold(Some((log, 0, place)), |state| async move {
        let (mut log, position, place) = state?;
        loop {
            match next(&mut log, position) {
                Next::Frame(frame) => return Some((Ok(frame), Some((log, position + 1, place)))),
                Next::End => return None,
                Next::Dropped => return Some((Err(spectator_too_slow()), None)),
                Next::Awaited if log.changed().await.is_ok() => {}
                Next::Awaited => return Some((Err(room_gone()), None)),
            }
        }
    });
    let mut response = Response::new(Body::new(StreamBody::new(frames)));
    *response.status_mut() = status;
    *response.headers_mut() = headers;
    Some(response)
}

/// What follows on a stream.
enum Next {
    Frame(Frame<Bytes>),
    End,
    /// It is not kept any more.
    Dropped,
    Awaited,
}

/// The piece with this number.
fn next(log: &mut watch::Receiver<Log>, position: usize) -> Next {
    let log = log.borrow_and_update();
    let Some(index) = position.checked_sub(log.first) else {
        return Next::Dropped;
    };
    match log.pieces.get(index) {
        Some(Piece::Data(data)) => Next::Frame(Frame::data(data.clone())),
        Some(Piece::Trailers(trailers)) => Next::Frame(Frame::trailers(trailers.clone())),
        None if log.is_over => Next::End,
        None => Next::Awaited,
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use tokio::sync::mpsc;
    use tokio_stream::StreamExt as _;
    use tokio_stream::wrappers::ReceiverStream;
    use tonic::Status;

    use super::*;
    use crate::limits::Shares;

    /// The request of a spectator with these headers.
    fn request(headers: &[(&'static str, &'static str)], snapshot: bool) -> Option<SameRequest> {
        let message = SpectatorServiceWatchRequest {
            room_id: "a room".into(),
            from_sequence: 0,
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

    /// An answer of another node, and where its messages come from.
    fn answer() -> (mpsc::Sender<Bytes>, Response<Body>) {
        let (sender, receiver) = mpsc::channel(1);
        let frames = ReceiverStream::new(receiver).map(|data| Ok::<_, Status>(Frame::data(data)));
        (sender, Response::new(Body::new(StreamBody::new(frames))))
    }

    async fn opened(fanout: &Fanout, open: impl FnOnce() -> Response<Body>) -> Body {
        let key = request(&[], false).expect("shared");
        let answered = fanout.answer(key, Key::Local, async { Ok::<_, Infallible>(open()) });
        let Ok(response) = answered.await;
        response.into_body()
    }

    async fn read(body: &mut Body) -> Option<Result<Bytes, Status>> {
        let frame = body.frame().await?;
        Some(frame.map(|frame| frame.into_data().expect("no trailers")))
    }

    fn not_opened() -> Response<Body> {
        panic!("it shares the stream that is there")
    }

    #[test]
    fn only_the_same_request_of_the_same_caller_is_shared() {
        let bare = request(&[], false);
        assert!(bare.is_some());
        assert_eq!(request(&[("x-forwarded-for", "192.0.2.7")], false), bare);
        assert_ne!(request(&[("authorization", "Bearer a")], false), bare);
        assert_eq!(request(&[], true), None);
        assert_eq!(request(&[("grpc-timeout", "5S")], false), None);
        let (message, _) = bare.expect("just seen");
        let others = key(
            "/chefshat.v1.RoomService/GetRoom",
            &HeaderMap::new(),
            &message,
        );
        assert_eq!(others, None);
    }

    #[tokio::test]
    async fn spectators_share_a_stream_from_its_first_message_on() {
        let fanout = Fanout::new(Arc::new(CallLimits::new(Shares::default())));
        let (sender, response) = answer();
        let mut first = opened(&fanout, || response).await;
        sender.send("a".into()).await.expect("it is read");
        assert_eq!(read(&mut first).await.expect("open").expect("a"), "a");
        let mut second = opened(&fanout, not_opened).await;
        sender.send("b".into()).await.expect("it is read");
        drop(sender);
        for message in ["a", "b"] {
            assert_eq!(read(&mut second).await.expect("open").expect("it"), message);
        }
        assert_eq!(read(&mut first).await.expect("open").expect("b"), "b");
        assert!(read(&mut first).await.is_none() && read(&mut second).await.is_none());
    }

    #[tokio::test]
    async fn a_stream_that_nobody_reads_is_ended() {
        let fanout = Fanout::new(Arc::new(CallLimits::new(Shares::default())));
        let (sender, response) = answer();
        let first = opened(&fanout, || response).await;
        let second = opened(&fanout, not_opened).await;
        drop(first);
        assert!(!sender.is_closed());
        drop(second);
        sender.closed().await;
    }

    #[tokio::test]
    async fn who_reads_too_slowly_is_cut_off_and_who_comes_too_late_has_a_stream_alone() {
        let fanout = Fanout::new(Arc::new(CallLimits::new(Shares::default())));
        let (sender, response) = answer();
        let mut slow = opened(&fanout, || response).await;
        let mut reading = opened(&fanout, not_opened).await;
        let half = Bytes::from(vec![7; MAX_KEPT_BYTES / 2 + 1]);
        for _ in 0..2 {
            sender.send(half.clone()).await.expect("it is read");
            assert_eq!(read(&mut reading).await.expect("open").expect("it"), half);
        }
        assert!(read(&mut slow).await.expect("an end").is_err());
        let (_other, response) = answer();
        opened(&fanout, || response).await;
    }
}
