//! What guards the way between nodes: certificates, who is charged for a call that another node
//! passed on, and what only a caller with a secret sees.

use std::path::Path;
use std::time::Duration;

use chefshat_proto::v1::{
    self, room_service_client::RoomServiceClient, seat_update::Update,
    spectator_service_client::SpectatorServiceClient,
};
use chefshat_server::config::ServerConfig;
use chefshat_server::peers::{PEER_NAME, PeerPort, PeerPortError};
use chefshat_server::proxies::TrustedProxies;
use chefshat_server::tls::TlsFiles;
use chefshat_tests::{StreamSeat, TestNodes};
use rcgen::{BasicConstraints, CertificateParams, IsCa, Issuer, KeyPair};
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Identity};
use tonic::{Code, Request};

use crate::records::reason;

/// An authority, and the files of a certificate that it has signed.
fn certified(folder: &Path, name: &str) -> TlsFiles {
    let key = KeyPair::generate().expect("a key");
    let mut authority = CertificateParams::new(Vec::new()).expect("no names");
    authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    let certificate = authority.self_signed(&key).expect("signed");
    let authority = Issuer::new(authority, key);
    let node_key = KeyPair::generate().expect("a key");
    let node = CertificateParams::new([PEER_NAME.to_owned()]).expect("a name");
    let node = node.signed_by(&node_key, &authority).expect("signed");
    let files = TlsFiles {
        certificate: folder.join(format!("{name}.pem")),
        key: folder.join(format!("{name}.key")),
        client_authority: Some(folder.join(format!("{name}-authority.pem"))),
    };
    std::fs::write(&files.certificate, node.pem()).expect("written");
    std::fs::write(&files.key, node_key.serialize_pem()).expect("written");
    let path = files.client_authority.as_ref().expect("just set");
    std::fs::write(path, certificate.pem()).expect("written");
    files
}

/// Whether a connection to a node's listener for other nodes can be used, with these certificates.
async fn connects(nodes: &TestNodes, trusted: &TlsFiles, own: Option<&TlsFiles>) -> bool {
    let read = |path: &Path| std::fs::read(path).expect("a file");
    let authority = read(trusted.client_authority.as_ref().expect("an authority"));
    let mut tls = ClientTlsConfig::new()
        .ca_certificate(Certificate::from_pem(authority))
        .domain_name(PEER_NAME);
    if let Some(own) = own {
        tls = tls.identity(Identity::from_pem(read(&own.certificate), read(&own.key)));
    }
    let url = format!("https://{}", nodes.nodes[0].peer_address);
    let channel = Channel::from_shared(url).expect("a URL");
    let channel = channel.tls_config(tls).expect("usable").connect().await;
    let Ok(channel) = channel else { return false };
    lists_rooms(channel).await
}

async fn lists_rooms(channel: Channel) -> bool {
    let mut service = RoomServiceClient::new(channel);
    let listed = service.list_rooms(v1::ListRoomsRequest::default());
    listed.await.is_ok()
}

#[tokio::test]
async fn only_nodes_with_a_certificate_of_the_clusters_authority_connect() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = certified(folder.path(), "node");
    let strange = certified(folder.path(), "stranger");
    let nodes = TestNodes::with(2, |_| {}, Some(files.clone())).await;
    let created = nodes.create_room(1, v1::CreateRoomRequest::default()).await;
    let room = created.room.expect("a room").room_id;
    let client = nodes.nodes[0].client().await;
    assert_eq!(client.get_room(&room).await.expect("found").room_id, room);
    assert!(connects(&nodes, &files, Some(&files)).await);
    assert!(
        !connects(&nodes, &files, None).await,
        "without a certificate"
    );
    assert!(
        !connects(&nodes, &files, Some(&strange)).await,
        "of another authority"
    );
    let plain = format!("http://{}", nodes.nodes[0].peer_address);
    let plain = Channel::from_shared(plain).expect("a URL").connect().await;
    if let Ok(channel) = plain {
        assert!(!lists_rooms(channel).await, "not encrypted");
    }
}

#[tokio::test]
async fn nodes_without_certificates_stay_on_one_machine() {
    let listen = async |address| {
        tokio::net::TcpListener::bind((address, 0))
            .await
            .expect("free")
    };
    let open = PeerPort::new(listen("0.0.0.0").await, None);
    assert!(matches!(open, Err(PeerPortError::NotEncrypted(_))));
    assert!(PeerPort::new(listen("127.0.0.1").await, None).is_ok());
    let folder = tempfile::tempdir().expect("a folder");
    let files = TlsFiles {
        client_authority: None,
        ..certified(folder.path(), "node")
    };
    let open = PeerPort::new(listen("127.0.0.1").await, Some(files));
    assert!(matches!(open, Err(PeerPortError::NoAuthority)));
}

