//! The page for people: serves the built browser client (`clients/web`) on the port of gRPC. All
//! gRPC calls are POST, so every GET is for the page. A release embeds the files; a debug build
//! reads them on each request, so that the page can be edited while a server runs.
//! `clients/web/vite.config.ts` decides which files there are.

mod answer;
mod origin;

use std::borrow::Cow;
use std::future::{Ready, ready};
use std::task::{Context, Poll};

use bytes::Bytes;
use futures::future::Either;
use http::{Method, Request, Response, header};
use rust_embed::RustEmbed;
use tonic::body::Body;
use tower::{Layer, Service};

use answer::{File, answer};
pub use origin::{OriginLayer, Origins};

#[derive(RustEmbed)]
#[folder = "../clients/web/dist"]
struct Dist;

/// Whether the page is built in.
pub fn is_built_in() -> bool {
    find("index.html").is_some()
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
pub struct PageLayer;

impl<S> Layer<S> for PageLayer {
    type Service = WithPage<S>;

    fn layer(&self, services: S) -> Self::Service {
        WithPage { services }
    }
}

/// The services with the page in front of them.
#[derive(Debug, Clone)]
pub struct WithPage<S> {
    services: S,
}

impl<S, B> Service<Request<B>> for WithPage<S>
where
    S: Service<Request<B>, Response = Response<Body>>,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = Either<Ready<Result<Self::Response, Self::Error>>, S::Future>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
        self.services.poll_ready(context)
    }

    fn call(&mut self, request: Request<B>) -> Self::Future {
        if is_for_page(&request) {
            Either::Left(ready(Ok(
                answer(find, &request).map(|bytes| Body::new(axum::body::Body::from(bytes)))
            )))
        } else {
            Either::Right(self.services.call(request))
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
