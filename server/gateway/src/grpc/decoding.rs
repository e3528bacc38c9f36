//! The layer directly in front of the services that costs each message before it is decoded: what
//! is longer than its call needs is refused before it is read, and what has too many elements, or
//! would take too much memory, before it is decoded. `access/calls.rs` has the limits of each call
//! and `limits/decoding.rs` the memory of all; `chefshat_proto::cost` counts.

use std::collections::HashMap;
use std::pin::Pin;
use std::sync::{Arc, LazyLock};
use std::task::{Context, Poll, ready};

use axum::body::HttpBody;
use bytes::{Buf as _, Bytes, BytesMut};
use chefshat_proto::codec::beside_tasks;
use chefshat_proto::cost::{Cost, Excess, Field, Kind, Shape, shapes};
use futures::future::{BoxFuture, Either};
use http::{Request, Response};
use http_body::Frame;
use tokio::time::{Instant, Sleep, sleep_until};
use tonic::body::Body;
use tonic::{Code, Status};
use tower::Service;

use super::limits::charged;
use super::status::{Refusal, is_elsewhere, status};
use crate::front::{Front, InFront};
use chefshat_admission::access::{Call, MessageLimits};
use chefshat_admission::limits::{
    CallLimits, DECODED_BYTES_PER_CALL, Decoding, Key, MAX_FREE_DECODED, MESSAGE_TIMEOUT, Permit,
    Refused, SMALL_DECODED, SMALL_MESSAGE,
};
use chefshat_base::lock::Lock;
use chefshat_wire::encoded::peer;

/// Bytes before each message: a flag and its length.
const PREFIX: usize = 5;

/// A message without lists: the requests of health checks and reflection.
static FLAT: Shape = Shape {
    name: "",
    size: 512,
    fields: &[],
};

/// The messages between nodes. The rest of the protocol has its shapes in `chefshat_proto`.
static PEER_PLAY: Shape = Shape {
    name: "chefshat.peer.v1.PlayRequest",
    size: size_of::<peer::PlayRequest>(),
    fields: &[Field {
        number: 1,
        list: true,
        kind: Kind::Message(&PEER_INPUT),
    }],
};
static PEER_INPUT: Shape = Shape {
    name: "chefshat.peer.v1.PlayInput",
    size: size_of::<peer::PlayInput>(),
    fields: &[
        Field {
            number: 1,
            list: false,
            kind: Kind::Message(&shapes::SEAT_COMMAND),
        },
        Field {
            number: 2,
            list: false,
            kind: Kind::Message(&FLAT),
        },
    ],
};
/// The fields of a message with one text and nothing else that costs.
const ONE_TEXT: &[Field] = &[Field {
    number: 1,
    list: false,
    kind: Kind::Text,
}];
static PEER_SHARE: Shape = Shape {
    name: "chefshat.peer.v1.ShareRequest",
    size: size_of::<peer::ShareRequest>(),
    fields: ONE_TEXT,
};

static PEER_REACH: Shape = Shape {
    name: "chefshat.peer.v1.ReachRequest",
    size: size_of::<peer::ReachRequest>(),
    fields: ONE_TEXT,
};

/// The shape of the requests of a call.
fn shape(path: &str) -> &'static Shape {
    static BY_PATH: LazyLock<HashMap<&str, &Shape>> = LazyLock::new(|| {
        let methods = shapes::METHODS.iter();
        let methods = methods.map(|method| (method.path, method.request));
        let of_nodes = [
            ("/chefshat.peer.v1.PeerService/Play", &PEER_PLAY),
            ("/chefshat.peer.v1.PeerService/Share", &PEER_SHARE),
            ("/chefshat.peer.v1.PeerService/Reach", &PEER_REACH),
        ];
        methods.chain(of_nodes).collect()
    });
    BY_PATH.get(path).copied().unwrap_or(&FLAT)
}

/// Puts the costs of messages in front of the services.
#[derive(Debug, Clone)]
pub struct DecodingLayer {
    limits: Arc<CallLimits>,
}

impl DecodingLayer {
    /// Creates a layer that takes memory from `limits`.
    pub fn new(limits: Arc<CallLimits>) -> InFront<Self> {
        InFront(Self { limits })
    }
}

/// The permit of the message that a call decodes or executes.
type HeldPermit = Arc<Lock<Option<Permit>>>;

