//! The layer that sends a call to the node that has its room or tournament. A call is first tried
//! here; if its handler finds what it is about at another node (`status::elsewhere`), the same
//! request goes to that node, and its answer comes back as it arrives. So no method knows anything
//! of forwarding. What is new is created by the node that it is for (`Lookup::check_placed_here`).
//! Spectators share streams (`fanout`). A single server does not have this layer.
//!
//! The other node decides about access and charges the caller, so the headers that it needs for
//! that pass with the request. It never passes the request on.

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use chefshat_proto::v1::{self, room_service_client::RoomServiceClient};
use futures::future::{BoxFuture, Either};
use http::{HeaderMap, HeaderName, HeaderValue, Request, Response, header};
use http_body_util::{BodyExt as _, Full};
use tokio::sync::watch;
use tokio_stream::StreamExt as _;
use tokio_stream::wrappers::WatchStream;
use tonic::body::Body;
use tonic::metadata::MetadataMap;
use tonic::transport::Channel;
use tower::{Service, ServiceExt as _};
use tracing::debug;

use super::deadline::Passed;
use super::fanout::{self, Fanout};
use super::limits::Charged;
use super::status::{is_elsewhere, is_not_owner, owner_unreachable};
use crate::connections::peer_address;
use crate::front::{Front, InFront, take_ready};
use crate::peers::Peers;
use chefshat_admission::access::{Call, MAX_STUDY_MESSAGE_BYTES, SECRET_HEADER};
use chefshat_admission::limits::{CallLimits, Key};
use chefshat_base::lock::Lock;
use chefshat_base::proxies::FORWARDED_FOR;
use chefshat_base::tasks::{LongTask, named};
use chefshat_hosting::cluster::{Directory, Elsewhere, Peer};
use chefshat_wire::encoded::peer::ShareRequest;
use chefshat_wire::encoded::peer::peer_service_client::PeerServiceClient;

/// How often a call looks for the node that has its room or tournament.
const ATTEMPTS: u32 = 3;
/// Pause before a call looks again: the node that was named is just handing over.
const PAUSE: Duration = Duration::from_millis(100);
/// Most bytes of a request that are kept: one message.
const MAX_KEPT_BYTES: usize = MAX_STUDY_MESSAGE_BYTES + 1024;
/// The headers of a request that other nodes need.
const HEADERS: [HeaderName; 8] = [
    header::AUTHORIZATION,
    HeaderName::from_static(SECRET_HEADER),
    header::CONTENT_TYPE,
    header::TE,
    header::USER_AGENT,
    HeaderName::from_static("grpc-timeout"),
    HeaderName::from_static("grpc-encoding"),
    HeaderName::from_static("grpc-accept-encoding"),
];

/// The headers with which a request is sent to other nodes. They name its client, and contain its
/// token and secrets.
fn passed_headers<B>(request: &Request<B>) -> HeaderMap {
    let mut passed = HeaderMap::new();
    for name in HEADERS {
        for value in request.headers().get_all(&name) {
            passed.append(name.clone(), value.clone());
        }
    }
    if let Some(client) = peer_address(request.extensions()) {
        let client = HeaderValue::try_from(client.to_string());
        let client = client.expect("addresses are printable");
        passed.insert(HeaderName::from_static(FORWARDED_FOR), client);
    }
    passed
}

/// In the extensions of requests of other nodes.
#[derive(Debug, Clone, Copy)]
pub struct FromPeer;

/// What a call needs to ask other nodes itself, in the extensions of its request.
#[derive(Clone)]
pub(super) struct Gateway {
    layer: ForwardLayer,
    headers: Passed,
}

impl Gateway {
    /// The connections to other nodes.
    pub(super) fn peers(&self) -> &Peers {
        &self.layer.peers
    }

    /// Who has which rooms and tournaments.
    pub(super) fn directory(&self) -> &Arc<dyn Directory> {
        &self.layer.directory
    }

    /// The node that was named does not have it, or cannot be reached.
    pub(super) fn forget(&self, elsewhere: &Elsewhere) {
        match &elsewhere.found_by {
            Some(found_by) => self.directory().forget(found_by),
            None => self.directory().avoid(&elsewhere.peer),
        }
    }

    /// A request to another node, for the client of this one.
    pub(super) fn request<T>(&self, message: T) -> tonic::Request<T> {
        let mut headers = self.headers.now();
        for own in [header::CONTENT_TYPE, header::TE, header::USER_AGENT] {
            headers.remove(own);
        }
        let mut request = tonic::Request::new(message);
        *request.metadata_mut() = MetadataMap::from_headers(headers);
        request
    }
}

/// Puts forwarding in front of the services.
#[derive(Debug, Clone)]
pub struct ForwardLayer {
    directory: Arc<dyn Directory>,
    peers: Arc<Peers>,
    fanout: Arc<Fanout>,
}

impl ForwardLayer {
    /// Creates a layer that sends calls to these peers. `limits` counts the spectators that share a
    /// stream.
    pub fn new(
        directory: Arc<dyn Directory>,
        peers: Arc<Peers>,
        limits: Arc<CallLimits>,
    ) -> InFront<Self> {
        InFront(Self {
            directory,
            peers,
            fanout: Arc::new(Fanout::new(limits)),
        })
    }

    /// What a request needs to ask other nodes itself.
    pub(super) fn gateway<B>(&self, request: &Request<B>) -> Gateway {
        Gateway {
            layer: self.clone(),
            headers: Passed::new(passed_headers(request)),
        }
    }
}

