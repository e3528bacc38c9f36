//! Streamable HTTP, for clients that do not start this program themselves. The current revision of
//! the protocol has no sessions; older ones do. Both see the same seats, by their handles.

use std::net::SocketAddr;
use std::sync::Arc;

use axum::Router;
use rmcp::transport::streamable_http_server::session::local::LocalSessionManager;
use rmcp::transport::streamable_http_server::{StreamableHttpServerConfig, StreamableHttpService};
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;

use super::server::{Server, Settings};
use crate::{CommandError, say};

/// Path of the endpoint.
const PATH: &str = "/mcp";
/// Maximum bytes of a request.
const MAX_REQUEST_BYTES: usize = 64 * 1024;

/// Which requests are answered, besides those for this computer by programs.
pub(super) struct Checks {
    /// Further host names.
    pub(super) hosts: Vec<String>,
    /// Origins of pages.
    pub(super) origins: Vec<String>,
}

/// Serves until `asked_to_stop` is ready.
///
/// # Errors
/// The address cannot be used.
pub(super) async fn serve(
    address: SocketAddr,
    checks: Checks,
    settings: Arc<Settings>,
    asked_to_stop: impl Future<Output = Result<(), CommandError>> + Send + 'static,
) -> Result<(), CommandError> {
    let listener = (TcpListener::bind(address).await)
        .map_err(|error| format!("--listen {address}: {error}"))?;
    let address = listener.local_addr()?;
    if !address.ip().is_loopback() {
        tracing::warn!("everybody who can reach {address} can take seats with this program");
    }
    let stop = CancellationToken::new();
    // A page in a browser sends its origin, and the name by which it reached this computer: neither
    // a page of a stranger nor a name that a stranger has pointed here is answered.
    let mut config = StreamableHttpServerConfig::default();
    config.allowed_hosts.push(address.ip().to_string());
    config.allowed_hosts.extend(checks.hosts);
    let config = config
        .with_allowed_origins(checks.origins)
        .enforce_origin_validation()
        .with_max_request_body_bytes(MAX_REQUEST_BYTES)
        .with_cancellation_token(stop.child_token());
    let service = StreamableHttpService::new(
        move || Ok(Server::new(settings.clone())),
        Arc::new(LocalSessionManager::default()),
        config,
    );
    let router = Router::new().route_service(PATH, service);
    say(format_args!("listening on http://{address}{PATH}"))?;
    let stopped = async move {
        if let Err(error) = asked_to_stop.await {
            tracing::error!("signals cannot be received: {error}");
        }
        stop.cancel();
    };
    axum::serve(listener, router)
        .with_graceful_shutdown(stopped)
        .await?;
    Ok(())
}
