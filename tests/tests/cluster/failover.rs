//! The database is lost while rooms play, and its synchronous standby takes over.

use std::time::Duration;

use chefshat_tests::{BusyRooms, Link};

use crate::cluster::{Cluster, Leases};
use crate::measure::{all_play, missed, rooms};

const ROOMS: usize = 12;
/// How long what is committed is on its way to the standby: what is acknowledged earlier is lost.
const WAY: Duration = Duration::from_millis(100);

#[tokio::test(flavor = "multi_thread")]
async fn the_standby_that_takes_over_has_all_that_was_acknowledged() {
    let mut cluster = Cluster::start(3, Leases::Steady).await;
    let replication = Link::to(cluster.postgres.address()).await;
    let address = replication.address;
    let standby = tokio::task::block_in_place(|| cluster.postgres.standby(address));
    let kinds = rooms(ROOMS, 1, 3_600_000, Duration::from_millis(20));
    let rooms = BusyRooms::start(&cluster.url(), kinds);
    all_play(&rooms).await;
    replication.delay(WAY);
    rooms.all_go_on().await;
    replication.close();
    cluster.fail_over(standby);
    rooms.all_go_on().await;
    assert_eq!(missed(&cluster, rooms).await, 0);
}
