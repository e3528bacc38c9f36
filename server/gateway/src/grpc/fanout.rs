//! Spectators of a room of another node: those of this node who send the same request share one
//! stream. Its messages are kept as the other node has encoded them, so a spectator who comes later
//! receives all events too, with the room and whom the game waits for as they are then.

mod log;
mod message;

use std::collections::HashMap;
use std::sync::{Arc, Weak};

use bytes::Bytes;
use chefshat_proto::v1::{self, SpectatorServiceWatchRequest};
use futures::stream::unfold;
use http::{HeaderMap, Response};
use http_body_util::StreamBody;
use prost::Message as _;
use tokio::sync::watch;
use tonic::body::Body;

use super::heartbeats::PREFIX;
use super::status::room_gone;
use chefshat_admission::limits::{CallLimits, Key};
use chefshat_base::lock::Lock;
use chefshat_base::proxies::FORWARDED_FOR;
use chefshat_base::tasks::{LongTask, named};
use log::{Reader, SharedStream};

/// The call whose streams are shared.
const WATCH: &str = "/chefshat.v1.SpectatorService/Watch";
/// The header with the status of a refusal.
const STATUS: &str = "grpc-status";

/// What requests have in common that get the same answer: the message and who sends it.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct SameRequest {
    message: Bytes,
    headers: Vec<(String, Bytes)>,
    /// The room that is watched.
    pub(super) room: String,
}

/// The streams of other nodes that spectators of this node share.
#[derive(Debug)]
pub(super) struct Fanout {
    limits: Arc<CallLimits>,
    streams: Lock<HashMap<SameRequest, Weak<SharedStream>>>,
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
    Some(SameRequest {
        message: body.clone(),
        headers,
        room: request.room_id,
    })
}

impl Fanout {
    /// No streams yet. Each spectator that shares one counts among the streams of its caller.
    pub(super) fn new(limits: Arc<CallLimits>) -> Self {
        Self {
            limits,
            streams: Lock::default(),
        }
    }

    /// Answers a request with the stream of others who have sent the same, or else with what `open`
    /// answers, which others may then share. The other node counts that stream, and learns by `tell`
    /// how many share it besides one. One who shares it begins with the `present` room.
    pub(super) async fn answer<E>(
        &self,
        key: SameRequest,
        caller: Key,
        present: impl Future<Output = Option<v1::Room>>,
        open: impl Future<Output = Result<Response<Body>, E>>,
        tell: impl FnOnce(watch::Receiver<u32>),
    ) -> Result<Response<Body>, E> {
        if let Some(reader) = self.join(&key)
            && let Some(place) = self.limits.share_stream(caller)
            && reader.head().await.is_some()
            && let Some(room) = present.await
            && let Some(response) = response(reader.joining(room, place)).await
        {
            return Ok(response);
        }
        let opening = Opening(SharedStream::new(Arc::clone(&self.limits), caller));
        let own = opening.0.reader().expect("it has just begun");
        {
            let mut streams = self.streams.lock();
            streams.retain(|_, stream| stream.strong_count() > 0);
            streams.insert(key, Arc::downgrade(&opening.0));
        }
        let answer = open.await?;
        // A refusal has its status in its headers.
        if answer.headers().contains_key(STATUS) {
            return Ok(answer);
        }
        let (parts, body) = answer.into_parts();
        opening.0.answered(parts.status, parts.headers);
        let receiving = Arc::clone(&opening.0);
        tell(receiving.others());
        let receiving = async move { receiving.receive(body).await };
        tokio::spawn(named(LongTask::SharedStream, receiving));
        let answer = response(own).await;
        Ok(answer.unwrap_or_else(|| room_gone().into_http()))
    }

    /// Joins a stream that still has everything from its first message on.
    fn join(&self, key: &SameRequest) -> Option<Reader> {
        let streams = self.streams.lock();
        streams.get(key)?.upgrade()?.reader()
    }
}

/// A stream that is being opened. Dropped before it is answered, it ends for those who wait for it.
struct Opening(Arc<SharedStream>);

impl Drop for Opening {
    fn drop(&mut self) {
        self.0.end_unanswered();
    }
}

/// The answer of another node for one spectator; `None` if that node has refused the stream.
async fn response(reader: Reader) -> Option<Response<Body>> {
    let (status, headers) = reader.head().await?;
    let frames = unfold(Some(reader), |reader| async move {
        let mut reader = reader?;
        let frame = reader.frame().await?;
        let reader = Some(reader).filter(|_| frame.is_ok());
        Some((frame, reader))
    });
    let mut response = Response::new(Body::new(StreamBody::new(frames)));
    *response.status_mut() = status;
    *response.headers_mut() = headers;
    Some(response)
}

#[cfg(test)]
mod tests;
