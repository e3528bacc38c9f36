//! Who is let in, and what those who are not are told.

use chefshat_proto::v1::{self, seat_update::Update};
use chefshat_tests::{StreamSeat, TestServer, one_shift, room_of_four};
use tonic::Code;

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
    let room_id = created.room.expect("a room was made").room_id;
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
            .expect_err("nobody is let in");
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
    altered[last] = if altered[last] == b'A' { b'B' } else { b'A' };
    let altered = String::from_utf8(altered).expect("still letters");
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
    // The stream has taken no harm.
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
        created
            .room
            .as_ref()
            .expect("a room was made")
            .room_id
            .clone()
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
        .expect("the owner may");
    assert_eq!(closed.state(), v1::RoomState::Aborted);
    match seat.next().await {
        Update::Detached(detached) => assert_eq!(detached.reason(), v1::DetachReason::GameOver),
        other => panic!("not detached, but {other:?}"),
    }
}
