//! Sends JSON in one POST request over a connection of its own, with or without TLS: webhooks, and
//! questions to language models.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use http::{HeaderName, Request, StatusCode, Uri, header};
use http_body_util::{BodyExt as _, Full, Limited};
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

use crate::tasks::short;
use crate::tls_files::add_authorities;

/// Why a request has no answer.
#[derive(Debug, thiserror::Error)]
pub enum PostError {
    /// The address, which may contain a secret, is not one.
    #[error("this is not an address; an example is https://example.org/chefshat")]
    Address,
    /// The authorities cannot be read.
    #[error("the certificate authorities cannot be read: {0}")]
    Authorities(String),
    /// The connection failed.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// The exchange failed.
    #[error("{0}")]
    Http(#[from] hyper::Error),
    /// The answer has more bytes than this, or ends early.
    #[error("the answer has more than {0} bytes, or ends early")]
    Body(usize),
    /// The receiver answered with another status than 2xx.
    #[error("the receiver answered {}", .0.status)]
    Status(Answer),
    /// The receiver did not answer in time.
    #[error("no answer within {} s", .0.as_secs())]
    Timeout(Duration),
}

/// An answer.
#[derive(Debug)]
pub struct Answer {
    /// Its status.
    pub status: StatusCode,
    /// When to try again, if the receiver says so in seconds.
    pub retry_after: Option<Duration>,
    /// Its body.
    pub body: Bytes,
}

/// A receiver of POST requests.
pub struct Target {
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
    /// The host and the port, without what may be secret.
    pub fn authority(&self) -> String {
        match self.host.contains(':') {
            true => format!("[{}]:{}", self.host, self.port),
            false => format!("{}:{}", self.host, self.port),
        }
    }

    /// Parses an address, http or https; `ca`: the file of the authorities to trust instead of the
    /// system's.
    ///
    /// # Errors
    /// The address or the file cannot be used.
    pub fn new(url: &str, ca: Option<&Path>) -> Result<Self, PostError> {
        let wrong = || PostError::Address;
        let uri: Uri = url.parse().map_err(|_| wrong())?;
        let host = uri.host().filter(|host| !host.is_empty());
        let host = host.ok_or_else(wrong)?;
        let (encrypted, port) = match uri.scheme_str() {
            Some("http") => (false, 80),
            Some("https") => (true, 443),
            _ => return Err(wrong()),
        };
        // `Uri` says of a port above 65535 that there is none: it would be the usual one.
        let rest = host_and_port(&uri).strip_prefix(host);
        let port = match rest.and_then(|rest| rest.strip_prefix(':')) {
            None | Some("") => port,
            Some(port) => port.parse().map_err(|_| wrong())?,
        };
        // An address of IPv6 stands in brackets.
        let host = host.trim_matches(['[', ']']).to_owned();
        let tls = match encrypted {
            true => {
                let name = ServerName::try_from(host.clone()).map_err(|_| wrong())?;
                Some((connector(ca)?, name))
            }
            false => None,
        };
        Ok(Self {
            uri,
            host,
            port,
            tls,
        })
    }

    /// Posts a JSON body with further headers. The answer has at most `longest` bytes and arrives
    /// within `time`.
    ///
    /// # Errors
    /// The receiver cannot be reached, does not answer in time, answers with another status than 2xx
    /// or with a longer body.
    ///
    /// # Panics
    /// A header has characters that headers cannot have.
    pub async fn post(
        &self,
        body: impl Into<Bytes>,
        headers: impl IntoIterator<Item = (&'static str, String)>,
        time: Duration,
        longest: usize,
    ) -> Result<Answer, PostError> {
        let path = self.uri.path_and_query().map_or("/", |path| path.as_str());
        let mut request = Request::post(path)
            .header(header::HOST, host_and_port(&self.uri))
            .header(header::CONTENT_TYPE, "application/json")
            .header(
                header::USER_AGENT,
                concat!("chefshat/", env!("CARGO_PKG_VERSION")),
            );
        for (name, value) in headers {
            request = request.header(HeaderName::from_static(name), value);
        }
        let request = request
            .body(Full::new(body.into()))
            .expect("the parts have been checked");
        let answered = timeout(time, self.exchange(request, longest)).await;
        let answer = answered.map_err(|_| PostError::Timeout(time))??;
        match answer.status.is_success() {
            true => Ok(answer),
            false => Err(PostError::Status(answer)),
        }
    }

    async fn exchange(
        &self,
        request: Request<Full<Bytes>>,
        longest: usize,
    ) -> Result<Answer, PostError> {
        let stream = TcpStream::connect((self.host.as_str(), self.port)).await?;
        match &self.tls {
            None => exchange_over(stream, request, longest).await,
            Some((connector, name)) => {
                let stream = connector.connect(name.clone(), stream).await?;
                exchange_over(stream, request, longest).await
            }
        }
    }
}

/// The host of an address and the port as they are written there, without a user and password.
fn host_and_port(uri: &Uri) -> &str {
    let authority = uri.authority().map_or("", |it| it.as_str());
    authority.rsplit('@').next().unwrap_or_default()
}

/// The answer to a request.
async fn exchange_over(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    request: Request<Full<Bytes>>,
    longest: usize,
) -> Result<Answer, PostError> {
    let (mut sender, connection) = http1::handshake(TokioIo::new(stream)).await?;
    let _running = AbortOnDropHandle::new(tokio::spawn(short("one request", connection)));
    let (head, body) = sender.send_request(request).await?.into_parts();
    let retry_after = head.headers.get(header::RETRY_AFTER);
    let retry_after = retry_after.and_then(|it| it.to_str().ok()?.trim().parse().ok());
    let body = match Limited::new(body, longest).collect().await {
        Ok(body) => body.to_bytes(),
        Err(_) if head.status.is_success() => return Err(PostError::Body(longest)),
        Err(_) => Bytes::new(),
    };
    Ok(Answer {
        status: head.status,
        retry_after: retry_after.map(Duration::from_secs),
        body,
    })
}

fn connector(ca: Option<&Path>) -> Result<TlsConnector, PostError> {
    let unreadable = |problem: &dyn std::fmt::Display| PostError::Authorities(problem.to_string());
    let mut roots = RootCertStore::empty();
    match ca {
        Some(path) => {
            let read: Result<Vec<_>, _> =
                CertificateDer::pem_file_iter(path).and_then(Iterator::collect);
            let read = read.map_err(|problem| unreadable(&problem))?;
            add_authorities(&mut roots, path, read);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_the_one_that_is_written_or_the_usual_one() {
        for (url, authority) in [
            ("http://example.org", Some("example.org:80")),
            ("http://example.org:/x", Some("example.org:80")),
            ("http://ada:1@example.org:8080/x", Some("example.org:8080")),
            ("http://ada:1@example.org/x", Some("example.org:80")),
            ("http://[::1]:8080", Some("[::1]:8080")),
            ("http://[::1]", Some("[::1]:80")),
            ("http://example.org:80800", None),
            ("http://example.org:http", None),
        ] {
            let target = Target::new(url, None).ok();
            assert_eq!(
                target.map(|it| it.authority()).as_deref(),
                authority,
                "{url}"
            );
        }
    }
}
