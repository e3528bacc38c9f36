//! Calls through a node that does not have the room: several servers in this process that know each
//! other's rooms. The owner's answer is the client's, and what does not exist is answered as by a
//! single server.

use std::sync::atomic::Ordering;
use std::time::Duration;

use bytes::Bytes;
use chefshat_proto::v1::{
    self, room_service_client::RoomServiceClient,
    tournament_service_client::TournamentServiceClient,
};
use chefshat_server::config::ServerConfig;
use chefshat_tests::{TestNodes, TestServer, one_shift, patiently};
use http::{HeaderMap, Request};
use http_body_util::{BodyExt as _, Full};
use tonic::Code;
use tonic::body::Body;
use tonic_prost::prost::Message;
use tower::ServiceExt as _;

use crate::records::reason;

fn join(code: &str) -> v1::JoinRoomRequest {
    v1::JoinRoomRequest {
        join_code: code.into(),
        name: "somebody".into(),
        ..v1::JoinRoomRequest::default()
    }
}

#[tokio::test]
async fn a_room_is_joined_shown_left_and_closed_through_another_node() {
    let nodes = TestNodes::start(3).await;
    let created = nodes.create_room(1, v1::CreateRoomRequest::default()).await;
    let room = created.room.expect("a room").room_id;
    let client = nodes.nodes[0].client().await;
    let third = nodes.nodes[2].client().await;
    assert_eq!(client.get_room(&room).await.expect("found").room_id, room);
    let joined = client.join(join(&created.join_code)).await;
    let joined = joined.expect("by its code");
    let named = v1::JoinRoomRequest {
        room_id: room.clone(),
        seat: Some(3),
        ..join(&created.join_code.to_lowercase())
    };
    let second = third.join(named).await.expect("by its id and code");
    assert_eq!(second.seat, 3);
    let left = third.leave_room(&joined.ticket).await.expect("its seat");
    assert_eq!(left.room_id, room);
    let wrong = client.close_room(&room, &second.ticket).await;
    let wrong = wrong.expect_err("not the owner's");
    assert_eq!(wrong.reason(), Some("OWNER_TOKEN_WRONG"));
    let closed = client.close_room(&room, &created.owner_token).await;
    assert_eq!(closed.expect("by its owner").room_id, room);
}

#[tokio::test]
async fn a_repeated_request_to_create_finds_the_room_at_another_node() {
    let nodes = TestNodes::start(2).await;
    let request = v1::CreateRoomRequest {
        name: "once".into(),
        request_id: vec![9; 32],
        ..v1::CreateRoomRequest::default()
    };
    let created = nodes.create_room(1, request.clone()).await;
    let client = nodes.nodes[0].client().await;
    let again = client.create_room(request.clone()).await.expect("the same");
    assert_eq!(again.owner_token, created.owner_token);
    assert_eq!(again.join_code, created.join_code);
    let other = v1::CreateRoomRequest {
        name: "another".into(),
        ..request
    };
    let refused = client.create_room(other).await.expect_err("another room");
    assert_eq!(refused.reason(), Some("REQUEST_ID_USED"));
}

#[tokio::test]
async fn a_tournament_is_joined_followed_and_closed_through_another_node() {
    let nodes = TestNodes::start(2).await;
    let owner = nodes.nodes[1].client().await.channel();
    let mut owner = TournamentServiceClient::new(owner);
    let request = v1::CreateTournamentRequest {
        settings: Some(v1::TournamentSettings {
            name: "Coppa".into(),
            format: v1::TournamentFormat::Swiss.into(),
            rules: Some(one_shift()),
            ..v1::TournamentSettings::default()
        }),
        request_id: vec![8; 32],
    };
    let created = owner.create_tournament(request.clone()).await;
    let created = created.expect("a tournament").into_inner();
    let id = created.tournament.expect("a tournament").tournament_id;
    nodes.place(1, &id, &created.join_code);
    let client = nodes.nodes[0].client().await;
    let mut there = TournamentServiceClient::new(client.channel());
    let again = there.create_tournament(request).await.expect("the same");
    assert_eq!(again.into_inner().owner_token, created.owner_token);
    let joined = client.join_tournament(v1::JoinTournamentRequest {
        join_code: created.join_code.clone(),
        name: "Ada".into(),
        ..v1::JoinTournamentRequest::default()
    });
    joined.await.expect("open");
    let mut followed = client.follow_tournament(&id);
    let first = patiently("an update", followed.next()).await;
    let first = first.expect("found").expect("an update");
    assert_eq!(first.tournament.expect("it").participants.len(), 1);
    let closed = client.close_tournament(&id, &created.owner_token).await;
    assert_eq!(closed.expect("by its owner").tournament_id, id);
    while let Some(update) = patiently("the end", followed.next())
        .await
        .expect("no error")
    {
        drop(update);
    }
    // The code of a tournament is no room's.
    let mut rooms = RoomServiceClient::new(client.channel());
    let refused = rooms.join_room(join(&created.join_code)).await;
    let refused = refused.expect_err("a tournament");
    assert_eq!(reason(&refused), "JOIN_CODE_WRONG");
}