impl<S> Front<S, Body> for DecodingLayer
where
    S: Service<Request<Body>, Response = Response<Body>>,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Answering = Either<S::Future, BoxFuture<'static, Result<Response<Body>, S::Error>>>;

    fn answer(&self, services: &mut S, request: Request<Body>) -> Self::Answering {
        let Some(call) = Call::find(request.uri().path()) else {
            return Either::Left(services.call(request));
        };
        let permit = HeldPermit::default();
        let messages = Messages {
            limits: Arc::clone(&self.limits),
            key: charged(request.extensions()),
            call,
            shape: shape(call.path),
            permit: Arc::clone(&permit),
            input: Bytes::new(),
            partial: BytesMut::new(),
            state: State::Next,
            begun: 0,
            until: None,
        };
        let answering = services.call(request.map(|body| Body::new(Costed { body, messages })));
        if call.sends_many {
            return Either::Left(answering);
        }
        Either::Right(Box::pin(async move {
            let mut response = answering.await?;
            let held = take(&permit);
            // The message is kept until the node that has what it is about has answered.
            let status: Option<&Status> = response.extensions().get();
            if let Some(held) = held
                && status.is_some_and(|status| is_elsewhere(status).is_some())
            {
                response.extensions_mut().insert(Arc::new(held));
            }
            Ok(response)
        }))
    }
}

/// The memory from which messages of players take, or those of all others.
fn memory_of(limits: &CallLimits, plays: bool) -> &Decoding {
    match plays {
        true => limits.playing(),
        false => limits.decoding(),
    }
}

fn take(permit: &HeldPermit) -> Option<Permit> {
    permit.lock().take()
}

/// The body of a request, whose messages are costed one by one. Each leaves it whole.
struct Costed {
    body: Body,
    messages: Messages,
}

struct Messages {
    limits: Arc<CallLimits>,
    key: Key,
    call: &'static Call,
    shape: &'static Shape,
    /// Of the last message.
    permit: HeldPermit,
    /// What was read and not yet looked at.
    input: Bytes,
    /// The beginning of the next message, if not all of it was read at once.
    partial: BytesMut,
    state: State,
    /// How many messages have begun.
    begun: u64,
    /// When what the client has begun must have arrived: the next message of a stream, or all of
    /// another call. It begins when something does not arrive at once.
    until: Option<Pin<Box<Sleep>>>,
}

/// Where a body is.
enum State {
    /// Before the next message.
    Next,
    /// A long message waits until it may be read.
    MayReceive(usize, BoxFuture<'static, Result<Permit, Refused>>),
    /// A message of this many bytes with its prefix is read. One that is not small has a permit.
    Receiving(usize, Option<Permit>),
    /// A message waits until it may be decoded.
    MayDecode {
        message: Bytes,
        permit: BoxFuture<'static, Result<Permit, Refused>>,
        _received: Option<Permit>,
    },
    /// Nothing more is read.
    Refused,
}

/// What a body does next.
enum Step {
    /// It passes this on.
    Pass(Bytes),
    /// It reads more.
    Read,
}

impl Messages {
    fn poll(&mut self, context: &mut Context<'_>) -> Poll<Result<Step, Status>> {
        loop {
            match &mut self.state {
                State::Refused => return Poll::Ready(Ok(Step::Read)),
                State::Next => {
                    if !self.has(PREFIX) {
                        return Poll::Ready(Ok(Step::Read));
                    }
                    let length = self.length()?;
                    self.state = match length <= SMALL_MESSAGE {
                        true => State::Receiving(PREFIX + length, None),
                        false => {
                            let permit = self.memory().receive(self.key, length);
                            State::MayReceive(PREFIX + length, Box::pin(permit))
                        }
                    };
                }
                State::MayReceive(length, permit) => {
                    let permit = ready!(permit.as_mut().poll(context));
                    let permit = permit.map_err(|refused| Status::from(Refusal::from(refused)))?;
                    let length = *length;
                    if self.input.len() < length {
                        self.partial.reserve(length);
                    }
                    self.state = State::Receiving(length, Some(permit));
                }
                State::Receiving(length, _) => {
                    let length = *length;
                    if !self.has(length) {
                        return Poll::Ready(Ok(Step::Read));
                    }
                    let State::Receiving(_, received) =
                        std::mem::replace(&mut self.state, State::Next)
                    else {
                        continue;
                    };
                    let message = self.take(length);
                    if self.call.sends_many {
                        self.until = None;
                    }
                    let cost = || self.cost(&message[PREFIX..]);
                    let memory = beside_tasks(message.len(), cost)?;
                    if memory <= SMALL_DECODED && !self.call.charges_each {
                        self.limits.charge(self.key, self.charge(memory));
                        return Poll::Ready(Ok(Step::Pass(message)));
                    }
                    self.state = State::MayDecode {
                        message,
                        permit: self.decode(memory),
                        _received: received,
                    };
                }
                State::MayDecode {
                    message, permit, ..
                } => {
                    let held = ready!(permit.as_mut().poll(context));
                    let held = held.map_err(|refused| Status::from(Refusal::from(refused)))?;
                    let message = std::mem::take(message);
                    *self.permit.lock() = Some(held);
                    self.state = State::Next;
                    return Poll::Ready(Ok(Step::Pass(message)));
                }
            }
        }
    }

