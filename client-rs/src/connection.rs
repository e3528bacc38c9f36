//! Opening a connection: address, keepalive and limits.

use std::time::Duration;

use tonic::transport::{Channel, Endpoint};

use crate::Error;
use crate::error::with_causes;

/// Time limit for connecting.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// Silence after which a connection is probed.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(20);
/// Time limit for the answer to a probe; after it the connection is closed.
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(10);
/// Bytes that the server may send on a stream before the client reads them: enough for messages to
/// hundreds of seats.
const STREAM_WINDOW_BYTES: u32 = 1 << 20;
/// The same limit for all streams of a connection together.
const CONNECTION_WINDOW_BYTES: u32 = 4 << 20;
/// Maximum size of a response: enough for the history of hundreds of seats in one message.
pub(crate) const MAX_RESPONSE_BYTES: usize = 64 << 20;

/// Connects to `http://host:port` or `host:port`.
pub(crate) async fn connect(url: &str) -> Result<Channel, Error> {
    let address = if url.contains("://") {
        url.to_owned()
    } else {
        format!("http://{url}")
    };
    let endpoint = Endpoint::from_shared(address)
        .map_err(|cause| Error::address(url, &with_causes(&cause)))?;
    if endpoint.uri().scheme_str() != Some("http") {
        return Err(Error::address(url, "only plain http:// is spoken here"));
    }
    if endpoint.uri().port().is_none() {
        return Err(Error::address(url, "the port is missing"));
    }
    endpoint
        .connect_timeout(CONNECT_TIMEOUT)
        .tcp_nodelay(true)
        .http2_keep_alive_interval(KEEPALIVE_INTERVAL)
        .keep_alive_timeout(KEEPALIVE_TIMEOUT)
        .keep_alive_while_idle(true)
        .initial_stream_window_size(STREAM_WINDOW_BYTES)
        .initial_connection_window_size(CONNECTION_WINDOW_BYTES)
        .connect()
        .await
        .map_err(|cause| Error::connect(url, &cause))
}
