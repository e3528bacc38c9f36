//! Streamable HTTP, for clients that do not start this program themselves. There are no sessions,
//! which the current revision of the protocol does not have and older ones do not require: seats
//! are found by their handles, and a client that has said `initialize` costs nothing more.

use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use chefshat_server::connections::{self, Connection, Connections, Limits};
use chefshat_server::limits::Shares;
use chefshat_server::proxies::TrustedProxies;
use futures::StreamExt as _;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use rmcp::transport::streamable_http_server::session::never::NeverSessionManager;
use rmcp::transport::streamable_http_server::{StreamableHttpServerConfig, StreamableHttpService};
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

use super::server::{Server, Settings};
use chefshat_cli::error::{CommandError, say};

/// Path of the endpoint.
const PATH: &str = "/mcp";
/// Maximum bytes of a request.
const MAX_REQUEST_BYTES: usize = 64 * 1024;
/// Maximum number of connections, each of which makes one request at a time. One address has a share
/// of them, as on a game server.
const MAX_CONNECTIONS: usize = 256;
/// How long a connection may be without a request: then its place is free.
const IDLE_LIMIT: Duration = Duration::from_secs(60);

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
        .with_legacy_session_mode(false)
        .with_cancellation_token(stop.child_token());
    let service = StreamableHttpService::new(
        move || Ok(Server::new(settings.clone())),
        Arc::new(NeverSessionManager::default()),
        config,
    );
    let router = Router::new().route_service(PATH, service);
    say(format_args!("listening on http://{address}{PATH}"))?;
    let stopped = stop.clone();
    let stopping = async move {
        if let Err(error) = asked_to_stop.await {
            tracing::error!("signals cannot be received: {error}");
        }
        stop.cancel();
    };
    tokio::join!(stopping, accept(listener, &router, &stopped));
    Ok(())
}

/// Serves connections until `stop`, and those that there are until their requests are answered.
async fn accept(listener: TcpListener, router: &Router, stop: &CancellationToken) {
    let limits = Limits {
        max_connections: MAX_CONNECTIONS,
        shares: Shares::default(),
        trusted_proxies: TrustedProxies::default(),
    };
    let connections = Connections::new(limits, Arc::default());
    let accepted = connections::accept(listener.into(), connections).take_until(stop.cancelled());
    let mut accepted = pin!(accepted);
    let serving = TaskTracker::new();
    while let Some(connection) = accepted.next().await {
        // After a failure it tries again.
        if let Ok(connection) = connection {
            serving.spawn(serve_one(connection, router.clone(), stop.clone()));
        }
    }
    serving.close();
    serving.wait().await;
}

/// Serves one connection, by HTTP/1 alone: it makes one request at a time.
async fn serve_one(connection: Connection, router: Router, stop: CancellationToken) {
    let serving = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(IDLE_LIMIT)
        .serve_connection(TokioIo::new(connection), TowerToHyperService::new(router));
    let mut serving = pin!(serving);
    tokio::select! {
        // A client that fails is disconnected.
        _ = serving.as_mut() => return,
        () = stop.cancelled() => {}
    }
    serving.as_mut().graceful_shutdown();
    let _ = serving.await;
}
