//! Browsers: the page and gRPC-web on the same port, over HTTP/1.1, with one stream for watching
//! and single calls for acting; and tools: reflection. clients/web tests the page itself.

use std::collections::VecDeque;
use std::sync::Arc;

use chefshat_proto::v1::{
    self, play_service_client::PlayServiceClient, room_service_client::RoomServiceClient,
    seat_update::Update,
};
use chefshat_server::config::{PaintingSettings, ServerConfig};
use chefshat_server::store::MemoryStore;
use chefshat_tests::{
    PATIENCE, TestServer, attach_all, first_legal, one_shift, patiently, play_on, play_out,
    room_of_four, set_up,
};
use http_body_util::BodyExt as _;
use hyper_util::client::legacy::Client as HttpClient;
use hyper_util::rt::TokioExecutor;
use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
use tonic_reflection::pb::v1::{
    ServerReflectionRequest, server_reflection_request::MessageRequest,
    server_reflection_response::MessageResponse,
};
use tonic_web::GrpcWebClientLayer;
use tower::ServiceBuilder;

#[tokio::test]
async fn a_seat_plays_over_grpc_web_on_the_same_port() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (created, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let mut others = attach_all(&server, &tickets[1..]).await;
    let others =
        tokio::spawn(
            async move { futures::future::join_all(others.iter_mut().map(play_on)).await },
        );

    // HTTP/1.1 only, as browsers use it for servers without TLS.
    let http = HttpClient::builder(TokioExecutor::new()).build_http();
    let web = ServiceBuilder::new()
        .layer(GrpcWebClientLayer::new())
        .service(http);
    let origin: http::Uri = server.url().parse().expect("a URL");
    let mut rooms = RoomServiceClient::with_origin(web.clone(), origin.clone());
    let room_id = created.room.expect("a room").room_id;
    let room = rooms
        .get_room(v1::GetRoomRequest {
            room_id,
            ..v1::GetRoomRequest::default()
        })
        .await
        .expect("the server answers")
        .into_inner();
    assert!(room.room.is_some());

    let mut play = PlayServiceClient::with_origin(web.clone(), origin);
    let mut updates = play
        .watch(v1::PlayServiceWatchRequest {
            seats: vec![v1::Attach {
                ticket: tickets[0].clone(),
                ..v1::Attach::default()
            }],
        })
        .await
        .expect("a stream")
        .into_inner();
    let mut waiting: VecDeque<v1::SeatUpdate> = VecDeque::new();
    let mut decisions = 0;
    let mut last_event = 0;
    let reason = loop {
        let Some(update) = waiting.pop_front() else {
            let message = patiently("the next message", updates.message())
                .await
                .expect("no error")
                .expect("the stream continues");
            waiting.extend(message.updates);
            continue;
        };
        match update.update.expect("an update") {
            Update::Events(batch) => {
                for event in batch.events {
                    assert_eq!(event.sequence, last_event + 1);
                    last_event = event.sequence;
                }
            }
            Update::Decision(decision) => {
                decisions += 1;
                let result = play
                    .act(v1::ActRequest {
                        ticket: tickets[0].clone(),
                        command: Some(v1::act_request::Command::Answer(v1::Answer {
                            decision_id: decision.decision_id,
                            action: first_legal(&decision),
                            annotations: None,
                        })),
                    })
                    .await
                    .expect("an accepted answer")
                    .into_inner()
                    .result
                    .expect("an answer has a result");
                assert_eq!(result.status(), v1::AnswerStatus::Accepted);
            }
            Update::Detached(detached) => break detached.reason(),
            _ => {}
        }
    };
    assert_eq!(reason, v1::DetachReason::GameOver);
    assert!(decisions > 0);
    assert_eq!(
        others.await.expect("the others play"),
        [v1::DetachReason::GameOver; 3]
    );
}

/// What a chat gets that follows a link.
#[derive(Debug)]
struct Followed {
    status: http::StatusCode,
    media_type: String,
    body: bytes::Bytes,
}

impl Followed {
    fn text(&self) -> std::borrow::Cow<'_, str> {
        String::from_utf8_lossy(&self.body)
    }
}

async fn followed(server: &TestServer, path: &str) -> Followed {
    let http = HttpClient::builder(TokioExecutor::new())
        .build_http::<http_body_util::Empty<bytes::Bytes>>();
    let uri = format!("{}{path}", server.url()).parse().expect("a URI");
    let answer = patiently("an answer", http.get(uri)).await;
    let (head, body) = answer.expect("the server answers").into_parts();
    let media_type = head.headers["content-type"].to_str().expect("text");
    Followed {
        status: head.status,
        media_type: media_type.to_owned(),
        body: body.collect().await.expect("a body").to_bytes(),
    }
}

/// Follows a link until the answer is one that is waited for.
async fn followed_until(
    server: &TestServer,
    path: &str,
    awaited: impl Fn(&Followed) -> bool,
) -> Followed {
    let following = async {
        loop {
            let answer = followed(server, path).await;
            if awaited(&answer) {
                break answer;
            }
        }
    };
    patiently(path, following).await
}

