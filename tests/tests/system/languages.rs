//! One game of four processes in three languages, against the binary over its port.

use std::process::{Output, Stdio};

use chefshat_client::Client;
use chefshat_proto::v1;
use chefshat_record::{jsonl, replay};
use chefshat_tests::{Launch, patiently, set_up};
use serde_json::Value;
use tokio::process::Command;

/// Runs a participant and returns its output.
async fn participant(name: &str, mut command: Command) -> Output {
    let output = command.stdin(Stdio::null()).kill_on_drop(true).output();
    let output = patiently(name, output)
        .await
        .unwrap_or_else(|error| panic!("{name} does not start: {error}"));
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
        let last = text.lines().last().expect("a printed result");
        serde_json::from_str::<Value>(last).expect("a JSON line");
    }

    let over = client.get_room(&room.room_id).await.expect("still listed");
    assert_eq!(over.state(), v1::RoomState::Finished);
    let names: Vec<&str> = over.seats.iter().map(|seat| seat.name.as_str()).collect();
    for name in ["greedy", "random", "python", "node"] {
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