/// Status, headers, body and trailers of an answer, without the date.
#[derive(Debug, PartialEq)]
struct Raw(http::StatusCode, HeaderMap, Bytes, Option<HeaderMap>);

async fn raw(url: &str, path: &str, message: &impl Message) -> Raw {
    raw_as("application/grpc", url, path, message).await
}

async fn raw_as(content_type: &str, url: &str, path: &str, message: &impl Message) -> Raw {
    let mut framed = vec![0];
    framed.extend(
        u32::try_from(message.encoded_len())
            .expect("short")
            .to_be_bytes(),
    );
    message.encode(&mut framed).expect("space");
    let request = Request::post(format!("{url}{path}"))
        .header("content-type", content_type)
        .header("te", "trailers")
        .body(Body::new(Full::new(Bytes::from(framed))))
        .expect("a request");
    let channel = tonic::transport::Channel::from_shared(url.to_owned()).expect("a URL");
    let channel = channel.connect().await.expect("it listens");
    let (parts, body) = channel
        .oneshot(request)
        .await
        .expect("an answer")
        .into_parts();
    let mut headers = parts.headers;
    headers.remove("date");
    let body = body.collect().await.expect("a body");
    let trailers = body.trailers().cloned();
    Raw(parts.status, headers, body.to_bytes(), trailers)
}

#[tokio::test]
async fn what_nobody_has_is_answered_as_by_a_single_server_to_the_byte() {
    let nodes = TestNodes::start(2).await;
    let alone = TestServer::start().await;
    let node = &nodes.nodes[0];
    let private = v1::CreateRoomRequest {
        policy: Some(v1::RoomPolicy {
            visibility: v1::Visibility::Private.into(),
            ..v1::RoomPolicy::default()
        }),
        ..v1::CreateRoomRequest::default()
    };
    let private = nodes.create_room(1, private).await;
    let private = private.room.expect("a room").room_id;
    let nobodys = "ab".repeat(16);
    let ticket = "cd".repeat(48);
    let same = async |path: &str, at_node: Raw, alone_url: &str, message: Raw| {
        assert_eq!(at_node, message, "{path} {alone_url}");
    };
    macro_rules! check {
        ($path:literal, $here:expr, $alone:expr) => {
            let path = concat!("/chefshat.v1.", $path);
            let at_node = raw(&node.url(), path, &$here).await;
            let at_alone = raw(&alone.url(), path, &$alone).await;
            same(path, at_node, &alone.url(), at_alone).await;
        };
    }
    let room = |id: &str| v1::GetRoomRequest {
        room_id: id.to_owned(),
        ..v1::GetRoomRequest::default()
    };
    check!("RoomService/GetRoom", room(&nobodys), room(&nobodys));
    // A private room of another node, and one that does not exist.
    check!("RoomService/GetRoom", room(&private), room(&nobodys));
    let clock = |id: &str| v1::GetClockRequest {
        room_id: id.to_owned(),
    };
    check!("ServerService/GetClock", clock(&nobodys), clock(&nobodys));
    check!("ServerService/GetClock", clock(&private), clock(&nobodys));
    let watch = |id: &str| v1::SpectatorServiceWatchRequest {
        room_id: id.to_owned(),
        ..v1::SpectatorServiceWatchRequest::default()
    };
    check!("SpectatorService/Watch", watch(&nobodys), watch(&nobodys));
    check!("SpectatorService/Watch", watch(&private), watch(&nobodys));
    check!("RoomService/JoinRoom", join("BCDF2345"), join("BCDF2345"));
    let named = |id: &str| v1::JoinRoomRequest {
        room_id: id.to_owned(),
        ..join("BCDF2345")
    };
    check!("RoomService/JoinRoom", named(&private), named(&nobodys));
    let leave = v1::LeaveRoomRequest {
        ticket: ticket.clone(),
    };
    check!("RoomService/LeaveRoom", leave, leave);
    let of_private = v1::LeaveRoomRequest {
        ticket: format!("{private}{}", "cd".repeat(32)),
    };
    check!("RoomService/LeaveRoom", of_private, leave);
    let act = v1::ActRequest {
        ticket: ticket.clone(),
        command: Some(v1::act_request::Command::Resume(v1::ResumeSeat {})),
    };
    check!("PlayService/Act", act, act);
    let tournament = v1::GetTournamentRequest {
        tournament_id: nobodys.clone(),
        ..v1::GetTournamentRequest::default()
    };
    check!("TournamentService/GetTournament", tournament, tournament);
    let games = v1::ListTournamentGamesRequest {
        tournament_id: private.clone(),
        ..v1::ListTournamentGamesRequest::default()
    };
    let none = v1::ListTournamentGamesRequest {
        tournament_id: nobodys.clone(),
        ..games.clone()
    };
    check!("TournamentService/ListTournamentGames", games, none);
}

