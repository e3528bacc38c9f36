//! Calls that the page makes itself, to the services behind it.

use http::{Extensions, Request, Response, Uri};
use tonic::body::Body;
use tonic::metadata::MetadataMap;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;
use tower::{BoxError, Service};

/// The services behind the page.
pub(super) trait Services:
    Service<Request<Body>, Response = Response<Body>, Error: Into<BoxError>>
{
}

impl<S> Services for S where
    S: Service<Request<Body>, Response = Response<Body>, Error: Into<BoxError>>
{
}

/// Their origin.
pub(super) fn own_origin() -> Uri {
    Uri::from_static("http://page")
}

/// A call for the client of a request with these extensions.
pub(super) fn own_call<M>(extensions: &Extensions, message: M) -> tonic::Request<M> {
    tonic::Request::from_parts(MetadataMap::new(), extensions.clone(), message)
}

/// What the health service of gRPC says of the whole server.
pub(super) async fn is_serving(services: impl Services, extensions: &Extensions) -> bool {
    let mut health = HealthClient::with_origin(services, own_origin());
    let call = own_call(extensions, HealthCheckRequest::default());
    let answered = health.check(call).await;
    answered.is_ok_and(|answer| answer.into_inner().status() == ServingStatus::Serving)
}
