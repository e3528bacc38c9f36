//! What attackers do that takes more than one kind of call.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use chefshat_client::{ActionId, Agent, Client, Connection, RandomAgent};
use chefshat_proto::v1::{
    self, participation_service_client::ParticipationServiceClient,
    play_service_client::PlayServiceClient, record_service_client::RecordServiceClient,
    room_service_client::RoomServiceClient, study_service_client::StudyServiceClient,
};
use futures::future::join_all;
use futures::{StreamExt as _, stream};
use prost::Message as _;
use rand::RngExt as _;
use rustls::pki_types::ServerName;
use rustls::{ClientConfig, ClientConnection, RootCertStore};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::{sleep_until, timeout_at};
use tokio_stream::wrappers::ReceiverStream;
use tonic::Status;
use v1::seat_update::Update;

use crate::bodies::{framed, repeated, worst};
use crate::raw::{self, RawRequest};
use crate::target::{ATTACKER, IN_FLIGHT, LONG, Target, newest_record, room};

/// Longest message of most calls, and of studies and vector games, bytes.
const MAX_MESSAGE: usize = 64 * 1024;
const MAX_LARGE_MESSAGE: usize = 1024 * 1024;
/// Requests with the worst, or largest, message that are sent at once.
pub(crate) const LARGE_AT_ONCE: usize = 32;
/// Messages of an import: 6 MB.
const IMPORT_MESSAGES: usize = 92;
/// Connections that are opened at once.
const OPENED_AT_ONCE: usize = 32;
/// Samples, channels and streams of a seat: the most that a server takes.
const SAMPLES: u64 = 512;
const CHANNELS: usize = 16;
const STREAMS: u64 = 16;
/// Bytes of an annotation: nearly the most that are recorded with a decision.
pub(crate) const ANNOTATION_BYTES: usize = 4_000;
/// Seats that a stream attaches and detaches with one message.
const ATTACHED_AT_ONCE: u32 = 128;
/// How long closing the rooms of an attack may take.
const CLOSING_LIMIT: Duration = Duration::from_secs(5);
/// How long a client of HTTP/1 waits for an answer.
const ANSWER_LIMIT: Duration = Duration::from_secs(5);

/// Sends the worst message of a call, many at once.
pub(crate) async fn worst_messages(
    target: &Target,
    call: &'static str,
    valid: &impl prost::Message,
) {
    let body = worst(call, valid, MAX_LARGE_MESSAGE / target.divide as usize);
    let request = RawRequest::grpc(call, vec![body]);
    let requests = u32::MAX;
    (target.send_all(1, LARGE_AT_ONCE, requests, move |_| request.clone())).await;
}

/// Sends imports of decisions without content, two at once.
pub(crate) async fn empty_decisions(target: &Target) {
    let call = "RecordService/ImportRecord";
    let decision = v1::RecordLine {
        line: Some(v1::record_line::Line::Decision(
            v1::DecisionRecord::default(),
        )),
    };
    let request = v1::ImportRecordRequest {
        lines: vec![decision],
    };
    let body = repeated(&request.encode_to_vec(), MAX_MESSAGE);
    let messages = IMPORT_MESSAGES.div_ceil(target.divide as usize);
    let request = RawRequest::grpc(call, vec![body; messages]);
    target
        .send_all(1, 2, u32::MAX, move |_| request.clone())
        .await;
}

/// Answers a questionnaire as a participant of a study with the worst message.
pub(crate) async fn worst_answers(target: &Target) -> Result<(), Status> {
    let connection = target.connection().await?;
    let mut studies = StudyServiceClient::new(connection.clone());
    let created = studies.create_study(study()).await?.into_inner();
    let request = v1::AddStudyParticipantsRequest {
        study_id: created.study.unwrap_or_default().study_id,
        owner_token: created.owner_token,
        count: 1,
        ..v1::AddStudyParticipantsRequest::default()
    };
    let added = studies.add_study_participants(request).await?.into_inner();
    let link = added.links.into_iter().next().unwrap_or_default().link;
    let mut participation = ParticipationServiceClient::new(connection);
    let opened = participation
        .open_study(v1::OpenStudyRequest {
            link,
            ..Default::default()
        })
        .await?;
    let valid = v1::AnswerQuestionnaireRequest {
        session: opened.into_inner().session,
        ..v1::AnswerQuestionnaireRequest::default()
    };
    worst_messages(target, "ParticipationService/AnswerQuestionnaire", &valid).await;
    Ok(())
}

