//! TLS over real sockets: a certificate that is replaced while a stream is open, files that cannot
//! be used, handshakes that stall, and clients with certificates.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use chefshat_client::{Client, ConnectOptions};
use chefshat_proto::v1::{self, spectator_service_client::SpectatorServiceClient};
use chefshat_server::config::ServerConfig;
use chefshat_server::store::MemoryStore;
use chefshat_server::tls::TlsFiles;
use chefshat_tests::{TestServer, patiently};
use tempfile::TempDir;
use tokio::net::TcpStream;
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Identity};

/// A self-signed certificate with its key, PEM.
struct Pair {
    certificate: String,
    key: String,
}

impl Pair {
    fn new() -> Self {
        let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).expect("a name");
        Self {
            certificate: made.cert.pem(),
            key: made.signing_key.serialize_pem(),
        }
    }

    /// Writes the files of a server; the key first, as a program that renews it may.
    fn write(&self, files: &TlsFiles) {
        std::fs::write(&files.key, &self.key).expect("written");
        std::fs::write(&files.certificate, &self.certificate).expect("written");
    }

    /// The certificate as the file of an authority.
    fn authority(&self, folder: &Path, name: &str) -> PathBuf {
        let path = folder.join(name);
        std::fs::write(&path, &self.certificate).expect("written");
        path
    }
}

fn files(folder: &TempDir) -> TlsFiles {
    TlsFiles {
        certificate: folder.path().join("cert.pem"),
        key: folder.path().join("key.pem"),
        client_authority: None,
    }
}

async fn serve(files: &TlsFiles) -> TestServer {
    let encrypted = |config: &mut ServerConfig| config.tls = Some(files.clone());
    TestServer::with(encrypted, Arc::new(MemoryStore::default())).await
}

fn url(server: &TestServer) -> String {
    format!("https://localhost:{}", server.address.port())
}

async fn connected(server: &TestServer, ca: &Path) -> Result<Client, chefshat_client::Error> {
    let options = ConnectOptions {
        token: None,
        ca: Some(ca.to_path_buf()),
    };
    Client::connect_with(url(server), &options).await
}

#[tokio::test]
async fn a_certificate_is_replaced_while_a_stream_is_open() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = files(&folder);
    let (old, new) = (Pair::new(), Pair::new());
    let old_authority = old.authority(folder.path(), "old.pem");
    let new_authority = new.authority(folder.path(), "new.pem");
    old.write(&files);
    let server = serve(&files).await;
    let client = connected(&server, &old_authority).await.expect("trusted");
    let created = client
        .create_room(v1::CreateRoomRequest::default())
        .await
        .expect("a room");
    let room_id = created.room.expect("a room").room_id;
    let request = v1::SpectatorServiceWatchRequest {
        room_id: room_id.clone(),
        ..v1::SpectatorServiceWatchRequest::default()
    };
    let watching = SpectatorServiceClient::new(client.channel())
        .watch(request)
        .await;
    let mut stream = watching.expect("a stream").into_inner();

    // Between the two writes the files do not fit together, which changes nothing.
    new.write(&files);
    let replaced = async {
        while connected(&server, &new_authority).await.is_err() {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    patiently("the new certificate", replaced).await;
    assert!(connected(&server, &old_authority).await.is_err());

    client
        .close_room(&room_id, &created.owner_token)
        .await
        .expect("the old connection works");
    let end = async {
        loop {
            let message = stream.message().await.expect("no error");
            if message
                .expect("the end of the game comes first")
                .events
                .is_empty()
            {
                continue;
            }
            break;
        }
    };
    patiently("the stream to continue", end).await;
}

#[tokio::test]
async fn a_handshake_that_stalls_delays_nobody() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = files(&folder);
    let pair = Pair::new();
    pair.write(&files);
    let server = serve(&files).await;
    let mut stalled = Vec::new();
    for _ in 0..20 {
        stalled.push(
            TcpStream::connect(server.address)
                .await
                .expect("it listens"),
        );
    }
    let authority = pair.authority(folder.path(), "ca.pem");
    connected(&server, &authority).await.expect("a connection");
    drop(stalled);
}

#[tokio::test]
async fn only_clients_with_a_certificate_are_admitted_where_one_is_required() {
    let folder = tempfile::tempdir().expect("a folder");
    let (pair, visitor) = (Pair::new(), Pair::new());
    let files = TlsFiles {
        client_authority: Some(visitor.authority(folder.path(), "clients.pem")),
        ..files(&folder)
    };
    pair.write(&files);
    let server = serve(&files).await;
    let call = |identity: Option<Identity>| {
        let ca = Certificate::from_pem(&pair.certificate);
        let mut tls = ClientTlsConfig::new()
            .ca_certificate(ca)
            .domain_name("localhost");
        if let Some(identity) = identity {
            tls = tls.identity(identity);
        }
        let channel = Channel::from_shared(url(&server)).expect("a URL");
        let channel = channel
            .tls_config(tls)
            .expect("a certificate")
            .connect_lazy();
        async move {
            let mut client = v1::server_service_client::ServerServiceClient::new(channel);
            client.get_server_info(v1::GetServerInfoRequest {}).await
        }
    };
    call(None).await.expect_err("no certificate");
    let stranger = Pair::new();
    let stranger = Identity::from_pem(&stranger.certificate, &stranger.key);
    call(Some(stranger))
        .await
        .expect_err("of another authority");
    let known = Identity::from_pem(&visitor.certificate, &visitor.key);
    call(Some(known)).await.expect("a known certificate");
}

#[test]
fn files_that_cannot_be_used_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = files(&folder);
    let refused = |problem: &str| {
        let error = chefshat_server::tls::Tls::open(files.clone()).expect_err("unusable");
        assert!(error.to_string().contains(problem), "{error}");
    };
    refused("cert.pem");
    let (one, other) = (Pair::new(), Pair::new());
    std::fs::write(&files.certificate, "nothing").expect("written");
    std::fs::write(&files.key, &one.key).expect("written");
    refused("it has no certificate in PEM");
    std::fs::write(&files.certificate, &other.certificate).expect("written");
    refused("with its key");
    std::fs::write(&files.key, "nothing").expect("written");
    refused("key.pem");
}
