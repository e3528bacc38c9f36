//! Keys of names: the same name with another key, or with none, is another participant.

use std::collections::BTreeMap;

use chefshat_client::Client;
use chefshat_proto::v1::{self, record_line::Line};
use chefshat_tests::{TestServer, one_shift, patiently, random_agents};

/// The key of one device, and that of another.
const KEY: [u8; 32] = [7; 32];
const OTHER: [u8; 32] = [8; 32];

fn join(code: &str, name: &str, key: &[u8]) -> v1::JoinRoomRequest {
    v1::JoinRoomRequest {
        join_code: code.to_owned(),
        name: name.to_owned(),
        name_key: key.to_vec(),
        ..v1::JoinRoomRequest::default()
    }
}

/// Plays a game of these participants; returns its id.
async fn play(client: &Client, participants: [(&str, &[u8]); 4]) -> String {
    let request = v1::CreateRoomRequest {
        rules: Some(one_shift()),
        ..v1::CreateRoomRequest::default()
    };
    let made = client.create_room(request).await.expect("a new room");
    let mut tickets = Vec::new();
    for (name, key) in participants {
        let joined = client.join(join(&made.join_code, name, key)).await;
        tickets.push(joined.expect("a free seat").ticket);
    }
    let playing = client.play_many(random_agents(tickets));
    patiently("the game to end", playing).await;
    made.room.expect("a room").game_id
}

/// The fingerprints of the seats in a record.
async fn recorded(client: &Client, game: &str) -> Vec<String> {
    let lines = client.record(game).await.expect("a record");
    let header = lines.into_iter().find_map(|line| match line.line {
        Some(Line::Header(header)) => Some(header),
        _ => None,
    });
    let seats = header.expect("a header").seats.into_iter();
    seats.map(|seat| seat.name_fingerprint).collect()
}

#[tokio::test]
async fn one_name_with_several_keys_is_rated_apart() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let none: &[u8] = &[];
    let all: [(&str, &[u8]); 4] = [("Ada", &KEY), ("Ada", &OTHER), ("Ada", none), ("Bo", &KEY)];
    let first = play(&client, all).await;
    let again: [(&str, &[u8]); 4] = [("Cy", none), ("Ada", &KEY), ("Di", none), ("Ed", none)];
    let second = play(&client, again).await;

    let seats = recorded(&client, &first).await;
    assert!(seats[2].is_empty());
    let ada = seats[0].clone();
    assert_eq!(recorded(&client, &second).await[1], ada);
    assert!(ada != seats[1] && ada != seats[3] && seats[1] != seats[3]);

    let rated = async {
        loop {
            let request = v1::GetLeaderboardRequest::default();
            let board = client.leaderboard(request).await.expect("a board");
            if board.games == 2 {
                return board.rated;
            }
            tokio::time::sleep(std::time::Duration::from_millis(50)).await;
        }
    };
    let rated = patiently("both games to be rated", rated).await;
    let games: BTreeMap<_, _> = (rated.iter())
        .filter(|line| line.name == "Ada")
        .map(|line| (&*line.name_fingerprint, line.rating.map(|it| it.games)))
        .collect();
    let expected = BTreeMap::from([("", Some(1)), (&*ada, Some(2)), (&*seats[1], Some(1))]);
    assert_eq!(games, expected);
    assert_eq!(rated.len(), 3 + 4, "everybody else once");
}

#[tokio::test]
async fn a_key_is_part_of_the_request_and_has_its_length() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let made = client.create_room(v1::CreateRoomRequest::default()).await;
    let code = made.expect("a new room").join_code;
    let refused = client.join(join(&code, "Ada", &[7; 31])).await;
    assert_eq!(
        refused.expect_err("too short").reason(),
        Some("NAME_KEY_REFUSED")
    );
    let ask = |key: &[u8]| v1::JoinRoomRequest {
        request_id: vec![1; 32],
        ..join(&code, "Ada", key)
    };
    let joined = client.join(ask(&KEY)).await.expect("a free seat");
    let again = client.join(ask(&KEY)).await.expect("the same seat");
    assert_eq!(again.ticket, joined.ticket);
    let refused = client.join(ask(&OTHER)).await.expect_err("somebody else");
    assert_eq!(refused.reason(), Some("REQUEST_ID_USED"));

    let settings = v1::TournamentSettings {
        name: "Coppa".into(),
        format: v1::TournamentFormat::Swiss.into(),
        rounds: 3,
        ..v1::TournamentSettings::default()
    };
    let made = client.create_tournament(settings).await.expect("created");
    let ask = |key: &[u8]| v1::JoinTournamentRequest {
        join_code: made.join_code.clone(),
        name: "Ada".into(),
        name_key: key.to_vec(),
        ..v1::JoinTournamentRequest::default()
    };
    let refused = client.join_tournament(ask(&[7; 33])).await;
    assert_eq!(
        refused.expect_err("too long").reason(),
        Some("NAME_KEY_REFUSED")
    );
    let ask = |key: &[u8]| v1::JoinTournamentRequest {
        request_id: vec![2; 32],
        ..ask(key)
    };
    let entered = client.join_tournament(ask(&KEY)).await.expect("a place");
    let again = client.join_tournament(ask(&KEY)).await;
    assert_eq!(again.expect("the same place").ticket, entered.ticket);
    let refused = client.join_tournament(ask(&OTHER)).await;
    assert_eq!(
        refused.expect_err("somebody else").reason(),
        Some("REQUEST_ID_USED")
    );
    let entered = entered.tournament.expect("a tournament").participants;
    let seat = &joined.room.expect("a room").seats[0];
    assert_eq!(entered[0].name_fingerprint, seat.name_fingerprint);
}