    /// The memory from which its messages take.
    fn memory(&self) -> &Decoding {
        memory_of(&self.limits, self.call.plays())
    }

    /// Nothing has arrived now: ready when what the client has begun is too slow. A stream may be
    /// silent between its messages; another call is one message and its end.
    fn is_late(&mut self, context: &mut Context<'_>) -> Poll<Status> {
        let is_between = matches!(self.state, State::Next) && self.partial.is_empty();
        if self.call.sends_many && is_between {
            self.until = None;
            return Poll::Pending;
        }
        let until = (self.until)
            .get_or_insert_with(|| Box::pin(sleep_until(Instant::now() + MESSAGE_TIMEOUT)));
        until.as_mut().poll(context).map(|()| too_slow())
    }

    /// Refuses to read more.
    fn refuse(&mut self) {
        self.state = State::Refused;
        (self.input, self.partial) = Default::default();
    }

    /// Whether the first `length` bytes of the next message were read. Moves what there is of a
    /// message in parts.
    fn has(&mut self, length: usize) -> bool {
        if self.partial.is_empty() && self.input.len() >= length {
            return true;
        }
        let missing = length.saturating_sub(self.partial.len());
        let part = self.input.split_to(missing.min(self.input.len()));
        self.partial.extend_from_slice(&part);
        self.partial.len() >= length
    }

    /// The first `length` bytes, which were read.
    fn take(&mut self, length: usize) -> Bytes {
        match self.partial.is_empty() {
            true => self.input.split_to(length),
            false => self.partial.split_to(length).freeze(),
        }
    }

    /// The length of the next message, whose prefix was read.
    fn length(&mut self) -> Result<usize, Status> {
        let mut prefix = match self.partial.is_empty() {
            true => &self.input[..PREFIX],
            false => &self.partial[..PREFIX],
        };
        self.begun += 1;
        if self.begun > 1 && !self.call.sends_many {
            return Err(malformed("this call takes one message"));
        }
        if prefix.get_u8() != 0 {
            return Err(Status::unimplemented(
                "this server reads no compressed messages",
            ));
        }
        let length = usize::try_from(prefix.get_u32()).unwrap_or(usize::MAX);
        let most = self.call.message.bytes;
        match length > most {
            true => Err(too_long(most, length)),
            false => Ok(length),
        }
    }

    /// A permit to decode a message into this many bytes. Its caller is charged; a message of a stream
    /// that is large or counts as a call waits first until the caller may make another call.
    fn decode(&self, memory: usize) -> BoxFuture<'static, Result<Permit, Refused>> {
        let (limits, key) = (Arc::clone(&self.limits), self.key);
        let (calls, plays) = (self.charge(memory), self.call.plays());
        let waits = self.call.charges_each || self.call.sends_many && self.is_large(memory);
        Box::pin(async move {
            if waits {
                limits.may_call(key).await;
            }
            limits.charge(key, calls);
            let permit = memory_of(&limits, plays).decode(key, memory);
            permit.await
        })
    }

    /// How many calls a message counts as that is decoded into this many bytes.
    fn charge(&self, memory: usize) -> u64 {
        let decoding = match self.begun == 1 || self.is_large(memory) {
            true => memory as u64 / DECODED_BYTES_PER_CALL,
            false => 0,
        };
        decoding + u64::from(self.call.charges_each)
    }

    /// Whether a message that is decoded into this many bytes counts wherever in a stream it is.
    fn is_large(&self, memory: usize) -> bool {
        memory > MAX_FREE_DECODED && !self.call.has_own_rate
    }

    /// Counts the memory of a message.
    fn cost(&self, message: &[u8]) -> Result<usize, Status> {
        let MessageLimits {
            elements, memory, ..
        } = self.call.message;
        let cost = (self.shape.cost(message, Cost { elements, memory }))
            .map_err(|excess| refused(excess, &self.call.message))?;
        Ok(cost.memory)
    }
}

