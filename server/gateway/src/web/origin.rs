//! Keeps foreign web pages from using a visitor's browser against the server. A request that names
//! a web origin must come from the server's own page or an allowed origin; this also covers
//! requests that a browser sends without asking first. Where the server is only meant for this
//! machine, the host of a request must be a name of this machine: otherwise a page could reach it
//! under its own name (DNS rebinding).

use std::net::IpAddr;
use std::sync::Arc;

use axum::body::Body as Text;
use futures::future::{BoxFuture, Either};
use http::uri::Authority;
use http::{HeaderName, HeaderValue, Method, Request, Response, StatusCode, header};
use tonic::body::Body;
use tower::Service;
use tracing::info;

use super::answer::busy;
use super::with_body;
use crate::connections::peer_address;
use crate::front::{Front, InFront};
use crate::grpc::within_share;
use chefshat_admission::limits::{CallLimits, LogPace};

/// Whose pages and under which names the server may be reached.
#[derive(Debug)]
pub struct Origins {
    /// Web origins besides the server's own, as browsers send them; `*` allows all.
    origins: Vec<String>,
    /// Names of hosts besides those of this machine; `None`: all.
    hosts: Option<Vec<String>>,
    logged: LogPace,
}

/// Refused requests that are logged in a minute.
const LOGGED: u32 = 60;

/// Why a request is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Foreign {
    Origin,
    Host,
}

impl Origins {
    /// Allows the server's own page, these origins and, if given, only these hosts besides the
    /// names of this machine.
    pub fn new(origins: &[String], hosts: Option<Vec<String>>) -> Self {
        Self {
            origins: origins.iter().map(|origin| as_sent(origin)).collect(),
            hosts,
            logged: LogPace::new(LOGGED),
        }
    }

    /// The allowed origins besides the server's own, as browsers send them; `*` allows all.
    pub fn listed(&self) -> &[String] {
        &self.origins
    }

    /// Checks the origin and host of a request.
    fn check<B>(&self, request: &Request<B>) -> Result<(), Foreign> {
        let host = host_of(request);
        if let Some(hosts) = &self.hosts
            && !host.as_ref().is_some_and(|host| is_named(host, hosts))
        {
            return Err(Foreign::Host);
        }
        let mut origins = request.headers().get_all(header::ORIGIN).iter();
        match origins.all(|origin| self.is_allowed(origin, host.as_ref())) {
            true => Ok(()),
            false => Err(Foreign::Origin),
        }
    }

    fn is_allowed(&self, origin: &HeaderValue, host: Option<&Authority>) -> bool {
        let Ok(origin) = origin.to_str() else {
            return false;
        };
        let listed = |allowed: &String| allowed == "*" || allowed == origin;
        if self.origins.iter().any(listed) {
            return true;
        }
        // A proxy may have taken TLS off, so the scheme is not compared, but it decides which port
        // is the default, which browsers leave out and proxies may not.
        let (own, port) = match (
            origin.strip_prefix("https://"),
            origin.strip_prefix("http://"),
        ) {
            (Some(own), _) => (own, ":443"),
            (_, Some(own)) => (own, ":80"),
            _ => return false,
        };
        let host = host.map_or("", |host| host.as_str());
        let host = host.strip_suffix(port).unwrap_or(host);
        !own.is_empty() && own.eq_ignore_ascii_case(host)
    }
}

/// An origin as browsers send it: in small letters, without the default port of its scheme.
fn as_sent(origin: &str) -> String {
    let origin = origin.to_ascii_lowercase();
    let port = match origin.starts_with("https:") {
        true => ":443",
        false => ":80",
    };
    origin.strip_suffix(port).unwrap_or(&origin).to_owned()
}

/// The host and port that a request names: of its URI in HTTP/2, else of its header.
fn host_of<B>(request: &Request<B>) -> Option<Authority> {
    let named = request.uri().authority().cloned();
    named.or_else(|| {
        let host = request.headers().get(header::HOST)?;
        Authority::try_from(host.as_bytes()).ok()
    })
}

