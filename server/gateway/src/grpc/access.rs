//! The layer in front of all services that asks `access` about each request: it refuses the
//! request, or puts the [`Caller`] into its extensions. A call or stream ends with the token that
//! authorised it.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use axum::body::HttpBody;
use bytes::Bytes;
use futures::future::{BoxFuture, Either};
use http::{HeaderMap, Request, Response, header};
use http_body::Frame;
use tokio_util::sync::{CancellationToken, WaitForCancellationFutureOwned};
use tonic::body::Body;
use tonic::{Code, Status};
use tower::Service;
use tracing::info;

use super::limits::refuse;
use super::status::{shutting_down, status};
use crate::connections::peer_address;
use crate::front::{Front, InFront, take_ready};
use chefshat_admission::access::{
    Access, Call, Caller, Ended, Granted, Refusal, SECRET_HEADER, Secrets, SecretsRefused,
};
use chefshat_admission::limits::{CallLimits, Key, LogPace, Permit};

/// Where the services of this project are.
const OWN_PACKAGE: &str = "/chefshat.";

/// Refused calls that are logged in a minute.
const LOGGED: u32 = 60;

/// Puts the decision about each request in front of the services.
#[derive(Debug, Clone)]
pub struct AccessLayer {
    access: Arc<Access>,
    limits: Arc<CallLimits>,
    logged: Arc<LogPace>,
}

impl AccessLayer {
    /// Creates a layer that asks `access`. Refusals count as calls in `limits`.
    pub fn new(access: Arc<Access>, limits: Arc<CallLimits>) -> InFront<Self> {
        InFront(Self {
            access,
            limits,
            logged: Arc::new(LogPace::new(LOGGED)),
        })
    }

    /// Decides about a request. Also returns whether its call is a stream.
    fn decide<B>(&self, request: &Request<B>) -> Result<(Granted, bool), Status> {
        let address = peer_address(request.extensions());
        let path = request.uri().path();
        let Some(call) = Call::find(path) else {
            if path.starts_with(OWN_PACKAGE) {
                return Err(Status::unimplemented("this server does not have this call"));
            }
            // No service: what follows says so.
            let caller = Caller {
                address,
                ..Caller::default()
            };
            let ended = None;
            return Ok((Granted { caller, ended }, false));
        };
        let checked = (self.access).check(call, authorization(request), address);
        let mut granted = checked.map_err(|refusal| {
            if self.logged.admits() {
                let address = address.map(tracing::field::display);
                info!(call = path, address, ?refusal, "a call was refused");
            }
            refused(refusal)
        })?;
        let secrets = request.headers().get_all(SECRET_HEADER).into_iter();
        granted.caller.secrets =
            Secrets::parse(secrets.map(|value| value.as_bytes())).map_err(secrets_refused)?;
        Ok((granted, call.streams))
    }

    /// Passes a request on or refuses it.
    fn pass<S>(
        &self,
        services: &mut S,
        mut request: Request<Body>,
    ) -> Answering<S::Future, S::Error>
    where
        S: Service<Request<Body>, Response = Response<Body>>,
        S::Future: Send + 'static,
        S::Error: Send + 'static,
    {
        let (granted, streams) = match self.decide(&request) {
            Ok(decided) => decided,
            Err(status) => {
                return Either::Right(refuse(&self.limits, request.extensions(), status));
            }
        };
        // They have served: nothing behind this layer needs them, or could log them.
        request.headers_mut().remove(header::AUTHORIZATION);
        request.headers_mut().remove(SECRET_HEADER);
        request.extensions_mut().insert(granted.caller);
        match granted.ended {
            None => Either::Left(services.call(request)),
            Some(ended) => {
                if streams {
                    // A client that does not read its answers keeps the answering side from ending.
                    request = request.map(|body| EndingBody::of(body, &ended, Side::Request));
                }
                let answering = services.call(request);
                Either::Right(Box::pin(until_ended(answering, ended)))
            }
        }
    }

    /// A place to wait in for a look at the tokens file, if this request has a token that may have
    /// just been created.
    fn place_to_look(&self, request: &Request<Body>) -> Option<Permit> {
        let authorization = authorization(request);
        if !self.access.may_be_new(authorization) {
            return None;
        }
        let address = peer_address(request.extensions());
        self.limits.place_to_wait(Key::of_address(address))
    }
}

/// The `authorization` header of a request.
fn authorization<B>(request: &Request<B>) -> Option<&[u8]> {
    let value = request.headers().get(header::AUTHORIZATION);
    value.map(|value| value.as_bytes())
}

