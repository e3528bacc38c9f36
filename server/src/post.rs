//! Sends one POST request over a connection of its own, with or without TLS.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use http::{HeaderName, Request, StatusCode, Uri, header};
use http_body_util::Full;
use hyper::client::conn::http1;
use hyper_util::rt::TokioIo;
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, ServerName};
use rustls::{ClientConfig, RootCertStore};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_rustls::TlsConnector;
use tokio_util::task::AbortOnDropHandle;

/// How long a receiver may take to answer.
pub const ANSWER_TIME: Duration = Duration::from_secs(10);

/// Why webhooks cannot be sent.
#[derive(Debug, thiserror::Error)]
pub enum WebhookError {
    /// The address is not one.
    #[error("{0:?} is not an address for webhooks; an example is https://example.org/chefshat")]
    Address(String),
    /// The authorities cannot be read.
    #[error("the certificate authorities for webhooks cannot be read: {0}")]
    Authorities(String),
    /// The connection failed.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// The exchange failed.
    #[error("{0}")]
    Http(#[from] hyper::Error),
    /// The receiver answered with another status than 2xx.
    #[error("the receiver answered {0}")]
    Status(StatusCode),
    /// The receiver did not answer in time.
    #[error("no answer within {} s", .0.as_secs())]
    Timeout(Duration),
}

/// A receiver of POST requests.
pub(crate) struct Target {
    uri: Uri,
    host: String,
    port: u16,
    tls: Option<(TlsConnector, ServerName<'static>)>,
}

/// Without the address, which may contain a secret.
impl std::fmt::Debug for Target {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("Target")
    }
}

impl Target {
    /// Parses an address; `ca`: the file of the authorities to trust instead of the system's.
    pub(crate) fn new(url: &str, ca: Option<&Path>) -> Result<Self, WebhookError> {
        let wrong = || WebhookError::Address(url.to_owned());
        let uri: Uri = url.parse().map_err(|_| wrong())?;
        let host = uri.host().filter(|host| !host.is_empty());
        let host = host.ok_or_else(wrong)?;
        // An address of IPv6 stands in brackets.
        let host = host.trim_matches(['[', ']']).to_owned();
        let (encrypted, port) = match uri.scheme_str() {
            Some("http") => (false, 80),
            Some("https") => (true, 443),
            _ => return Err(wrong()),
        };
        let tls = match encrypted {
            true => {
                let name = ServerName::try_from(host.clone()).map_err(|_| wrong())?;
                Some((connector(ca)?, name))
            }
            false => None,
        };
        Ok(Self {
            port: uri.port_u16().unwrap_or(port),
            uri,
            host,
            tls,
        })
    }

    /// Posts a JSON body with further headers.
    ///
    /// # Errors
    /// The receiver cannot be reached, does not answer in time, or answers with another status than
    /// 2xx.
    pub(crate) async fn post<const N: usize>(
        &self,
        body: Bytes,
        headers: [(&'static str, String); N],
    ) -> Result<(), WebhookError> {
        let path = self.uri.path_and_query().map_or("/", |path| path.as_str());
        let authority = self.uri.authority().map_or("", |it| it.as_str());
        // Without a user and password.
        let host = authority.rsplit('@').next().unwrap_or_default();
        let mut request = Request::post(path)
            .header(header::HOST, host)
            .header(header::CONTENT_TYPE, "application/json")
            .header(
                header::USER_AGENT,
                concat!("chefshat/", env!("CARGO_PKG_VERSION")),
            );
        for (name, value) in headers {
            request = request.header(HeaderName::from_static(name), value);
        }
        let request = request
            .body(Full::new(body))
            .expect("the parts have been checked");
        let answered = timeout(ANSWER_TIME, self.exchange(request)).await;
        let status = answered.map_err(|_| WebhookError::Timeout(ANSWER_TIME))??;
        match status.is_success() {
            true => Ok(()),
            false => Err(WebhookError::Status(status)),
        }
    }

    async fn exchange(&self, request: Request<Full<Bytes>>) -> Result<StatusCode, WebhookError> {
        let stream = TcpStream::connect((self.host.as_str(), self.port)).await?;
        match &self.tls {
            None => exchange_over(stream, request).await,
            Some((connector, name)) => {
                let stream = connector.connect(name.clone(), stream).await?;
                exchange_over(stream, request).await
            }
        }
    }
}

/// The status of the answer to a request.
async fn exchange_over(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    request: Request<Full<Bytes>>,
) -> Result<StatusCode, WebhookError> {
    let (mut sender, connection) = http1::handshake(TokioIo::new(stream)).await?;
    let _running = AbortOnDropHandle::new(tokio::spawn(connection));
    let response = sender.send_request(request).await?;
    Ok(response.status())
}

fn connector(ca: Option<&Path>) -> Result<TlsConnector, WebhookError> {
    let unreadable =
        |problem: &dyn std::fmt::Display| WebhookError::Authorities(problem.to_string());
    let mut roots = RootCertStore::empty();
    match ca {
        Some(path) => {
            let read: Result<Vec<_>, _> =
                CertificateDer::pem_file_iter(path).and_then(Iterator::collect);
            for certificate in read.map_err(|problem| unreadable(&problem))? {
                (roots.add(certificate)).map_err(|problem| unreadable(&problem))?;
            }
        }
        None => {
            let found = rustls_native_certs::load_native_certs();
            roots.add_parsable_certificates(found.certs);
        }
    }
    if roots.is_empty() {
        return Err(unreadable(&"there are none"));
    }
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .expect("ring supports the default versions")
        .with_root_certificates(roots)
        .with_no_client_auth();
    Ok(TlsConnector::from(Arc::new(config)))
}
