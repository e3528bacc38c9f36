//! Opening a connection: address, TLS, token, keepalive and limits.

use std::error::Error as _;
use std::fmt;
use std::io::{self, Write as _};
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::Once;
use std::task::{Context, Poll};
use std::time::Duration;

use tonic::body::Body;
use tonic::codegen::{Service, http};
use tonic::transport::channel::ResponseFuture;
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Endpoint};

use crate::Error;
use crate::error::with_causes;

/// Time limit for connecting.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// Silence on open streams after which a connection is probed. Together with the timeout it is
/// shorter than the default time for a decision: ten seconds.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(3);
/// Time limit for the answer to a probe; after it the connection is closed. Longer than a round
/// trip on a bad network.
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(5);
/// Bytes that the server may send on a stream before the client reads them: enough for messages to
/// hundreds of seats.
const STREAM_WINDOW_BYTES: u32 = 1 << 20;
/// The same limit for all streams of a connection together.
const CONNECTION_WINDOW_BYTES: u32 = 4 << 20;
/// Maximum size of a response: enough for the history of hundreds of seats in one message.
pub const MAX_RESPONSE_BYTES: usize = 64 << 20;
/// Name of the header that shows an owner token or a ticket.
const SECRET_HEADER: &str = "chefshat-secret";
/// First line of each certificate in a PEM file.
const PEM_CERTIFICATE: &[u8] = b"-----BEGIN CERTIFICATE-----";

/// How to connect to a server.
#[derive(Clone, Default)]
pub struct ConnectOptions {
    /// Token sent with every call, from `chefshat token create`. Over `http://` it is readable on
    /// the way: for a server elsewhere, a warning on standard error says so once.
    pub token: Option<String>,
    /// PEM file of the certificate authorities to trust with `https://`, instead of the system's.
    pub ca: Option<PathBuf>,
}

impl ConnectOptions {
    /// The token from `CHEFSHAT_TOKEN` and the authorities from `CHEFSHAT_CA`, where set.
    pub fn from_env() -> Self {
        let set = |name| std::env::var_os(name).filter(|value| !value.is_empty());
        Self {
            token: set("CHEFSHAT_TOKEN").map(|token| token.to_string_lossy().into_owned()),
            ca: set("CHEFSHAT_CA").map(PathBuf::from),
        }
    }
}

impl fmt::Debug for ConnectOptions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let token = self.token.as_ref().map(|_| "hidden");
        f.debug_struct("ConnectOptions")
            .field("token", &token)
            .field("ca", &self.ca)
            .finish()
    }
}

/// A channel that sends a token with every call, if there is one. For the clients generated from
/// the protocol.
#[derive(Clone, Debug)]
pub struct Connection {
    channel: Channel,
    /// Marked as sensitive: never printed.
    authorization: Option<http::HeaderValue>,
    /// The same.
    secrets: Arc<[http::HeaderValue]>,
}

impl Connection {
    pub(crate) fn without_token(channel: Channel) -> Self {
        Self {
            channel,
            authorization: None,
            secrets: Arc::default(),
        }
    }

    /// The same connection, which shows these secrets with every call.
    pub(crate) fn with_secrets<S: AsRef<str>>(
        &self,
        secrets: impl IntoIterator<Item = S>,
    ) -> Result<Self, Error> {
        let secrets = secrets.into_iter().map(|secret| {
            let mut value =
                http::HeaderValue::try_from(secret.as_ref().trim()).map_err(|_| Error::secret())?;
            value.set_sensitive(true);
            Ok(value)
        });
        Ok(Self {
            secrets: secrets.collect::<Result<_, Error>>()?,
            ..self.clone()
        })
    }
}

fn authorization(token: &str) -> Result<http::HeaderValue, Error> {
    let mut value = http::HeaderValue::try_from(format!("Bearer {}", token.trim()))
        .map_err(|_| Error::token())?;
    value.set_sensitive(true);
    Ok(value)
}

impl Service<http::Request<Body>> for Connection {
    type Response = http::Response<Body>;
    type Error = tonic::transport::Error;
    type Future = ResponseFuture;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
        Service::poll_ready(&mut self.channel, context)
    }

    fn call(&mut self, mut request: http::Request<Body>) -> Self::Future {
        if let Some(value) = &self.authorization {
            let headers = request.headers_mut();
            headers.insert(http::header::AUTHORIZATION, value.clone());
        }
        for secret in self.secrets.iter() {
            request.headers_mut().append(SECRET_HEADER, secret.clone());
        }
        self.channel.call(request)
    }
}

