//! In step with other instruments: the server's clocks, markers, what expressions are about, and
//! webhooks.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use chefshat_client::{Client, ServerClock};
use chefshat_proto::v1::instrument_service_client::InstrumentServiceClient;
use chefshat_proto::v1::{
    self, expression::About, game_event::Kind, record_line::Line,
    record_service_client::RecordServiceClient,
};
use chefshat_record::{replay, samples};
use chefshat_server::config::ServerConfig;
use chefshat_server::host::Host;
use chefshat_server::store::{MemoryStore, SqliteStore};
use chefshat_server::webhooks::WebhookSettings;
use chefshat_tests::{
    TestNodes, TestServer, attach_all, one_shift, patiently, play_out, random_agents, room_of_four,
};
use futures::future::select_all;
use http_body_util::BodyExt as _;
use hyper_util::rt::TokioIo;
use serde_json::Value;
use tokio::net::TcpListener;
use tokio::sync::mpsc;
use tonic::Streaming;

/// A join of a room, between two instants.
struct Join {
    name: String,
    before: Instant,
    after: Instant,
}

/// Creates a room that is joined three times. Returns its id and the joins.
async fn joined(client: &Client) -> (v1::Room, Vec<Join>) {
    let created = client.create_room(v1::CreateRoomRequest::default()).await;
    join_thrice(client, created.expect("a room")).await
}

async fn join_thrice(client: &Client, created: v1::CreateRoomResponse) -> (v1::Room, Vec<Join>) {
    let mut joins = Vec::new();
    for number in 0..3 {
        let name = format!("agent {number}");
        let before = Instant::now();
        let join = client.join_with_code(&created.join_code, &name);
        join.await.expect("a free seat");
        let after = Instant::now();
        joins.push(Join {
            name,
            before,
            after,
        });
    }
    (created.room.expect("a room"), joins)
}

/// Checks that the clock places each event between the instants in which it must have happened.
async fn check(client: &Client, clock: &ServerClock, room: &v1::Room, joins: &[Join]) {
    // Half the round trip, and the millisecond to which the times of events are rounded.
    let error = clock.round_trip() / 2;
    let rounding = Duration::from_millis(1);
    let mut events = client.spectate(&room.room_id, 0);
    for join in joins {
        let event = patiently("an event", events.next()).await;
        let event = event.expect("watched").expect("not over");
        assert!(matches!(event.kind, Some(Kind::Seated(seated)) if seated.name == join.name));
        let instant = clock.instant_of(event.elapsed_ms).expect("an instant");
        assert!(instant - error <= join.after, "too late: {clock:?}");
        assert!(
            join.before <= instant + error + rounding,
            "too early: {clock:?}"
        );
    }
}

#[tokio::test]
async fn the_clock_of_a_room_places_its_events_between_what_came_before_and_after() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let before = Instant::now();
    let (room, joins) = joined(&client).await;
    let clock = client.room_clock(&room.room_id).await.expect("a clock");
    check(&client, &clock, &room, &joins).await;
    // The room's clock started at `created_at_ms`, when the room was created.
    let after = joins[0].before;
    let error = clock.round_trip() / 2 + Duration::from_millis(1);
    let zero = clock.instant_of(0).expect("an instant");
    assert!(before <= zero + error && zero - error <= after, "{clock:?}");
    let created_at = Duration::from_millis(room.created_at_ms);
    assert!(clock.time_of_day_at(before) <= created_at + error);
    assert!(created_at <= clock.time_of_day_at(after) + error);
}

#[tokio::test]
async fn the_offset_is_known_to_half_the_round_trip() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let clock = client.clock().await.expect("a clock");
    assert_eq!(clock.room_at(Instant::now()), None);
    assert_eq!(clock.instant_of(0), None);
    // The server is in this process, so the offset is zero.
    let error = clock.round_trip() / 2 + Duration::from_micros(2);
    assert!(u128::from(clock.offset_us().unsigned_abs()) <= error.as_micros());
    let refused = client.room_clock("ab".repeat(16)).await;
    let refused = refused.expect_err("no such room");
    assert_eq!(refused.reason(), Some("ROOM_UNKNOWN"));
}

