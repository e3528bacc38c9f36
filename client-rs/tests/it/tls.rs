//! Connecting with TLS and a token, and connections that go silent.

use std::io::Write as _;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};

use chefshat_client::v1::server_service_server::{ServerService, ServerServiceServer};
use chefshat_client::{Client, ConnectOptions, Error, PlayError, RandomAgent, v1};
use tempfile::NamedTempFile;
use tokio::net::{TcpListener, TcpStream};
use tokio_stream::wrappers::TcpListenerStream;
use tonic::transport::{Identity, Server, ServerTlsConfig};
use tonic::{Code, Request, Response, Status};
use tonic_types::{ErrorDetails, StatusExt as _};

use crate::fake::{Fake, Line, connect, listen};
use crate::play::{ends, quick};

const TOKEN: &str = "chefshat_0badcafe_c2VjcmV0";

/// Says who calls, and refuses the calls without the token.
#[derive(Clone, Default)]
struct Guarded {
    calls: Arc<AtomicU32>,
    seen: Arc<Mutex<Option<String>>>,
}

impl Guarded {
    /// Refuses a call unless it has the token.
    fn check(&self, request: Request<()>) -> Result<Request<()>, Status> {
        self.calls.fetch_add(1, Ordering::Relaxed);
        let header = request.metadata().get("authorization");
        let header = header.map(|value| value.to_str().unwrap().to_owned());
        self.seen.lock().unwrap().clone_from(&header);
        if header == Some(format!("Bearer {TOKEN}")) {
            return Ok(request);
        }
        let details = ErrorDetails::with_error_info("TOKEN_MISSING", "chefshat", []);
        Err(Status::with_error_details(
            Code::Unauthenticated,
            "a token is needed",
            details,
        ))
    }
}

impl ServerService for Guarded {
    async fn get_server_info(
        &self,
        _request: Request<v1::GetServerInfoRequest>,
    ) -> Result<Response<v1::GetServerInfoResponse>, Status> {
        Ok(Response::new(v1::GetServerInfoResponse::default()))
    }

    async fn get_action_table(
        &self,
        _request: Request<v1::GetActionTableRequest>,
    ) -> Result<Response<v1::GetActionTableResponse>, Status> {
        Err(Status::unimplemented("not in this play"))
    }

    async fn get_clock(
        &self,
        _request: Request<v1::GetClockRequest>,
    ) -> Result<Response<v1::GetClockResponse>, Status> {
        Err(Status::unimplemented("not in this play"))
    }
}

/// A server with TLS that wants a token, and the certificate that vouches for it.
async fn serve_tls(guarded: Guarded, fake: Fake) -> (SocketAddr, NamedTempFile) {
    let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    let certificate = made.cert.pem();
    let mut file = NamedTempFile::new().unwrap();
    file.write_all(certificate.as_bytes()).unwrap();
    let identity = Identity::from_pem(certificate, made.signing_key.serialize_pem());
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let mut server = Server::builder()
        .tls_config(ServerTlsConfig::new().identity(identity))
        .unwrap();
    let guard = guarded.clone();
    let play = v1::play_service_server::PlayServiceServer::with_interceptor(
        fake,
        move |request: Request<()>| guard.check(request),
    );
    let guard = guarded.clone();
    let info = ServerServiceServer::with_interceptor(guarded, move |request: Request<()>| {
        guard.check(request)
    });
    let served = server
        .add_service(play)
        .add_service(info)
        .serve_with_incoming(TcpListenerStream::new(listener));
    tokio::spawn(served);
    (address, file)
}

fn options(token: Option<&str>, ca: Option<&NamedTempFile>) -> ConnectOptions {
    ConnectOptions {
        token: token.map(str::to_owned),
        ca: ca.map(|file| file.path().to_owned()),
    }
}

async fn failed(url: &str, options: ConnectOptions) -> Error {
    let connected = Client::connect_with(url, &options).await;
    connected.expect_err("not connected")
}

