//! Real receivers that fail, hang or cannot be reached.

use std::sync::atomic::{AtomicUsize, Ordering};

use axum::Router;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::routing::post;
use tokio::net::TcpListener;

use super::*;
use crate::post::Target;

const SECRET: &[u8] = b"a secret of the operator";
/// How long a test waits for something that must happen.
const PATIENCE: Duration = Duration::from_secs(120);

/// A receiver that refuses its first requests.
struct Receiver {
    refuses: AtomicUsize,
    received: mpsc::UnboundedSender<(HeaderMap, Bytes)>,
}

async fn receive(
    State(receiver): State<Arc<Receiver>>,
    headers: HeaderMap,
    body: Bytes,
) -> StatusCode {
    let sent = receiver.received.send((headers, body));
    sent.expect("the test waits");
    let left = |left: usize| left.checked_sub(1);
    let (set, fetch) = (Ordering::Relaxed, Ordering::Relaxed);
    match receiver.refuses.fetch_update(set, fetch, left) {
        Ok(_) => StatusCode::SERVICE_UNAVAILABLE,
        Err(_) => StatusCode::NO_CONTENT,
    }
}

type Received = mpsc::UnboundedReceiver<(HeaderMap, Bytes)>;

/// Starts a receiver. Returns its port and what it receives.
async fn receiver(refuses: usize) -> (u16, Received) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let port = listener.local_addr().expect("bound").port();
    let (received, requests) = mpsc::unbounded_channel();
    let receiver = Arc::new(Receiver {
        refuses: refuses.into(),
        received,
    });
    let router = Router::new()
        .route("/hooks/chefshat", post(receive))
        .with_state(receiver);
    tokio::spawn(async move { axum::serve(listener, router).await });
    (port, requests)
}

fn settings(port: u16) -> WebhookSettings {
    let url = format!("http://127.0.0.1:{port}/hooks/chefshat?from=test");
    let settings = WebhookSettings::new(&url, SECRET, None).expect("an address");
    settings.pausing(Duration::from_millis(1))
}

async fn next(requests: &mut Received) -> (HeaderMap, Bytes) {
    let next = tokio::time::timeout(PATIENCE, requests.recv()).await;
    next.expect("a request in time").expect("a request")
}

/// Checks the signature of a request as a receiver does.
fn check_signature(headers: &HeaderMap, body: &[u8]) {
    let header = headers["chefshat-signature"].to_str().expect("text");
    let (timestamp, code) = (header.strip_prefix("t="))
        .and_then(|rest| rest.split_once(",v1="))
        .expect("t=TIME,v1=CODE");
    let mut mac = Hmac::<Sha256>::new_from_slice(SECRET).expect("a key");
    mac.update(timestamp.as_bytes());
    mac.update(b".");
    mac.update(body);
    let code = hex::decode(code).expect("hexadecimal digits");
    mac.verify_slice(&code).expect("the right signature");
    let timestamp: u64 = timestamp.parse().expect("seconds");
    assert!(timestamp <= since_epoch().as_secs());
}

#[tokio::test]
async fn an_event_is_sent_until_it_is_received_and_signed_each_time() {
    let (port, mut requests) = receiver(2).await;
    let metrics = Arc::new(Metrics::default());
    let webhooks = Webhooks::new(settings(port), Arc::clone(&metrics));
    let closing = CancellationToken::new();
    let delivering = tokio::spawn(webhooks.clone().deliver(closing.clone()));
    let cup = Id::random();
    webhooks.tournament_started(cup, "Coppa", 8);
    webhooks.tournament_ended(cup, "Coppa", true);
    let mut seen = Vec::new();
    for _ in 0..4 {
        let (headers, body) = next(&mut requests).await;
        check_signature(&headers, &body);
        assert_eq!(headers["content-type"], "application/json");
        let event: Value = serde_json::from_slice(&body).expect("JSON");
        assert_eq!(
            headers["chefshat-delivery"],
            event["id"].as_str().expect("text")
        );
        assert_eq!(event["data"]["tournament_id"], cup.to_string());
        seen.push(event["type"].as_str().expect("text").to_owned());
    }
    let (started, ended) = ("tournament.started", "tournament.ended");
    assert_eq!(seen, [started, started, started, ended]);
    closing.cancel();
    delivering.await.expect("it ends");
    assert_eq!(metrics.webhooks(WebhookOutcome::Delivered), 2);
    assert_eq!(metrics.webhooks(WebhookOutcome::Failed), 0);
}