#[tokio::test]
async fn an_owner_that_has_nothing_is_asked_a_bounded_number_of_times() {
    let nodes = TestNodes::start(3).await;
    let room = created_room(&nodes).await;
    let client = nodes.nodes[0].client().await.channel();
    let mut client = RoomServiceClient::new(client);
    let mut show = async || {
        let request = v1::GetRoomRequest {
            room_id: room.clone(),
            ..v1::GetRoomRequest::default()
        };
        client.get_room(request).await
    };
    let forgotten = || nodes.nodes[0].forgotten.load(Ordering::Relaxed);
    nodes.mislead(0, &room, 2, 1);
    // The third node says that it does not have it.
    show().await.expect("found");
    assert_eq!(forgotten(), 1);
    nodes.mislead(0, &room, 2, 100);
    let refused = show().await.expect_err("not found");
    assert_eq!(reason(&refused), "OWNER_UNREACHABLE");
    assert_eq!(refused.code(), Code::Unavailable);
    assert_eq!(forgotten(), 4);
}

#[tokio::test]
async fn a_node_that_cannot_be_reached_is_forgotten_and_asked_again() {
    let nodes = TestNodes::start(2).await;
    let room = created_room(&nodes).await;
    let client = nodes.nodes[0].client().await.channel();
    let mut client = RoomServiceClient::new(client);
    let mut show = async || {
        let request = v1::GetRoomRequest {
            room_id: room.clone(),
            ..v1::GetRoomRequest::default()
        };
        client.get_room(request).await
    };
    show().await.expect("found");
    nodes.link(0, 1).close();
    let refused = patiently("an answer", show()).await;
    let refused = refused.expect_err("unreachable");
    assert_eq!(reason(&refused), "OWNER_UNREACHABLE");
    assert_eq!(nodes.nodes[0].forgotten.load(Ordering::Relaxed), 1);
}

/// The id of a new room at the second node.
async fn created_room(nodes: &TestNodes) -> String {
    let created = nodes.create_room(1, v1::CreateRoomRequest::default()).await;
    created.room.expect("a room").room_id
}

#[tokio::test]
async fn calls_of_browsers_are_sent_on_too() {
    let nodes = TestNodes::start(2).await;
    let request = v1::GetRoomRequest {
        room_id: created_room(&nodes).await,
        ..v1::GetRoomRequest::default()
    };
    let path = "/chefshat.v1.RoomService/GetRoom";
    let web = "application/grpc-web+proto";
    let near = raw_as(web, &nodes.nodes[1].url(), path, &request).await;
    let far = raw_as(web, &nodes.nodes[0].url(), path, &request).await;
    assert_eq!(far.1["content-type"], web);
    assert!(far.2.len() > 100, "the room");
    assert_eq!(far, near);
}

