//! What becomes of the seats of a node's game whose clients are connected to another one: when the nodes
//! are cut off from each other, and when a client goes.

use std::time::Duration;

use chefshat_client::{ActionId, Agent, RandomAgent};
use chefshat_proto::v1::{self, record_line::Line, seat_config::FilledBy};
use chefshat_tests::{BusyRooms, patiently};
use tokio::sync::mpsc;

use crate::cluster::{Cluster, Leases};
use crate::measure::{all_play, missed, rooms};

const ROOMS: usize = 4;
/// Rooms whose clients a balancer spreads.
const BALANCED_ROOMS: usize = 12;
/// After which time a cut is noticed on connections that it has silenced.
const NOTICED: Duration = Duration::from_secs(8);
/// Longer than a decision may take, answers that are on their way included.
const CUT: Duration = Duration::from_secs(20);
/// How long a room waits for seats that are away because of a node.
const RECALL_TIME_MS: u64 = 60_000;
/// Decisions of a client before it goes.
const BEFORE: usize = 3;
const LOOK_AGAIN: Duration = Duration::from_millis(200);

#[tokio::test(flavor = "multi_thread")]
async fn a_cut_between_two_nodes_costs_nobody_a_decision() {
    let cluster = Cluster::start(2, Leases::Steady).await;
    let (owner, gateway) = (cluster.nodes[0].url(), cluster.nodes[1].url());
    let kinds = rooms(ROOMS, 1, 10_000, Duration::from_millis(50));
    let rooms = BusyRooms::start_apart(&owner, &gateway, kinds);
    all_play(&rooms).await;
    // `chefshat cluster status` shows it.
    let not_reached = async |expected: &str| {
        let shown = async {
            while cluster.select("SELECT string_agg(unreachable::text, ' ') FROM nodes") != expected
            {
                tokio::time::sleep(LOOK_AGAIN).await;
            }
        };
        patiently("the nodes to notice", shown).await;
    };
    cluster.separate(0, 1);
    tokio::join!(tokio::time::sleep(CUT), not_reached("1 1"));
    cluster.join(0, 1);
    not_reached("0 0").await;
    assert_eq!(missed(&cluster, rooms).await, 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn clients_come_to_nodes_that_reach_their_rooms() {
    let cluster = Cluster::start(3, Leases::Steady).await;
    let kinds = rooms(BALANCED_ROOMS, 1, 3_600_000, Duration::from_millis(150));
    let rooms = BusyRooms::start(&cluster.url(), kinds);
    all_play(&rooms).await;
    cluster.separate(0, 1);
    // Whose way is cut stands still now.
    tokio::time::sleep(NOTICED).await;
    rooms.all_go_on().await;
    cluster.join(0, 1);
    assert_eq!(missed(&cluster, rooms).await, 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_node_that_restarts_costs_the_clients_connected_to_it_no_decision() {
    let mut cluster = Cluster::start(2, Leases::Steady).await;
    let (owner, gateway) = (cluster.nodes[0].url(), cluster.nodes[1].url());
    let kinds = rooms(ROOMS, 1, 10_000, Duration::from_millis(50));
    let rooms = BusyRooms::start_apart(&owner, &gateway, kinds);
    all_play(&rooms).await;
    cluster.stop(1).await;
    tokio::time::sleep(CUT).await;
    cluster.restart(1).await;
    rooms.all_go_on().await;
    assert_eq!(missed(&cluster, rooms).await, 0);
}

/// Tells of each of its decisions.
struct Telling(RandomAgent, mpsc::UnboundedSender<()>);

impl Agent for Telling {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        let _ = self.1.send(());
        self.0.decide(request)
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_waits_for_a_client_that_goes_from_another_node() {
    let cluster = Cluster::start(2, Leases::Steady).await;
    let owner = cluster.nodes[0].client().await;
    let agent = |seat: u32| v1::SeatConfig {
        filled_by: (seat > 0).then(|| FilledBy::BuiltInAgent("random".to_owned())),
        ..v1::SeatConfig::default()
    };
    let request = v1::CreateRoomRequest {
        policy: Some(v1::RoomPolicy {
            decision_time_ms: Some(1_000),
            bank_ms: Some(0),
            // The game is not over before the client goes.
            pace_ms: Some(100),
            ..v1::RoomPolicy::default()
        }),
        seats: (0..4).map(agent).collect(),
        ..v1::CreateRoomRequest::default()
    };
    let created = owner.create_room(request).await.expect("a room");
    let game = created.room.expect("a room").game_id;

    let client = cluster.nodes[1].client().await;
    let joined = client.join_with_code(created.join_code, "guest").await;
    let ticket = joined.expect("a seat").ticket;
    let (told, mut decisions) = mpsc::unbounded_channel();
    let agent = Telling(RandomAgent::new(1), told);
    let playing = tokio::spawn(async move { client.play(ticket, agent).await });
    for _ in 0..BEFORE {
        let decided = patiently("a decision", decisions.recv()).await;
        decided.expect("it plays");
    }
    playing.abort();

    let recorded = async {
        loop {
            if let Ok(record) = owner.record(&game).await {
                return record;
            }
            tokio::time::sleep(LOOK_AGAIN).await;
        }
    };
    let record = patiently("the end", recorded).await;
    let first_missed = record.into_iter().find_map(|line| match line.line {
        Some(Line::Decision(it)) if it.source() == v1::DecisionSource::Disconnected => Some(it),
        _ => None,
    });
    let waited = first_missed.expect("the server decided for it").elapsed_ms;
    assert!(waited < RECALL_TIME_MS, "{waited} ms");
}