/// A small study that begins with a questionnaire.
pub(crate) fn study() -> v1::CreateStudyRequest {
    use v1::study_stage::Stage;
    let built_in = v1::SeatConfig {
        filled_by: Some(v1::seat_config::FilledBy::BuiltInAgent("random".into())),
        ..v1::SeatConfig::default()
    };
    let stage = |stage| v1::StudyStage {
        stage: Some(stage),
        ..v1::StudyStage::default()
    };
    v1::CreateStudyRequest {
        settings: Some(v1::StudySettings {
            name: "hostile".into(),
            title: "hostile".into(),
            participants: 1,
            conditions: vec![v1::StudyCondition {
                id: "only".into(),
                seats: vec![built_in; 3],
                ..v1::StudyCondition::default()
            }],
            stages: vec![
                stage(Stage::Questionnaire(v1::StudyQuestionnaire {
                    template: "nasa_tlx".into(),
                    ..v1::StudyQuestionnaire::default()
                })),
                stage(Stage::Games(v1::StudyGames { count: 1 })),
            ],
            ..v1::StudySettings::default()
        }),
        ..v1::CreateStudyRequest::default()
    }
}

/// Requests the picture of a long game, over two connections.
pub(crate) async fn replay_pictures(target: &Target) -> Result<(), Status> {
    let mut records = RecordServiceClient::new(target.connection().await?);
    let game_id = newest_record(&mut records, "hostile").await?;
    let request = RawRequest::get(&format!("/replay/{game_id}.png"));
    target.send_all(2, 500, 500, move |_| request.clone()).await;
    Ok(())
}

/// Asks for long analyses with each token.
pub(crate) async fn evaluations(target: &Target) -> Result<(), Status> {
    let mut records = RecordServiceClient::new(target.connection().await?);
    let game_id = newest_record(&mut records, "hostile").await?;
    let body = raw::framed(&evaluation(game_id, 10_000));
    let mut callers = JoinSet::new();
    for token in target.tokens.iter() {
        let request = RawRequest::grpc("AnalysisService/Evaluate", vec![body.clone()]);
        let (target, request) = (target.clone(), request.with_token(token));
        callers.spawn(async move {
            target
                .send_all(1, 16, u32::MAX, move |_| request.clone())
                .await;
        });
    }
    callers.join_all().await;
    Ok(())
}

/// An analysis of an early decision of a game for this time.
pub(crate) fn evaluation(game_id: String, time_ms: u32) -> v1::EvaluateRequest {
    v1::EvaluateRequest {
        position: Some(v1::evaluate_request::Position::Moment(v1::RecordedMoment {
            game_id,
            decisions: 6,
        })),
        time_ms,
        agent: "trained".into(),
        ..v1::EvaluateRequest::default()
    }
}

/// Plays in many rooms with all seats as fast as it can; each decision has an annotation of this many
/// bytes. Closes the rooms at the end, so that the memory of rooms that still play does not count as
/// memory that is not given back.
pub(crate) async fn games(target: &Target, rooms: u32, annotation: usize) -> Result<(), Status> {
    let (client, until) = (target.client().await?, target.until);
    let mut playing = JoinSet::new();
    for seed in 0..target.count(rooms) {
        let (client, tally) = (client.clone(), Arc::clone(&target.tally));
        playing.spawn(async move {
            tally.tried(1);
            let mut rooms = RoomServiceClient::new(client.channel());
            let created = rooms.create_room(room(false, LONG)).await;
            tally.outcome(&created);
            let created = created?.into_inner();
            let played = async {
                let tickets = seats(&mut rooms, &created).await?;
                let agents = tickets.into_iter().map(|ticket| {
                    let agent = RandomAgent::new(u64::from(seed));
                    (ticket, Talkative { agent, annotation })
                });
                client.play_many(agents).await;
                Ok::<_, Status>(())
            };
            let _ = timeout_at(until, played).await;
            let request = v1::CloseRoomRequest {
                room_id: created.room.unwrap_or_default().room_id,
                owner_token: created.owner_token,
            };
            rooms.close_room(request).await
        });
    }
    let _ = timeout_at(until + CLOSING_LIMIT, playing.join_all()).await;
    Ok(())
}