#[tokio::test]
async fn a_game_is_played_over_tls_with_a_token() {
    let fake = Fake::default();
    fake.play(async |mut line: Line| {
        line.attaches().await;
        ends(line, &[0], 1).await;
    });
    let guarded = Guarded::default();
    let (address, ca) = serve_tls(guarded.clone(), fake).await;
    let url = format!("https://localhost:{}", address.port());
    let connect_options = options(Some(TOKEN), Some(&ca));
    let client = Client::connect_with(&url, &connect_options).await.unwrap();
    client.server_info().await.unwrap();
    assert_eq!(
        guarded.seen.lock().unwrap().as_deref(),
        Some(format!("Bearer {TOKEN}").as_str())
    );
    let options = quick();
    let outcome = client.play_with("ticket", RandomAgent::new(1), &options);
    assert_eq!(outcome.await.unwrap().standings().len(), 1);
    let shown = format!("{client:?} {connect_options:?}");
    assert!(!shown.contains("chefshat_"), "{shown}");
}

#[tokio::test]
async fn a_refused_token_is_not_sent_again() {
    let guarded = Guarded::default();
    let (address, ca) = serve_tls(guarded.clone(), Fake::default()).await;
    let url = format!("https://localhost:{}", address.port());
    let client = Client::connect_with(&url, &options(None, Some(&ca)))
        .await
        .unwrap();
    let options = quick();
    let played = client.play_with("ticket", RandomAgent::new(1), &options);
    let Err(PlayError::Refused(error)) = played.await else {
        panic!("it was not refused");
    };
    assert_eq!(error.code(), Code::Unauthenticated);
    assert_eq!(error.reason(), Some("TOKEN_MISSING"));
    assert!(error.message().contains("CHEFSHAT_TOKEN"), "{error}");
    assert_eq!(guarded.calls.load(Ordering::Relaxed), 1);
}

#[tokio::test]
async fn servers_that_cannot_be_trusted_are_reported() {
    let (address, ca) = serve_tls(Guarded::default(), Fake::default()).await;
    let url = format!("https://localhost:{}", address.port());
    let fake = Fake::default();
    let plain = listen();
    let to_plain = format!("https://localhost:{}", plain.local_addr().unwrap().port());
    tokio::spawn(fake.serve(plain));
    let empty = NamedTempFile::new().unwrap();
    let table = [
        (url.as_str(), options(None, None), "TLS_FAILED"),
        (to_plain.as_str(), options(None, Some(&ca)), "TLS_FAILED"),
        (url.as_str(), options(None, Some(&empty)), "CA_REFUSED"),
        (
            url.as_str(),
            options(Some("a\nb"), Some(&ca)),
            "TOKEN_REFUSED",
        ),
    ];
    for (url, options, reason) in table {
        let error = failed(url, options).await;
        assert_eq!(error.reason(), Some(reason), "{url}: {error}");
    }
}

/// Forwards connections to a server. The first goes silent after `silence` is notified: it stays
/// open, but forwards nothing more.
async fn silent_relay(server: SocketAddr, silence: Arc<tokio::sync::Notify>) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async move {
        let (mut first, _) = listener.accept().await.unwrap();
        let mut onward = TcpStream::connect(server).await.unwrap();
        tokio::select! {
            _ = tokio::io::copy_bidirectional(&mut first, &mut onward) => {}
            () = silence.notified() => {}
        }
        loop {
            let (mut next, _) = listener.accept().await.unwrap();
            let mut onward = TcpStream::connect(server).await.unwrap();
            tokio::spawn(
                async move { tokio::io::copy_bidirectional(&mut next, &mut onward).await },
            );
        }
    });
    address
}

#[tokio::test]
async fn a_connection_that_goes_silent_is_replaced() {
    let silence = Arc::new(tokio::sync::Notify::new());
    let fake = Fake::default();
    let attached = Arc::clone(&silence);
    fake.play(async move |mut line: Line| {
        line.attaches().await;
        attached.notify_one();
        // Open for as long as the test runs.
        std::future::pending::<()>().await;
    });
    fake.play(async |mut line: Line| {
        line.attaches().await;
        ends(line, &[0], 1).await;
    });
    let listener = listen();
    let server = listener.local_addr().unwrap();
    tokio::spawn(fake.clone().serve(listener));
    let client = connect(silent_relay(server, silence).await).await;
    let options = quick();
    let played = client.play_with("ticket", RandomAgent::new(1), &options);
    played.await.unwrap();
    assert!(fake.is_done());
}
