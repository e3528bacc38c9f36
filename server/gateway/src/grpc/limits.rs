//! The layer in front of all services that holds each caller to its share: of calls, of answers
//! that it does not read, and of streams. `limits` decides; this file keeps the places of calls
//! until their answers have been read: the transport takes a message long before it can send it.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};

use axum::body::HttpBody;
use bytes::Bytes;
use futures::future::BoxFuture;
use http::{Request, Response};
use http_body::{Frame, SizeHint};
use tokio::time::Instant;
use tonic::body::Body;
use tonic::{Code, Status};
use tower::Service;

use super::status::{Refusal, is_elsewhere, status};
use crate::connections::{Client, Unread, peer_address};
use crate::front::{Front, InFront, take_ready};
use chefshat_admission::access::{Call, Caller};
use chefshat_admission::limits::{Admitted, BYTES_PER_CALL, CallLimits, Executing, Key};

/// Who is charged for a request.
pub(super) fn charged(extensions: &http::Extensions) -> Key {
    match extensions.get() {
        Some(caller) => Key::of_caller(caller),
        // Refused before its caller was known.
        None => Key::of_address(peer_address(extensions)),
    }
}

/// Lets others be executed in place of the call with these extensions, because it only waits from now on.
pub(super) fn make_way(extensions: &http::Extensions) {
    let executing: Option<&Executing> = extensions.get();
    if let Some(executing) = executing {
        executing.give_back();
    }
}

/// When a request was received, before it waited for its caller's share. In its extensions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arrived(Instant);

impl Arrived {
    /// When a request with these extensions was received.
    pub(super) fn of(extensions: &http::Extensions) -> Instant {
        let arrived: Option<&Self> = extensions.get();
        arrived.map_or_else(Instant::now, |arrived| arrived.0)
    }
}

/// Who was charged for a call that belongs to another node. In the extensions of its answer.
#[derive(Debug, Clone, Copy)]
pub(super) struct Charged(pub(super) Key);

/// The client that sent a request, unless a proxy did: its connection belongs to many callers, also
/// if the proxy names none of them.
fn own_client(extensions: &http::Extensions) -> Option<&Arc<Client>> {
    Client::of(extensions).filter(|client| !client.is_proxy())
}

/// Refuses a call for which no place to wait is left. Refusing costs work as well, so the connection of
/// the client is closed; `None`: it is a proxy's, and stays open for the others behind it.
fn too_many_waiting(client: Option<&Arc<Client>>) -> Status {
    let message = match client {
        Some(client) => {
            client.close();
            "too many calls wait; the connection is closed"
        }
        None => "too many calls wait; make fewer at a time",
    };
    status(
        Code::ResourceExhausted,
        "TOO_MANY_WAITING_CALLS",
        message,
        [],
    )
}

/// Refuses a call that its caller may not make. It counts as a call: a caller that made too many
/// waits for the refusal.
pub(super) fn refuse<E: Send + 'static>(
    limits: &CallLimits,
    extensions: &http::Extensions,
    status: Status,
) -> BoxFuture<'static, Result<Response<Body>, E>> {
    let key = charged(extensions);
    let wait = limits.charge_refused(key);
    let refusal = move || Ok(status.into_http());
    if wait.is_zero() {
        return Box::pin(async move { refusal() });
    }
    match limits.place_to_wait(key) {
        None => {
            let status = too_many_waiting(own_client(extensions));
            Box::pin(async move { Ok(status.into_http()) })
        }
        Some(waiting) => Box::pin(async move {
            let _waiting = waiting;
            tokio::time::sleep(wait).await;
            refusal()
        }),
    }
}

/// Puts the limits in front of the services.
#[derive(Debug, Clone)]
pub struct LimitsLayer {
    limits: Arc<CallLimits>,
}

impl LimitsLayer {
    /// Creates a layer that asks `limits`.
    pub fn new(limits: Arc<CallLimits>) -> InFront<Self> {
        InFront(Self { limits })
    }
}

