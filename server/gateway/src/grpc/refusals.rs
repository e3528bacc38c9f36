//! Counts the calls that a server refuses, by the reason in their `ErrorInfo`. Streams that end with
//! an error later are not refused.

use std::sync::Arc;

use http::Response;
use tonic::Status;
use tonic::body::Body;
use tonic_types::StatusExt as _;
use tower::util::MapResponseLayer;

use chefshat_base::metrics::Metrics;

/// Counts the refusals of the services below this layer.
pub fn count_refusals(
    metrics: &Arc<Metrics>,
) -> MapResponseLayer<impl Fn(Response<Body>) -> Response<Body> + Clone + Send + 'static> {
    let metrics = Arc::clone(metrics);
    MapResponseLayer::new(move |response: Response<Body>| {
        if let Some(status) = response.extensions().get::<Status>() {
            count(&metrics, status);
        }
        response
    })
}

/// Counts a refusal. Its reason is one of this server's; the transport's own errors have none.
pub(super) fn count(metrics: &Metrics, status: &Status) {
    match status.get_details_error_info() {
        Some(info) => metrics.refused(&info.reason),
        None => metrics.refused(&format!("{:?}", status.code())),
    }
}