#[tokio::test]
async fn the_clock_of_a_room_is_that_of_the_node_that_has_it() {
    let nodes = TestNodes::start(2).await;
    let created = nodes.create_room(1, v1::CreateRoomRequest::default()).await;
    let client = nodes.nodes[0].client().await;
    let (room, joins) = join_thrice(&client, created).await;
    let clock = client.room_clock(&room.room_id).await.expect("a clock");
    check(&client, &clock, &room, &joins).await;
}

/// A room of four, its owner's token and the tickets.
async fn owned_room(client: &Client) -> (v1::Room, String, Vec<String>) {
    let (created, tickets) = room_of_four(client, one_shift(), v1::RoomPolicy::default()).await;
    (created.room.expect("a room"), created.owner_token, tickets)
}

fn marker(room: &v1::Room, owner: &str, label: &str) -> v1::AddMarkerRequest {
    v1::AddMarkerRequest {
        room_id: room.room_id.clone(),
        owner_token: owner.to_owned(),
        label: label.to_owned(),
        elapsed_us: None,
    }
}

/// A stream that follows the markers of a room.
struct Following {
    stream: Streaming<v1::FollowMarkersResponse>,
    received: VecDeque<v1::Marker>,
}

impl Following {
    async fn new(client: &Client, room: &v1::Room, owner: &str, from_number: u64) -> Self {
        let mut service = InstrumentServiceClient::new(client.channel());
        let request = v1::FollowMarkersRequest {
            room_id: room.room_id.clone(),
            owner_token: owner.to_owned(),
            from_number,
        };
        let following = service.follow_markers(request).await;
        Self {
            stream: following.expect("a stream").into_inner(),
            received: VecDeque::new(),
        }
    }

    /// The next marker; `None` when the game is over.
    async fn next(&mut self) -> Option<v1::Marker> {
        while self.received.is_empty() {
            let next = patiently("a message", self.stream.message()).await;
            self.received.extend(next.expect("no error")?.markers);
        }
        self.received.pop_front()
    }
}

fn markers_of(lines: &[v1::RecordLine]) -> Vec<&v1::Marker> {
    let lines = lines.iter();
    lines
        .filter_map(|line| match &line.line {
            Some(Line::Marker(marker)) => Some(marker),
            _ => None,
        })
        .collect()
}

/// The record of a game as this client sees it.
async fn record_seen_by(client: &Client, room: &v1::Room) -> Vec<v1::RecordLine> {
    let mut records = RecordServiceClient::new(client.channel());
    let request = v1::GetRecordRequest {
        game_id: room.game_id.clone(),
    };
    let mut stream = records
        .get_record(request)
        .await
        .expect("over")
        .into_inner();
    let mut lines = Vec::new();
    while let Some(part) = stream.message().await.expect("no error") {
        lines.extend(part.lines);
    }
    lines
}