#[tokio::test]
async fn a_seat_is_told_where_its_room_is() {
    let named = |config: &mut ServerConfig| {
        config.client_endpoint = Some("https://node.example.org".into());
    };
    let nodes = TestNodes::with(2, named, None).await;
    let created = nodes.create_room(1, v1::CreateRoomRequest::default()).await;
    let client = nodes.nodes[0].client().await;
    let joined = client.join(join(&created.join_code)).await.expect("a seat");
    assert_eq!(joined.preferred_endpoint, "https://node.example.org");
    let alone = TestServer::start().await;
    let client = alone.client().await;
    let created = client.create_room(v1::CreateRoomRequest::default()).await;
    let code = created.expect("a room").join_code;
    let joined = client.join(join(&code)).await.expect("a seat");
    assert_eq!(joined.preferred_endpoint, "");
}

#[tokio::test]
async fn lists_have_the_rooms_and_tournaments_of_all_nodes() {
    let nodes = TestNodes::start(3).await;
    let mut created = Vec::new();
    for number in 0..7 {
        let request = v1::CreateRoomRequest {
            name: format!("room {number}"),
            ..v1::CreateRoomRequest::default()
        };
        let room = nodes.create_room(number % 3, request).await;
        created.push(room.room.expect("a room").room_id);
        // Lists are ordered by the time of creation, in milliseconds.
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
    let private = v1::CreateRoomRequest {
        policy: Some(v1::RoomPolicy {
            visibility: v1::Visibility::Private.into(),
            ..v1::RoomPolicy::default()
        }),
        ..v1::CreateRoomRequest::default()
    };
    let private = nodes.create_room(2, private).await;
    created.reverse();
    let client = nodes.nodes[0].client().await;
    for page_size in [0, 1, 2, 7] {
        let mut listed = Vec::new();
        let mut page_token = String::new();
        // Each page is asked for at another node, as behind a load balancer.
        for node in nodes.nodes.iter().cycle() {
            let request = v1::ListRoomsRequest {
                page_size,
                page_token,
                ..v1::ListRoomsRequest::default()
            };
            let page = node.client().await.list_rooms(request).await;
            let page = page.expect("a page");
            assert!(page_size == 0 || page.rooms.len() <= page_size as usize);
            listed.extend(page.rooms.into_iter().map(|room| room.room_id));
            page_token = page.next_page_token;
            if page_token.is_empty() {
                break;
            }
        }
        assert_eq!(listed, created, "{page_size}");
    }
    let owner = client
        .with_secrets([&private.owner_token])
        .expect("a secret");
    let all = owner.list_rooms(v1::ListRoomsRequest::default()).await;
    assert_eq!(all.expect("a page").rooms.len(), 8);
    assert_eq!(
        client.server_info().await.expect("it answers").open_rooms,
        8
    );
    let elsewhere = nodes.nodes[2].client().await;
    let settings = v1::TournamentSettings {
        name: "Coppa".into(),
        format: v1::TournamentFormat::Swiss.into(),
        ..v1::TournamentSettings::default()
    };
    elsewhere
        .create_tournament(settings)
        .await
        .expect("created");
    let listed = client.list_tournaments(v1::ListTournamentsRequest::default());
    assert_eq!(listed.await.expect("a page").tournaments.len(), 1);
    let wrong = v1::ListRoomsRequest {
        page_token: "7".into(),
        ..v1::ListRoomsRequest::default()
    };
    let refused = client.list_rooms(wrong).await.expect_err("of no node");
    assert_eq!(refused.reason(), Some("PAGE_TOKEN_REFUSED"));
    // A node that cannot be reached is left out.
    nodes.link(0, 2).close();
    let listed = patiently("a page", client.list_rooms(v1::ListRoomsRequest::default())).await;
    assert_eq!(listed.expect("a page").rooms.len(), 5);
}
