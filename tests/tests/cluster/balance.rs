//! Rooms are where there is space: what is new is created by a node that has some, and a node that joins gets its share
//! while games are played.

use std::time::Duration;

use chefshat_proto::v1;
use chefshat_tests::BusyRooms;

use crate::cluster::{Cluster, Leases};
use crate::measure::{all_play, missed, rooms};

/// Most rooms of a node; half of them are one client's share.
const MAX_ROOMS: usize = 120;
/// More than a client has at one node.
const WAITING: usize = 90;
/// Rooms that are played meanwhile.
const PLAYING: usize = 6;

#[tokio::test(flavor = "multi_thread")]
async fn rooms_go_to_the_nodes_with_space() {
    let mut cluster = Cluster::start_with(3, Leases::Steady, |launch| {
        launch.with("--max-rooms", MAX_ROOMS)
    })
    .await;
    cluster.stop(2).await;
    let kinds = rooms(PLAYING, 2, 3_600_000, Duration::from_millis(80));
    let playing = BusyRooms::start(&cluster.url(), kinds);
    all_play(&playing).await;
    let client = cluster.nodes[0].client().await;
    for _ in 0..WAITING {
        let created = client.create_room(v1::CreateRoomRequest::default()).await;
        created.expect("one of the nodes has space");
    }
    let rooms = cluster.rooms_of_nodes();
    assert!(
        rooms[..2].iter().all(|rooms| *rooms <= MAX_ROOMS / 2),
        "{rooms:?}"
    );

    cluster.restart(2).await;
    cluster.balanced(50).await;
    playing.all_go_on().await;
    assert_eq!(missed(&cluster, playing).await, 0);
}
