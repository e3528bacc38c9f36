//! The database is lost while rooms play, and its synchronous standby takes over.

use std::time::Duration;

use chefshat_postgres::Server as Postgres;
use chefshat_tests::{BusyRooms, Held, Link, patiently};

use crate::cluster::{Cluster, Leases};
use crate::measure::{all_play, missed, rooms};

const NODES: usize = 3;
const ROOMS: usize = 12;
/// How long what is committed is on its way to the standby: what is acknowledged earlier is lost.
const WAY: Duration = Duration::from_millis(100);
const LOOK_AGAIN: Duration = Duration::from_millis(200);

/// A cluster whose rooms play, the standby of its database, and the way to that standby.
async fn playing() -> (Cluster, BusyRooms, Postgres, Link) {
    let cluster = Cluster::start(NODES, Leases::Steady).await;
    let replication = Link::to(cluster.postgres.address()).await;
    let address = replication.address;
    let standby = tokio::task::block_in_place(|| cluster.postgres.standby(address));
    let kinds = rooms(ROOMS, 1, 3_600_000, Duration::from_millis(20));
    let rooms = BusyRooms::start(&cluster.url(), kinds);
    all_play(&rooms).await;
    (cluster, rooms, standby, replication)
}

#[tokio::test(flavor = "multi_thread")]
async fn the_standby_that_takes_over_has_all_that_was_acknowledged() {
    let (mut cluster, rooms, standby, replication) = playing().await;
    replication.delay(WAY);
    rooms.all_go_on().await;
    replication.close();
    cluster.fail_over(standby);
    rooms.all_go_on().await;
    assert_eq!(missed(&cluster, rooms).await, 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_found_committed_is_acknowledged_when_the_standby_has_it() {
    let (mut cluster, rooms, standby, replication) = playing().await;
    let waits_since = async |cluster: &Cluster, time: &str| {
        let waiting = format!(
            "SELECT count(*) FROM pg_stat_activity WHERE wait_event = 'SyncRep' AND query LIKE '%journal%' \
             AND backend_start > '{time}'"
        );
        let waits = async {
            while cluster.select(&waiting) == "0" {
                tokio::time::sleep(LOOK_AGAIN).await;
            }
        };
        patiently("decisions that wait for the standby", waits).await;
    };
    replication.way().hold(Held::Everything);
    waits_since(&cluster, "-infinity").await;
    // What waits is committed then, but at the primary alone.
    let time = cluster.select("SELECT clock_timestamp()");
    (0..NODES).for_each(|node| cluster.terminate_connections(node));
    waits_since(&cluster, &time).await;
    replication.close();
    cluster.fail_over(standby);
    rooms.all_go_on().await;
    assert_eq!(missed(&cluster, rooms).await, 0);
}
