//! One game of four processes in four languages, against the binary over its port; and what is tested
//! of the agent in C++ alone: its ticket file, signals, TLS, tokens, and games that end when the
//! connection is lost.

use std::collections::VecDeque;
use std::path::Path;
use std::process::{Output, Stdio};
use std::sync::{Arc, Mutex};

use chefshat_client::{Client, ConnectOptions};
use chefshat_proto::v1::play_service_server::{PlayService, PlayServiceServer};
use chefshat_proto::v1::{self, seat_command::Command as Sent, seat_update::Update};
use chefshat_record::{jsonl, replay};
use chefshat_server::access::{AccessSettings, Mode, NewToken, Role, TokenFile};
use chefshat_server::config::ServerConfig;
use chefshat_server::store::MemoryStore;
use chefshat_server::tls::TlsFiles;
use chefshat_tests::{
    Launch, StreamSeat, TestServer, first_legal, one_shift, patiently, play_on, set_up,
};
use serde_json::Value;
use tokio::io::{AsyncBufReadExt as _, BufReader};
use tokio::net::TcpListener;
use tokio::process::Command;
use tokio::sync::mpsc;
use tokio_stream::wrappers::{ReceiverStream, TcpListenerStream};
use tonic::{Request, Response, Status, Streaming};

/// Runs a program and returns its output.
async fn output_of(name: &str, mut command: Command) -> Output {
    let output = command.stdin(Stdio::null()).kill_on_drop(true).output();
    patiently(name, output)
        .await
        .unwrap_or_else(|error| panic!("{name} does not start: {error}"))
}

