//! The page for people: serves the built browser client (`clients/web`) on the port of gRPC. All
//! gRPC calls are POST, so every GET is for the page. `clients/web/vite.config.ts` decides which
//! files there are.

mod answer;
mod cache;
mod calls;
mod files;
mod origin;
mod preview;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use bytes::Bytes;
use futures::future::{BoxFuture, Either};
use http::{Method, Request, Response, header};
use rayon::ThreadPoolBuildError;
use tonic::body::Body;
use tower::{BoxError, Service};

use answer::{DOCUMENT, absent, answer, busy, generated, health};
use calls::{Services, is_serving};
use files::find;
pub use origin::{OriginLayer, Origins};
use preview::{Link, Previews, Unshown};
pub use preview::{MAX_PREVIEWS, MAX_PREVIEWS_WAITING};

use crate::front::{Front, InFront, take_ready};
use crate::grpc::within_share;
use chefshat_admission::limits::CallLimits;
use chefshat_hosting::config::PaintingSettings;
use chefshat_hosting::rooms::Rooms;

/// Where proxies and monitors that speak no gRPC ask whether the server takes new clients.
const HEALTH: &str = "/health";

/// Whether the page was built.
pub fn is_built() -> bool {
    find(DOCUMENT).is_some()
}

/// Puts the page in front of the services.
#[derive(Debug, Clone)]
pub struct PageLayer {
    tls: bool,
    limits: Arc<CallLimits>,
    previews: Arc<Previews>,
}

impl PageLayer {
    /// Creates the page. `tls`: whether browsers reach this server with TLS. `limits`: what holds each
    /// caller to its share. `rooms`: whose games it previews. `painter`: what draws the previews.
    ///
    /// # Errors
    /// The operating system cannot start the thread that reads their records.
    pub fn new(
        tls: bool,
        limits: Arc<CallLimits>,
        rooms: Arc<Rooms>,
        painter: Option<PaintingSettings>,
    ) -> Result<InFront<Self>, ThreadPoolBuildError> {
        let previews = Arc::new(Previews::new(rooms, painter)?);
        Ok(InFront(Self {
            tls,
            limits,
            previews,
        }))
    }
}

impl<S> Front<S, Body> for PageLayer
where
    S: Service<Request<Body>, Response = Response<Body>> + Clone + Send + 'static,
    S::Error: Into<BoxError>,
    S::Future: Send,
{
    type Answering = Either<S::Future, BoxFuture<'static, Result<Response<Body>, S::Error>>>;

    fn answer(&self, services: &mut S, request: Request<Body>) -> Self::Answering {
        if !is_for_page(&request) {
            return Either::Left(services.call(request));
        }
        let (page, services) = (self.clone(), take_ready(services));
        let request = request.map(drop);
        Either::Right(Box::pin(async move {
            let extensions = request.extensions().clone();
            let method = request.method().clone();
            let answer = with_body(page.page(request, services).await);
            let answer = within_share(&page.limits, &extensions, answer).await;
            Ok(answer.unwrap_or_else(|| with_body(busy(&method))))
        }))
    }
}

fn with_body(answer: Response<Bytes>) -> Response<Body> {
    answer.map(|bytes| Body::new(axum::body::Body::from(bytes)))
}

impl PageLayer {
    /// The answer to a request for the page.
    async fn page(&self, request: Request<()>, services: impl Services) -> Response<Bytes> {
        let path = request.uri().path();
        match Link::of(path) {
            None if path == HEALTH => health(
                is_serving(services, request.extensions()).await,
                request.method(),
            ),
            None => of_files(request, |request| answer(find, request)).await,
            Some(link) => self.previewed(link, services, &request).await,
        }
    }

    /// The answer to a request for the replay of a game or its picture.
    async fn previewed(
        &self,
        link: Link,
        services: impl Services,
        request: &Request<()>,
    ) -> Response<Bytes> {
        let (previews, extensions) = (&self.previews, request.extensions());
        match link {
            Link::Picture(game) => match previews.picture(game, services, extensions).await {
                Ok(picture) => generated(picture, request),
                Err(Unshown::Unknown) => absent(request.method()),
                Err(Unshown::Busy) => busy(request.method()),
            },
            Link::Replay(game) => {
                let title = previews.title(game, services, extensions).await.ok();
                let tags =
                    title.and_then(|title| Some((title, preview::origin(request, self.tls)?)));
                let paints = previews.paints();
                of_files(request.clone(), move |request| {
                    let tagged = tags.and_then(|(title, origin)| {
                        preview::document(&find(DOCUMENT)?.bytes, game, &title, &origin, paints)
                    });
                    match tagged {
                        Some(tagged) => generated(tagged, request),
                        None => answer(find, request),
                    }
                })
                .await
            }
        }
    }
}

/// An answer that needs files of the page, which are in this program.
#[cfg(feature = "embedded-page")]
#[allow(clippy::unused_async, reason = "other builds read a disk")]
async fn of_files(
    request: Request<()>,
    make: impl FnOnce(&Request<()>) -> Response<Bytes>,
) -> Response<Bytes> {
    make(&request)
}

/// An answer that needs files of the page, which are read from a disk.
#[cfg(not(feature = "embedded-page"))]
async fn of_files(
    request: Request<()>,
    make: impl FnOnce(&Request<()>) -> Response<Bytes> + Send + 'static,
) -> Response<Bytes> {
    let method = request.method().clone();
    let making = tokio::task::spawn_blocking(move || make(&request));
    making.await.unwrap_or_else(|_| absent(&method))
}

fn is_for_page<B>(request: &Request<B>) -> bool {
    let asks = matches!(*request.method(), Method::GET | Method::HEAD);
    // The services answer a call with a wrong method.
    let calls = (request.headers().get(header::CONTENT_TYPE))
        .is_some_and(|media_type| media_type.as_bytes().starts_with(b"application/grpc"));
    asks && !calls
}
