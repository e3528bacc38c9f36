//! The main job: one game of four processes in three languages, played against the binary over its port.

use std::path::PathBuf;
use std::process::{ExitStatus, Output, Stdio};

use chefshat_client::Client;
use chefshat_proto::v1;
use chefshat_records::{jsonl, replay};
use chefshat_tests::patiently;
use serde_json::Value;
use tempfile::TempDir;
use tokio::io::{AsyncBufReadExt as _, BufReader};
use tokio::process::{Child, Command};

/// What `cargo xtask test` has set up: the binary, a Python with the package, a folder with the Node agent.
fn set_up(name: &str) -> PathBuf {
    std::env::var_os(name)
        .map(PathBuf::from)
        .unwrap_or_else(|| panic!("{name} is not set: run this test by `cargo xtask test`"))
}

/// A running `chefshat serve`.
struct Server {
    process: Child,
    address: String,
    data: TempDir,
}

impl Server {
    async fn start() -> Self {
        let data = tempfile::tempdir().expect("a temporary folder");
        let mut process = Command::new(set_up("CHEFSHAT_BIN"))
            .args(["serve", "--listen", "127.0.0.1:0", "--json", "--data-dir"])
            .arg(data.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .kill_on_drop(true)
            .spawn()
            .expect("the binary runs");
        let stdout = process.stdout.take().expect("it is piped");
        let mut lines = BufReader::new(stdout).lines();
        let line = patiently("the server to listen", lines.next_line())
            .await
            .expect("it writes text")
            .expect("it says where it listens");
        let listening: Value = serde_json::from_str(&line).expect("a JSON line");
        assert_eq!(listening["event"], "listening");
        Self {
            process,
            address: listening["address"]
                .as_str()
                .expect("an address")
                .to_owned(),
            data,
        }
    }

    /// Asks the server to stop as an operator would, and waits until it has.
    async fn stop(mut self) -> (ExitStatus, TempDir) {
        let id = self.process.id().expect("it is running").to_string();
        let asked = Command::new("kill")
            .args(["-TERM", &id])
            .status()
            .await
            .expect("kill runs");
        assert!(asked.success());
        let status = patiently("the server to stop", self.process.wait())
            .await
            .expect("it ends");
        (status, self.data)
    }
}

/// Runs a participant and waits for what it prints.
async fn participant(name: &str, mut command: Command) -> Output {
    let output = command.stdin(Stdio::null()).kill_on_drop(true).output();
    let output = patiently(name, output)
        .await
        .unwrap_or_else(|error| panic!("{name} does not run: {error}"));
    assert!(
        output.status.success(),
        "{name}: {}\n{}\n{}",
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    output
}

#[tokio::test]
async fn rust_python_and_javascript_play_a_game_to_fifteen_points() {
    let binary = set_up("CHEFSHAT_BIN");
    let python = set_up("CHEFSHAT_PYTHON");
    let node = set_up("CHEFSHAT_NODE_DIR");
    let server = Server::start().await;
    let client = Client::connect(&server.address)
        .await
        .expect("the server listens");
    let created = client
        .create_room(v1::CreateRoomRequest::default())
        .await
        .expect("the room is made");
    let room = created.room.expect("a room");
    let (address, code) = (server.address.as_str(), created.join_code.as_str());
    let url = format!("http://{address}");
    let built_in = |kind: &str| {
        let mut command = Command::new(&binary);
        command.args(["agent", kind, "--server", &url, "--code", code]);
        command.args(["--name", kind, "--json"]);
        command
    };
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
        participant("greedy", built_in("greedy")),
        participant("random", built_in("random")),
        participant("python", in_python),
        participant("node", in_node),
    );
    for output in [outputs.0, outputs.1, outputs.2, outputs.3] {
        let text = String::from_utf8(output.stdout).expect("text");
        let last = text.lines().last().expect("it prints its result");
        serde_json::from_str::<Value>(last).expect("a JSON line");
    }

    let over = client.get_room(&room.room_id).await.expect("it is shown");
    assert_eq!(over.state(), v1::RoomState::Finished);
    let names: Vec<&str> = over.seats.iter().map(|seat| seat.name.as_str()).collect();
    for name in ["greedy", "random", "python", "node"] {
        assert!(names.contains(&name), "{name} is not among {names:?}");
    }
    let (status, data) = server.stop().await;
    assert!(status.success());
    let record = jsonl::read(&jsonl::path_of(data.path(), &room.game_id)).expect("it was written");
    let replayed = replay::replay(&record).expect("it replays to the same result");
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
        "nobody was late or wrong"
    );
}