impl HttpBody for Costed {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        let Self { body, messages } = &mut *self;
        if messages.call.sends_many {
            // The service asks for the next message when it has executed the last one.
            take(&messages.permit);
        }
        loop {
            match ready!(messages.poll(context)) {
                Ok(Step::Pass(message)) => return Poll::Ready(Some(Ok(Frame::data(message)))),
                Ok(Step::Read) => {}
                Err(status) => {
                    messages.refuse();
                    return Poll::Ready(Some(Err(status)));
                }
            }
            if matches!(messages.state, State::Refused) {
                return Poll::Ready(None);
            }
            let Poll::Ready(frame) = Pin::new(&mut *body).poll_frame(context)? else {
                let late = ready!(messages.is_late(context));
                messages.refuse();
                return Poll::Ready(Some(Err(late)));
            };
            let Some(frame) = frame else {
                // The rest is not a message: the decoder refuses it.
                let rest = std::mem::take(&mut messages.partial);
                return Poll::Ready(match rest.is_empty() {
                    true => None,
                    false => Some(Ok(Frame::data(rest.freeze()))),
                });
            };
            match frame.into_data() {
                Ok(data) => messages.input = data,
                Err(trailers) => return Poll::Ready(Some(Ok(trailers))),
            }
        }
    }

    fn is_end_stream(&self) -> bool {
        let Messages { input, partial, .. } = &self.messages;
        input.is_empty() && partial.is_empty() && self.body.is_end_stream()
    }
}

fn too_long(most: usize, length: usize) -> Status {
    status(
        Code::OutOfRange,
        "MESSAGE_TOO_LARGE",
        format!("a message of this call has at most {most} bytes; this one has {length}"),
        [("max_bytes", &most.to_string())],
    )
}

fn refused(excess: Excess, most: &MessageLimits) -> Status {
    match excess {
        Excess::Elements => status(
            Code::OutOfRange,
            "TOO_MANY_ELEMENTS",
            format!(
                "a message of this call has at most {} submessages, texts in lists and entries of maps; send fewer at a time",
                most.elements
            ),
            [("max_elements", &most.elements.to_string())],
        ),
        Excess::Memory => status(
            Code::OutOfRange,
            "MESSAGE_TOO_LARGE",
            format!(
                "a message of this call takes at most {} bytes once it is decoded; send fewer items at a time",
                most.memory
            ),
            [("max_decoded_bytes", &most.memory.to_string())],
        ),
        Excess::Depth => malformed("messages are nested too deeply"),
        Excess::Malformed => malformed("the message cannot be read: it is not encoded as its type"),
    }
}

fn malformed(problem: &str) -> Status {
    status(Code::InvalidArgument, "MESSAGE_MALFORMED", problem, [])
}

