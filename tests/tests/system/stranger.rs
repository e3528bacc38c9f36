//! Malformed bytes and meaningless messages: no panic, no change, and other clients are unaffected.

use bytes::{Buf, BufMut, Bytes};
use chefshat_proto::v1;
use chefshat_tests::{StreamSeat, TestServer, attach_all, one_shift, play_on, room_of_four};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tonic::Status;
use tonic::codec::{Codec, DecodeBuf, Decoder, EncodeBuf, Encoder};

/// A codec that passes bytes through.
#[derive(Debug, Clone, Copy, Default)]
struct Raw;

impl Codec for Raw {
    type Encode = Bytes;
    type Decode = Bytes;
    type Encoder = Self;
    type Decoder = Self;

    fn encoder(&mut self) -> Self {
        Self
    }

    fn decoder(&mut self) -> Self {
        Self
    }
}

impl Encoder for Raw {
    type Item = Bytes;
    type Error = Status;

    fn encode(&mut self, item: Bytes, buffer: &mut EncodeBuf<'_>) -> Result<(), Status> {
        buffer.put(item);
        Ok(())
    }
}

impl Decoder for Raw {
    type Item = Bytes;
    type Error = Status;

    fn decode(&mut self, buffer: &mut DecodeBuf<'_>) -> Result<Option<Bytes>, Status> {
        Ok(Some(buffer.copy_to_bytes(buffer.remaining())))
    }
}

/// Random bytes, and valid messages with some bytes changed.
fn garbage(generator: &mut ChaCha8Rng, ticket: &str) -> Bytes {
    use prost_message::encode;
    let mut bytes = match generator.random_range(0..4) {
        0 => (0..generator.random_range(0..200))
            .map(|_| generator.random())
            .collect(),
        1 => encode(&v1::PlayRequest {
            commands: vec![v1::SeatCommand {
                handle: generator.random_range(0..3),
                command: Some(v1::seat_command::Command::Answer(v1::Answer {
                    decision_id: generator.random_range(0..4),
                    action: generator.random(),
                    annotations: None,
                })),
            }],
        }),
        2 => encode(&v1::ActRequest {
            ticket: ticket.to_owned(),
            command: None,
        }),
        _ => encode(&v1::CreateRoomRequest {
            rules: Some(v1::RuleSet {
                players: Some(generator.random()),
                faces: Some(generator.random()),
                points: vec![generator.random(); 3],
                ..v1::RuleSet::default()
            }),
            ..v1::CreateRoomRequest::default()
        }),
    };
    if !bytes.is_empty() && generator.random() {
        let at = generator.random_range(0..bytes.len());
        bytes[at] = generator.random();
    }
    bytes.into()
}

mod prost_message {
    use tonic_prost::prost::Message;

    pub(super) fn encode(message: &impl Message) -> Vec<u8> {
        message.encode_to_vec()
    }
}

#[tokio::test]
async fn no_bytes_harm_a_server_or_a_game() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (created, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let mut seats = attach_all(&server, &tickets[..3]).await;
    let room_id = created.room.expect("a room").room_id;
    let before = client.get_room(&room_id).await.expect("it exists");

    let mut generator = ChaCha8Rng::seed_from_u64(5);
    let paths = [
        "/chefshat.v1.PlayService/Play",
        "/chefshat.v1.PlayService/Watch",
        "/chefshat.v1.PlayService/Act",
        "/chefshat.v1.RoomService/CreateRoom",
        "/chefshat.v1.RoomService/GetRoom",
        "/chefshat.v1.RoomService/ListRooms",
        "/chefshat.v1.RoomService/JoinRoom",
        "/chefshat.v1.RoomService/CloseRoom",
        "/chefshat.v1.SpectatorService/Watch",
        "/chefshat.v1.RecordService/GetRecord",
        "/chefshat.v1.ServerService/GetActionTable",
        "/chefshat.v1.ServerService/GetClock",
    ];
    let mut grpc = tonic::client::Grpc::new(server.channel().await);
    let mut refused = 0;
    for round in 0..40 {
        for path in paths {
            let messages: Vec<Bytes> = (0..3)
                .map(|_| garbage(&mut generator, &tickets[3]))
                .collect();
            grpc.ready().await.expect("the connection holds");
            let request = tonic::Request::new(tokio_stream::iter(messages));
            let path = http::uri::PathAndQuery::from_static(path);
            match grpc.streaming(request, path, Raw).await {
                Ok(mut response) => {
                    // One message or the end: only that it arrives matters, not what it says. Watch
                    // has no end.
                    if chefshat_tests::patiently("an answer", response.get_mut().message())
                        .await
                        .is_err()
                    {
                        refused += 1;
                    }
                }
                Err(_) => refused += 1,
            }
        }
        assert!(round < 40);
    }
    assert!(refused > 100, "only {refused} were refused");
    let after = client.get_room(&room_id).await.expect("it exists");
    assert_eq!(after, before, "nothing has changed");
    seats.push(StreamSeat::attached(server.channel().await, &tickets[3]).await);
    let reasons = futures::future::join_all(seats.iter_mut().map(play_on)).await;
    assert_eq!(reasons, [v1::DetachReason::GameOver; 4]);
}

#[tokio::test]
async fn a_message_over_the_limit_ends_only_its_stream() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (_, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let mut huge = StreamSeat::open(server.channel().await).await;
    huge.attach(v1::Attach {
        ticket: "x".repeat(70_000),
        ..v1::Attach::default()
    })
    .await;
    let status = huge.next_or_end().await.expect_err("too large");
    assert_eq!(status.code(), tonic::Code::OutOfRange);
    StreamSeat::attached(server.channel().await, &tickets[0]).await;
}