impl<S, B> Front<S, B> for LimitsLayer
where
    S: Service<Request<B>, Response = Response<Body>> + Clone + Send + 'static,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
    B: Send + 'static,
{
    type Answering = BoxFuture<'static, Result<Response<Body>, S::Error>>;

    fn answer(&self, services: &mut S, mut request: Request<B>) -> Self::Answering {
        request.extensions_mut().insert(Arrived(Instant::now()));
        let key = charged(request.extensions());
        let client = own_client(request.extensions()).cloned();
        let caller: Option<&Caller> = request.extensions().get();
        let token = caller.and_then(|caller| caller.token);
        let number = (client.as_ref()).map_or(0, |client| client.called(token));
        let call = Call::find(request.uri().path());
        let (is_stream, cost) = call.map_or((false, 1), |call| (call.streams, call.charge));
        let charges_bytes = call.is_none_or(|call| !call.streams || call.charges_each);
        let mut place = Place {
            limits: Arc::clone(&self.limits),
            key,
            client,
            number,
            is_stream,
            charges_bytes,
            unread: None,
            admitted: None,
        };
        if let Some(admitted) = self.limits.admit_now(key, is_stream, cost) {
            place.admit(admitted, &mut request);
            let answering = services.call(request);
            return Box::pin(async move { Ok(place.keep(answering.await?)) });
        }
        let Some(waiting) = self.limits.place_to_wait(key) else {
            let status = too_many_waiting(place.client.as_ref());
            return Box::pin(async move { Ok(status.into_http()) });
        };
        let (limits, mut services) = (Arc::clone(&self.limits), take_ready(services));
        Box::pin(async move {
            match limits.admit(key, is_stream, cost).await {
                Ok(admitted) => {
                    drop(waiting);
                    place.admit(admitted, &mut request);
                    Ok(place.keep(services.call(request).await?))
                }
                Err(refused) => {
                    limits.delay_refusal().await;
                    Ok(Status::from(Refusal::from(refused)).into_http())
                }
            }
        })
    }
}

/// What a call has until its answer has been read.
struct Place {
    limits: Arc<CallLimits>,
    key: Key,
    client: Option<Arc<Client>>,
    /// The number of the call on its connection.
    number: u64,
    is_stream: bool,
    /// Whether large parts of the answer are charged.
    charges_bytes: bool,
    /// What the client has not read of a stream.
    unread: Option<Arc<Unread>>,
    admitted: Option<Admitted>,
}

impl Place {
    /// Takes the places of a call, and shows the call the one that it may give back.
    fn admit<B>(&mut self, admitted: Admitted, request: &mut Request<B>) {
        if let Some(executing) = admitted.executing() {
            request.extensions_mut().insert(executing.clone());
        }
        self.admitted = Some(admitted);
        let client = self.client.as_ref().filter(|_| self.is_stream);
        self.unread = client.map(|client| client.stream_begins(self.number, self.key));
    }

    /// Keeps the place until the answer has been read.
    fn keep(self, mut response: Response<Body>) -> Response<Body> {
        if let Some(admitted) = &self.admitted {
            admitted.executed();
        }
        let status: Option<&Status> = response.extensions().get();
        if status.is_some_and(|status| is_elsewhere(status).is_some()) {
            response.extensions_mut().insert(Charged(self.key));
        }
        response.map(|body| {
            // A refusal has no body to be read.
            if body.is_end_stream() {
                return body;
            }
            if let Some(client) = self.client.as_ref().filter(|_| !self.is_stream) {
                client.answer_ready(self.number);
            }
            let place = Arc::new(self);
            let rest = Bytes::new();
            Body::new(KeptBody { body, rest, place })
        })
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        match &self.client {
            Some(client) if self.is_stream => client.stream_gone(self.number),
            Some(client) => client.answer_gone(self.number),
            None => {}
        }
    }
}