/// Connects to `https://host`, `http://host:port` or `host:port`.
pub(crate) async fn connect(url: &str, options: &ConnectOptions) -> Result<Connection, Error> {
    let authorization = (options.token.as_deref()).map(authorization).transpose()?;
    let address = if url.contains("://") {
        url.to_owned()
    } else {
        format!("http://{url}")
    };
    let endpoint = Endpoint::from_shared(address)
        .map_err(|cause| Error::address(url, &with_causes(&cause)))?;
    let endpoint = match endpoint.uri().scheme_str() {
        Some("https") => endpoint
            .tls_config(trust(options.ca.as_deref())?)
            .map_err(|cause| Error::tls(url, &with_causes(&cause)))?,
        Some("http") if endpoint.uri().port().is_none() => {
            return Err(Error::address(url, "the port is missing"));
        }
        Some("http") => endpoint,
        _ => return Err(Error::address(url, "the scheme is unknown")),
    };
    if authorization.is_some()
        && let Some(host) = unencrypted(endpoint.uri())
    {
        static WARNING: Once = Once::new();
        WARNING.call_once(|| {
            // A program whose standard error nobody reads must not end by this.
            let _ = writeln!(
                io::stderr(),
                "WARNING: the token is sent unencrypted to {host}; use https://{host}"
            );
        });
    }
    let channel = endpoint
        .connect_timeout(CONNECT_TIMEOUT)
        .tcp_nodelay(true)
        .http2_keep_alive_interval(KEEPALIVE_INTERVAL)
        .keep_alive_timeout(KEEPALIVE_TIMEOUT)
        .initial_stream_window_size(STREAM_WINDOW_BYTES)
        .initial_connection_window_size(CONNECTION_WINDOW_BYTES)
        .connect()
        .await
        .map_err(|cause| {
            if is_tls(&cause) {
                Error::tls(url, &with_causes(&cause))
            } else {
                Error::connect(url, &cause)
            }
        })?;
    Ok(Connection {
        channel,
        authorization,
        secrets: Arc::default(),
    })
}

/// The host, if what is sent to this address can be read on the way: without TLS to another
/// machine.
fn unencrypted(address: &http::Uri) -> Option<&str> {
    let host = address.host()?;
    let plain = host.trim_start_matches('[').trim_end_matches(']');
    let is_loopback = plain.parse::<IpAddr>().map_or_else(
        |_| plain.eq_ignore_ascii_case("localhost"),
        |ip| ip.to_canonical().is_loopback(),
    );
    (address.scheme_str() != Some("https") && !is_loopback).then_some(host)
}

/// The authorities of a PEM file, or those of the system.
fn trust(ca: Option<&Path>) -> Result<ClientTlsConfig, Error> {
    let tls = ClientTlsConfig::new();
    let Some(file) = ca else {
        return Ok(tls.with_native_roots());
    };
    let pem = std::fs::read(file).map_err(|cause| Error::ca(file, &cause.to_string()))?;
    let has_certificate = pem
        .windows(PEM_CERTIFICATE.len())
        .any(|bytes| bytes == PEM_CERTIFICATE);
    if !has_certificate {
        return Err(Error::ca(file, "it contains no certificate in PEM form"));
    }
    Ok(tls.ca_certificate(Certificate::from_pem(pem)))
}

/// Whether TLS failed, rather than the connection below it.
fn is_tls(error: &tonic::transport::Error) -> bool {
    let mut cause = error.source();
    while let Some(error) = cause {
        let inside = error
            .downcast_ref::<std::io::Error>()
            .and_then(std::io::Error::get_ref);
        if error.is::<rustls::Error>() || inside.is_some_and(|it| it.is::<rustls::Error>()) {
            return true;
        }
        cause = error.source();
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_goes_to_another_machine_without_tls_is_unencrypted() {
        for (address, host) in [
            ("http://example.org:50051", Some("example.org")),
            ("http://192.0.2.1:50051", Some("192.0.2.1")),
            ("http://[2001:db8::1]:50051", Some("[2001:db8::1]")),
            ("https://example.org", None),
            ("http://localhost:50051", None),
            ("http://127.8.0.1:50051", None),
            ("http://[::1]:50051", None),
        ] {
            let address = http::Uri::from_static(address);
            assert_eq!(unencrypted(&address), host, "{address}");
        }
    }
}
