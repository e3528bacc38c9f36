//! Rooms that one node has another one create, while the two are cut off from each other.

use std::cell::Cell;
use std::time::Duration;

use chefshat_client::Client;
use chefshat_proto::v1::{self, room_service_client::RoomServiceClient};
use chefshat_tests::{Held, patiently};

use crate::cluster::{Cluster, Leases};

/// Most rooms of the node that is asked, so few that it soon has more than its share.
const MAX_ROOMS: usize = 40;
const LOOK_AGAIN: Duration = Duration::from_millis(50);

async fn create_room(client: &Client, durability: v1::Durability) -> String {
    let request = v1::CreateRoomRequest {
        policy: Some(v1::RoomPolicy {
            durability: durability.into(),
            ..v1::RoomPolicy::default()
        }),
        ..v1::CreateRoomRequest::default()
    };
    let created = client.create_room(request).await.expect("a room");
    created.room.expect("a room").room_id
}

/// Two nodes, the first of which has everything that is new created by the second. It has more than its
/// share of rooms, and cannot hand them over.
async fn unequal() -> Cluster {
    let is_first = Cell::new(true);
    let cluster = Cluster::start_with(2, Leases::Steady, |launch| match is_first.take() {
        true => launch.with("--max-rooms", MAX_ROOMS),
        false => launch,
    })
    .await;
    let client = cluster.nodes[0].client().await;
    let passed_on = async {
        while cluster.owner_of(&create_room(&client, v1::Durability::Ephemeral).await) == 0 {}
    };
    patiently("a room of the other node", passed_on).await;
    cluster
}

/// The durable rooms.
fn durable(cluster: &Cluster) -> String {
    cluster.select("SELECT count(*) FROM owned WHERE durable")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_room_that_a_node_cut_off_is_to_create_is_created_by_another() {
    let cluster = unequal().await;
    cluster.separate(0, 1);
    // The client itself would ask again for a while.
    let mut rooms = RoomServiceClient::new(cluster.nodes[0].client().await.channel());
    let created = patiently(
        "a room",
        rooms.create_room(v1::CreateRoomRequest::default()),
    )
    .await;
    let room = created.expect("no error").into_inner().room.expect("one");
    cluster.join(0, 1);
    assert_eq!(cluster.owner_of(&room.room_id), 0);
    assert_eq!(durable(&cluster), "1");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_room_whose_creation_is_not_answered_is_created_once() {
    let cluster = unequal().await;
    cluster.way(0, 1).hold(Held::Answers);
    let client = cluster.nodes[0].client().await;
    let creating = tokio::spawn(async move { create_room(&client, v1::Durability::Durable).await });
    let created = async {
        while durable(&cluster) == "0" {
            tokio::time::sleep(LOOK_AGAIN).await;
        }
    };
    patiently("a room", created).await;
    cluster.join(0, 1);
    let room = patiently("an answer", creating).await.expect("no panic");
    assert_eq!(cluster.owner_of(&room), 1);
    assert_eq!(durable(&cluster), "1");
}
