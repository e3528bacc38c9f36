//! A node that the others do not reach when it joins takes nothing until they do.

use std::time::Duration;

use chefshat_client::Client;
use chefshat_proto::v1::{self, room_service_client::RoomServiceClient};
use chefshat_tests::patiently;
use tonic_health::pb::health_check_response::ServingStatus;

use crate::cluster::{Cluster, Leases};

const ROOMS: usize = 8;
const LOOK_AGAIN: Duration = Duration::from_millis(100);

async fn create_room(client: &Client) -> Result<String, chefshat_client::Error> {
    let created = client.create_room(v1::CreateRoomRequest::default()).await?;
    Ok(created.room.expect("a room").room_id)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_node_that_no_other_reaches_takes_no_rooms() {
    let mut cluster = Cluster::start(3, Leases::Steady).await;
    let reached = |cluster: &Cluster, node| cluster.select_of("reached", node);
    cluster.stop(1).await;
    cluster.hide(1);
    cluster.restart(1).await;
    let hidden = cluster.nodes[1].client().await;
    // The client itself would ask again for a while.
    let mut rooms = RoomServiceClient::new(hidden.channel());
    let refused = rooms.create_room(v1::CreateRoomRequest::default()).await;
    let refused = chefshat_client::Error::from(refused.expect_err("it is not reached"));
    assert_eq!(refused.reason(), Some("NODE_NOT_REACHED"), "{refused}");
    assert_eq!(cluster.nodes[1].health().await, ServingStatus::NotServing);
    let warned = async {
        while !cluster.nodes[1].said().contains("which takes no rooms") {
            tokio::time::sleep(LOOK_AGAIN).await;
        }
    };
    patiently("a warning", warned).await;
    assert_eq!(reached(&cluster, 1), "f");

    // Another one takes over what the node owned that is killed.
    let owner = cluster.nodes[0].client().await;
    let mut rooms = Vec::new();
    for _ in 0..ROOMS {
        rooms.push(create_room(&owner).await.expect("it is reached"));
    }
    cluster.kill(0).await;
    cluster.taken_over(0).await;
    for room in &rooms {
        assert_eq!(cluster.owner_of(room), 2);
    }

    cluster.show(1);
    let accepted = async {
        while create_room(&hidden).await.is_err() {
            tokio::time::sleep(LOOK_AGAIN).await;
        }
    };
    patiently("the node to be reached", accepted).await;
    let served = async {
        while cluster.nodes[1].health().await != ServingStatus::Serving
            || reached(&cluster, 1) != "t"
        {
            tokio::time::sleep(LOOK_AGAIN).await;
        }
    };
    patiently("the node to serve", served).await;
}