#[tokio::test]
async fn a_link_to_a_replay_has_a_title_and_a_picture_unless_the_game_is_private() {
    let lab = set_up("CHEFSHAT_BIN").with_file_name("chefshat-lab");
    let painting = |config: &mut ServerConfig| {
        // A busy machine draws slowly, since games come first.
        config.painter = Some(PaintingSettings {
            program: lab,
            patience: PATIENCE,
        });
    };
    let server = TestServer::with(painting, Arc::new(MemoryStore::default())).await;
    let client = server.client().await;
    for (visibility, is_shown) in [
        (v1::Visibility::Unlisted, true),
        (v1::Visibility::Private, false),
    ] {
        let policy = v1::RoomPolicy {
            visibility: visibility.into(),
            ..v1::RoomPolicy::default()
        };
        let (created, tickets) = room_of_four(&client, one_shift(), policy).await;
        let game = created.room.expect("a room").game_id;
        let path = format!("/replay/{game}");
        let running = followed(&server, &format!("{path}.png")).await;
        assert_eq!(running.status, http::StatusCode::NOT_FOUND, "not ended");
        play_out(&server, tickets).await;
        if is_shown {
            // A server that is busy answers in time and without them.
            let has_picture = |it: &Followed| it.status != http::StatusCode::SERVICE_UNAVAILABLE;
            let shown = followed_until(&server, &format!("{path}.png"), has_picture).await;
            assert_eq!(shown.status, http::StatusCode::OK);
            assert_eq!(shown.media_type, "image/png");
            // The width stands behind the signature and the head of the first chunk.
            assert_eq!(shown.body[16..20], 1200_u32.to_be_bytes());
            if chefshat_server::web::is_built() {
                let has_tags = |it: &Followed| it.text().contains("og:title");
                let shown = followed_until(&server, &path, has_tags).await;
                let tag = format!("content=\"{}{path}.png\"", server.url());
                assert!(shown.text().contains(&tag), "{shown:?}");
                assert!(shown.text().contains("1. agent "), "{shown:?}");
            }
        } else {
            let picture = followed(&server, &format!("{path}.png")).await;
            assert_eq!(picture.status, http::StatusCode::NOT_FOUND);
            let document = followed(&server, &path).await;
            assert!(!document.text().contains("og:"), "{document:?}");
        }
    }
}

#[tokio::test]
async fn every_path_serves_the_page_in_both_http_versions_and_calls_still_work() {
    let server = TestServer::start().await;
    for http2 in [false, true] {
        let http = HttpClient::builder(TokioExecutor::new())
            .http2_only(http2)
            .build_http::<http_body_util::Empty<bytes::Bytes>>();
        for (method, path, status) in [
            ("GET", "/rooms/0123", None),
            ("HEAD", "/", None),
            ("GET", "/assets/none.js", Some(http::StatusCode::NOT_FOUND)),
        ] {
            let request = http::Request::builder()
                .method(method)
                .uri(format!("{}{path}", server.url()))
                .body(http_body_util::Empty::new())
                .expect("a request");
            let answer = patiently("an answer", http.request(request))
                .await
                .expect("the server answers");
            // Without a build of the page the answer is a page with instructions.
            let wanted = status.unwrap_or(match chefshat_server::web::is_built() {
                true => http::StatusCode::OK,
                false => http::StatusCode::SERVICE_UNAVAILABLE,
            });
            assert_eq!(answer.status(), wanted, "{method} {path}");
            assert_eq!(answer.headers()["x-content-type-options"], "nosniff");
            let media_type = answer.headers()["content-type"].to_str().expect("text");
            assert_eq!(
                media_type.starts_with("text/html"),
                status.is_none(),
                "{method} {path}: {media_type}"
            );
        }
    }
    let client = server.client().await;
    assert!(client.get_room("0".repeat(32)).await.is_err());
}

#[tokio::test]
async fn reflection_names_every_service() {
    let server = TestServer::start().await;
    let mut reflection = ServerReflectionClient::new(server.channel().await);
    let request = ServerReflectionRequest {
        message_request: Some(MessageRequest::ListServices(String::new())),
        ..ServerReflectionRequest::default()
    };
    let mut answers = reflection
        .server_reflection_info(tokio_stream::iter([request]))
        .await
        .expect("reflection is served")
        .into_inner();
    let answer = answers
        .message()
        .await
        .expect("no error")
        .expect("an answer");
    let Some(MessageResponse::ListServicesResponse(list)) = answer.message_response else {
        panic!("no list, but {answer:?}");
    };
    let names: Vec<String> = list
        .service
        .into_iter()
        .map(|service| service.name)
        .collect();
    for service in ["Play", "Room", "Spectator", "Record", "Server"] {
        let name = format!("chefshat.v1.{service}Service");
        assert!(names.contains(&name), "{name} is not among {names:?}");
    }
    assert!(names.contains(&"grpc.health.v1.Health".to_owned()));
}