/// Whether a host is this machine, an address, or one of these names. No page has an address as
/// its name unless it comes from there.
fn is_named(host: &Authority, hosts: &[String]) -> bool {
    let name = host.host();
    let address = name.trim_start_matches('[').trim_end_matches(']');
    address.parse::<IpAddr>().is_ok()
        || name.eq_ignore_ascii_case("localhost")
        || hosts.iter().any(|known| known.eq_ignore_ascii_case(name))
}

/// Refuses requests of foreign pages.
#[derive(Debug, Clone)]
pub struct OriginLayer {
    origins: Arc<Origins>,
    limits: Arc<CallLimits>,
}

impl OriginLayer {
    /// Creates a layer that admits these origins. `limits`: what holds each caller to its share.
    pub fn new(origins: Origins, limits: Arc<CallLimits>) -> InFront<Self> {
        InFront(Self {
            origins: Arc::new(origins),
            limits,
        })
    }
}

impl<S, B> Front<S, B> for OriginLayer
where
    S: Service<Request<B>, Response = Response<Body>>,
    S::Future: Send + 'static,
    S::Error: Send,
{
    type Answering = Either<BoxFuture<'static, Result<Response<Body>, S::Error>>, S::Future>;

    fn answer(&self, services: &mut S, request: Request<B>) -> Self::Answering {
        let Self { origins, limits } = self;
        match origins.check(&request) {
            // Answered before the limits of calls: it counts here.
            Ok(()) if request.method() == Method::OPTIONS => {
                let (limits, extensions) = (Arc::clone(limits), request.extensions().clone());
                let answering = services.call(request);
                Either::Left(Box::pin(async move {
                    let kept = within_share(&limits, &extensions, answering.await?).await;
                    Ok(kept.unwrap_or_else(|| with_body(busy(&Method::OPTIONS))))
                }))
            }
            Ok(()) => Either::Right(services.call(request)),
            Err(foreign) => {
                if origins.logged.admits() {
                    let address = peer_address(request.extensions());
                    let address = address.map(tracing::field::display);
                    info!(address, ?foreign, "a request was refused");
                }
                let (limits, extensions) = (Arc::clone(limits), request.extensions().clone());
                Either::Left(Box::pin(async move {
                    let kept = within_share(&limits, &extensions, refused(foreign)).await;
                    // Without a share, the headers alone.
                    Ok(kept.unwrap_or_else(|| refused(foreign).map(|_| Body::empty())))
                }))
            }
        }
    }
}