fn too_slow() -> Status {
    let seconds = MESSAGE_TIMEOUT.as_secs();
    status(
        Code::DeadlineExceeded,
        "MESSAGE_TOO_SLOW",
        format!("a message did not arrive within {seconds} s"),
        [],
    )
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::convert::Infallible;
    use std::time::Duration;

    use chefshat_proto::cost::{Filling, Method};
    use chefshat_proto::v1;
    use futures::{FutureExt as _, StreamExt as _, stream};
    use http_body_util::{BodyExt as _, Full, StreamBody};
    use prost::Message as _;
    use tonic_types::StatusExt as _;
    use tower::{Layer as _, service_fn};

    use super::*;
    use chefshat_admission::access::CALLS;
    use chefshat_admission::limits::Shares;
    use chefshat_admission::limits::calls::{CALLS_AT_ONCE, CALLS_PER_SECOND};

    const PLAY: &str = "/chefshat.v1.PlayService/Play";
    const CREATE_STUDY: &str = "/chefshat.v1.StudyService/CreateStudy";
    /// Longest message that is decoded here, bytes.
    const READ: usize = 16 * 1024;

    /// The fields of messages between nodes that are lists, texts or messages.
    fn of_nodes() -> BTreeMap<String, Vec<(u32, bool, bool)>> {
        let bytes: &[u8] = include_bytes!("../../../wire/generated/peer.bin");
        let set = prost_types::FileDescriptorSet::decode(bytes).expect("descriptors");
        let file = (set.file.iter()).find(|file| file.package() == "chefshat.peer.v1");
        let messages = &file.expect("the file").message_type;
        let fields = |message: &prost_types::DescriptorProto| {
            let fields = message.field.iter().map(|field| {
                use prost_types::field_descriptor_proto::{Label, Type};
                let is_message = field.r#type() == Type::Message;
                let is_text = matches!(field.r#type(), Type::String | Type::Bytes);
                let list = field.label() == Label::Repeated;
                let number = u32::try_from(field.number()).expect("positive");
                (number, list, is_message, is_text)
            });
            let costly = fields.filter(|(_, list, message, text)| *list || *message || *text);
            costly
                .map(|(number, list, message, _)| (number, list, message))
                .collect()
        };
        (messages
            .iter()
            .map(|message| (message.name().to_owned(), fields(message))))
        .collect()
    }

    #[test]
    fn every_call_has_the_shape_of_its_requests() {
        for call in CALLS {
            match call.path.starts_with("/chefshat.") {
                true => assert!(Method::find(call.path).is_some(), "{}", call.path),
                false => assert!(std::ptr::eq(shape(call.path), &raw const FLAT)),
            }
        }
        let of_nodes = of_nodes();
        for shape in [&PEER_PLAY, &PEER_INPUT, &PEER_SHARE, &PEER_REACH] {
            let name = shape.name.trim_start_matches("chefshat.peer.v1.");
            let fields = (shape.fields.iter()).map(|field| {
                (
                    field.number,
                    field.list,
                    matches!(field.kind, Kind::Message(_)),
                )
            });
            assert_eq!(of_nodes[name], fields.collect::<Vec<_>>(), "{name}");
        }
        assert_eq!(of_nodes["HandedOver"], [], "flat");
        // Those of health checks and reflection have no lists.
        for bytes in [
            tonic_health::pb::FILE_DESCRIPTOR_SET,
            tonic_reflection::pb::v1::FILE_DESCRIPTOR_SET,
        ] {
            let set = prost_types::FileDescriptorSet::decode(bytes).expect("descriptors");
            let file = set.file.first().expect("a file");
            let requests = file
                .message_type
                .iter()
                .filter(|it| it.name().ends_with("Request"));
            for field in requests.flat_map(|message| &message.field) {
                use prost_types::field_descriptor_proto::Label;
                assert_ne!(field.label(), Label::Repeated, "{}", field.name());
            }
        }
    }

    #[test]
    fn the_worst_message_of_each_call_takes_no_more_than_its_permit() {
        let remote = Key::Address([192, 0, 2, 1].into());
        let share = Shares::default().of(remote, chefshat_admission::limits::MAX_DECODED);
        let (mut refusals, mut most_taken) = (BTreeMap::new(), 0);
        for call in Call::all() {
            let limits = &call.message;
            assert!(
                limits.memory <= share,
                "{}: more than one caller may have",
                call.path
            );
            let (shape, most) = (
                shape(call.path),
                Cost {
                    elements: limits.elements,
                    memory: limits.memory,
                },
            );
            for filling in Filling::all(shape) {
                let message = filling.longest(limits.bytes);
                match shape.cost(&message, most) {
                    Ok(cost) => most_taken = most_taken.max(cost.memory),
                    Err(excess) => {
                        let status = refused(excess, limits);
                        let info = status.get_details_error_info().expect("a reason");
                        let named = info.metadata.values().any(|most| {
                            [limits.elements, limits.memory]
                                .iter()
                                .any(|it| *most == it.to_string())
                        });
                        assert!(named, "{} {}: {status}", call.path, filling.name);
                        *refusals.entry(info.reason).or_insert(0) += 1;
                        // What is just allowed is readable.
                        let message = filling.largest(shape, limits.bytes.min(READ), most);
                        if let Some(method) = Method::find(call.path) {
                            (method.decode)(&message).expect("readable");
                        }
                    }
                }
            }
        }
        assert!(
            refusals["TOO_MANY_ELEMENTS"] > 10 && refusals["MESSAGE_TOO_LARGE"] > 10,
            "{refusals:?}"
        );
        assert!(most_taken > 1024 * 1024);
    }

    fn limits() -> Arc<CallLimits> {
        Arc::new(CallLimits::new(Shares::default()))
    }

    fn framed(message: &[u8]) -> Vec<u8> {
        let length = u32::try_from(message.len()).expect("short").to_be_bytes();
        [&[0], length.as_slice(), message].concat()
    }

    /// 700 commands in one message.
    fn commands() -> Vec<u8> {
        let play = v1::PlayRequest {
            commands: vec![v1::SeatCommand::default(); 700],
        };
        framed(&play.encode_to_vec())
    }

    fn request(path: &str, body: Body) -> Request<Body> {
        Request::post(path).body(body).expect("a request")
    }

    /// A call whose messages have all arrived.
    fn whole(path: &str, messages: Vec<u8>) -> Request<Body> {
        request(path, Body::new(Full::new(Bytes::from(messages))))
    }

    /// What a service receives of a body in these parts.
    async fn received(path: &str, parts: Vec<Vec<u8>>) -> Result<Vec<u8>, Status> {
        let (sender, receiver) = tokio::sync::oneshot::channel();
        let mut sender = Some(sender);
        let service = service_fn(move |request: Request<Body>| {
            let sender = sender.take().expect("one call");
            async move {
                let read = request.into_body().collect().await;
                let _ = sender.send(read.map(|body| body.to_bytes().to_vec()));
                Ok::<_, Infallible>(Response::new(Body::empty()))
            }
        });
        let parts = stream::iter(parts).map(|part| Ok::<_, Status>(Frame::data(part.into())));
        let body = Body::new(StreamBody::new(parts));
        let limits = limits();
        let mut services = DecodingLayer::new(Arc::clone(&limits)).layer(service);
        let answer = services.call(request(path, body)).await;
        answer.expect("infallible");
        assert_eq!(limits.decoding().taken() + limits.playing().taken(), 0);
        receiver.await.expect("read")
    }

    #[tokio::test]
    async fn messages_pass_unchanged_however_they_are_cut() {
        let bytes = [commands(), framed(&[])].concat().repeat(2);
        for size in [1, 3, 7, 1_000, 100_000] {
            let parts = bytes.chunks(size).map(<[u8]>::to_vec).collect();
            let read = received(PLAY, parts).await;
            assert_eq!(read.expect("legal"), bytes, "in parts of {size} bytes");
        }
        // A message that breaks off reaches the decoder, which refuses it.
        let read = received(PLAY, vec![bytes[..9].to_vec()]).await;
        assert_eq!(read.expect("its beginning"), &bytes[..9]);
    }

    #[tokio::test]
    async fn what_costs_too_much_is_refused_by_the_name_of_its_limit() {
        let check = async |path: &str, bytes: Vec<u8>, reason: &str| {
            let status = received(path, vec![bytes]).await.expect_err(reason);
            let info = status.get_details_error_info().expect("a reason");
            assert_eq!(info.reason, reason, "{status}");
        };
        // Its first 5 bytes are enough.
        check(CREATE_STUDY, vec![0, 0, 0x20, 0, 0], "MESSAGE_TOO_LARGE").await;
        // A million bytes of empty factors.
        let factors = v1::StudySettings {
            factors: vec![v1::StudyFactor::default(); 500_000],
            ..v1::StudySettings::default()
        };
        let create = v1::CreateStudyRequest {
            settings: Some(factors),
            ..v1::CreateStudyRequest::default()
        };
        check(
            CREATE_STUDY,
            framed(&create.encode_to_vec()),
            "TOO_MANY_ELEMENTS",
        )
        .await;
        check(CREATE_STUDY, framed(&[0xff]), "MESSAGE_MALFORMED").await;
        let twice = framed(&[]).repeat(2);
        check(CREATE_STUDY, twice, "MESSAGE_MALFORMED").await;
    }

    /// A service that reads a request to its end.
    async fn read_whole(request: Request<Body>) -> Result<Response<Body>, Infallible> {
        Ok(match request.into_body().collect().await {
            Ok(_) => Response::new(Body::empty()),
            Err(status) => status.into_http(),
        })
    }

    /// Why a call was refused, if it was.
    fn reason_of(answer: &Response<Body>) -> Option<String> {
        let status = Status::from_header_map(answer.headers())?;
        Some(status.get_details_error_info()?.reason)
    }

    /// A body that sends these bytes and then nothing, and does not end.
    fn stalled(bytes: Vec<u8>) -> Body {
        let parts = stream::iter([Ok::<_, Status>(Frame::data(bytes.into()))]);
        Body::new(StreamBody::new(parts.chain(stream::pending())))
    }

    #[tokio::test(start_paused = true)]
    async fn a_message_waits_for_its_permit_before_it_is_read_and_ends_if_it_is_slow() {
        let limits = limits();
        let mut services = DecodingLayer::new(Arc::clone(&limits)).layer(service_fn(read_whole));
        let half = [&[0, 0, 8, 0, 0], [0; 1_000].as_slice()].concat();
        let path = "/chefshat.v1.ParticipationService/AnswerQuestionnaire";
        let mut calls = Vec::new();
        // Those of a local caller may have half of the memory: 16 of 1 MiB each.
        for _ in 0..20 {
            let mut call = Box::pin(services.call(request(path, stalled(half.clone()))));
            assert!((&mut call).now_or_never().is_none());
            calls.push(call);
        }
        assert_eq!(limits.decoding().taken(), 16 * 1024 * 1024);
        let begun = Instant::now();
        let mut reasons = BTreeMap::new();
        for answer in futures::future::join_all(calls).await {
            let answer = answer.expect("infallible");
            let reason = reason_of(&answer).expect("a reason");
            *reasons.entry(reason).or_insert(0) += 1;
        }
        let expected = [("MESSAGE_TOO_SLOW", 16), ("TOO_MANY_LARGE_MESSAGES", 4)];
        assert_eq!(
            reasons,
            expected.map(|(it, count)| (it.to_owned(), count)).into()
        );
        assert_eq!(begun.elapsed(), MESSAGE_TIMEOUT);
        assert_eq!(limits.decoding().taken(), 0);
    }

    #[tokio::test(start_paused = true)]
    async fn a_call_that_does_not_arrive_whole_ends_however_small_it_is() {
        let limits = limits();
        let mut services = DecodingLayer::new(limits).layer(service_fn(read_whole));
        let unary = "/chefshat.v1.RoomService/GetRoom";
        let whole = framed(&[]);
        for (path, sent) in [
            (unary, Vec::new()),
            (unary, vec![0, 0]),
            (unary, vec![0, 0, 0, 0, 9, 1]),
            // Its message has arrived, and its end has not.
            (unary, whole.clone()),
            (PLAY, vec![0, 0]),
            (PLAY, [whole.as_slice(), &[0, 0, 0, 0, 9, 1]].concat()),
        ] {
            let begun = Instant::now();
            let answer = services.call(request(path, stalled(sent.clone()))).await;
            let reason = reason_of(&answer.expect("infallible"));
            let expected = Some("MESSAGE_TOO_SLOW");
            assert_eq!(reason.as_deref(), expected, "{path} {sent:?}");
            assert_eq!(begun.elapsed(), MESSAGE_TIMEOUT, "{path} {sent:?}");
        }
        // A stream is silent as long as it likes between its messages.
        let silent = services.call(request(PLAY, stalled(whole)));
        let day = Duration::from_secs(24 * 60 * 60);
        tokio::time::timeout(day, silent).await.expect_err("silent");
    }

    #[tokio::test(start_paused = true)]
    async fn a_stream_that_always_has_half_a_message_left_is_not_slow() {
        let part = |_| async {
            tokio::time::sleep(MESSAGE_TIMEOUT / 2).await;
            // The second half of a message and the first half of the next.
            Ok::<_, Status>(Frame::data(Bytes::from_static(&[0, 2, 8, 1, 0, 0, 0])))
        };
        let first = stream::iter([Ok(Frame::data(Bytes::from_static(&[0, 0, 0])))]);
        let parts = first.chain(stream::iter(0..20).then(part));
        let service = service_fn(async |request: Request<Body>| {
            let read = request.into_body().collect().await;
            let read = read.expect("each message arrives in time");
            assert_eq!(read.to_bytes().len(), 20 * 7 + 3);
            Ok::<_, Infallible>(Response::new(Body::empty()))
        });
        let mut services = DecodingLayer::new(limits()).layer(service);
        let body = Body::new(StreamBody::new(parts));
        let answer = services.call(request(PLAY, body)).await;
        answer.expect("infallible");
    }

    #[tokio::test(start_paused = true)]
    async fn messages_of_players_do_not_wait_for_those_of_others() {
        let limits = limits();
        let mut taken = Vec::new();
        for host in 0..=u8::MAX {
            let key = Key::Address([192, 0, 2, host].into());
            let share = Shares::default().of(key, chefshat_admission::limits::MAX_DECODED);
            let permit = limits.decoding().decode(key, share).now_or_never();
            taken.extend(permit.and_then(Result::ok));
        }
        let mut services = DecodingLayer::new(limits).layer(service_fn(read_whole));
        let create = v1::CreateStudyRequest {
            settings: Some(v1::StudySettings {
                stages: vec![v1::StudyStage::default(); 100],
                ..v1::StudySettings::default()
            }),
            ..v1::CreateStudyRequest::default()
        };
        let create = framed(&create.encode_to_vec());
        for (path, message, reason) in [
            (CREATE_STUDY, create, Some("TOO_MANY_LARGE_MESSAGES")),
            (PLAY, commands(), None),
        ] {
            let answer = services.call(whole(path, message)).await;
            let found = reason_of(&answer.expect("infallible"));
            assert_eq!(found.as_deref(), reason, "{path}");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn the_messages_of_a_stream_cost_as_much_as_their_decoding() {
        let limits = limits();
        let mut services = DecodingLayer::new(Arc::clone(&limits)).layer(service_fn(read_whole));
        let setup = |starts| v1::RunRequest {
            request: Some(v1::run_request::Request::Setup(Box::new(v1::VectorSetup {
                start: Some(v1::vector_setup::Start::Listed(v1::ListedStarts {
                    starts: vec![v1::ListedStart::default(); starts],
                })),
                ..v1::VectorSetup::default()
            }))),
        };
        let large = framed(&setup(5_000).encode_to_vec());
        let small = framed(&setup(1_000).encode_to_vec());
        let run = "/chefshat.v1.VectorService/Run";
        let memory = |message: &[u8]| {
            let cost = shape(run).cost(&message[PREFIX..], Cost::MAX);
            cost.expect("legal").memory
        };
        assert!(memory(&small) < MAX_FREE_DECODED && memory(&large) > MAX_FREE_DECODED);
        let cost = |message: &[u8]| memory(message) as u64 / DECODED_BYTES_PER_CALL;
        let time = |calls| calls as f64 / CALLS_PER_SECOND as f64;
        let key = charged(&http::Extensions::new());
        let mut send = async |path: &str, messages: &[&[u8]]| {
            let begun = Instant::now();
            let answer = services.call(whole(path, messages.concat())).await;
            assert_eq!(reason_of(&answer.expect("infallible")), None, "{path}");
            begun.elapsed().as_secs_f64()
        };
        limits.charge(key, CALLS_AT_ONCE);
        // The first message of a stream costs; small ones after it do not.
        assert_eq!(send(run, &[&small, &small, &small]).await, 0.0);
        let wait = limits.wait(key).as_secs_f64();
        assert!((wait - time(cost(&small))).abs() < 0.001, "{wait}");
        // Each large one waits for what came before it.
        let waited = send(run, &[&large, &large, &small]).await;
        let expected = time(cost(&small) + cost(&large));
        assert!((waited - expected).abs() < 0.01, "{waited} {expected}");
        let wait = limits.wait(key).as_secs_f64();
        assert!((wait - time(cost(&large))).abs() < 0.01, "{wait}");
        // Streams of one caller wait for each other: together they take as long.
        let begun = Instant::now();
        let together = (0..3).map(|_| services.call(whole(run, large.repeat(2))));
        for answer in futures::future::join_all(together.collect::<Vec<_>>()).await {
            assert_eq!(reason_of(&answer.expect("infallible")), None);
        }
        let expected = time(6 * cost(&large));
        let waited = begun.elapsed().as_secs_f64();
        assert!((waited - expected).abs() < 0.01, "{waited} {expected}");

        // Imports have a rate of their own: only their first message counts.
        tokio::time::sleep(limits.wait(key)).await;
        let import = v1::ImportRecordRequest {
            lines: vec![v1::RecordLine::default(); 1_000],
        };
        let import = framed(&import.encode_to_vec());
        let path = "/chefshat.v1.RecordService/ImportRecord";
        let answer = services.call(whole(path, import.repeat(3))).await;
        assert_eq!(reason_of(&answer.expect("infallible")), None);
        let most = shape(path).cost(&import[PREFIX..], Cost::MAX);
        let expected = time(most.expect("legal").memory as u64 / DECODED_BYTES_PER_CALL);
        let wait = limits.wait(key).as_secs_f64();
        assert!((wait - expected).abs() < 0.01, "{wait} {expected}");

        // Each question about the protocol counts as a call, because its answer is larger.
        tokio::time::sleep(limits.wait(key)).await;
        let path = "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo";
        let begun = Instant::now();
        let answer = services.call(whole(path, framed(&[]).repeat(1_000))).await;
        assert_eq!(reason_of(&answer.expect("infallible")), None);
        let waited = begun.elapsed().as_secs_f64();
        assert!((waited - time(1_000)).abs() < 0.1, "{waited}");
    }

    #[tokio::test]
    async fn a_permit_is_held_until_a_call_has_answered_and_a_stream_asks_for_more() {
        let limits = limits();
        let (release, released) = tokio::sync::oneshot::channel::<()>();
        let mut released = Some(released);
        let service = service_fn(move |request: Request<Body>| {
            let released = released.take().expect("one call");
            async move {
                let mut body = request.into_body();
                body.frame().await.expect("a message").expect("legal");
                let _ = released.await;
                Ok::<_, Infallible>(Response::new(Body::empty()))
            }
        });
        let mut services = DecodingLayer::new(Arc::clone(&limits)).layer(service);
        let body = stalled(commands());
        let mut call = Box::pin(services.call(request(PLAY, body)));
        assert!((&mut call).now_or_never().is_none(), "it is executed");
        let size = size_of::<v1::SeatCommand>();
        assert!(limits.playing().taken() > 700 * size);
        release.send(()).expect("waiting");
        call.await.expect("infallible");
        assert_eq!(limits.playing().taken(), 0);
    }
}