/// The answer to a request that is no call, such as one for a file of the page. It has a place in the
/// share of its caller until it has been read; `None` if none is left.
pub(crate) async fn within_share(
    limits: &Arc<CallLimits>,
    extensions: &http::Extensions,
    answer: Response<Body>,
) -> Option<Response<Body>> {
    let key = charged(extensions);
    let admitted = limits.admit_answer(key).await?;
    let client = own_client(extensions).cloned();
    let place = Place {
        limits: Arc::clone(limits),
        key,
        number: client.as_ref().map_or(0, |client| client.called(None)),
        client,
        is_stream: false,
        // What everybody may load costs little to send.
        charges_bytes: false,
        unread: None,
        admitted: Some(admitted),
    };
    Some(place.keep(answer))
}

/// Most bytes of an answer that the transport takes at a time: what it sends of fewer shows that the
/// client reads.
const PIECE: usize = 16 * 1024;

/// A piece of an answer, with the place of its call: the transport keeps it until it is sent.
struct KeptData {
    data: Bytes,
    place: Arc<Place>,
}

impl KeptData {
    fn bytes(data: Bytes, place: Arc<Place>) -> Bytes {
        if let Some(unread) = &place.unread {
            unread.waits(data.len());
        }
        Bytes::from_owner(Self { data, place })
    }
}

impl AsRef<[u8]> for KeptData {
    fn as_ref(&self) -> &[u8] {
        &self.data
    }
}

impl Drop for KeptData {
    fn drop(&mut self) {
        let Place { unread, client, .. } = &*self.place;
        match (unread, client) {
            (Some(unread), _) => unread.sent(self.data.len()),
            (None, Some(client)) => client.answer_moves(self.place.number),
            (None, None) => {}
        }
    }
}

/// An answer, with the place of its call. Large answers are charged.
struct KeptBody {
    body: Body,
    /// What the transport has not taken yet of what the body had last.
    rest: Bytes,
    place: Arc<Place>,
}

impl HttpBody for KeptBody {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        if self.rest.is_empty() {
            let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
            let data = match frame.map(|frame| frame.map(Frame::into_data)) {
                Some(Ok(Ok(data))) => data,
                Some(Ok(Err(trailers))) => return Poll::Ready(Some(Ok(trailers))),
                Some(Err(status)) => return Poll::Ready(Some(Err(status))),
                None => return Poll::Ready(None),
            };
            let cost = data.len() as u64 / BYTES_PER_CALL;
            if self.place.charges_bytes && cost > 0 {
                self.place.limits.charge(self.place.key, cost);
            }
            self.rest = data;
        }
        let length = self.rest.len().min(PIECE);
        let piece = self.rest.split_to(length);
        let piece = KeptData::bytes(piece, Arc::clone(&self.place));
        Poll::Ready(Some(Ok(Frame::data(piece))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_empty() && self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        let (rest, hint) = (self.rest.len() as u64, self.body.size_hint());
        let mut size = SizeHint::new();
        size.set_lower(hint.lower() + rest);
        if let Some(upper) = hint.upper() {
            size.set_upper(upper + rest);
        }
        size
    }
}

/// A caller that has as many calls as may be executed at a time.
#[cfg(test)]
pub(super) struct FullShare {
    limits: CallLimits,
    _others: Vec<Admitted>,
}

#[cfg(test)]
impl FullShare {
    /// With this call among them.
    pub(super) fn with<T>(request: &mut tonic::Request<T>) -> Self {
        let limits = CallLimits::new(chefshat_admission::limits::Shares::default());
        let admitted = limits.admit_now(Key::Local, false, 1).expect("the first");
        let executing = admitted.executing().expect("its place").clone();
        request.extensions_mut().insert(executing);
        let others = std::iter::from_fn(|| limits.admit_now(Key::Local, false, 1));
        let others = std::iter::once(admitted).chain(others).collect();
        Self {
            limits,
            _others: others,
        }
    }

