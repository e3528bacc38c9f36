//! Tokens, roles and scopes over real sockets. The role matrix is asked of a running server and
//! must be the table in docs/access.md.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use chefshat_client::{Client, ConnectOptions, Error};
use chefshat_proto::v1::{
    self, room_service_client::RoomServiceClient, spectator_service_client::SpectatorServiceClient,
    study_service_client::StudyServiceClient, tournament_service_client::TournamentServiceClient,
};
use chefshat_record::replay::replay;
use chefshat_record::signature::{self, SigningKey};
use chefshat_room::ids::Id;
use chefshat_server::access::{
    AccessSettings, CALLS, Call, Mode, NewToken, Role, Scope, Scoped, TokenFile, TokenId,
};
use chefshat_server::config::ServerConfig;
use chefshat_server::host::Host;
use chefshat_server::store::MemoryStore;
use chefshat_tests::{TestServer, one_shift, patiently, play_out, room_of_four};
use http::{Method, Request, StatusCode};
use http_body_util::Full;
use hyper_util::client::legacy::Client as HttpClient;
use hyper_util::client::legacy::connect::HttpConnector;
use hyper_util::rt::TokioExecutor;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

/// A call without fields: the frame of an empty message.
const EMPTY_CALL: &[u8] = &[0; 5];
/// What starts the paths of this project's services.
const PACKAGE: &str = "/chefshat.v1.";
/// The line in docs/access.md before the table.
const TABLE_FOLLOWS: &str =
    "<!-- The table is compared with a running server by tests/tests/system/access.rs. -->\n";

/// A server that requires tokens.
struct Guarded {
    server: TestServer,
    tokens: TokenFile,
}

impl Guarded {
    async fn start() -> Self {
        let require = |config: &mut chefshat_server::config::ServerConfig| {
            config.signing_key = Some(Arc::new(SigningKey::from_seed(&[7; 32])));
            config.access = AccessSettings {
                mode: Some(Mode::Tokens),
                ..AccessSettings::default()
            };
        };
        let server = TestServer::with(require, Arc::new(MemoryStore::default())).await;
        let tokens = TokenFile::of(server.data_dir());
        Self { server, tokens }
    }

    /// Creates a token.
    fn token(
        &self,
        role: Role,
        scope: Option<Scope>,
        lifetime: Option<Duration>,
    ) -> (TokenId, String) {
        let created = self.tokens.create(NewToken {
            role,
            label: String::new(),
            lifetime,
            scope,
        });
        let created = created.expect("the data folder is writable");
        (created.id, created.to_text())
    }

    async fn client(&self, token: &str) -> Client {
        let options = ConnectOptions {
            token: Some(token.to_owned()),
            ca: None,
        };
        let client = Client::connect_with(self.server.url(), &options).await;
        client.expect("the server listens")
    }

    /// A token with its client.
    async fn caller(&self, role: Role, scope: Option<Scope>) -> (TokenId, Client) {
        let (id, token) = self.token(role, scope, None);
        (id, self.client(&token).await)
    }

    /// Why access refuses an empty call, if it does.
    async fn refusal(&self, path: &str, token: Option<&str>) -> Option<String> {
        let mut request = Request::post(format!("{}{path}", self.server.url()))
            .header("content-type", "application/grpc")
            .header("te", "trailers");
        if let Some(token) = token {
            request = request.header("authorization", format!("Bearer {token}"));
        }
        let body = Full::new(Bytes::from_static(EMPTY_CALL));
        let request = request.body(body).expect("a request");
        let answering = http_client().request(request);
        let response = patiently("the headers of an answer", answering).await;
        let response = response.expect("the server answers");
        assert_eq!(response.status(), StatusCode::OK, "{path}");
        // A refused call is answered with headers alone; others are not read further.
        let status = Status::from_header_map(response.headers())?;
        let reason = status.get_details_error_info()?.reason;
        let ours = [
            "TOKEN_MISSING",
            "TOKEN_UNKNOWN",
            "TOKEN_EXPIRED",
            "ROLE_TOO_LOW",
            "OUT_OF_SCOPE",
        ];
        ours.contains(&reason.as_str()).then_some(reason)
    }
}

