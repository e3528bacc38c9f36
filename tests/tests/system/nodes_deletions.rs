//! Deleting a participant on one node of a cluster: the others refuse it while it plays there, and
//! remove it from their memory.

use std::path::{Path, PathBuf};

use chefshat_client::{Client, ConnectOptions, Connection};
use chefshat_proto::v1::{self, admin_service_client::AdminServiceClient};
use chefshat_server::access::{Mode, NewToken, Role, TokenFile};
use chefshat_tests::{TestNodes, patiently};
use tonic::Code;

use crate::records::reason;

/// Nodes open to all, and what the operator of the first one calls.
async fn operated(folder: &Path, count: usize) -> (TestNodes, AdminServiceClient<Connection>) {
    let new = NewToken {
        role: Role::Admin,
        label: String::new(),
        lifetime: None,
        scope: None,
    };
    let token = TokenFile::of(folder).create(new).expect("a token");
    let configure = |config: &mut chefshat_server::config::ServerConfig| {
        config.data_dir = Some(PathBuf::from(folder));
        config.access.mode = Some(Mode::Open);
    };
    let nodes = TestNodes::with(count, configure, None).await;
    let options = ConnectOptions {
        token: Some(token.to_text()),
        ca: None,
    };
    let client = Client::connect_with(&nodes.nodes[0].url(), &options).await;
    let operator = AdminServiceClient::new(client.expect("it listens").channel());
    (nodes, operator)
}

#[tokio::test]
async fn a_participant_is_deleted_from_the_memory_of_every_node() {
    let folder = tempfile::tempdir().expect("a folder");
    let (nodes, mut operator) = operated(folder.path(), 2).await;
    let created = nodes.create_room(1, v1::CreateRoomRequest::default()).await;
    let room = created.room.expect("a room").room_id;
    let owner = nodes.nodes[1].client().await;
    let joined = owner.join(v1::JoinRoomRequest {
        join_code: created.join_code,
        name: "Ada".into(),
        ..v1::JoinRoomRequest::default()
    });
    joined.await.expect("a seat");
    let mut delete = async || {
        let request = v1::DeleteParticipantRequest {
            name: "Ada".into(),
            ..v1::DeleteParticipantRequest::default()
        };
        patiently("an answer", operator.delete_participant(request)).await
    };
    // Only the other node knows that it has a seat.
    let refused = delete().await.expect_err("it plays");
    assert_eq!(reason(&refused), "PARTICIPANT_PLAYING");
    let closed = owner.close_room(&room, &created.owner_token).await;
    closed.expect("by its owner");
    let shown = owner
        .get_room(&room)
        .await
        .expect("shown until it is forgotten");
    assert!(shown.seats.iter().any(|seat| seat.name == "Ada"));

    nodes.link(0, 1).close();
    let refused = delete().await.expect_err("the other node does not know");
    assert_eq!(refused.code(), Code::Unavailable);
    assert_eq!(reason(&refused), "OWNER_UNREACHABLE");
    assert!(refused.message().contains("node 1"), "{refused}");
    assert!(
        owner.get_room(&room).await.is_ok(),
        "it still shows the name"
    );
}

#[tokio::test]
async fn a_deleted_participant_is_shown_by_no_node() {
    let folder = tempfile::tempdir().expect("a folder");
    let (nodes, mut operator) = operated(folder.path(), 3).await;
    let created = nodes.create_room(1, v1::CreateRoomRequest::default()).await;
    let room = created.room.expect("a room").room_id;
    let owner = nodes.nodes[1].client().await;
    let joined = owner.join(v1::JoinRoomRequest {
        join_code: created.join_code,
        name: "Ada".into(),
        ..v1::JoinRoomRequest::default()
    });
    joined.await.expect("a seat");
    let closed = owner.close_room(&room, &created.owner_token).await;
    closed.expect("by its owner");
    assert!(owner.get_room(&room).await.is_ok());
    let request = v1::DeleteParticipantRequest {
        name: "Ada".into(),
        ..v1::DeleteParticipantRequest::default()
    };
    let deleted = operator.delete_participant(request);
    patiently("an answer", deleted).await.expect("deleted");
    assert!(
        owner.get_room(&room).await.is_err(),
        "it is not shown any more"
    );
}
