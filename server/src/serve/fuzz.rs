//! Fuzz target: edited requests of every service. Each is answered, and never with an error that
//! says the server is at fault; no task panics, and the next call is served.

use std::cell::Cell;
use std::sync::Once;
use std::time::Duration;

use bolero::check;
use chefshat_engine::{Event, Game, RuleSetSpec, Seed, Viewer};
use chefshat_record::convert::{
    By, decision_kind, event_kind, observation_to_proto, rules_to_proto, seat_number,
};
use chefshat_record::testing::Edits;
use http::Request;
use http_body_util::{BodyExt as _, Full};
use prost::Message;
use tonic::body::Body;
use tonic::{Code, Status};
use tower::ServiceExt as _;

use super::*;
use crate::store::MemoryStore;

/// Runs in `cargo test`.
const RUNS: usize = 600;

/// How long a stream is read, in simulated time.
const READ: Duration = Duration::from_secs(20);

/// The request ids with which the room is created and joined: they determine its secrets.
const ROOM: [u8; 32] = [1; 32];
const SEAT: [u8; 32] = [2; 32];

/// A call: its path and the messages of its request.
type Call = (&'static str, Vec<Vec<u8>>);

fn call<const N: usize>(path: &'static str, messages: [&dyn Encode; N]) -> Call {
    (path, messages.map(|message| message.bytes()).to_vec())
}

trait Encode {
    fn bytes(&self) -> Vec<u8>;
}

impl<M: Message> Encode for M {
    fn bytes(&self) -> Vec<u8> {
        self.encode_to_vec()
    }
}

fn create_room() -> v1::CreateRoomRequest {
    let built_in = v1::SeatConfig {
        filled_by: Some(v1::seat_config::FilledBy::BuiltInAgent("greedy".into())),
        name: "Greta".into(),
    };
    let mut seats = vec![built_in; 4];
    seats[0] = v1::SeatConfig::default();
    v1::CreateRoomRequest {
        name: "room".into(),
        rules: Some(v1::RuleSet {
            preset: "paper".into(),
            ..v1::RuleSet::default()
        }),
        seats,
        policy: Some(v1::RoomPolicy {
            decision_time_ms: Some(1_000),
            reward_scheme: v1::RewardScheme::Paper.into(),
            spectators: Some(true),
            clocks: vec![v1::KindClock {
                kind: v1::ParticipantKind::Human.into(),
                decision_time_ms: Some(5_000),
                bank_ms: Some(0),
                absence_time_ms: Some(1_000),
            }],
            ..v1::RoomPolicy::default()
        }),
        game_seed: vec![3; 32],
        request_id: ROOM.to_vec(),
        ..v1::CreateRoomRequest::default()
    }
}

fn create_tournament() -> v1::CreateTournamentRequest {
    v1::CreateTournamentRequest {
        settings: Some(v1::TournamentSettings {
            name: "cup".into(),
            format: v1::TournamentFormat::Swiss.into(),
            rounds: 2,
            built_in_agents: vec!["random".into(); 4],
            start_when_joined: 5,
            draw_seed: vec![4; 32],
            ..v1::TournamentSettings::default()
        }),
        request_id: ROOM.to_vec(),
    }
}

fn join(room: &v1::CreateRoomResponse) -> v1::JoinRoomRequest {
    v1::JoinRoomRequest {
        join_code: room.join_code.clone(),
        name: "Ada".into(),
        request_id: SEAT.to_vec(),
        ..v1::JoinRoomRequest::default()
    }
}

/// Valid calls for a room, a seat in it and a tournament.
fn calls(
    room: &v1::CreateRoomResponse,
    ticket: &str,
    cup: &v1::CreateTournamentResponse,
) -> Vec<Call> {
    let room_id = room.room.clone().unwrap_or_default().room_id;
    let tournament_id = cup.tournament.clone().unwrap_or_default().tournament_id;
    let answer = v1::Answer {
        decision_id: 1,
        action: 1,
        annotations: Some(v1::Annotations {
            value_estimate: Some(0.5),
            action_scores: vec![0.1; 5],
            extra: [("why".to_owned(), "because".to_owned())].into(),
        }),
    };
    let expression = v1::Expression {
        label: "joy".into(),
        valence: Some(0.5),
        ..v1::Expression::default()
    };
    let command = |command| v1::PlayRequest {
        commands: vec![v1::SeatCommand {
            handle: 1,
            command: Some(command),
        }],
    };
    let attach = v1::Attach {
        ticket: ticket.into(),
        request_id: 1,
        from_sequence: 2,
        entropy: vec![5; 32],
        ..v1::Attach::default()
    };
    use v1::seat_command::Command;
    vec![
        call("RoomService/CreateRoom", [&create_room()]),
        call("RoomService/JoinRoom", [&join(room)]),
        call(
            "RoomService/GetRoom",
            [&v1::GetRoomRequest {
                room_id: room_id.clone(),
                ..v1::GetRoomRequest::default()
            }],
        ),
        call(
            "RoomService/ListRooms",
            [&v1::ListRoomsRequest {
                page_size: 10,
                page_token: "9".into(),
                ..v1::ListRoomsRequest::default()
            }],
        ),
        call(
            "RoomService/CloseRoom",
            [&v1::CloseRoomRequest {
                room_id: room_id.clone(),
                owner_token: room.owner_token.clone(),
            }],
        ),
        call(
            "RoomService/SetNextRoom",
            [&v1::SetNextRoomRequest {
                room_id: room_id.clone(),
                owner_token: room.owner_token.clone(),
                join_code: "BCDF2345".into(),
                ticket: String::new(),
            }],
        ),
        call(
            "PlayService/Play",
            [
                &command(Command::Attach(attach)),
                &command(Command::Answer(answer.clone())),
                &command(Command::Express(expression.clone())),
                &command(Command::Resume(v1::ResumeSeat {})),
            ],
        ),
        call(
            "PlayService/Act",
            [&v1::ActRequest {
                ticket: ticket.into(),
                command: Some(v1::act_request::Command::Answer(answer)),
            }],
        ),
        call(
            "PlayService/Act",
            [&v1::ActRequest {
                ticket: ticket.into(),
                command: Some(v1::act_request::Command::Express(expression)),
            }],
        ),
        call(
            "SpectatorService/Watch",
            [&v1::SpectatorServiceWatchRequest {
                room_id: room_id.clone(),
                from_sequence: 1,
                ..v1::SpectatorServiceWatchRequest::default()
            }],
        ),
        call("TournamentService/CreateTournament", [&create_tournament()]),
        call(
            "TournamentService/JoinTournament",
            [&v1::JoinTournamentRequest {
                join_code: cup.join_code.clone(),
                name: "Bruna".into(),
                ..v1::JoinTournamentRequest::default()
            }],
        ),
        call(
            "TournamentService/FollowTournament",
            [&v1::FollowTournamentRequest {
                tournament_id: tournament_id.clone(),
            }],
        ),
        call(
            "TournamentService/GetTournamentResults",
            [&v1::GetTournamentResultsRequest { tournament_id }],
        ),
        call(
            "RecordService/ListRecords",
            [&v1::ListRecordsRequest {
                page_size: 10,
                filter: Some(v1::RecordFilter::default()),
                ..v1::ListRecordsRequest::default()
            }],
        ),
        call(
            "VectorService/Run",
            [
                &vector(v1::run_request::Request::Setup(Box::new(v1::VectorSetup {
                    games: 3,
                    client_seats: vec![0, 2],
                    opponents: vec!["random".into()],
                    reward_scheme: v1::RewardScheme::Paper.into(),
                    ..v1::VectorSetup::default()
                }))),
                &vector(v1::run_request::Request::Actions(
                    v1::VectorActions::default(),
                )),
            ],
        ),
        call(
            "AnalysisService/Evaluate",
            [&v1::EvaluateRequest {
                position: Some(v1::evaluate_request::Position::Situation(situation())),
                rollouts: 8,
                update_ms: 50,
                agent: "random".into(),
                ..v1::EvaluateRequest::default()
            }],
        ),
        call(
            "AnalysisService/LegalActions",
            [&v1::LegalActionsRequest {
                moment: Some(v1::RecordedMoment {
                    game_id: "0".repeat(32),
                    decisions: 3,
                }),
            }],
        ),
        call(
            "ServerService/GetActionTable",
            [&v1::GetActionTableRequest { faces: 11 }],
        ),
        call(
            "InstrumentService/AddMarker",
            [&v1::AddMarkerRequest {
                room_id: room_id.clone(),
                owner_token: room.owner_token.clone(),
                label: "EEG on".into(),
                elapsed_us: Some(1),
            }],
        ),
        call(
            "InstrumentService/AddSamples",
            [&v1::AddSamplesRequest {
                ticket: ticket.into(),
                chunk: Some(v1::SampleChunk {
                    stream: "affect".into(),
                    channels: vec!["valence".into()],
                    elapsed_us: vec![1, 2],
                    values: vec![0.5, 0.25],
                }),
                owned_seat: Some(v1::OwnedSeat {
                    room_id: room_id.clone(),
                    owner_token: room.owner_token.clone(),
                    seat: 1,
                }),
            }],
        ),
        call(
            "InstrumentService/FollowMarkers",
            [&v1::FollowMarkersRequest {
                room_id: room_id.clone(),
                owner_token: room.owner_token.clone(),
                from_number: 1,
            }],
        ),
        call(
            "ServerService/GetClock",
            [&v1::GetClockRequest {
                room_id: room_id.clone(),
            }],
        ),
    ]
}

/// The first decision of a game, as its seat sees it.
fn situation() -> v1::Situation {
    let rules = RuleSetSpec::default().validate().expect("a rule set");
    let mut events = Vec::new();
    let game = Game::new(rules, Seed([6; 32]), |event| events.push(event));
    let decision = game.decision().expect("a decision is open");
    let viewer = Viewer::Seat(decision.seat);
    let by = By {
        source: v1::DecisionSource::Unspecified,
        decision_time_us: 0,
    };
    let seen = |event: &Event| event_kind(&event.seen_by(viewer), rules.actions(), by);
    v1::Situation {
        rules: Some(rules_to_proto(&rules)),
        seat: seat_number(decision.seat),
        decision: Some(v1::DecisionRequest {
            kind: decision_kind(decision.kind).into(),
            observation: Some(observation_to_proto(&game.observe(viewer))),
            ..v1::DecisionRequest::default()
        }),
        events: (events.iter().filter_map(seen))
            .map(|kind| v1::GameEvent {
                kind: Some(kind),
                ..v1::GameEvent::default()
            })
            .collect(),
    }
}

fn vector(request: v1::run_request::Request) -> v1::RunRequest {
    v1::RunRequest {
        request: Some(request),
    }
}

/// The length-prefixed messages of a request's body.
fn framed(messages: &[Vec<u8>]) -> Vec<u8> {
    let mut body = Vec::new();
    for message in messages {
        body.push(0);
        body.extend(u32::try_from(message.len()).expect("short").to_be_bytes());
        body.extend(message);
    }
    body
}

/// Calls a service. Returns its status and the bytes of its answer; a stream is read for [`READ`].
async fn answer(routes: &Routes, path: &str, body: Vec<u8>) -> (Status, Vec<u8>) {
    let request = Request::post(format!("http://server/chefshat.v1.{path}"))
        .header("content-type", "application/grpc")
        .body(Body::new(Full::new(bytes::Bytes::from(body))))
        .expect("a valid request");
    let calling = async {
        let response = routes.clone().oneshot(request).await.expect("infallible");
        let early = Status::from_header_map(response.headers());
        let collected = response.into_body().collect().await;
        let Ok(collected) = collected else {
            return (Status::cancelled("the stream was cut"), Vec::new());
        };
        let late = (collected.trailers()).and_then(Status::from_header_map);
        let status = early.or(late).unwrap_or(Status::ok(""));
        (status, collected.to_bytes().to_vec())
    };
    (tokio::time::timeout(READ, calling).await).unwrap_or((Status::ok(""), Vec::new()))
}

async fn call_once<R: Message + Default>(routes: &Routes, path: &str, request: &dyn Encode) -> R {
    let (status, body) = answer(routes, path, framed(&[request.bytes()])).await;
    assert_eq!(status.code(), Code::Ok, "{path}: {}", status.message());
    R::decode(&body[5..]).expect("a message")
}

thread_local! {
    /// Whether a task of this thread's runtime has panicked.
    static PANICKED: Cell<bool> = const { Cell::new(false) };
}

/// Notices panics of tasks, which the runtime catches.
fn notice_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            PANICKED.set(true);
            before(panic);
        }));
    });
}