#[tokio::test]
async fn a_repeated_request_is_answered_to_its_own_token_alone() {
    let server = Guarded::start().await;
    let (_, first) = server.caller(Role::Host, None).await;
    let (_, second) = server.caller(Role::Host, None).await;
    let request_id = vec![7; 32];
    let open = v1::CreateRoomRequest {
        rules: Some(one_shift()),
        seats: vec![v1::SeatConfig::default(); 4],
        request_id: request_id.clone(),
        ..v1::CreateRoomRequest::default()
    };
    let create = async |client: &Client| {
        let mut service = RoomServiceClient::new(client.channel());
        let created = service.create_room(open.clone()).await;
        created.expect("a room").into_inner()
    };
    let room = create(&first).await;
    assert_eq!(
        create(&first).await.owner_token,
        room.owner_token,
        "repeated"
    );
    let other = create(&second).await;
    assert_ne!(other.owner_token, room.owner_token);
    let id_of = |room: &v1::CreateRoomResponse| room.room.as_ref().expect("a room").room_id.clone();
    assert_ne!(id_of(&other), id_of(&room));
    let join = async |client: &Client| {
        let mut service = RoomServiceClient::new(client.channel());
        let joined = service.join_room(v1::JoinRoomRequest {
            room_id: id_of(&room),
            join_code: room.join_code.clone(),
            name: "Ada".to_owned(),
            request_id: request_id.clone(),
            ..v1::JoinRoomRequest::default()
        });
        joined.await.expect("a seat").into_inner().ticket
    };
    let ticket = join(&first).await;
    assert_eq!(join(&first).await, ticket, "repeated");
    assert_ne!(join(&second).await, ticket);
    let settings = v1::TournamentSettings {
        name: "Cup".to_owned(),
        format: v1::TournamentFormat::RoundRobin.into(),
        max_participants: 8,
        ..v1::TournamentSettings::default()
    };
    let hold = async |client: &Client| {
        let mut service = TournamentServiceClient::new(client.channel());
        let created = service.create_tournament(v1::CreateTournamentRequest {
            settings: Some(settings.clone()),
            request_id: request_id.clone(),
        });
        created
            .await
            .expect("a tournament")
            .into_inner()
            .owner_token
    };
    let owner = hold(&first).await;
    assert_eq!(hold(&first).await, owner, "repeated");
    assert_ne!(hold(&second).await, owner);
}

#[tokio::test]
async fn a_study_of_empty_factors_is_refused_before_it_is_decoded() {
    let server = Guarded::start().await;
    let (_, host) = server.caller(Role::Host, None).await;
    let factors = vec![v1::StudyFactor::default(); 500_000];
    let settings = v1::StudySettings {
        factors,
        ..v1::StudySettings::default()
    };
    let mut studies = StudyServiceClient::new(host.channel());
    let created = studies.create_study(v1::CreateStudyRequest {
        settings: Some(settings),
        ..v1::CreateStudyRequest::default()
    });
    let status = created.await.expect_err("too many");
    let info = status.get_details_error_info().expect("a reason");
    assert_eq!(
        (status.code(), info.reason.as_str()),
        (Code::OutOfRange, "TOO_MANY_ELEMENTS")
    );
    assert!(info.metadata.contains_key("max_elements"), "{info:?}");
}

fn http_client() -> HttpClient<HttpConnector, Full<Bytes>> {
    HttpClient::builder(TokioExecutor::new())
        .http2_only(true)
        .build_http()
}

fn reason_of(error: &Error) -> Option<&str> {
    error.reason()
}

