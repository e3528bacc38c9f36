//! What an operator does with a running server, and what one caller may take of it.

use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;

use chefshat_client::{Client, ConnectOptions, Connection};
use chefshat_proto::v1::{
    self, admin_service_client::AdminServiceClient, room_service_client::RoomServiceClient,
    seat_config::FilledBy,
};
use chefshat_record::jsonl;
use chefshat_server::access::{NewToken, Role, TokenFile};
use chefshat_server::config::ServerConfig;
use chefshat_server::store::{MemoryStore, SqliteStore, Store};
use chefshat_tests::{StreamSeat, TestServer, one_shift, patiently, room_of_four};
use tonic::Code;
use tonic::transport::Endpoint;
use tonic_types::StatusExt as _;

use crate::records::reason;

/// A server open to all, and a token of its operator.
async fn operated(
    store: Arc<dyn Store>,
    configure: impl FnOnce(&mut ServerConfig),
) -> (TestServer, String) {
    let mut token = String::new();
    let server = TestServer::with(
        |config| {
            let folder = config.data_dir.as_ref().expect("a folder");
            let new = NewToken {
                role: Role::Admin,
                label: String::new(),
                lifetime: None,
                scope: None,
            };
            let created = TokenFile::of(folder).create(new).expect("a token");
            token = created.to_text();
            config.access.mode = Some(chefshat_server::access::Mode::Open);
            configure(config);
        },
        store,
    );
    (server.await, token)
}

async fn operator(server: &TestServer, token: String) -> AdminServiceClient<Connection> {
    let options = ConnectOptions {
        token: Some(token),
        ca: None,
    };
    let client = Client::connect_with(server.url(), &options).await;
    AdminServiceClient::new(client.expect("it listens").channel())
}

async fn clients(operator: &mut AdminServiceClient<Connection>) -> Vec<v1::ConnectedClient> {
    let listed = operator.list_clients(v1::ListClientsRequest::default());
    listed.await.expect("a list").into_inner().clients
}

#[tokio::test]
async fn an_operator_disconnects_clients_and_closes_rooms_of_others() {
    let (server, token) = operated(Arc::new(MemoryStore::default()), |_| {}).await;
    let host = server.client().await;
    let policy = v1::RoomPolicy::default();
    let (created, tickets) = room_of_four(&host, one_shift(), policy).await;
    let mut seat = StreamSeat::attached(server.channel().await, &tickets[0]).await;

    let mut stranger = AdminServiceClient::new(server.channel().await);
    let refused = stranger.list_clients(v1::ListClientsRequest::default());
    let refused = refused.await.expect_err("without a token");
    assert_eq!(refused.code(), Code::Unauthenticated);

    let mut operator = operator(&server, token.clone()).await;
    let listed = clients(&mut operator).await;
    let own = (listed.iter()).filter(|client| token.contains(&client.token_id));
    assert_eq!(own.filter(|client| !client.token_id.is_empty()).count(), 1);
    let playing: Vec<_> = listed.iter().filter(|client| client.streams > 0).collect();
    assert_eq!(playing.len(), 1, "{listed:?}");
    let request = v1::DisconnectClientRequest {
        client_id: playing[0].client_id,
    };
    let disconnected = operator.disconnect_client(request).await;
    disconnected.expect("a connected client");
    patiently("the stream to break", async {
        while seat
            .next_or_end()
            .await
            .is_ok_and(|update| update.is_some())
        {}
    })
    .await;
    patiently("the client to be gone", async {
        while clients(&mut operator).await.iter().any(|it| it.streams > 0) {
            tokio::task::yield_now().await;
        }
    })
    .await;
    let again = operator.disconnect_client(request).await;
    assert_eq!(reason(&again.expect_err("it is gone")), "CLIENT_UNKNOWN");

    let request = v1::AdminServiceCloseRoomRequest {
        room_id: created.room.expect("a room").room_id,
    };
    let closed = operator.close_room(request).await.expect("a room");
    let room = closed.into_inner().room.expect("the room");
    assert_eq!(room.state(), v1::RoomState::Aborted);
}

