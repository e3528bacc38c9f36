//! Joining, attaching, closing and leaving rooms: who may, and the errors for others.

use chefshat_proto::v1::{self, room_service_client::RoomServiceClient, seat_update::Update};
use chefshat_tests::{StreamSeat, TestServer, attach_all, first_update, one_shift, room_of_four};
use tonic::Code;

use crate::records::reason;

fn join(code: &str) -> v1::JoinRoomRequest {
    v1::JoinRoomRequest {
        join_code: code.into(),
        name: "somebody".into(),
        ..v1::JoinRoomRequest::default()
    }
}

#[tokio::test]
async fn joining_needs_the_code_and_a_free_seat() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (created, _) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let room_id = created.room.expect("a new room").room_id;
    let code = created.join_code;
    let cases = [
        (join("WRONG"), Code::PermissionDenied, "JOIN_CODE_WRONG"),
        (
            v1::JoinRoomRequest {
                room_id: room_id.clone(),
                ..join("WRONG")
            },
            Code::PermissionDenied,
            "JOIN_CODE_WRONG",
        ),
        (
            v1::JoinRoomRequest {
                room_id: "00".repeat(16),
                ..join(&code)
            },
            Code::NotFound,
            "ROOM_UNKNOWN",
        ),
        (join(&code), Code::ResourceExhausted, "ROOM_FULL"),
        (
            join(&code.to_lowercase()),
            Code::ResourceExhausted,
            "ROOM_FULL",
        ),
        (
            v1::JoinRoomRequest {
                seat: Some(2),
                ..join(&code)
            },
            Code::FailedPrecondition,
            "SEAT_TAKEN",
        ),
        (
            v1::JoinRoomRequest {
                seat: Some(4),
                ..join(&code)
            },
            Code::InvalidArgument,
            "NO_SUCH_SEAT",
        ),
        (
            v1::JoinRoomRequest {
                name: "\u{7}".into(),
                ..join(&code)
            },
            Code::InvalidArgument,
            "NAME_REFUSED",
        ),
    ];
    for (request, status, reason) in cases {
        let error = client
            .join(request.clone())
            .await
            .expect_err("joining is refused");
        assert_eq!(error.reason(), Some(reason), "{request:?}");
        assert_eq!(error.code(), status, "{request:?}");
    }
}

#[tokio::test]
async fn attaching_needs_a_ticket_of_this_room() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (_, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let mut altered = tickets[0].clone().into_bytes();
    let last = altered.len() - 3;
    altered[last] = if altered[last] == b'0' { b'1' } else { b'0' };
    let altered = String::from_utf8(altered).expect("still digits");
    let mut seat = StreamSeat::open(server.channel().await).await;
    for (request_id, ticket) in [(7, "nonsense"), (8, ""), (9, altered.as_str())] {
        seat.attach(v1::Attach {
            ticket: ticket.to_owned(),
            request_id,
            ..v1::Attach::default()
        })
        .await;
        match seat.next().await {
            Update::Refused(refused) => {
                assert_eq!(refused.reason, "TICKET_UNKNOWN");
                assert_eq!(refused.request_id, request_id);
                assert!(!refused.message.is_empty());
            }
            other => panic!("not refused, but {other:?}"),
        }
    }
    // The stream is unaffected.
    seat.attach(v1::Attach {
        ticket: tickets[0].clone(),
        request_id: 10,
        ..v1::Attach::default()
    })
    .await;
    match seat.next().await {
        Update::Attached(attached) => assert_eq!((attached.request_id, attached.seat), (10, 0)),
        other => panic!("not attached, but {other:?}"),
    }
}

#[tokio::test]
async fn only_its_owner_closes_a_room() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (mine, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let (other, _) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let id = |created: &v1::CreateRoomResponse| {
        created.room.as_ref().expect("a new room").room_id.clone()
    };
    for token in [other.owner_token.as_str(), tickets[0].as_str(), ""] {
        let error = client
            .close_room(id(&mine), token)
            .await
            .expect_err("not the owner");
        assert_eq!(error.reason(), Some("OWNER_TOKEN_WRONG"));
    }
    let mut seat = StreamSeat::attached(server.channel().await, &tickets[0]).await;
    let closed = client
        .close_room(id(&mine), mine.owner_token.clone())
        .await
        .expect("closed");
    assert_eq!(closed.state(), v1::RoomState::Aborted);
    match seat.next().await {
        Update::Detached(detached) => assert_eq!(detached.reason(), v1::DetachReason::GameOver),
        other => panic!("not detached, but {other:?}"),
    }
}

#[tokio::test]
async fn a_room_can_be_looked_up_by_its_code_before_joining() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let created = client
        .create_room(v1::CreateRoomRequest::default())
        .await
        .expect("a new room");
    let room = created.room.expect("a room");
    let mut service = RoomServiceClient::new(server.channel().await);
    let mut look = async |room_id: &str, code: &str| {
        let request = v1::GetRoomRequest {
            room_id: room_id.into(),
            join_code: code.into(),
        };
        let found = service.get_room(request).await;
        found
            .map(|found| found.into_inner().room.expect("a room").room_id)
            .map_err(|status| (status.code(), reason(&status)))
    };
    let code = &created.join_code;
    assert_eq!(
        look("", &code.to_lowercase()).await,
        Ok(room.room_id.clone())
    );
    assert_eq!(look(&room.room_id, code).await, Ok(room.room_id.clone()));
    let wrong = Err((Code::PermissionDenied, "JOIN_CODE_WRONG".to_owned()));
    assert_eq!(look("", "WRONG").await, wrong);
    assert_eq!(look(&room.room_id, "WRONG").await, wrong);
    let unknown = Err((Code::NotFound, "ROOM_UNKNOWN".to_owned()));
    assert_eq!(look("", "").await, unknown);
}

#[tokio::test]
async fn a_seat_can_be_freed_until_the_game_starts() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let created = client
        .create_room(v1::CreateRoomRequest::default())
        .await
        .expect("a new room");
    let mut tickets = Vec::new();
    for _ in 0..4 {
        let joined = client.join(join(&created.join_code)).await;
        tickets.push(joined.expect("a free seat").ticket);
    }
    // An attached seat is notified; one that never was is not.
    let mut attached = StreamSeat::attached(server.channel().await, &tickets[1]).await;
    for seat in [1, 2] {
        let room = client
            .leave_room(&*tickets[seat])
            .await
            .expect("a waiting room");
        assert_eq!(room.seats[seat].name, "");
        let error = client.leave_room(&*tickets[seat]).await;
        assert_eq!(
            error.expect_err("it has left").reason(),
            Some("TICKET_UNKNOWN")
        );
    }
    let Update::Detached(detached) = attached.next().await else {
        panic!("the stream still has the seat");
    };
    assert_eq!(detached.reason(), v1::DetachReason::Requested);
    for seat in [1, 2] {
        let again = client.join(join(&created.join_code)).await;
        let again = again.expect("the seat is free again");
        assert_eq!(again.seat, u32::try_from(seat).expect("small"));
        tickets[seat] = again.ticket;
    }
    let mut seats = attach_all(&server, &tickets).await;
    let (_, to_play) = first_update(&mut seats).await;
    let error = client.leave_room(&*tickets[to_play]).await;
    assert_eq!(
        error.expect_err("the game has started").reason(),
        Some("GAME_STARTED")
    );
}