/// Plays long games in rooms whose agents read a byte a second: substitutes soon play for them, and
/// everything waits for them in the server.
pub(crate) async fn unread_games(target: &Target, rooms: u32) -> Result<(), Status> {
    let client = target.client().await?;
    let mut reading = JoinSet::new();
    for _ in 0..target.count(rooms) {
        let (client, target) = (client.clone(), target.clone());
        reading.spawn(async move {
            let mut rooms = RoomServiceClient::new(client.channel());
            let request = v1::CreateRoomRequest {
                policy: Some(v1::RoomPolicy {
                    decision_time_ms: Some(100),
                    bank_ms: Some(0),
                    max_timeouts: Some(1),
                    abort: v1::AbortPolicy::Never.into(),
                    ..v1::RoomPolicy::default()
                }),
                ..room(false, LONG)
            };
            target.tally.tried(1);
            let created = rooms.create_room(request).await;
            target.tally.outcome(&created);
            let created = created?.into_inner();
            let tickets = seats(&mut rooms, &created).await?;
            let connected = raw::http2(target.address, ATTACKER, 1).await;
            let sender = connected.map_err(|error| Status::unavailable(error.to_string()))?;
            let streams = tickets.into_iter().map(async |ticket| {
                let attach = v1::Attach {
                    ticket,
                    delivery: v1::EventDelivery::AtOnce.into(),
                    ..v1::Attach::default()
                };
                let seats = v1::PlayServiceWatchRequest {
                    seats: vec![attach],
                };
                let body = Some(raw::framed(&seats));
                let opened = raw::open(&sender, "PlayService/Watch", body, &target.tally);
                if let Some(stream) = opened.await {
                    stream.read_slowly().await;
                }
            });
            let _ = timeout_at(target.until, join_all(streams)).await;
            Ok::<_, Status>(())
        });
    }
    let _ = timeout_at(target.until + CLOSING_LIMIT, reading.join_all()).await;
    Ok(())
}

/// Takes all seats of a room. Returns their tickets.
async fn seats(
    rooms: &mut RoomServiceClient<Connection>,
    created: &v1::CreateRoomResponse,
) -> Result<Vec<String>, Status> {
    let mut tickets = Vec::new();
    for name in ["a", "b", "c", "d"] {
        let request = v1::JoinRoomRequest {
            join_code: created.join_code.clone(),
            name: name.into(),
            ..v1::JoinRoomRequest::default()
        };
        tickets.push(rooms.join_room(request).await?.into_inner().ticket);
    }
    Ok(tickets)
}

/// An agent that says something about each decision.
struct Talkative {
    agent: RandomAgent,
    /// Bytes.
    annotation: usize,
}

impl Agent for Talkative {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        self.agent.decide(request)
    }

    fn annotate(&mut self) -> Option<v1::Annotations> {
        (self.annotation > 0).then(|| annotations(self.annotation))
    }
}

/// Annotations of a decision of this many bytes.
pub(crate) fn annotations(bytes: usize) -> v1::Annotations {
    v1::Annotations {
        extra: [("thoughts".to_owned(), "x".repeat(bytes))].into(),
        ..v1::Annotations::default()
    }
}

/// Calls with tokens that the server has never heard of.
pub(crate) async fn unknown_tokens(target: &Target) {
    let body = raw::framed(&v1::ListRoomsRequest::default());
    let request = RawRequest::grpc("RoomService/ListRooms", vec![body]);
    let unknown = move |_| {
        let id: u32 = rand::rng().random();
        let token = format!("chefshat_{id:08x}_{}", "A".repeat(43));
        request.clone().with_token(&token)
    };
    target.send_all(8, IN_FLIGHT, u32::MAX, unknown).await;
}