#[tokio::test]
async fn a_call_is_charged_to_its_client_and_not_to_the_node_that_passed_it_on() {
    let behind_proxy = |config: &mut ServerConfig| {
        let proxy = "127.0.0.1".parse().expect("an address");
        config.trusted_proxies = TrustedProxies::new([proxy]);
    };
    let nodes = TestNodes::with(2, behind_proxy, None).await;
    let created = nodes.create_room(1, v1::CreateRoomRequest::default()).await;
    let room_id = created.room.expect("a room").room_id;
    let channel = nodes.nodes[0].client().await.channel();
    let guess = async |client: &str| {
        let mut request = Request::new(v1::JoinRoomRequest {
            room_id: room_id.clone(),
            join_code: "BCDF2345".into(),
            name: "somebody".into(),
            ..v1::JoinRoomRequest::default()
        });
        let client = client.parse().expect("an address");
        request.metadata_mut().insert("x-forwarded-for", client);
        let refused = RoomServiceClient::new(channel.clone())
            .join_room(request)
            .await;
        reason(&refused.expect_err("a wrong code"))
    };
    // The owner counts the wrong codes of each client.
    let mut last = String::new();
    for _ in 0..1_000 {
        last = guess("198.51.100.7").await;
        if last != "JOIN_CODE_WRONG" {
            break;
        }
    }
    assert_eq!(last, "TOO_MANY_WRONG_CODES");
    assert_eq!(guess("203.0.113.9").await, "JOIN_CODE_WRONG");
    // What a client says of itself counts at no node. It may guess again once a second.
    let mut refused = 0;
    for _ in 0..10 {
        let last = guess("203.0.113.9, 198.51.100.7").await;
        refused += u32::from(last == "TOO_MANY_WRONG_CODES");
    }
    assert!(refused > 0);
}

#[tokio::test]
async fn a_private_room_of_another_node_is_shown_to_those_with_its_secrets() {
    let nodes = TestNodes::start(2).await;
    let private = v1::CreateRoomRequest {
        policy: Some(v1::RoomPolicy {
            visibility: v1::Visibility::Private.into(),
            ..v1::RoomPolicy::default()
        }),
        ..v1::CreateRoomRequest::default()
    };
    let created = nodes.create_room(1, private).await;
    let room = created.room.expect("a room").room_id;
    let stranger = nodes.nodes[0].client().await;
    let unknown = stranger.get_room(&room).await.expect_err("private");
    assert_eq!(unknown.code(), Code::NotFound);
    assert_eq!(unknown.reason(), Some("ROOM_UNKNOWN"));
    let owner = stranger
        .with_secrets([&created.owner_token])
        .expect("a secret");
    assert_eq!(owner.get_room(&room).await.expect("its own").room_id, room);
    let joined = stranger.join_with_code(&created.join_code, "Ada").await;
    let ticket = joined.expect("it has the code").ticket;
    let seated = stranger.with_secrets([&ticket]).expect("a secret");
    assert_eq!(seated.get_room(&room).await.expect("its own").room_id, room);
}

#[tokio::test]
async fn calls_that_clients_cancel_leave_the_connection_between_nodes_as_it_is() {
    let nodes = TestNodes::start(2).await;
    let created = nodes.create_room(1, v1::CreateRoomRequest::default()).await;
    let room_id = created.room.expect("a room").room_id;
    let client = nodes.nodes[0].client().await;
    let joined = client.join_with_code(&created.join_code, "Ada").await;
    let ticket = joined.expect("a seat").ticket;
    let mut seat = StreamSeat::attached(client.channel(), &ticket).await;
    let others = nodes.nodes[0].client().await;
    for _ in 0..50 {
        let watching = (0..40).map(|_| {
            let (mut service, room_id) = (
                SpectatorServiceClient::new(others.channel()),
                room_id.clone(),
            );
            async move {
                let watch = v1::SpectatorServiceWatchRequest {
                    room_id,
                    ..v1::SpectatorServiceWatchRequest::default()
                };
                let _ = service.watch(watch).await;
            }
        });
        // Some are cancelled before they are answered, others while they are.
        let watching = futures::future::join_all(watching);
        let _ = tokio::time::timeout(Duration::from_millis(3), watching).await;
    }
    seat.send(v1::seat_command::Command::Detach(v1::Detach {}))
        .await;
    match seat.next().await {
        Update::Detached(detached) => {
            assert_eq!(detached.reason(), v1::DetachReason::Requested);
        }
        other => panic!("not detached, but {other:?}"),
    }
}