/// An answer of the services, or something that takes longer or refuses.
type Answering<F, E> = Either<F, BoxFuture<'static, Result<Response<Body>, E>>>;

impl<S> Front<S, Body> for AccessLayer
where
    S: Service<Request<Body>, Response = Response<Body>> + Clone + Send + 'static,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Answering = Answering<S::Future, S::Error>;

    fn answer(&self, services: &mut S, request: Request<Body>) -> Self::Answering {
        let Some(waiting) = self.place_to_look(&request) else {
            return self.pass(services, request);
        };
        let (this, mut services) = (self.clone(), take_ready(services));
        Either::Right(Box::pin(async move {
            let value = authorization(&request).map(<[u8]>::to_vec);
            this.access.look_again(value.as_deref()).await;
            drop(waiting);
            this.pass(&mut services, request).await
        }))
    }
}

/// Answers a call, and ends it together with its token.
async fn until_ended<E>(
    answering: impl Future<Output = Result<Response<Body>, E>>,
    ended: Ended,
) -> Result<Response<Body>, E> {
    tokio::select! {
        () = ended.signal().cancelled() => Ok(refused(ended.refusal()).into_http()),
        response = answering => {
            Ok(response?.map(|body| EndingBody::of(body, &ended, Side::Response)))
        }
    }
}

/// An answer of a service that does not know when the server shuts down, ended then.
pub fn until_closing(answer: Response<Body>, closing: &CancellationToken) -> Response<Body> {
    answer.map(|body| EndingBody::with(body, closing, Side::Response, shutting_down))
}

/// A body that ends with a signal: that of its token, or that the server shuts down.
struct EndingBody<F> {
    /// `None` after the end.
    body: Option<Body>,
    side: Side,
    signal: CancellationToken,
    signalled: Pin<Box<WaitForCancellationFutureOwned>>,
    /// Why it has ended.
    why: F,
}

/// Which body of a call.
#[derive(Debug, Clone, Copy)]
enum Side {
    /// What the client sends. Ends with an error.
    Request,
    /// What the client receives. Ends with a status.
    Response,
}

impl EndingBody<fn() -> Status> {
    fn of(body: Body, ended: &Ended, side: Side) -> Body {
        let token = ended.clone();
        EndingBody::with(body, ended.signal(), side, move || refused(token.refusal()))
    }
}

impl<F: Fn() -> Status + Unpin + Send + 'static> EndingBody<F> {
    fn with(body: Body, signal: &CancellationToken, side: Side, why: F) -> Body {
        // The body of a finished call has nothing left to end.
        match body.is_end_stream() {
            true => body,
            false => Body::new(Self {
                body: Some(body),
                side,
                signal: signal.clone(),
                signalled: Box::pin(signal.clone().cancelled_owned()),
                why,
            }),
        }
    }
}

impl<F: Fn() -> Status + Unpin> HttpBody for EndingBody<F> {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        let this = &mut *self;
        let Some(body) = &mut this.body else {
            return Poll::Ready(None);
        };
        // Checked first: a body that always has something to send ends as well.
        if !this.signal.is_cancelled() {
            let frame = Pin::new(body).poll_frame(context);
            if frame.is_ready() {
                return frame;
            }
        }
        match this.signalled.as_mut().poll(context) {
            Poll::Pending => Poll::Pending,
            Poll::Ready(()) => {
                this.body = None;
                let status = (this.why)();
                Poll::Ready(Some(match this.side {
                    Side::Request => Err(status),
                    Side::Response => {
                        let mut trailers = HeaderMap::new();
                        let written = status.add_header(&mut trailers);
                        written.map(|()| Frame::trailers(trailers))
                    }
                }))
            }
        }
    }
}

/// The caller of a request, and its message.
pub(super) fn opened<M>(request: tonic::Request<M>) -> (Caller, M) {
    let caller = Caller::of(request.extensions());
    (caller, request.into_inner())
}

/// Checks that the scope of a caller includes something.
pub(super) fn check(caller: &Caller, reaches: impl FnOnce(&Caller) -> bool) -> Result<(), Status> {
    match caller.scope {
        Some(scope) if !reaches(caller) => Err(refused(Refusal::OutOfScope { scope })),
        _ => Ok(()),
    }
}

/// The status for secrets that cannot be read.
fn secrets_refused(refused: SecretsRefused) -> Status {
    let field = [("field", SECRET_HEADER)];
    status(
        Code::InvalidArgument,
        "SECRETS_REFUSED",
        refused.to_string(),
        field,
    )
}