#[tokio::test]
async fn every_call_has_the_role_that_the_documentation_says() {
    let guarded = Guarded::start().await;
    let elsewhere = Some(Scope::Room(Id::random()));
    let minute = Some(Duration::from_secs(3_600));
    let callers: Vec<(&str, Option<String>)> = vec![
        ("no token", None),
        (
            "spectator",
            Some(guarded.token(Role::Spectator, None, minute).1),
        ),
        ("player", Some(guarded.token(Role::Player, None, minute).1)),
        ("host", Some(guarded.token(Role::Host, None, minute).1)),
        ("admin", Some(guarded.token(Role::Admin, None, minute).1)),
        (
            "expired",
            Some(guarded.token(Role::Admin, None, Some(Duration::ZERO)).1),
        ),
        (
            "host, scoped",
            Some(guarded.token(Role::Host, elsewhere, minute).1),
        ),
    ];

    let mut calls: Vec<&Call> = CALLS
        .iter()
        .filter(|it| it.path.starts_with(PACKAGE))
        .collect();
    calls.sort_by_key(|call| call.path);
    let mut table = String::from("\n| calls |");
    callers
        .iter()
        .for_each(|(name, _)| table += &format!(" {name} |"));
    table += "\n|---|";
    callers.iter().for_each(|_| table += "---|");
    table += "\n";
    // The calls that answer all callers alike are a row.
    let mut rows: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for call in calls {
        let mut cells = String::new();
        for (name, token) in &callers {
            let refusal = guarded.refusal(call.path, token.as_deref()).await;
            let cell = match refusal {
                Some(reason) => format!("`{reason}`"),
                None if *name == "host, scoped" && call.scoped == Scoped::Compared => {
                    "in its scope".to_owned()
                }
                None => "yes".to_owned(),
            };
            cells += &format!(" {cell} |");
        }
        let name = format!("`{}`", call.path.trim_start_matches(PACKAGE));
        rows.entry(cells).or_default().push(name);
    }
    for (cells, names) in rows {
        table += &format!("| {} |{cells}\n", names.join(", "));
    }
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/access.md");
    let page = std::fs::read_to_string(page).expect("the page");
    let (_, rest) = page
        .split_once(TABLE_FOLLOWS)
        .expect("the line before the table");
    let documented = rest.split("\n\n").next().expect("the table");
    assert_eq!(
        documented.trim(),
        table.trim(),
        "docs/access.md should have:\n{table}"
    );
}

#[tokio::test]
async fn a_scoped_token_reaches_its_room_alone() {
    let guarded = Guarded::start().await;
    let (_, host) = guarded.caller(Role::Host, None).await;
    let (mine, tickets) = room_of_four(&host, one_shift(), v1::RoomPolicy::default()).await;
    let (other, other_tickets) = room_of_four(&host, one_shift(), v1::RoomPolicy::default()).await;
    let room = mine.room.expect("a room");
    let other_room = other.room.expect("a room");
    let scope = Scope::Room(Id::parse(&room.room_id).expect("an id"));
    let (_, scoped) = guarded.caller(Role::Host, Some(scope)).await;

    let rooms = scoped
        .list_rooms(v1::ListRoomsRequest::default())
        .await
        .expect("a list")
        .rooms;
    let ids: Vec<_> = rooms.iter().map(|it| &it.room_id).collect();
    assert_eq!(ids, [&room.room_id]);
    scoped.get_room(&room.room_id).await.expect("its room");
    let refused = |error: Error| assert_eq!(reason_of(&error), Some("OUT_OF_SCOPE"), "{error}");
    refused(
        scoped
            .get_room(&other_room.room_id)
            .await
            .expect_err("another room"),
    );
    refused(
        scoped
            .close_room(&other_room.room_id, &other.owner_token)
            .await
            .expect_err("another"),
    );
    refused(
        scoped
            .leave_room(&other_tickets[0])
            .await
            .expect_err("another room"),
    );
    let join = v1::JoinRoomRequest {
        join_code: other.join_code.clone(),
        name: "stranger".to_owned(),
        ..v1::JoinRoomRequest::default()
    };
    refused(scoped.join(join).await.expect_err("another room"));
    let watch = |room_id: &str| v1::SpectatorServiceWatchRequest {
        room_id: room_id.to_owned(),
        ..v1::SpectatorServiceWatchRequest::default()
    };
    let mut spectate = SpectatorServiceClient::new(scoped.channel());
    let error = spectate
        .watch(watch(&other_room.room_id))
        .await
        .expect_err("another room");
    assert_eq!(error.code(), Code::PermissionDenied);
    spectate
        .watch(watch(&room.room_id))
        .await
        .expect("its room");

    // Records of both games, seen by the scoped token and by a spectator.
    for tickets in [tickets, other_tickets] {
        let agents = chefshat_tests::random_agents(tickets);
        for outcome in patiently("the game to end", host.play_many(agents)).await {
            outcome.expect("the game ended");
        }
    }
    let listed = scoped
        .list_records(v1::ListRecordsRequest::default())
        .await
        .expect("a list");
    let games: Vec<_> = listed.records.iter().map(|it| &it.game_id).collect();
    assert_eq!(games, [&room.game_id]);
    scoped.record(&room.game_id).await.expect("its record");
    refused(
        scoped
            .record(&other_room.game_id)
            .await
            .expect_err("another record"),
    );
}