/// Runs a participant to the end of its game and returns its output.
async fn participant(name: &str, command: Command) -> Output {
    let output = output_of(name, command).await;
    assert!(
        output.status.success(),
        "{name}: {}\n{}\n{}",
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    output
}

/// The agent in C++, without settings from the environment of the tests.
fn agent_in_cpp(address: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(set_up("CHEFSHAT_CPP_AGENT"));
    command.args(["--address", address]).args(arguments);
    for name in ["CODE", "TICKET", "TOKEN", "CA"] {
        command.env_remove(format!("CHEFSHAT_{name}"));
    }
    command
}

#[tokio::test]
async fn rust_python_javascript_and_cpp_play_a_game_to_fifteen_points() {
    let binary = set_up("CHEFSHAT_BIN");
    let python = set_up("CHEFSHAT_PYTHON");
    let node = set_up("CHEFSHAT_NODE_DIR");
    let data = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(data.path());
    let server = launch.start().await.expect("the server starts");
    let url = launch.url();
    let client = Client::connect(&url).await.expect("the server listens");
    let created = client
        .create_room(v1::CreateRoomRequest::default())
        .await
        .expect("a new room");
    let room = created.room.expect("a room");
    let address = url.trim_start_matches("http://");
    let code = created.join_code.as_str();
    let mut built_in = Command::new(&binary);
    built_in.args(["agent", "greedy", "--server", &url, "--code", code]);
    built_in.args(["--name", "greedy", "--json"]);
    let mut in_python = Command::new(python);
    in_python
        .args(["-m", "chefshat.agent", "--address", address])
        .args(["--code", code, "--name", "python", "--json"]);
    let mut in_node = Command::new("node");
    in_node
        .arg("agent.js")
        .args(["--address", address, "--code", code, "--name", "node"])
        .current_dir(node);
    let outputs = tokio::join!(
        participant("greedy", built_in),
        participant(
            "cpp",
            agent_in_cpp(address, &["--code", code, "--name", "cpp"])
        ),
        participant("python", in_python),
        participant("node", in_node),
    );
    for output in [outputs.0, outputs.1, outputs.2, outputs.3] {
        let text = String::from_utf8(output.stdout).expect("text");
        let last = text.lines().last().expect("a printed result");
        serde_json::from_str::<Value>(last).expect("a JSON line");
    }

    let over = client.get_room(&room.room_id).await.expect("still listed");
    assert_eq!(over.state(), v1::RoomState::Finished);
    let names: Vec<&str> = over.seats.iter().map(|seat| seat.name.as_str()).collect();
    for name in ["greedy", "cpp", "python", "node"] {
        assert!(names.contains(&name), "{name} is not among {names:?}");
    }
    assert!(server.stop().await.status.success());
    let record = jsonl::read(&jsonl::path_of(data.path(), &room.game_id)).expect("a record file");
    let replayed = replay::replay(&record).expect("a valid record");
    assert_eq!(replayed.state, v1::RoomState::Finished);
    assert!(replayed.standings[0].points >= 15);
    let from_agents = record
        .iter()
        .filter(|line| {
            matches!(
                &line.line,
                Some(v1::record_line::Line::Decision(decision))
                    if decision.source() == v1::DecisionSource::Agent
            )
        })
        .count();
    assert_eq!(
        u64::try_from(from_agents),
        Ok(replayed.decisions),
        "no timeouts and no illegal actions"
    );
}

fn built_in_seat() -> v1::SeatConfig {
    v1::SeatConfig {
        filled_by: Some(v1::seat_config::FilledBy::BuiltInAgent("random".to_owned())),
        ..v1::SeatConfig::default()
    }
}

/// The error that an agent printed before it exited with status 1.
fn error_of(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    let error = said.lines().find_map(|line| line.strip_prefix("agent: "));
    error
        .unwrap_or_else(|| panic!("no error: {said}"))
        .to_owned()
}

#[tokio::test]
async fn an_agent_in_cpp_that_is_killed_or_stopped_resumes_with_its_ticket_file() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let built_in = built_in_seat();
    let open = v1::SeatConfig::default();
    let created = client
        .create_room(v1::CreateRoomRequest {
            rules: Some(one_shift()),
            // Far longer than a test, so that no decision times out while no agent runs.
            policy: Some(v1::RoomPolicy {
                decision_time_ms: Some(3_600_000),
                ..v1::RoomPolicy::default()
            }),
            seats: vec![open.clone(), open, built_in.clone(), built_in],
            ..v1::CreateRoomRequest::default()
        })
        .await
        .expect("a new room");
    let code = created.join_code.as_str();
    let other = client
        .join_with_code(code, "other")
        .await
        .expect("a free seat");
    let mut other = StreamSeat::attached(server.channel().await, &other.ticket).await;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("ticket");
    let url = server.url();
    let agent = || {
        let file = file.to_str().expect("text");
        agent_in_cpp(&url, &["--code", code, "--ticket-file", file])
    };

    let mut first = agent()
        .stderr(Stdio::null())
        .kill_on_drop(true)
        .spawn()
        .expect("it starts");
    // The game has begun and waits for the other seat.
    let mut open = other.decision().await;
    for _ in 0..2 {
        other.answer(open.decision_id, first_legal(&open)).await;
        open = other.decision().await;
    }
    let refused = error_of(&output_of("a second agent", agent()).await);
    assert!(refused.starts_with("another agent uses "), "{refused}");
    first.kill().await.expect("SIGKILL");
    let ticket = std::fs::read_to_string(&file).expect("a ticket file");

    let mut second = agent()
        .stderr(Stdio::piped())
        .kill_on_drop(true)
        .spawn()
        .expect("it starts");
    let mut lines = BufReader::new(second.stderr.take().expect("a pipe")).lines();
    let line = patiently("its first line", lines.next_line()).await;
    let line = line.expect("text").expect("a line");
    assert!(line.starts_with("resuming with the ticket in "), "{line}");
    let id = second.id().expect("it runs").to_string();
    let sent = Command::new("kill").args(["-TERM", &id]).status().await;
    assert!(sent.expect("kill runs").success());
    let status = patiently("the stopped agent", second.wait()).await;
    assert_eq!(status.expect("a child process").code(), Some(1));
    let line = lines.next_line().await.expect("text");
    assert_eq!(line.as_deref(), Some("agent: stopped by a signal"));
    let kept = std::fs::read_to_string(&file).expect("the file is kept");
    assert_eq!(kept, ticket);

    let third = tokio::spawn(participant("the third agent", agent()));
    other.answer(open.decision_id, first_legal(&open)).await;
    assert_eq!(play_on(&mut other).await, v1::DetachReason::GameOver);
    let output = third.await.expect("it plays to the end");
    let result: Value = serde_json::from_slice(&output.stdout).expect("a JSON line");
    assert_eq!(result["standings"].as_array().map(Vec::len), Some(4));
    let room = created.room.expect("a room").room_id;
    let room = client.get_room(&room).await.expect("still listed");
    let seat = result["seat"].as_u64().expect("a number");
    assert_eq!(
        room.seats[usize::try_from(seat).expect("small")].name,
        "C++"
    );
    assert!(!file.exists(), "a ticket that is used up is removed");
}