/// Records samples of all seats of some rooms as fast as the server takes them.
pub(crate) async fn samples(target: &Target) -> Result<(), Status> {
    let mut rooms = RoomServiceClient::new(target.connection().await?);
    let mut recording = JoinSet::new();
    for _ in 0..target.count(4) {
        let created = rooms.create_room(room(true, LONG)).await?.into_inner();
        let room_id = created.room.unwrap_or_default().room_id;
        for seat in 0..4 {
            let always = v1::AddSamplesRequest {
                owned_seat: Some(v1::OwnedSeat {
                    room_id: room_id.clone(),
                    owner_token: created.owner_token.clone(),
                    seat,
                }),
                chunk: Some(v1::SampleChunk {
                    channels: (0..CHANNELS).map(|number| format!("c{number}")).collect(),
                    values: vec![0.5; CHANNELS * SAMPLES as usize],
                    ..v1::SampleChunk::default()
                }),
                ..v1::AddSamplesRequest::default()
            };
            let always = Bytes::from(always.encode_to_vec());
            let target = target.clone();
            let request = move |number| {
                RawRequest::grpc("InstrumentService/AddSamples", vec![chunk(&always, number)])
            };
            // In their order: samples that are not later than the last ones are ignored.
            recording.spawn(async move { target.send_all(1, 4, u32::MAX, request).await });
        }
    }
    recording.join_all().await;
    Ok(())
}

/// The n-th chunk of a seat: what all have, and the name of its stream and its times.
fn chunk(always: &Bytes, number: u32) -> Bytes {
    let number = u64::from(number);
    let first = number / STREAMS * SAMPLES + 1;
    let own = v1::AddSamplesRequest {
        chunk: Some(v1::SampleChunk {
            stream: format!("s{}", number % STREAMS),
            elapsed_us: (first..first + SAMPLES).collect(),
            ..v1::SampleChunk::default()
        }),
        ..v1::AddSamplesRequest::default()
    };
    // Two encoded messages after each other are one that has the fields of both.
    framed(&[&always[..], &own.encode_to_vec()].concat())
}

/// Opens sessions of the Model Context Protocol as fast as possible, each over a connection of its
/// own.
pub(crate) async fn mcp_sessions(target: &Target) {
    let Some(address) = target.mcp else {
        return;
    };
    let sessions = stream::iter(0..target.count(u32::MAX)).map(|_| async {
        target.tally.tried(1);
        match initialize(address).await {
            Some(status) if status.starts_with("HTTP/1.1 200") => target.tally.granted(1),
            Some(status) => target.tally.refusal(&status),
            None => target.tally.lost(),
        }
    });
    let all = sessions.buffer_unordered(OPENED_AT_ONCE).collect::<()>();
    let _ = timeout_at(target.until, all).await;
    sleep_until(target.until).await;
}

/// Opens a session. Returns the status line of the answer.
pub(crate) async fn initialize(address: SocketAddr) -> Option<String> {
    let body = serde_json::json!({
        "jsonrpc": "2.0",
        "id": 1,
        "method": "initialize",
        "params": {
            "protocolVersion": "2025-06-18",
            "capabilities": {},
            "clientInfo": {"name": "hostile", "version": "1"},
        },
    })
    .to_string();
    let request = format!(
        "POST /mcp HTTP/1.1\r\nhost: {address}\r\ncontent-type: application/json\r\n\
         accept: application/json, text/event-stream\r\nconnection: close\r\n\
         content-length: {}\r\n\r\n{body}",
        body.len()
    );
    let answered = async {
        let mut stream = raw::connect(address, ATTACKER).await.ok()?;
        stream.write_all(request.as_bytes()).await.ok()?;
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).await.ok()?;
        let answer = String::from_utf8_lossy(&answer);
        answer.lines().next().map(str::to_owned)
    };
    tokio::time::timeout(ANSWER_LIMIT, answered).await.ok()?
}

