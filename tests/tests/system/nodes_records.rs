//! Records of games whose room or tournament runs at another node than the one that is asked.

use chefshat_client::Client;
use chefshat_proto::v1::{
    self, seat_update::Update, tournament_service_client::TournamentServiceClient,
};
use chefshat_tests::{StreamSeat, TestNodes, patiently};

use crate::played::{point, recorded};
use crate::tournament_deals::{counted, withheld};
use crate::tournaments::{create, id_of, join, start, unhurried};

/// A tournament at a node that runs although one of its games is over: a participant does not play.
/// Returns that game, and the stream of the participant.
async fn running(
    nodes: &TestNodes,
    node: usize,
    through: &Client,
    deals: v1::TournamentDeals,
) -> (v1::TournamentGame, StreamSeat) {
    let owner = nodes.nodes[node].client().await;
    let mut service = TournamentServiceClient::new(owner.channel());
    let settings = v1::TournamentSettings {
        format: v1::TournamentFormat::RoundRobin.into(),
        rounds: 1,
        deals: deals.into(),
        built_in_agents: vec!["random".into(); 7],
        policy: Some(unhurried()),
        ..v1::TournamentSettings::default()
    };
    let created = create(&mut service, settings).await;
    let id = id_of(&created);
    nodes.place(node, &id, &created.join_code);
    let joined = join(&mut service, &created.join_code, "Ada").await;
    let stream = StreamSeat::open(through.channel()).await;
    let attach = v1::Attach {
        ticket: joined.ticket,
        ..v1::Attach::default()
    };
    stream.attach(attach).await;
    start(&mut service, &created).await;
    let done = patiently("the other table's end", counted(&mut service, &id)).await;
    nodes.place(node, &done.room_id, "");
    (done, stream)
}

#[tokio::test]
async fn records_that_the_node_of_a_tournament_withholds_are_withheld_by_all() {
    let nodes = TestNodes::start(2).await;
    let client = nodes.nodes[0].client().await;
    let deals = v1::TournamentDeals::SameAtAllTables;
    let (done, _plays_on) = running(&nodes, 1, &client, deals).await;
    withheld(&nodes.nodes[1].client().await, &done).await;
    withheld(&client, &done).await;
}

#[tokio::test]
async fn a_room_begins_with_games_of_tournaments_that_run_at_two_other_nodes() {
    let nodes = TestNodes::start(3).await;
    let client = nodes.nodes[0].client().await;
    let deals = v1::TournamentDeals::Unspecified;
    let (first, _plays_on) = running(&nodes, 1, &client, deals).await;
    let (second, _plays_on_too) = running(&nodes, 2, &client, deals).await;
    let mut seats = vec![v1::SeatConfig::default(); 4];
    seats[0] = recorded(&first.game_id, 0);
    seats[1] = recorded(&second.game_id, 1);
    let request = v1::CreateRoomRequest {
        seats,
        start: point(&second.game_id, 1, false),
        ..v1::CreateRoomRequest::default()
    };
    let created = client.create_room(request).await.expect("a room");
    // It is a room of the node that was asked.
    let room = created.room.expect("a room").room_id;
    assert_eq!(client.get_room(&room).await.expect("found").room_id, room);
}

#[tokio::test]
async fn the_record_of_a_game_that_runs_at_another_node_is_not_available_yet() {
    let nodes = TestNodes::start(2).await;
    let created = nodes.create_room(1, v1::CreateRoomRequest::default()).await;
    let client = nodes.nodes[0].client().await;
    let joined = client.join_with_code(&created.join_code, "Ada").await;
    let mut stream = StreamSeat::open(client.channel()).await;
    let attach = v1::Attach {
        ticket: joined.expect("a free seat").ticket,
        ..v1::Attach::default()
    };
    stream.attach(attach).await;
    let Update::Attached(attached) = stream.next().await else {
        panic!("it is attached first");
    };
    nodes.place_game(1, &attached.game_id);
    for node in &nodes.nodes {
        let refused = node.client().await.record(&attached.game_id).await;
        let refused = refused.expect_err("it runs");
        assert_eq!(refused.reason(), Some("GAME_RUNNING"));
    }
}