#[tokio::test]
async fn an_agent_in_cpp_shows_its_token_over_tls() {
    let certificates = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/tls");
    let files = TlsFiles {
        certificate: certificates.join("localhost.pem"),
        key: certificates.join("localhost.key"),
        client_authority: None,
    };
    let ca = files.certificate.clone();
    let guarded = |config: &mut ServerConfig| {
        config.tls = Some(files);
        config.access = AccessSettings {
            mode: Some(Mode::Tokens),
            ..AccessSettings::default()
        };
    };
    let server = TestServer::with(guarded, Arc::new(MemoryStore::default())).await;
    let url = format!("https://localhost:{}", server.address.port());
    let token = |role| {
        let created = TokenFile::of(server.data_dir()).create(NewToken {
            role,
            label: String::new(),
            lifetime: None,
            scope: None,
        });
        created.expect("the data folder is writable").to_text()
    };
    let options = ConnectOptions {
        token: Some(token(Role::Host)),
        ca: Some(ca.clone()),
    };
    let client = Client::connect_with(&url, &options).await;
    let client = client.expect("the server listens");
    let built_in = built_in_seat();
    let created = client
        .create_room(v1::CreateRoomRequest {
            rules: Some(one_shift()),
            seats: [vec![v1::SeatConfig::default()], vec![built_in; 3]].concat(),
            ..v1::CreateRoomRequest::default()
        })
        .await
        .expect("a new room");
    let code = ["--code", created.join_code.as_str()];

    let mut without_token = agent_in_cpp(&url, &code);
    without_token.env("CHEFSHAT_CA", &ca);
    let refused = error_of(&output_of("without a token", without_token).await);
    assert!(refused.contains("token"), "{refused}");

    let mut with_token = agent_in_cpp(&url, &code);
    with_token.env("CHEFSHAT_CA", &ca);
    with_token.env("CHEFSHAT_TOKEN", token(Role::Player));
    let output = participant("with a token", with_token).await;
    let result: Value = serde_json::from_slice(&output.stdout).expect("a JSON line");
    assert_eq!(result["seat"], 0);
}

/// The messages of a stream: updates with their handles.
type Script = Vec<Vec<(u32, Update)>>;

/// A server without rules and rooms. Each stream sends the next of the scripts after its first
/// request; all but the last then break.
#[derive(Clone, Default)]
struct Scripted {
    scripts: Arc<Mutex<VecDeque<Script>>>,
    /// All commands of agents but attachments, with their handles.
    heard: Arc<Mutex<Vec<(u32, Sent)>>>,
}

impl Scripted {
    /// Serves on a free port. Returns its address.
    async fn start(&self) -> String {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
        let address = listener.local_addr().expect("bound").to_string();
        let service = PlayServiceServer::new(self.clone());
        let server = tonic::transport::Server::builder().add_service(service);
        tokio::spawn(server.serve_with_incoming(TcpListenerStream::new(listener)));
        address
    }

    async fn hear(&self, requests: &mut Streaming<v1::PlayRequest>) -> bool {
        let Ok(Some(request)) = requests.message().await else {
            return false;
        };
        let commands = (request.commands.into_iter())
            .filter_map(|it| Some((it.handle, it.command?)))
            .filter(|(_, command)| !matches!(command, Sent::Attach(_)));
        self.heard.lock().expect("no panic").extend(commands);
        true
    }
}

impl PlayService for Scripted {
    type PlayStream = ReceiverStream<Result<v1::PlayResponse, Status>>;
    type WatchStream = tokio_stream::Empty<Result<v1::PlayServiceWatchResponse, Status>>;