/// Begins handshakes of TLS with the same first message, and leaves when the server has answered.
pub(crate) async fn tls_hellos(target: &Target) {
    let hello = client_hello(target.address);
    let handshakes = stream::iter(0..target.count(u32::MAX)).map(|_| async {
        target.tally.tried(1);
        let answered = async {
            let mut stream = raw::connect(target.address, ATTACKER).await?;
            stream.write_all(&hello).await?;
            stream.read_u8().await
        };
        match answered.await {
            Ok(_) => target.tally.granted(1),
            Err(_) => target.tally.refusal("CONNECTION_CLOSED"),
        }
    });
    let all = handshakes.buffer_unordered(OPENED_AT_ONCE).collect::<()>();
    let _ = timeout_at(target.until, all).await;
    sleep_until(target.until).await;
}

/// The first message of a client.
fn client_hello(address: SocketAddr) -> Vec<u8> {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .expect("the provider has its defaults")
        .with_root_certificates(RootCertStore::empty())
        .with_no_client_auth();
    let name = ServerName::IpAddress(address.ip().into());
    let mut client = ClientConnection::new(Arc::new(config), name).expect("a valid configuration");
    let mut hello = Vec::new();
    client.write_tls(&mut hello).expect("memory takes all");
    hello
}

/// Attaches and detaches the same seats of another node on one stream, again and again.
pub(crate) async fn long_stream(target: &Target) -> Result<(), Status> {
    let Some(other) = &target.other_node else {
        return Ok(());
    };
    let other = other.connect().await.map_err(unavailable)?;
    let tickets = open_seats(&other).await.map_err(unavailable)?;
    let connection = target.connection().await?;
    let (batches, waiting) = mpsc::channel(1);
    let mut service = PlayServiceClient::new(connection);
    let play = service.play(ReceiverStream::new(waiting));
    let playing = async {
        let mut updates = play.await?.into_inner();
        let mut first = 0;
        loop {
            let commands = (first..first + ATTACHED_AT_ONCE).flat_map(|handle| {
                let ticket = &tickets[handle as usize % tickets.len()];
                [attach(ticket), detach(handle)]
            });
            let commands = commands.collect();
            if batches.send(v1::PlayRequest { commands }).await.is_err() {
                return Ok(());
            }
            target.tally.tried(ATTACHED_AT_ONCE.into());
            first += ATTACHED_AT_ONCE;
            detached(&mut updates, target).await?;
        }
    };
    // The stream stays open until the end of the attack.
    timeout_at(target.until, playing).await.unwrap_or(Ok(()))
}

/// Reads until as many seats are detached or refused as a message attaches.
async fn detached(
    updates: &mut tonic::Streaming<v1::PlayResponse>,
    target: &Target,
) -> Result<(), Status> {
    let mut ended = 0;
    while ended < ATTACHED_AT_ONCE {
        let answer = updates.message().await?;
        let answer = answer.ok_or_else(|| Status::unavailable("the stream ended"))?;
        for update in answer.updates {
            match update.update {
                Some(Update::Detached(_)) => {
                    target.tally.granted(1);
                    ended += 1;
                }
                Some(Update::Refused(refused)) => {
                    target.tally.refusal(&refused.reason);
                    ended += 1;
                }
                _ => {}
            }
        }
    }
    Ok(())
}

fn attach(ticket: &str) -> v1::SeatCommand {
    v1::SeatCommand {
        handle: 0,
        command: Some(v1::seat_command::Command::Attach(v1::Attach {
            ticket: ticket.to_owned(),
            ..v1::Attach::default()
        })),
    }
}

fn detach(handle: u32) -> v1::SeatCommand {
    v1::SeatCommand {
        handle,
        command: Some(v1::seat_command::Command::Detach(v1::Detach {})),
    }
}

/// Tickets of three seats of a room that waits for the fourth.
async fn open_seats(client: &Client) -> Result<Vec<String>, chefshat_client::Error> {
    let created = client.create_room(room(false, 1)).await?;
    let mut tickets = Vec::new();
    for name in ["a", "b", "c"] {
        let joined = client.join_with_code(&created.join_code, name).await?;
        tickets.push(joined.ticket);
    }
    Ok(tickets)
}

fn unavailable(error: impl std::fmt::Display) -> Status {
    Status::unavailable(error.to_string())
}