/// Serves one edited call; `which` selects it.
async fn serve_edited(which: usize, edits: &Edits, frames: bool) {
    let config = ServerConfig {
        vector_threads: 1,
        max_rooms: 8,
        allow_import: true,
        ..ServerConfig::default()
    };
    let store = Arc::new(MemoryStore::default());
    let server = Server::restored(config, store)
        .await
        .expect("an empty store");
    let closing = CancellationToken::new();
    let retention = Retention::new(Arc::clone(&server.rooms));
    let routes = server.routes(&closing, retention);
    let routes = routes.expect("valid settings");
    let room: v1::CreateRoomResponse =
        call_once(&routes, "RoomService/CreateRoom", &create_room()).await;
    let seat: v1::JoinRoomResponse = call_once(&routes, "RoomService/JoinRoom", &join(&room)).await;
    let cup: v1::CreateTournamentResponse = call_once(
        &routes,
        "TournamentService/CreateTournament",
        &create_tournament(),
    )
    .await;
    let calls = calls(&room, &seat.ticket, &cup);
    let (path, messages) = &calls[which % calls.len()];
    let body = match frames {
        true => edits.apply(&framed(messages)),
        // The first message stays readable in half of the calls with several.
        false => {
            let mut messages = messages.clone();
            let edited = which / calls.len() % messages.len();
            messages[edited] = edits.apply(&messages[edited]);
            framed(&messages)
        }
    };
    let (status, _) = answer(&routes, path, body).await;
    // How tonic refuses what is not a message.
    let refused_by_tonic = ["decod", "protocol error", "Missing request"]
        .iter()
        .any(|words| status.message().contains(words));
    let is_fault = match status.code() {
        Code::Unknown | Code::DataLoss => true,
        Code::Internal => !refused_by_tonic,
        _ => false,
    };
    assert!(!is_fault, "{path}: {status:?}");
    let info: v1::GetServerInfoResponse = call_once(
        &routes,
        "ServerService/GetServerInfo",
        &v1::GetServerInfoRequest {},
    )
    .await;
    assert!(!info.shutting_down);
    server.rooms.shut_down(Duration::ZERO).await;
    server.tournaments.end();
    assert!(!PANICKED.get(), "{path}: a task panicked");
}

#[test]
fn edited_requests_are_answered() {
    notice_panics();
    let inputs = check!()
        .with_type::<(u16, bool, Edits)>()
        .with_iterations(RUNS);
    inputs.for_each(|(which, frames, edits)| {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .start_paused(true)
            .build()
            .expect("a runtime");
        runtime.block_on(serve_edited(usize::from(*which), edits, *frames));
    });
}
