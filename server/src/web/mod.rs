//! The page for people: serves the built browser client (`clients/web`) on the port of gRPC. All
//! gRPC calls are POST, so every GET is for the page. A release embeds the files; a debug build
//! reads them on each request, so that the page can be edited while a server runs.
//! `clients/web/vite.config.ts` decides which files there are.

mod answer;
mod origin;
mod preview;

use std::borrow::Cow;
use std::task::{Context, Poll};

use bytes::Bytes;
use futures::future::{BoxFuture, Either};
use http::{Method, Request, Response, header};
use rust_embed::RustEmbed;
use tonic::body::Body;
use tower::{BoxError, Layer, Service};

use answer::{DOCUMENT, File, answer, generated};
pub use origin::{OriginLayer, Origins};
use preview::Link;

#[derive(RustEmbed)]
#[folder = "../clients/web/dist"]
struct Dist;

/// Whether the page is built in.
pub fn is_built_in() -> bool {
    find(DOCUMENT).is_some()
}

/// A built file; `None` for hidden ones, which belong to the source tree.
fn find(name: &str) -> Option<File> {
    if name.starts_with('.') {
        return None;
    }
    let file = Dist::get(name)?;
    let bytes = match file.data {
        Cow::Borrowed(bytes) => Bytes::from_static(bytes),
        Cow::Owned(bytes) => bytes.into(),
    };
    Some(File {
        media_type: file.metadata.mimetype().to_owned(),
        hash: hex::encode(&file.metadata.sha256_hash()[..16]),
        bytes,
    })
}

/// Puts the page in front of the services.
#[derive(Debug, Clone, Copy)]
pub struct PageLayer {
    /// Whether browsers reach this server with TLS.
    pub tls: bool,
}

impl<S> Layer<S> for PageLayer {
    type Service = WithPage<S>;

    fn layer(&self, services: S) -> Self::Service {
        WithPage {
            layer: *self,
            services,
        }
    }
}

/// The services with the page in front of them.
#[derive(Debug, Clone)]
pub struct WithPage<S> {
    layer: PageLayer,
    services: S,
}

impl<S> Service<Request<Body>> for WithPage<S>
where
    S: Service<Request<Body>, Response = Response<Body>> + Clone + Send + 'static,
    S::Error: Into<BoxError>,
    S::Future: Send,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = Either<S::Future, BoxFuture<'static, Result<Self::Response, Self::Error>>>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
        self.services.poll_ready(context)
    }

    fn call(&mut self, request: Request<Body>) -> Self::Future {
        if !is_for_page(&request) {
            return Either::Left(self.services.call(request));
        }
        // The clone that is ready serves this request.
        let clone = self.services.clone();
        let services = std::mem::replace(&mut self.services, clone);
        let tls = self.layer.tls;
        Either::Right(Box::pin(async move {
            let request = request.map(drop);
            let answer = match Link::of(request.uri().path()) {
                None => answer(find, &request),
                Some(link) => previewed(link, services, &request, tls).await,
            };
            Ok(answer.map(|bytes| Body::new(axum::body::Body::from(bytes))))
        }))
    }
}

/// The answer to a request for the replay of a game or its picture.
async fn previewed<S>(
    link: Link<'_>,
    services: S,
    request: &Request<()>,
    tls: bool,
) -> Response<Bytes>
where
    S: Service<Request<Body>, Response = Response<Body>>,
    S::Error: Into<BoxError>,
{
    let lines = preview::record(services, link.game(), request.extensions().clone()).await;
    match link {
        Link::Picture(_) => {
            let picture = match lines {
                Some(lines) => preview::picture(lines).await,
                None => None,
            };
            generated("image/png", picture, request.method())
        }
        Link::Replay(_) => {
            let tagged = lines.and_then(|lines| {
                let origin = preview::origin(request, tls)?;
                preview::document(&find(DOCUMENT)?.bytes, &lines, &origin)
            });
            match tagged {
                Some(_) => generated("text/html; charset=utf-8", tagged, request.method()),
                None => answer(find, request),
            }
        }
    }
}

fn is_for_page<B>(request: &Request<B>) -> bool {
    let asks = matches!(*request.method(), Method::GET | Method::HEAD);
    // The services answer a call with a wrong method.
    let calls = (request.headers().get(header::CONTENT_TYPE))
        .is_some_and(|media_type| media_type.as_bytes().starts_with(b"application/grpc"));
    asks && !calls
}
