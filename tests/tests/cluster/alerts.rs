//! How long after a fault the shipped alerts fire, in a real Prometheus that scrapes and evaluates as it
//! is shipped: measured, never asserted, except that they fire.
//!
//! `cargo test -p chefshat-tests --test cluster alerts -- --ignored --nocapture`

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use chefshat_tests::{BusyRooms, Held, Prometheus, own_address};

use crate::cluster::{Cluster, Leases};
use crate::measure::{all_play, rooms};

const ROOMS: usize = 12;
const LOOK_AGAIN: Duration = Duration::from_millis(250);
/// Longest wait for an alert: the longest `for` of these, the range it looks at, and some scrapes.
const LONGEST: Duration = Duration::from_secs(10 * 60);

/// Waits until an alert fires, or none does.
async fn fires(prometheus: &Prometheus, what: &str, alert: Option<&str>) {
    let begun = Instant::now();
    let firing = async {
        loop {
            let firing = prometheus.firing().await;
            if alert.map_or(firing.is_empty(), |alert| firing.contains(alert)) {
                return firing;
            }
            tokio::time::sleep(LOOK_AGAIN).await;
        }
    };
    let firing = tokio::time::timeout(LONGEST, firing).await;
    let firing = firing.unwrap_or_else(|_| panic!("{what}: {alert:?} does not fire"));
    eprintln!(
        "{what}: after {:.0} s {firing:?}",
        begun.elapsed().as_secs_f64()
    );
}

/// Waits until an alert does not fire any more.
async fn ends(prometheus: &Prometheus, alert: &str) {
    while prometheus.firing().await.contains(alert) {
        tokio::time::sleep(LOOK_AGAIN).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "measures"]
async fn an_alert_fires_in_each_fault() {
    let scraped = [(); 3].map(|()| SocketAddr::from((own_address(), 9_464)));
    let mut left = scraped.iter();
    let mut cluster = Cluster::start_with(3, Leases::Default, |launch| {
        launch.with("--metrics-listen", left.next().expect("one for each"))
    })
    .await;
    let prometheus = Prometheus::start(&scraped, "15s").await;
    let prometheus = prometheus.expect("Prometheus is installed");
    let pace = Duration::from_millis(500);
    let rooms = BusyRooms::start(&cluster.url(), rooms(ROOMS, 1_000, 3_600_000, pace));
    all_play(&rooms).await;
    // Every node has been scraped.
    prometheus.has_data("count(chefshat_node_lease) == 3").await;
    fires(&prometheus, "before", None).await;

    let way = cluster.nodes[0].database.way().clone();
    way.hold(Held::Everything);
    fires(
        &prometheus,
        "a node is cut off from the database",
        Some("ChefshatNoLease"),
    )
    .await;
    way.hold(Held::Nothing);
    rooms.all_go_on().await;
    ends(&prometheus, "ChefshatNoLease").await;
    ends(&prometheus, "ChefshatCommitsWait").await;

    let lock = "BEGIN; LOCK TABLE journal IN SHARE MODE; SELECT pg_sleep(60); COMMIT";
    let database = cluster.database.clone();
    let locking = tokio::task::spawn_blocking(move || database.run(lock));
    fires(
        &prometheus,
        "the journal is locked",
        Some("ChefshatCommitsWait"),
    )
    .await;
    locking.await.expect("it ends");
    rooms.all_go_on().await;

    // Locked: a row that is written meanwhile would leave a hole before it.
    let newest = "SELECT game, max(position) FROM journal GROUP BY game";
    cluster.select(&format!(
        "BEGIN; LOCK TABLE journal IN EXCLUSIVE MODE; DELETE FROM journal WHERE (game, position) IN ({newest}); COMMIT"
    ));
    fires(
        &prometheus,
        "rows of running games are lost",
        Some("ChefshatCommitsLost"),
    )
    .await;
    rooms.all_go_on().await;

    cluster.stop(1).await;
    cluster.hide(1);
    cluster.restart(1).await;
    fires(
        &prometheus,
        "no other node reaches one that joins",
        Some("ChefshatNotReached"),
    )
    .await;
    cluster.show(1);
    rooms.all_go_on().await;

    cluster.separate(0, 1);
    fires(
        &prometheus,
        "two nodes are cut off from each other",
        Some("ChefshatPeersUnreachable"),
    )
    .await;
    cluster.join(0, 1);
    rooms.all_go_on().await;
    ends(&prometheus, "ChefshatPeersUnreachable").await;

    cluster.kill(2).await;
    fires(&prometheus, "a node is down", Some("ChefshatDown")).await;
    cluster.restart(2).await;
    rooms.all_go_on().await;
}