#[tokio::test]
async fn markers_are_recorded_and_reach_the_owner_alone() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (room, owner, tickets) = owned_room(&client).await;
    let mut following = Following::new(&client, &room, &owner, 0).await;
    let before = client.room_clock(&room.room_id).await.expect("a clock");
    let sent = Instant::now();
    let first = client.add_marker(marker(&room, &owner, "EEG on")).await;
    let first = first.expect("a marker");
    let done = Instant::now();
    assert_eq!((first.number, first.label.as_str()), (1, "EEG on"));
    let error = before.round_trip() / 2 + Duration::from_millis(1);
    let at = Duration::from_micros(first.elapsed_us);
    assert!(before.room_at(sent).expect("a room") <= at + error);
    assert!(at <= before.room_at(done).expect("a room") + error);
    let earlier = v1::AddMarkerRequest {
        elapsed_us: Some(1),
        ..marker(&room, &owner, "saccade, left")
    };
    let second = client.add_marker(earlier).await.expect("a marker");
    assert_eq!((second.number, second.elapsed_us), (2, 1));
    assert_eq!(following.next().await, Some(first.clone()));
    assert_eq!(following.next().await, Some(second.clone()));
    let mut late = Following::new(&client, &room, &owner, 2).await;
    assert_eq!(late.next().await, Some(second.clone()));

    let refused = async |request| {
        let error = client.add_marker(request).await.expect_err("refused");
        error.reason().map(str::to_owned)
    };
    let wrong = "MARKER_REFUSED";
    let long = "ä".repeat(129);
    assert_eq!(
        refused(marker(&room, &owner, "")).await.as_deref(),
        Some(wrong)
    );
    assert_eq!(
        refused(marker(&room, &owner, &long)).await.as_deref(),
        Some(wrong)
    );
    assert_eq!(
        refused(marker(&room, &owner, "a\nb")).await.as_deref(),
        Some(wrong)
    );
    let future = v1::AddMarkerRequest {
        elapsed_us: Some(u64::MAX),
        ..marker(&room, &owner, "tomorrow")
    };
    assert_eq!(refused(future).await.as_deref(), Some(wrong));
    let stranger = refused(marker(&room, &tickets[0], "mine")).await;
    assert_eq!(stranger.as_deref(), Some("OWNER_TOKEN_WRONG"));
    client
        .add_marker(marker(&room, &owner, &long[2..]))
        .await
        .expect("128 characters");

    // Spectators and seats see none: their events are numbered without gaps.
    let mut watching = client.spectate(&room.room_id, 0);
    play_out(&server, tickets).await;
    let mut sequence = 0;
    while let Some(event) = patiently("an event", watching.next())
        .await
        .expect("watched")
    {
        sequence += 1;
        assert_eq!(event.sequence, sequence);
    }
    assert_eq!(following.next().await.map(|it| it.number), Some(3));
    assert_eq!(following.next().await, None, "the game is over");
    let over = refused(marker(&room, &owner, "late")).await;
    assert_eq!(over.as_deref(), Some("GAME_OVER"));
    let lines = record_seen_by(&client, &room).await;
    replay::replay(&lines).expect("it verifies");
    let recorded = markers_of(&lines);
    assert_eq!(recorded.len(), 3);
    assert_eq!(recorded[..2], [&first, &second]);
    let events = lines
        .iter()
        .filter(|line| matches!(line.line, Some(Line::Event(_))));
    assert_eq!(events.count() as u64, sequence);
}

#[tokio::test]
async fn markers_survive_a_restart_and_are_left_out_for_players() {
    let folder = tempfile::tempdir().expect("a folder");
    let start = async || {
        let store = SqliteStore::open(folder.path()).await.expect("a store");
        let config = ServerConfig {
            data_dir: Some(folder.path().to_path_buf()),
            grace: Duration::ZERO,
            ..ServerConfig::default()
        };
        Host::start(config, Arc::new(store)).await.expect("a port")
    };
    let host = start().await;
    let client = Client::connect(host.url()).await.expect("it listens");
    // Of a private game only the owner sees everything.
    let policy = v1::RoomPolicy {
        visibility: v1::Visibility::Private.into(),
        ..v1::RoomPolicy::default()
    };
    let (created, tickets) = room_of_four(&client, one_shift(), policy).await;
    let (room, owner) = (created.room.expect("a room"), created.owner_token);
    let first = client.add_marker(marker(&room, &owner, "before")).await;
    first.expect("a marker");
    patiently("the server to stop", host.stop())
        .await
        .expect("a clean end");

    let host = start().await;
    let client = Client::connect(host.url()).await.expect("it listens");
    let mut following = Following::new(&client, &room, &owner, 0).await;
    let second = client.add_marker(marker(&room, &owner, "after")).await;
    assert_eq!(second.expect("a marker").number, 2);
    for label in ["before", "after"] {
        let next = following.next().await.expect("a marker");
        assert_eq!(next.label, label);
    }
    let playing = client.play_many(random_agents(tickets.clone()));
    for outcome in patiently("the game to end", playing).await {
        outcome.expect("the game ended");
    }
    for (secret, expected) in [(&owner, 2), (&tickets[1], 0)] {
        let reader = client.with_secrets([secret]).expect("a secret");
        let lines = record_seen_by(&reader, &room).await;
        replay::replay(&lines).expect("it verifies");
        assert_eq!(markers_of(&lines).len(), expected);
    }
    patiently("the server to stop", host.stop())
        .await
        .expect("a clean end");
}