#[tokio::test]
async fn what_nobody_receives_is_given_up_and_what_has_no_space_is_dropped() {
    let (port, mut requests) = receiver(usize::MAX).await;
    let metrics = Arc::new(Metrics::default());
    let webhooks = Webhooks::new(settings(port), Arc::clone(&metrics));
    // Nothing is delivered yet.
    for _ in 0..MAX_WAITING + 3 {
        webhooks.tournament_started(Id::random(), "Coppa", 8);
    }
    assert_eq!(webhooks.waiting(), MAX_WAITING);
    assert_eq!(metrics.webhooks(WebhookOutcome::Dropped), 3);
    let closing = CancellationToken::new();
    let delivering = tokio::spawn(webhooks.clone().deliver(closing.clone()));
    let (first, _) = next(&mut requests).await;
    for _ in 1..MAX_ATTEMPTS {
        let (again, _) = next(&mut requests).await;
        assert_eq!(again["chefshat-delivery"], first["chefshat-delivery"]);
    }
    let (second, _) = next(&mut requests).await;
    assert_ne!(second["chefshat-delivery"], first["chefshat-delivery"]);
    assert_eq!(metrics.webhooks(WebhookOutcome::Failed), 1);
    closing.cancel();
    delivering.await.expect("it ends");
    assert_eq!(webhooks.waiting(), 0, "the rest was tried once more");
    let settled = metrics.webhooks(WebhookOutcome::Failed);
    assert_eq!(settled, u64::try_from(MAX_WAITING).expect("small"));
}

#[tokio::test]
async fn a_certificate_must_be_of_a_trusted_authority() {
    let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).expect("a pair");
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let key = rustls::pki_types::PrivateKeyDer::try_from(made.signing_key.serialize_der());
    let config = rustls::ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .expect("ring supports the default versions")
        .with_no_client_auth()
        .with_single_cert(vec![made.cert.der().clone()], key.expect("a key"))
        .expect("a pair");
    let acceptor = tokio_rustls::TlsAcceptor::from(Arc::new(config));
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let port = listener.local_addr().expect("bound").port();
    tokio::spawn(async move {
        loop {
            let (stream, _) = listener.accept().await.expect("a connection");
            let Ok(stream) = acceptor.accept(stream).await else {
                continue;
            };
            let service = hyper::service::service_fn(|_| async {
                Ok::<_, hyper::Error>(http::Response::new(String::new()))
            });
            let serving = hyper::server::conn::http1::Builder::new()
                .serve_connection(hyper_util::rt::TokioIo::new(stream), service);
            // The client closes the connection.
            let _ = serving.await;
        }
    });
    let folder = tempfile::tempdir().expect("a folder");
    let own = folder.path().join("own.pem");
    std::fs::write(&own, made.cert.pem()).expect("written");
    let other = rcgen::generate_simple_self_signed(["localhost".to_owned()]).expect("a pair");
    let others = folder.path().join("others.pem");
    std::fs::write(&others, other.cert.pem()).expect("written");
    let url = format!("https://localhost:{port}/");
    let post = async |ca: &std::path::Path| {
        let target = Target::new(&url, Some(ca)).expect("an address");
        let body = Bytes::from_static(b"{}");
        target.post(body, [], ANSWER_TIME, 1_000).await
    };
    post(&own).await.expect("received");
    let refused = post(&others).await.expect_err("not trusted");
    assert!(matches!(refused, PostError::Io(_)), "{refused:?}");
    for wrong in [
        "",
        "example.org",
        "ftp://example.org/",
        "https://",
        "http:///x",
    ] {
        let refused = Target::new(wrong, Some(&own)).expect_err(wrong);
        assert!(matches!(refused, PostError::Address(_)), "{wrong}");
    }
}
