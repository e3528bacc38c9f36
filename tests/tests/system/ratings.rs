//! What ratings make of games that somebody breaks off: it has lost them, and nobody else has.

use std::sync::Arc;
use std::time::Duration;

use chefshat_client::Client;
use chefshat_proto::v1::play_service_client::PlayServiceClient;
use chefshat_proto::v1::record_service_client::RecordServiceClient;
use chefshat_proto::v1::{self, seat_config::FilledBy};
use chefshat_record::rated::rated;
use chefshat_record::replay::replay;
use chefshat_record::summary::summary;
use chefshat_server::config::ServerConfig;
use chefshat_server::host::Host;
use chefshat_server::store::MemoryStore;
use chefshat_tests::{one_shift, patiently};

const BUILT_IN: [&str; 3] = ["greedy", "random", "trained"];

/// Creates a public room for one participant among built-in agents, begins the game and closes it.
/// Returns the id of the game.
async fn broken_off(client: &Client) -> String {
    let mut seats = vec![v1::SeatConfig::default()];
    seats.extend(BUILT_IN.map(|agent| v1::SeatConfig {
        filled_by: Some(FilledBy::BuiltInAgent(agent.to_owned())),
        ..v1::SeatConfig::default()
    }));
    let request = v1::CreateRoomRequest {
        rules: Some(one_shift()),
        seats,
        ..v1::CreateRoomRequest::default()
    };
    let created = client.create_room(request).await.expect("a room");
    let joined = client.join_with_code(&created.join_code, "farmer").await;
    let attach = v1::Attach {
        ticket: joined.expect("joined").ticket,
        ..v1::Attach::default()
    };
    let mut service = PlayServiceClient::new(client.channel());
    let request = v1::PlayServiceWatchRequest {
        seats: vec![attach],
    };
    let watching = service.watch(request).await.expect("attached").into_inner();
    let room = created.room.expect("a room");
    let begun = async {
        let mut state = v1::RoomState::Waiting;
        while state != v1::RoomState::Playing {
            state = client.get_room(&room.room_id).await.expect("shown").state();
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    };
    patiently("the game to begin", begun).await;
    let closed = client.close_room(&room.room_id, &created.owner_token).await;
    closed.expect("closed");
    drop(watching);
    room.game_id
}

#[tokio::test]
async fn an_owner_who_closes_its_room_has_lost_the_game() {
    let config = ServerConfig {
        grace: Duration::ZERO,
        ..ServerConfig::default()
    };
    let host = Host::start(config, Arc::new(MemoryStore::default())).await;
    let host = host.expect("a free port");
    let client = Client::connect(host.url()).await.expect("it listens");
    let game = broken_off(&client).await;
    let lines = async {
        loop {
            match client.record(&game).await {
                Ok(lines) => break lines,
                Err(_) => tokio::time::sleep(Duration::from_millis(20)).await,
            }
        }
    };
    let lines = patiently("the record", lines).await;

    // The summary of the server and the record say the same.
    let mut records = RecordServiceClient::new(client.channel());
    let listed = records
        .list_records(v1::ListRecordsRequest::default())
        .await;
    let listed = listed.expect("a list").into_inner().records.remove(0);
    let replayed = replay(&lines).expect("it verifies");
    let read = summary(&lines, &replayed).expect("something was dealt");
    let results = rated(&listed).expect("rated");
    assert_eq!(rated(&read), Ok(results.clone()));
    for seat in &results {
        assert_eq!(seat.forfeited, seat.identity.name == "farmer", "{seat:?}");
    }

    let board = async {
        loop {
            let board = client
                .leaderboard(v1::GetLeaderboardRequest::default())
                .await;
            let board = board.expect("a leaderboard");
            if board.games > 0 {
                break board;
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    };
    let board = patiently("the game to be rated", board).await;
    let order: Vec<&str> = (board.rated.iter())
        .map(|line| line.name.as_str())
        .collect();
    assert_eq!(order.len(), 4, "{order:?}");
    assert_eq!(order.last(), Some(&"farmer"));
}