#[tokio::test]
async fn expressions_are_about_seats_and_points_of_gaze() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (room, _, tickets) = owned_room(&client).await;
    let about = |about| v1::Expression {
        label: "attention".into(),
        about: Some(about),
        ..v1::Expression::default()
    };
    let gaze = |x, y| {
        About::Gaze(v1::GazePoint {
            x,
            y,
            frame: v1::GazeFrame::Screen.into(),
        })
    };
    let sent = [about(About::AboutSeat(3)), about(gaze(0.25, 1.5))];
    for expression in &sent {
        let sending = client.express(&tickets[0], expression.clone());
        sending.await.expect("accepted");
    }
    let refused = [
        About::AboutSeat(4),
        About::AboutSeat(6),
        gaze(f32::NAN, 0.0),
        gaze(0.0, 11.0),
    ];
    for wrong in refused {
        let error = client.express(&tickets[0], about(wrong)).await;
        assert_eq!(
            error.expect_err("refused").reason(),
            Some("EXPRESSION_REFUSED")
        );
    }
    play_out(&server, tickets).await;
    let lines = record_seen_by(&client, &room).await;
    let shown: Vec<_> = lines
        .iter()
        .filter_map(|line| match &line.line {
            Some(Line::Event(v1::GameEvent {
                kind: Some(Kind::ExpressionShown(shown)),
                ..
            })) => shown.expression.clone(),
            _ => None,
        })
        .collect();
    assert_eq!(shown, sent);
    replay::replay(&lines).expect("it verifies");
    // A seat that the game does not have is found.
    let mut forged = lines.clone();
    for line in &mut forged {
        if let Some(Line::Event(v1::GameEvent {
            kind: Some(Kind::ExpressionShown(shown)),
            ..
        })) = &mut line.line
            && let Some(expression) = &mut shown.expression
        {
            expression.about = Some(About::AboutSeat(4));
        }
    }
    let problem = replay::replay(&forged).expect_err("no such seat");
    assert!(problem.to_string().contains("about_seat"), "{problem}");
}

#[tokio::test]
async fn samples_of_a_seat_are_in_a_file_beside_the_records() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (room, _, tickets) = owned_room(&client).await;
    let chunk = |from: u64| v1::SampleChunk {
        stream: "affect".into(),
        channels: vec!["valence".into(), "arousal".into()],
        elapsed_us: vec![from, from + 1],
        values: vec![0.5, -0.5, f32::NAN, 0.25],
    };
    let add = async |ticket: &str, chunk| {
        let added = client.add_samples(ticket, chunk).await;
        added.map_err(|error| error.reason().map(str::to_owned))
    };
    let refused = |reason: &str| Err(Some(reason.to_owned()));
    let early = add(&tickets[1], chunk(1)).await;
    assert_eq!(early, refused("GAME_NOT_STARTED"));
    let mut seats = attach_all(&server, &tickets).await;
    // The game has started when a seat has heard of it. The others hear of it when they decide.
    let first = select_all(seats.iter_mut().map(|seat| Box::pin(seat.next())));
    patiently("an update", first).await;
    assert_eq!(add(&tickets[1], chunk(1)).await, Ok(2));
    assert_eq!(add(&tickets[1], chunk(2)).await, Ok(1), "one is known");
    let wrong = add(&tickets[1], v1::SampleChunk::default()).await;
    assert_eq!(wrong, refused("SAMPLES_REFUSED"));
    let future = add(&tickets[1], chunk(u64::MAX - 1)).await;
    assert_eq!(future, refused("SAMPLES_REFUSED"));
    let stranger = add(&"ab".repeat(48), chunk(1)).await;
    assert_eq!(stranger, refused("TICKET_UNKNOWN"));
    let path = samples::path_of(server.data_dir(), &room.game_id, 1);
    let mut times = Vec::new();
    samples::read(&path, |chunk| times.extend(chunk.elapsed_us)).expect("chunks");
    assert_eq!(times, [1, 2, 3]);
    let none = samples::path_of(server.data_dir(), &room.game_id, 0);
    assert!(!none.exists());
}