impl<S> Front<S, Body> for ForwardLayer
where
    S: Service<Request<Body>, Response = Response<Body>> + Clone + Send + 'static,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Answering = Either<S::Future, BoxFuture<'static, Result<Response<Body>, S::Error>>>;

    fn answer(&self, services: &mut S, mut request: Request<Body>) -> Self::Answering {
        // Streams of seats, lists of everything and what is about several records ask other nodes
        // themselves.
        let gateway = self.gateway(&request);
        request.extensions_mut().insert(gateway.clone());
        if !Call::find(request.uri().path()).is_some_and(|call| call.forwarded) {
            return Either::Left(services.call(request));
        }
        Either::Right(Box::pin(gateway.answer(take_ready(services), request)))
    }
}

impl Gateway {
    /// Answers a call here or at the node that has what it is about.
    async fn answer<S>(
        self,
        mut services: S,
        request: Request<Body>,
    ) -> Result<Response<Body>, S::Error>
    where
        S: Service<Request<Body>, Response = Response<Body>> + Clone + Send,
        S::Future: Send,
        S::Error: Send,
    {
        let (parts, body) = request.into_parts();
        let address = Key::of_address(peer_address(&parts.extensions));
        let kept = Arc::new(Kept::default());
        let keeping = Arc::clone(&kept);
        let mut body = Body::new(body.map_frame(move |frame| {
            if let Some(data) = frame.data_ref() {
                keeping.add(data);
            }
            frame
        }));
        for attempt in 1..=ATTEMPTS {
            let request = Request::from_parts(parts.clone(), body);
            let again = services.clone();
            let response = services.call(request).await?;
            let Some(elsewhere) = response.extensions().get().and_then(is_elsewhere) else {
                return Ok(response);
            };
            let Some(message) = kept.message() else {
                break;
            };
            let shared = fanout::key(parts.uri.path(), self.headers.as_arrived(), &message);
            let mut forwarded = Request::new(Body::new(Full::new(message.clone())));
            *forwarded.method_mut() = parts.method.clone();
            *forwarded.uri_mut() = parts.uri.clone();
            *forwarded.headers_mut() = self.headers.now();
            let sent = self.peers().send(&elsewhere.peer, forwarded);
            let answered = match shared {
                Some(key) => {
                    let caller = response
                        .extensions()
                        .get()
                        .map_or(address, |key: &Charged| key.0);
                    let present = self.room(&elsewhere.peer, key.room.clone());
                    let channel = self.peers().channel(&elsewhere.peer);
                    let room_id = key.room.clone();
                    let tell = |others| {
                        let telling = tell_sharing(channel, room_id, others);
                        tokio::spawn(named(LongTask::Sharing, telling));
                    };
                    (self.layer.fanout.answer(key, caller, present, sent, tell)).await
                }
                None => sent.await,
            };
            match answered {
                Ok(answer) if !is_not_owner(answer.headers()) => return Ok(returned(answer)),
                Ok(_) => self.forget(elsewhere),
                Err(error) => {
                    debug!(peer = %elsewhere.peer.node, %error, "a call could not be forwarded");
                    self.forget(elsewhere);
                    // Whether it was executed is unknown. Something new is found by its request, or
                    // waits for nobody.
                    if elsewhere.found_by.is_some() {
                        break;
                    }
                }
            }
            if attempt < ATTEMPTS {
                tokio::time::sleep(PAUSE).await;
            }
            body = Body::new(Full::new(message));
            services = again;
            services.ready().await?;
        }
        Ok(owner_unreachable().into_http())
    }
}

impl Gateway {
    /// A room of another node, as its spectators see it.
    async fn room(&self, peer: &Peer, room_id: String) -> Option<v1::Room> {
        let mut rooms = RoomServiceClient::new(self.peers().channel(peer));
        let request = self.request(v1::GetRoomRequest {
            room_id,
            join_code: String::new(),
        });
        let room = rooms.get_room(request).await.ok()?.into_inner().room?;
        // The stream itself says that.
        Some(v1::Room {
            awaited: None,
            ..room
        })
    }
}

/// Tells the node that has a room how many share a stream of it, until they have left.
async fn tell_sharing(channel: Channel, room_id: String, mut others: watch::Receiver<u32>) {
    // Most streams have one spectator.
    if others.wait_for(|others| *others > 0).await.is_err() {
        return;
    }
    let counts = WatchStream::new(others).map(move |others| ShareRequest {
        room_id: room_id.clone(),
        others,
    });
    if let Err(error) = PeerServiceClient::new(channel).share(counts).await {
        debug!(%error, "the spectators who share a stream are not counted");
    }
}

/// The answer of another node, as an answer of this one.
fn returned(answer: Response<Body>) -> Response<Body> {
    let (parts, body) = answer.into_parts();
    let mut response = Response::new(body);
    *response.status_mut() = parts.status;
    *response.headers_mut() = parts.headers;
    response
}

/// What has been read of the body of a request, which may be sent again.
#[derive(Default)]
struct Kept(Lock<Read>);

#[derive(Default)]
struct Read {
    bytes: Vec<u8>,
    too_long: bool,
}

impl Kept {
    fn add(&self, data: &Bytes) {
        let mut read = self.0.lock();
        if read.bytes.len() + data.len() > MAX_KEPT_BYTES {
            read.too_long = true;
            read.bytes = Vec::new();
        } else if !read.too_long {
            read.bytes.extend_from_slice(data);
        }
    }

    /// The message of the request, which has been read; `None` if it is too long.
    fn message(&self) -> Option<Bytes> {
        let read = self.0.lock();
        (!read.too_long).then(|| Bytes::copy_from_slice(&read.bytes))
    }
}