#[tokio::test]
async fn what_is_only_for_the_record_is_for_hosts() {
    let guarded = Guarded::start().await;
    let (_, host) = guarded.caller(Role::Host, None).await;
    let (_, spectator) = guarded.caller(Role::Spectator, None).await;
    let (created, tickets) = room_of_four(&host, one_shift(), v1::RoomPolicy::default()).await;
    for (record_only, label) in [(true, "secret"), (false, "joy")] {
        let expression = v1::Expression {
            label: label.to_owned(),
            media: "file.mp4".to_owned(),
            record_only,
            ..v1::Expression::default()
        };
        host.express(&tickets[0], expression)
            .await
            .expect("expressed");
    }
    let agents = chefshat_tests::random_agents(tickets);
    for outcome in patiently("the game to end", host.play_many(agents)).await {
        outcome.expect("the game ended");
    }
    let game = created.room.expect("a room").game_id;
    let all = host.record(&game).await.expect("a record");
    let some = spectator.record(&game).await.expect("a record");
    // Both are signed, and both are records.
    for lines in [&all, &some] {
        let signer = signature::signer(lines).expect("a valid signature");
        assert_eq!(signer, Some(SigningKey::from_seed(&[7; 32]).public()));
        replay(lines).expect("a valid record");
    }
    let (all, some) = (format!("{all:?}"), format!("{some:?}"));
    for (word, for_spectators) in [("secret", false), ("file.mp4", false), ("joy", true)] {
        assert!(all.contains(word), "{word}");
        assert_eq!(some.contains(word), for_spectators, "{word}");
    }
}

#[tokio::test]
async fn a_stream_ends_with_its_token_and_no_other_does() {
    let guarded = Guarded::start().await;
    let (_, host) = guarded.caller(Role::Host, None).await;
    let created = host
        .create_room(v1::CreateRoomRequest::default())
        .await
        .expect("a room");
    let room_id = created.room.expect("a room").room_id;
    let (revoked, first) = guarded.caller(Role::Spectator, None).await;
    let (_, second) = guarded.caller(Role::Spectator, None).await;
    let mut streams = Vec::new();
    for client in [&first, &second] {
        let request = v1::SpectatorServiceWatchRequest {
            room_id: room_id.clone(),
            ..v1::SpectatorServiceWatchRequest::default()
        };
        let watching = SpectatorServiceClient::new(client.channel())
            .watch(request)
            .await;
        let mut stream = watching.expect("a stream").into_inner();
        stream.message().await.expect("no error").expect("the room");
        streams.push(stream);
    }
    guarded
        .tokens
        .revoke(revoked)
        .expect("written")
        .expect("a token")
        .expect("readable");
    let ended = async {
        loop {
            match streams[0].message().await {
                // A heartbeat.
                Ok(Some(_)) => {}
                ended => break ended,
            }
        }
    };
    let status = patiently("the stream to end", ended)
        .await
        .expect_err("revoked");
    assert_eq!(status.code(), Code::Unauthenticated);
    let info = status.get_details_error_info().expect("error info");
    assert_eq!(info.reason, "TOKEN_UNKNOWN");
    let error = first.get_room(&room_id).await.expect_err("revoked");
    assert_eq!(reason_of(&error), Some("TOKEN_UNKNOWN"));

    host.close_room(&room_id, &created.owner_token)
        .await
        .expect("its room");
    let events = async {
        loop {
            let message = streams[1].message().await.expect("no error");
            let message = message.expect("the end of the game comes first");
            if !message.events.is_empty() {
                break;
            }
        }
    };
    patiently("the other stream to continue", events).await;
}