/// Receives webhooks. Returns its port and the events.
async fn receiver() -> (u16, mpsc::UnboundedReceiver<Value>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let port = listener.local_addr().expect("bound").port();
    let (received, events) = mpsc::unbounded_channel();
    tokio::spawn(async move {
        while let Ok((stream, _)) = listener.accept().await {
            let received = received.clone();
            let take = move |request: http::Request<hyper::body::Incoming>| {
                let received = received.clone();
                async move {
                    let body = request.into_body().collect().await?.to_bytes();
                    let event = serde_json::from_slice(&body).expect("JSON");
                    received.send(event).expect("the test waits");
                    Ok::<_, hyper::Error>(http::Response::new(String::new()))
                }
            };
            let service = hyper::service::service_fn(take);
            let serving = hyper::server::conn::http1::Builder::new()
                .serve_connection(TokioIo::new(stream), service);
            // The server closes the connection.
            let _ = serving.await;
        }
    });
    (port, events)
}

#[tokio::test]
async fn webhooks_announce_rooms_games_and_tournaments() {
    let (port, mut events) = receiver().await;
    let url = format!("http://127.0.0.1:{port}/");
    let settings = WebhookSettings::new(&url, b"a secret of the operator", None);
    let settings = settings.expect("an address");
    let configure = |config: &mut ServerConfig| config.webhooks = Some(settings);
    let server = TestServer::with(configure, Arc::new(MemoryStore::default())).await;
    let client = server.client().await;
    let mut next = async || {
        patiently("an event", events.recv())
            .await
            .expect("an event")
    };

    let (room, _, tickets) = owned_room(&client).await;
    let created = next().await;
    assert_eq!(created["type"], "room.created");
    assert_eq!(created["data"]["room_id"], room.room_id);
    assert_eq!(created["data"]["created_at_ms"], room.created_at_ms);
    play_out(&server, tickets).await;
    let ended = next().await;
    assert_eq!(ended["type"], "game.ended");
    assert_eq!(ended["id"], format!("game.ended:{}", room.game_id));
    let record = &ended["data"]["record"];
    assert_eq!(record["state"], "ROOM_STATE_FINISHED");
    assert_eq!(record["standings"].as_array().map(Vec::len), Some(4));

    let settings = v1::TournamentSettings {
        name: "Coppa".into(),
        format: v1::TournamentFormat::RoundRobin.into(),
        rules: Some(one_shift()),
        rounds: 1,
        built_in_agents: vec!["random".into(); 4],
        ..v1::TournamentSettings::default()
    };
    let cup = client
        .create_tournament(settings)
        .await
        .expect("a tournament");
    let id = cup.tournament.expect("a tournament").tournament_id;
    let started = client.start_tournament(&id, &cup.owner_token).await;
    started.expect("started");
    let mut kinds = Vec::new();
    loop {
        let event = next().await;
        assert_eq!(event["data"]["tournament_id"], id);
        let kind = event["type"].as_str().expect("text").to_owned();
        kinds.push(kind.clone());
        if kind == "tournament.ended" {
            assert_eq!(event["data"]["finished"], true);
            break;
        }
    }
    assert_eq!(kinds[0], "tournament.started");
    let count = |kind: &str| kinds.iter().filter(|it| *it == kind).count();
    assert_eq!(count("tournament.started"), 1);
    assert!(count("room.created") > 0);
    assert_eq!(count("room.created"), count("game.ended"));
}
