//! The lists of rooms and of tournaments: newest first, page by page, by state; items created
//! during paging do not appear. `records` tests the list of records.

use std::time::Duration;

use chefshat_client::Client;
use chefshat_proto::v1::{self, tournament_service_client::TournamentServiceClient};
use chefshat_tests::{TestServer, attach_all, one_shift, room_of_four};
use tonic_types::StatusExt as _;

use crate::tournaments::{create, id_of};

const MADE: usize = 5;

async fn room(client: &Client) -> String {
    let created = client.create_room(v1::CreateRoomRequest::default()).await;
    let room = created.expect("a new room").room;
    room.expect("a room").room_id
}

#[tokio::test]
async fn rooms_are_listed_newest_first() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let mut made = Vec::new();
    for _ in 0..MADE {
        made.push(room(&client).await);
    }
    let mut listed = Vec::new();
    let mut page_token = String::new();
    loop {
        let request = v1::ListRoomsRequest {
            page_size: 2,
            page_token,
            ..v1::ListRoomsRequest::default()
        };
        let page = client.list_rooms(request).await.expect("a page");
        assert!(page.rooms.len() <= 2);
        listed.extend(page.rooms.into_iter().map(|room| room.room_id));
        page_token = page.next_page_token;
        if page_token.is_empty() {
            break;
        }
        room(&client).await;
    }
    made.reverse();
    assert_eq!(listed, made);
    let (begun, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let _seats = attach_all(&server, &tickets).await;
    let begun = begun.room.expect("a room").room_id;
    let playing = v1::ListRoomsRequest {
        state: v1::RoomState::Playing.into(),
        ..v1::ListRoomsRequest::default()
    };
    let playing = client.list_rooms(playing).await.expect("a page").rooms;
    let playing: Vec<&str> = playing.iter().map(|room| &*room.room_id).collect();
    assert_eq!(playing, [&*begun]);
}

#[tokio::test]
async fn tournaments_are_listed_newest_first() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let mut service = TournamentServiceClient::new(server.channel().await);
    let settings = || v1::TournamentSettings {
        format: v1::TournamentFormat::Swiss.into(),
        ..v1::TournamentSettings::default()
    };
    let mut made = Vec::new();
    for number in 0..MADE {
        // Those of one millisecond are in the order of their ids.
        tokio::time::sleep(Duration::from_millis(2)).await;
        let created = create(&mut service, settings()).await;
        if number % 2 == 0 {
            let close = v1::CloseTournamentRequest {
                tournament_id: id_of(&created),
                owner_token: created.owner_token.clone(),
            };
            service.close_tournament(close).await.expect("closed");
        }
        made.insert(0, id_of(&created));
    }
    let of = |numbers: &[usize]| -> Vec<String> {
        numbers.iter().map(|number| made[*number].clone()).collect()
    };
    let cases = [
        (v1::TournamentState::Open, of(&[1, 3])),
        (v1::TournamentState::Closed, of(&[0, 2, 4])),
        (v1::TournamentState::Playing, of(&[])),
        (v1::TournamentState::Unspecified, of(&[0, 1, 2, 3, 4])),
    ];
    for (state, expected) in cases {
        let mut listed = Vec::new();
        let mut page_token = String::new();
        loop {
            let request = v1::ListTournamentsRequest {
                page_size: 2,
                page_token,
                state: state.into(),
            };
            let page = client.list_tournaments(request).await.expect("a page");
            assert!(page.tournaments.len() <= 2);
            listed.extend(page.tournaments.into_iter().map(|it| it.tournament_id));
            page_token = page.next_page_token;
            if page_token.is_empty() {
                break;
            }
            if state == v1::TournamentState::Unspecified {
                create(&mut service, settings()).await;
            }
        }
        assert_eq!(listed, expected, "{state:?}");
    }
    let no_state = v1::ListTournamentsRequest {
        state: 77,
        ..v1::ListTournamentsRequest::default()
    };
    let refused = service.list_tournaments(no_state).await;
    let refused = refused.expect_err("an unknown state");
    let info = refused.get_details_error_info().expect("error info");
    assert_eq!(info.reason, "STATE_REFUSED");
}