    async fn play(
        &self,
        request: Request<Streaming<v1::PlayRequest>>,
    ) -> Result<Response<Self::PlayStream>, Status> {
        let mut scripts = self.scripts.lock().expect("no panic");
        let script = scripts
            .pop_front()
            .ok_or_else(|| Status::not_found("no script is left"))?;
        let is_last = scripts.is_empty();
        let (messages, queue) = mpsc::channel(script.len());
        let (server, mut requests) = (self.clone(), request.into_inner());
        tokio::spawn(async move {
            server.hear(&mut requests).await;
            for updates in script {
                let updates = (updates.into_iter()).map(|(handle, update)| v1::SeatUpdate {
                    handle,
                    update: Some(update),
                });
                let message = v1::PlayResponse {
                    updates: updates.collect(),
                };
                messages
                    .send(Ok(message))
                    .await
                    .expect("there is space for all");
            }
            while is_last && server.hear(&mut requests).await {}
        });
        Ok(Response::new(ReceiverStream::new(queue)))
    }

    async fn watch(
        &self,
        _request: Request<v1::PlayServiceWatchRequest>,
    ) -> Result<Response<Self::WatchStream>, Status> {
        Err(Status::unimplemented("not scripted"))
    }

    async fn act(&self, _: Request<v1::ActRequest>) -> Result<Response<v1::ActResponse>, Status> {
        Err(Status::unimplemented("not scripted"))
    }
}

/// `ticket`: of a seat that the server adds.
fn attached(ticket: &str) -> Update {
    Update::Attached(v1::Attached {
        seat: 2,
        game_id: "game".to_owned(),
        ticket: ticket.to_owned(),
        ..v1::Attached::default()
    })
}

fn game_ended() -> Update {
    let standing = v1::Standing {
        seat: 2,
        points: 15,
        place: 1,
    };
    let ended = v1::GameEnded {
        standings: vec![standing],
        ..v1::GameEnded::default()
    };
    let event = v1::GameEvent {
        sequence: 1,
        kind: Some(v1::game_event::Kind::GameEnded(Box::new(ended))),
        ..v1::GameEvent::default()
    };
    Update::Events(v1::EventBatch {
        events: vec![event],
    })
}

fn detached(reason: v1::DetachReason) -> Update {
    Update::Detached(v1::Detached {
        reason: reason.into(),
    })
}

#[tokio::test]
async fn an_agent_in_cpp_keeps_the_results_of_games_that_are_over_when_the_connection_is_lost() {
    let refused = Update::Refused(v1::Refused {
        code: tonic::Code::Unauthenticated as u32,
        reason: "TICKET_UNKNOWN".to_owned(),
        ..v1::Refused::default()
    });
    for gone in [refused, detached(v1::DetachReason::Superseded)] {
        let server = Scripted::default();
        let scripts = [
            vec![vec![(0, attached(""))], vec![(0, game_ended())]],
            vec![vec![(0, gone)]],
        ];
        server.scripts.lock().expect("no panic").extend(scripts);
        let agent = agent_in_cpp(&server.start().await, &["--ticket", "kept"]);
        let output = participant("an agent", agent).await;
        let result: Value = serde_json::from_slice(&output.stdout).expect("a JSON line");
        assert_eq!(result["standings"][0]["points"], 15);
    }

    // A tournament that has not counted the game yet seats its participant again.
    const ADDED: u32 = 1 << 31;
    let entered = || {
        (
            0,
            Update::Entered(v1::Entered {
                participant: 5,
                ..v1::Entered::default()
            }),
        )
    };
    let server = Scripted::default();
    server.scripts.lock().expect("no panic").extend([
        vec![
            vec![entered(), (ADDED, attached("of the seat"))],
            vec![
                (ADDED, game_ended()),
                (ADDED, detached(v1::DetachReason::GameOver)),
            ],
        ],
        vec![
            vec![
                entered(),
                (ADDED, attached("of the seat")),
                (ADDED, game_ended()),
            ],
            vec![
                (ADDED, detached(v1::DetachReason::Requested)),
                (0, detached(v1::DetachReason::TournamentOver)),
            ],
        ],
    ]);
    let agent = agent_in_cpp(&server.start().await, &["--ticket", "cup"]);
    let output = participant("an agent", agent).await;
    let result: Value = serde_json::from_slice(&output.stdout).expect("a JSON line");
    assert_eq!(
        result["games"].as_array().map(Vec::len),
        Some(1),
        "{result}"
    );
    let heard = server.heard.lock().expect("no panic").clone();
    assert_eq!(heard, [(ADDED, Sent::Detach(v1::Detach {}))]);
}