#[tokio::test]
async fn pruned_games_are_gone_with_their_records() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = SqliteStore::open(folder.path()).await.expect("a store");
    let (server, token) = operated(Arc::new(store), |_| {}).await;
    let client = server.client().await;
    let built_in = || v1::SeatConfig {
        filled_by: Some(FilledBy::BuiltInAgent("random".into())),
        ..v1::SeatConfig::default()
    };
    for _ in 0..20 {
        let request = v1::CreateRoomRequest {
            rules: Some(one_shift()),
            seats: (0..4).map(|_| built_in()).collect(),
            ..v1::CreateRoomRequest::default()
        };
        client.create_room(request).await.expect("a room");
    }
    let mut operator = operator(&server, token).await;
    let records = jsonl::folder_of(server.data_dir());
    let files = || std::fs::read_dir(&records).map_or(0, |files| files.count());
    patiently("the records", async {
        while files() < 20 {
            tokio::time::sleep(std::time::Duration::from_millis(5)).await;
        }
    })
    .await;
    let request = v1::PruneRecordsRequest::default();
    let refused = operator.prune_records(request).await;
    assert_eq!(reason(&refused.expect_err("no condition")), "PRUNE_REFUSED");
    let prune = v1::PruneRecordsRequest {
        keep: 3,
        ..v1::PruneRecordsRequest::default()
    };
    // A record is marked as written just after its file.
    patiently("old games to be deleted", async {
        while files() > 3 {
            operator.prune_records(prune).await.expect("deleted");
        }
    })
    .await;
    let listed = client.list_records(v1::ListRecordsRequest::default());
    let kept = listed.await.expect("a list").records;
    assert_eq!((kept.len(), files()), (3, 3));
    for summary in kept {
        client.record(summary.game_id).await.expect("a record");
    }
    let storage = operator.get_storage(v1::GetStorageRequest {}).await;
    let storage = storage.expect("figures").into_inner();
    assert_eq!((storage.finished_games, storage.record_files), (3, 3));
    assert!(storage.free_bytes > 0 && storage.record_bytes > 0);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let mode = |path: &std::path::Path| {
            let about = path.metadata().expect("it exists");
            about.permissions().mode() & 0o777
        };
        assert_eq!(mode(&records), 0o700);
        let file = std::fs::read_dir(&records).expect("a folder").next();
        assert_eq!(
            mode(&file.expect("a file").expect("readable").path()),
            0o600
        );
    }
}

#[tokio::test]
async fn one_address_cannot_take_all_rooms() {
    let configure = |config: &mut ServerConfig| config.max_rooms = 4;
    let server = TestServer::with(configure, Arc::new(MemoryStore::default())).await;
    let create = async |from: u8| {
        let address = IpAddr::V4(Ipv4Addr::new(127, 0, 0, from));
        let endpoint = Endpoint::from_shared(server.url()).expect("a URL");
        let channel = endpoint.local_address(Some(address)).connect().await;
        RoomServiceClient::new(channel.expect("it listens"))
            .create_room(v1::CreateRoomRequest::default())
            .await
    };
    for _ in 0..2 {
        create(1).await.expect("half of the rooms");
    }
    let refused = create(1).await.expect_err("its share is used up");
    assert_eq!(refused.code(), Code::ResourceExhausted);
    assert_eq!(reason(&refused), "TOO_MANY_ROOMS");
    let details = refused.get_error_details();
    let limit = details
        .error_info()
        .map(|info| info.metadata["limit"].clone());
    assert_eq!(limit.as_deref(), Some("2"));
    let retry = details.retry_info().and_then(|retry| retry.retry_delay);
    assert!(retry.is_some_and(|delay| !delay.is_zero()));
    create(2).await.expect("another address has its own share");
}