#[tokio::test]
async fn an_open_server_needs_no_token_and_lets_nobody_operate_it() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (_, tickets) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    play_out(&server, tickets).await;
    let path = format!("{}/chefshat.v1.RoomService/NoSuchCall", server.url());
    let body = Full::new(Bytes::from_static(EMPTY_CALL));
    let request = Request::post(path)
        .header("content-type", "application/grpc")
        .body(body);
    let answer = http_client()
        .request(request.expect("a request"))
        .await
        .expect("an answer");
    let status = Status::from_header_map(answer.headers()).expect("a status");
    assert_eq!(status.code(), Code::Unimplemented);
}

#[tokio::test]
async fn a_foreign_page_creates_no_room() {
    let server = TestServer::start().await;
    let create = |origin: &'static str| {
        let path = format!("{}/chefshat.v1.RoomService/CreateRoom", server.url());
        // What a page may send without being asked first.
        let request = Request::post(path)
            .header("content-type", "text/plain")
            .header("origin", origin)
            .body(Full::new(Bytes::from_static(EMPTY_CALL)));
        http_client().request(request.expect("a request"))
    };
    let refused = create("https://evil.net").await.expect("an answer");
    assert_eq!(refused.status(), StatusCode::FORBIDDEN);
    let status = Status::from_header_map(refused.headers()).expect("a status");
    assert_eq!(status.code(), Code::PermissionDenied);
    let client = server.client().await;
    let rooms = client
        .list_rooms(v1::ListRoomsRequest::default())
        .await
        .expect("a list");
    assert_eq!(rooms.rooms, []);
}

/// A page of an allowed origin asks the browser to send a token, and the browser asks the server.
#[tokio::test]
async fn a_server_inside_a_command_needs_no_token_of_the_one_that_has_the_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let tokens = TokenFile::of(folder.path());
    let player = NewToken {
        role: Role::Player,
        label: String::new(),
        lifetime: None,
        scope: None,
    };
    tokens.create(player).expect("a token");
    let host = Host::in_memory(Some(folder.path().to_path_buf())).await;
    let host = host.expect("a free port");
    let client = Client::connect(host.url()).await.expect("it listens");
    room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    host.stop().await.expect("it stops");
}

#[tokio::test]
async fn a_page_of_an_allowed_origin_may_send_tokens() {
    const ORIGIN: &str = "https://page.example";
    let allow = |config: &mut ServerConfig| config.allowed_origins = vec![ORIGIN.to_owned()];
    let server = TestServer::with(allow, Arc::new(MemoryStore::default())).await;
    let request = Request::builder()
        .method(Method::OPTIONS)
        .uri(format!("{}/chefshat.v1.RoomService/GetRoom", server.url()))
        .header("origin", ORIGIN)
        .header("access-control-request-method", "POST")
        .header("access-control-request-headers", "authorization,x-grpc-web")
        .body(Full::new(Bytes::new()))
        .expect("a request");
    let answer = http_client().request(request).await.expect("an answer");
    let allowed = &answer.headers()["access-control-allow-headers"];
    // A star would not include it.
    assert!(
        allowed.to_str().expect("text").contains("authorization"),
        "{allowed:?}"
    );
}