/// The answer to a foreign request. gRPC clients read the status in its headers.
fn refused(foreign: Foreign) -> Response<Body> {
    let text = match foreign {
        Foreign::Origin => {
            "web pages of this origin may not use this server; its operator can allow it with --allow-origin"
        }
        Foreign::Host => {
            "this server is not known by this host name; its operator can allow it with --allow-host"
        }
    };
    let mut response = Response::new(Body::new(Text::from(text)));
    *response.status_mut() = StatusCode::FORBIDDEN;
    let headers = response.headers_mut();
    headers.insert(
        header::CONTENT_TYPE,
        HeaderValue::from_static("text/plain; charset=utf-8"),
    );
    headers.insert(
        HeaderName::from_static("grpc-status"),
        HeaderValue::from(i32::from(tonic::Code::PermissionDenied)),
    );
    headers.insert(
        HeaderName::from_static("grpc-message"),
        HeaderValue::from_static(text),
    );
    response
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use futures::FutureExt as _;
    use tower::{Layer as _, service_fn};

    use super::*;
    use chefshat_admission::limits::calls::CALLS_AT_ONCE;
    use chefshat_admission::limits::{Key, Shares};

    fn request(host: &str, origin: Option<&str>) -> Request<()> {
        let mut request = Request::post("/chefshat.v1.RoomService/CreateRoom").header("host", host);
        if let Some(origin) = origin {
            request = request.header("origin", origin);
        }
        request.body(()).expect("a request")
    }

    #[test]
    fn only_the_own_page_and_allowed_origins_call() {
        let listed = ["https://Example.org:443", "http://example.net:80"].map(str::to_owned);
        let some = Origins::new(&listed, None);
        assert_eq!(some.listed(), ["https://example.org", "http://example.net"]);
        let all = Origins::new(&["*".to_owned()], None);
        for (origin, allowed) in [
            (None, true),
            (Some("http://127.0.0.1:50051"), true),
            (Some("HTTP://127.0.0.1:50051"), false),
            (Some("https://127.0.0.1:50051"), true),
            (Some("https://example.org"), true),
            (Some("http://example.net"), true),
            (Some("http://example.org"), false),
            (Some("https://example.org.evil.net"), false),
            (Some("http://127.0.0.1:8080"), false),
            (Some("https://evil.net"), false),
            (Some("null"), false),
            (Some(""), false),
        ] {
            let request = request("127.0.0.1:50051", origin);
            assert_eq!(some.check(&request).is_ok(), allowed, "{origin:?}");
            assert_eq!(all.check(&request), Ok(()), "{origin:?}");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn questions_of_browsers_whether_they_may_call_count() {
        let limits = Arc::new(CallLimits::new(Shares::default()));
        let answer = service_fn(|_: Request<()>| {
            std::future::ready(Ok::<_, Infallible>(Response::new(Body::empty())))
        });
        let layer = OriginLayer::new(Origins::new(&[], None), Arc::clone(&limits));
        let mut services = layer.layer(answer);
        let mut ask = || {
            let request = Request::options("http://here/chefshat.v1.PlayService/Play").body(());
            services.call(request.expect("a request")).now_or_never()
        };
        let answered = (0..=CALLS_AT_ONCE).filter(|_| ask().is_some()).count() as u64;
        assert_eq!(answered, CALLS_AT_ONCE + 1);
        assert!(ask().is_none(), "it waits");
        assert!(!limits.wait(Key::Local).is_zero());
    }

    #[test]
    fn a_default_port_is_none() {
        let own = Origins::new(&[], None);
        for (host, origin, allowed) in [
            ("chef.example.org:443", "https://chef.example.org", true),
            ("chef.example.org:80", "http://chef.example.org", true),
            ("chef.example.org", "https://chef.example.org", true),
            ("chef.example.org:80", "https://chef.example.org", false),
            ("chef.example.org", "https://chef.example.org:8443", false),
            ("", "https://", false),
        ] {
            let request = request(host, Some(origin));
            assert_eq!(own.check(&request).is_ok(), allowed, "{host} {origin}");
        }
    }

    #[test]
    fn a_server_for_this_machine_has_only_names_of_this_machine() {
        let listed = vec!["chef.example.org".to_owned()];
        let here = Origins::new(&[], Some(listed));
        let anywhere = Origins::new(&[], None);
        for (host, allowed) in [
            ("localhost:50051", true),
            ("LOCALHOST", true),
            ("127.0.0.1:50051", true),
            ("[::1]:50051", true),
            ("chef.example.org:50051", true),
            ("evil.net:50051", false),
            ("localhost.evil.net", false),
            ("", false),
        ] {
            let request = request(host, None);
            assert_eq!(here.check(&request).is_ok(), allowed, "{host}");
            assert_eq!(anywhere.check(&request), Ok(()), "{host}");
        }
        // The page of another name that was bound to this address has that name as its origin.
        let rebound = request("evil.net:50051", Some("http://evil.net:50051"));
        assert_eq!(here.check(&rebound), Err(Foreign::Host));
        // HTTP/2 names the host in the URI.
        let uri = Request::post("http://evil.net/path").body(());
        assert_eq!(here.check(&uri.expect("a request")), Err(Foreign::Host));
    }
}
