//! Real receivers that fail, hang or cannot be reached.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use axum::Router;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::routing::post;
use bytes::Bytes;
use hmac::{Hmac, KeyInit as _, Mac as _};
use sha2::Sha256;
use tokio::net::TcpListener;

use super::*;
use chefshat_base::post::{PostError, Target};

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
    assert!(timestamp <= since_epoch_ms() / 1_000);
}

#[tokio::test]
async fn an_event_is_sent_until_it_is_received_and_signed_each_time() {
    let (port, mut requests) = receiver(2).await;
    let metrics = Arc::new(Metrics::default());
    let webhooks = Webhooks::new(settings(port), Arc::clone(&metrics));
    let closing = CancellationToken::new();
    let delivering = tokio::spawn(webhooks.clone().deliver(closing.clone()));
    let cup = TournamentId::random();
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
    assert_eq!(seen, [started, started, started, ended], "in order");
    closing.cancel();
    delivering.await.expect("it ends");
    assert_eq!(metrics.webhooks(WebhookOutcome::Delivered), 2);
    assert_eq!(metrics.webhooks(WebhookOutcome::Failed), 0);
}

#[tokio::test]
async fn what_has_no_space_is_dropped_and_what_waits_at_the_end_is_tried_once_more() {
    let (port, mut requests) = receiver(usize::MAX).await;
    let metrics = Arc::new(Metrics::default());
    let webhooks = Webhooks::new(settings(port), Arc::clone(&metrics));
    // Nothing is delivered yet.
    for _ in 0..MAX_WAITING + 3 {
        webhooks.tournament_started(TournamentId::random(), "Coppa", 8);
    }
    assert_eq!(webhooks.waiting(), MAX_WAITING);
    assert_eq!(metrics.webhooks(WebhookOutcome::Dropped), 3);
    let closing = CancellationToken::new();
    let delivering = tokio::spawn(webhooks.clone().deliver(closing.clone()));
    let id = |(headers, _): (HeaderMap, Bytes)| headers["chefshat-delivery"].clone();
    let first = id(next(&mut requests).await);
    assert_ne!(
        id(next(&mut requests).await),
        first,
        "another comes before it is sent again"
    );
    closing.cancel();
    delivering.await.expect("it ends");
    assert_eq!(webhooks.waiting(), 0, "the rest was tried once more");
    let settled = metrics.webhooks(WebhookOutcome::Failed);
    assert_eq!(settled, u64::try_from(MAX_WAITING).expect("small"));
}

#[tokio::test]
async fn what_is_not_received_in_any_attempt_is_given_up() {
    let (port, mut requests) = receiver(usize::MAX).await;
    let metrics = Arc::new(Metrics::default());
    let webhooks = Webhooks::new(settings(port), Arc::clone(&metrics));
    let closing = CancellationToken::new();
    webhooks.tournament_started(TournamentId::random(), "Coppa", 8);
    let delivering = tokio::spawn(webhooks.clone().deliver(closing.clone()));
    for _ in 0..MAX_ATTEMPTS {
        assert_eq!(names(&mut requests, 1).await, ["Coppa"]);
    }
    while webhooks.waiting() > 0 {
        tokio::task::yield_now().await;
    }
    closing.cancel();
    delivering.await.expect("it ends");
    assert_eq!(metrics.webhooks(WebhookOutcome::Failed), 1);
    assert!(requests.try_recv().is_err(), "it is not sent any more");
}

/// Answers requests whose body contains a text with this status, and others with 204.
async fn picky(text: &'static str, status: StatusCode) -> (u16, Received) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let port = listener.local_addr().expect("bound").port();
    let (received, requests) = mpsc::unbounded_channel();
    let answer = async move |headers: HeaderMap, body: Bytes| {
        let is_it = String::from_utf8_lossy(&body).contains(text);
        received.send((headers, body)).expect("the test waits");
        match is_it {
            true => status,
            false => StatusCode::NO_CONTENT,
        }
    };
    let router = Router::new().route("/hooks/chefshat", post(answer));
    tokio::spawn(async move { axum::serve(listener, router).await });
    (port, requests)
}

/// The names of tournaments in requests, in order.
async fn names(requests: &mut Received, count: usize) -> Vec<String> {
    let mut names = Vec::new();
    for _ in 0..count {
        let (_, body) = next(requests).await;
        let event: Value = serde_json::from_slice(&body).expect("JSON");
        names.push(event["data"]["name"].as_str().expect("text").to_owned());
    }
    names
}

#[tokio::test]
async fn a_refused_event_is_not_repeated_and_delays_nothing() {
    for status in [400, 401, 404, 410, 422] {
        let status = StatusCode::from_u16(status).expect("a status");
        let (port, mut requests) = picky("Refused", status).await;
        let metrics = Arc::new(Metrics::default());
        // Whatever is repeated waits for longer than the test.
        let patient = settings(port).pausing(PATIENCE * 10);
        let webhooks = Webhooks::new(patient, Arc::clone(&metrics));
        let closing = CancellationToken::new();
        let cup = TournamentId::random();
        webhooks.tournament_started(cup, "Refused", 8);
        webhooks.tournament_ended(cup, "Next of it", true);
        webhooks.tournament_started(TournamentId::random(), "Other", 8);
        let delivering = tokio::spawn(webhooks.clone().deliver(closing.clone()));
        let sent = names(&mut requests, 3).await;
        assert_eq!(sent, ["Refused", "Other", "Next of it"], "{status}");
        closing.cancel();
        delivering.await.expect("it ends");
        assert_eq!(metrics.webhooks(WebhookOutcome::Refused), 1, "{status}");
        assert_eq!(webhooks.waiting(), 0);
    }
}

#[tokio::test]
async fn an_event_that_is_sent_again_is_overtaken_by_others_and_not_by_the_next_of_its_tournament()
{
    for status in [408, 425, 429, 500, 503] {
        let status = StatusCode::from_u16(status).expect("a status");
        let (port, mut requests) = picky("Failing", status).await;
        let metrics = Arc::new(Metrics::default());
        let webhooks = Webhooks::new(settings(port), Arc::clone(&metrics));
        let closing = CancellationToken::new();
        let cup = TournamentId::random();
        webhooks.tournament_started(cup, "Failing", 8);
        webhooks.tournament_ended(cup, "Next of it", true);
        for other in ["One", "Two", "Three"] {
            webhooks.tournament_started(TournamentId::random(), other, 8);
        }
        let delivering = tokio::spawn(webhooks.clone().deliver(closing.clone()));
        let sent = names(&mut requests, 4).await;
        assert_eq!(sent, ["Failing", "One", "Two", "Three"], "{status}");
        let again = usize::try_from(MAX_ATTEMPTS).expect("few") - 1;
        let sent = names(&mut requests, again + 1).await;
        assert!(
            sent[..again].iter().all(|name| name == "Failing"),
            "{sent:?}"
        );
        assert_eq!(sent[again], "Next of it", "{status}");
        closing.cancel();
        delivering.await.expect("it ends");
        assert_eq!(metrics.webhooks(WebhookOutcome::Failed), 1, "{status}");
    }
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
        assert!(matches!(refused, PostError::Address), "{wrong}");
    }
}