/// The status for a refused request.
pub(super) fn refused(refusal: Refusal) -> Status {
    match refusal {
        Refusal::TokenMissing { required } => status(
            Code::Unauthenticated,
            "TOKEN_MISSING",
            format!(
                "this server requires a token with the role {required} or higher for this; ask its operator for one, and send it as `authorization: Bearer TOKEN`"
            ),
            [("required_role", required.name())],
        ),
        Refusal::TokenUnknown => status(
            Code::Unauthenticated,
            "TOKEN_UNKNOWN",
            "the server does not know this token: it is mistyped or was revoked; ask the operator for another",
            [],
        ),
        Refusal::TokenExpired => status(
            Code::Unauthenticated,
            "TOKEN_EXPIRED",
            "this token has expired; ask the operator for another",
            [],
        ),
        Refusal::RoleTooLow { required, role } => status(
            Code::PermissionDenied,
            "ROLE_TOO_LOW",
            format!("this needs the role {required}; the token has the role {role}"),
            [("required_role", required.name()), ("role", role.name())],
        ),
        Refusal::OutOfScope { scope } => status(
            Code::PermissionDenied,
            "OUT_OF_SCOPE",
            format!("the token is valid for {scope} only"),
            [("scope", &scope.to_string())],
        ),
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;
    use std::sync::Mutex;

    use futures::{FutureExt as _, stream};
    use http_body_util::{BodyExt as _, StreamBody};
    use tokio::sync::oneshot;
    use tower::{Layer as _, service_fn};

    use super::*;
    use chefshat_admission::access::{AccessSettings, NewToken, Role, TokenFile};
    use chefshat_admission::limits::Shares;

    #[tokio::test]
    async fn a_stream_of_a_service_of_the_transport_ends_when_the_server_shuts_down() {
        let silent = stream::pending::<Result<Frame<Bytes>, Status>>();
        let closing = CancellationToken::new();
        let answer = Response::new(Body::new(StreamBody::new(silent)));
        let mut body = until_closing(answer, &closing).into_body();
        assert!(body.frame().now_or_never().is_none());
        closing.cancel();
        let end = body.frame().now_or_never().flatten().expect("a frame");
        let trailers = end.expect("no error").into_trailers().expect("trailers");
        let status = Status::from_header_map(&trailers).expect("a status");
        assert_eq!(status.code(), shutting_down().code());
        assert!(body.frame().await.is_none());
    }

    /// A stream of a client that sends nothing and reads nothing.
    #[tokio::test(start_paused = true)]
    async fn what_a_client_sends_ends_with_its_token_even_if_it_reads_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let tokens = TokenFile::of(folder.path());
        let token = tokens.create(NewToken {
            role: Role::Player,
            label: String::new(),
            lifetime: None,
            scope: None,
        });
        let token = token.expect("written");
        let data_dir = folder.path().to_path_buf();
        let access = Access::open(&AccessSettings::default(), Some(&data_dir)).expect("readable");
        let access = Arc::new(access);
        tokio::spawn(Arc::clone(&access).follow());
        let limits = Arc::new(CallLimits::new(Shares::default()));
        let (sender, read) = oneshot::channel();
        let sender = Arc::new(Mutex::new(Some(sender)));
        let reading = service_fn(move |request: Request<Body>| {
            let sender = sender.lock().expect("no panic").take().expect("one call");
            tokio::spawn(
                async move { sender.send(request.into_body().collect().await.map(|_| ())) },
            );
            async {
                let body = Body::new(StreamBody::new(stream::pending::<
                    Result<Frame<Bytes>, Status>,
                >()));
                Ok::<_, Infallible>(Response::new(body))
            }
        });
        let mut service = AccessLayer::new(access, limits).layer(reading);
        let silent = stream::pending::<Result<Frame<Bytes>, Status>>();
        let request = Request::post("/chefshat.v1.PlayService/Play")
            .header("authorization", format!("Bearer {}", token.to_text()))
            .body(Body::new(StreamBody::new(silent)))
            .expect("a request");
        let _unread = service.call(request).await.expect("infallible");
        let mut read = read.shared();
        assert!((&mut read).now_or_never().is_none());
        tokens.revoke(token.id).expect("written");
        let ended = read.await.expect("read").expect_err("it ends");
        assert_eq!(ended.code(), Code::Unauthenticated);
    }
}