    /// Whether another one may be executed.
    pub(super) fn has_place(&self) -> bool {
        self.limits.admit_now(Key::Local, false, 1).is_some()
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use futures::FutureExt as _;
    use tower::{Layer as _, service_fn};

    use super::*;
    use chefshat_admission::limits::{Shares, calls::MAX_ANSWERS};

    /// More calls than may be executed at a time.
    const MANY: usize = 100;

    /// Answers at once, except a path that waits forever: with or without its place.
    async fn served(request: Request<Body>) -> Result<Response<Body>, Infallible> {
        match request.uri().path() {
            "/at_once" => return Ok(Response::new(Body::empty())),
            "/waits_without" => {
                let executing: Option<&Executing> = request.extensions().get();
                executing.expect("a call that is executed").give_back();
            }
            _ => {}
        }
        std::future::pending().await
    }

    /// Whether a call is answered at once after many to a path have begun.
    fn answers_beside(path: &str) -> bool {
        let limits = Arc::new(CallLimits::new(Shares::default()));
        let mut services = LimitsLayer::new(limits).layer(service_fn(served));
        let mut call = |path: &str| {
            let request = Request::builder().uri(path).body(Body::empty());
            services.call(request.expect("a request"))
        };
        let mut waiting: Vec<_> = (0..MANY).map(|_| call(path)).collect();
        for call in &mut waiting {
            assert!(call.now_or_never().is_none(), "{path} waits");
        }
        call("/at_once").now_or_never().is_some()
    }

    #[tokio::test]
    async fn the_place_of_an_answer_is_free_when_its_last_byte_has_been_sent() {
        let limits = Arc::new(CallLimits::new(Shares::default()));
        let answer = |_: Request<Body>| async {
            let body = axum::body::Body::from("an answer");
            Ok::<_, Infallible>(Response::new(Body::new(body)))
        };
        let mut services = LimitsLayer::new(limits).layer(service_fn(answer));
        // The transport takes an answer and lets go of its body, whether or not the client reads.
        let mut take = || {
            let request = Request::builder().uri("/").body(Body::empty());
            let call = services.call(request.expect("a request"));
            let mut body = call.now_or_never()?.expect("infallible").into_body();
            let frame = http_body_util::BodyExt::frame(&mut body).now_or_never();
            let frame = frame.flatten().expect("a frame").expect("no error");
            Some(frame.into_data().expect("data"))
        };
        let mut unread: Vec<Bytes> = std::iter::from_fn(&mut take).take(MAX_ANSWERS).collect();
        assert_eq!(unread.len(), MAX_ANSWERS / 2, "the share of a caller");
        assert!(take().is_none());
        unread.pop();
        assert_eq!(take().as_deref(), Some(&b"an answer"[..]));
    }

    #[tokio::test]
    async fn a_large_answer_is_taken_in_pieces_that_are_all_of_it() {
        let limits = Arc::new(CallLimits::new(Shares::default()));
        let text: Bytes = (0..=u8::MAX).cycle().take(5 * PIECE / 2).collect();
        let whole = text.clone();
        let services = LimitsLayer::new(limits).layer(service_fn(move |_: Request<Body>| {
            let body = axum::body::Body::from(text.clone());
            std::future::ready(Ok::<_, Infallible>(Response::new(Body::new(body))))
        }));
        let request = Request::builder().uri("/").body(Body::empty());
        let answer = tower::ServiceExt::oneshot(services, request.expect("a request"));
        let mut body = answer.await.expect("infallible").into_body();
        let (mut read, mut pieces) = (Vec::new(), 0);
        while let Some(frame) = http_body_util::BodyExt::frame(&mut body).await {
            let left = (whole.len() - read.len()) as u64;
            let data = frame.expect("no error").into_data().expect("data");
            read.extend(&data);
            pieces += 1;
            assert_eq!(body.size_hint().exact(), Some(left - data.len() as u64));
            assert_eq!(body.is_end_stream(), read.len() == whole.len());
        }
        assert_eq!((read, pieces), (whole.to_vec(), 3));
    }

    #[tokio::test]
    async fn calls_that_only_wait_hold_up_no_others() {
        assert!(answers_beside("/waits_without"));
        assert!(!answers_beside("/waits_with"));
    }
}
