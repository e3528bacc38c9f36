//! `chefshat serve`, `room` and `agent` as processes: a room, four agents that join it with the
//! code from a file, and a spectator. All agree on the result.

use std::io::{BufRead as _, BufReader};

use chefshat_client::Client;
use serde_json::Value;
use tempfile::TempDir;

use super::run::{Running, in_runtime, run, serve, typed, typed_into_a_closed_pipe};

/// The only line that an agent printed, as JSON.
fn only_line(lines: &[String]) -> Value {
    let [line] = lines else {
        panic!("expected one line: {lines:?}");
    };
    serde_json::from_str(line).unwrap()
}

#[test]
fn four_processes_play_a_game_that_a_fifth_watches() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let code_file = folder.path().join("code");
    let code_file = code_file.display();

    // The agents may start before the code exists.
    let kinds = ["greedy", "random", "random_unmasked", "greedy"];
    let agents: Vec<Running> = (kinds.iter().zip(["Ada", "Ben", "Cleo", "Dan"]))
        .map(|(kind, name)| {
            let line =
                format!("agent {kind} --name {name} --seed 7 --json --code-file {code_file}");
            Running::start(&url, &line)
        })
        .collect();
    let create =
        format!("room create --name friday --target-shifts 2 --code-file {code_file} --json");
    let made = run(&url, &create).json();
    let room_id = made["room"]["roomId"].as_str().unwrap();
    let watched = run(&url, &format!("room watch {room_id}")).well();
    watched.assert_says(&["friday", "Ada", "Dan", "Shift 1", "Shift 2"]);
    watched.assert_says(&["Standings", "★ wins"]);

    let mut results = Vec::new();
    for agent in agents {
        let (code, lines) = agent.ended();
        assert_eq!(code, Some(0));
        let result = only_line(&lines);
        assert_eq!(result["event"], "result");
        assert_eq!(result["game_id"], made["room"]["gameId"]);
        let number = |field: &str| result[field].as_u64().unwrap();
        results.push((number("place"), number("points")));
    }
    results.sort_unstable();
    let places: Vec<u64> = results.iter().map(|(place, _)| *place).collect();
    assert_eq!(places, [1, 2, 3, 4]);
    let points: u64 = results.iter().map(|(_, points)| points).sum();
    assert_eq!(points, 2 * (5 + 3 + 1), "two Shifts give all their points");
}

#[test]
fn rooms_are_listed_shown_and_closed() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    assert_eq!(run(&url, "room list").stdout, "no rooms\n");

    let create = "room create --name quiet --seat greedy --seat human --json";
    let made = run(&url, create).json();
    let room_id = made["room"]["roomId"].as_str().unwrap();
    let listed = run(&url, "room list --json --state waiting").json();
    assert_eq!(listed["roomId"], room_id);
    let shown = run(&url, &format!("room show {room_id}"));
    shown.assert_says(&["quiet", "waiting", "greedy, played by the server"]);
    shown.assert_says(&["free for humans", "free for anyone"]);
    typed_into_a_closed_pipe(&format!("room show {room_id} --server {url}")).clean();

    let close = format!("room close {room_id} --json --owner-token");
    run(&url, &format!("{close} nonsense")).assert_failed("OWNER_TOKEN_WRONG");
    let token = made["owner_token"].as_str().unwrap();
    let closed = run(&url, &format!("{close} {token}")).json();
    assert_eq!(closed["room"]["state"], "ROOM_STATE_ABORTED");

    let watched = run(&url, &format!("room watch {room_id}"));
    assert_eq!(watched.code, Some(1), "an aborted game has no result");
    let code = made["join_code"].as_str().unwrap();
    let late = run(&url, &format!("agent greedy --code {code}"));
    assert_eq!(late.code, Some(1));
}

#[test]
fn an_agent_keeps_its_ticket_in_a_file_until_the_game_is_over() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let file = folder.path().join("ticket");
    let room = || {
        let made = run(&url, "room create --seat greedy*3 --target-shifts 1 --json");
        made.json()["join_code"].as_str().unwrap().to_owned()
    };
    let agent = |code: &str| {
        let line = format!(
            "agent random --code {code} --ticket-file {}",
            file.display()
        );
        run(&url, &line).well()
    };
    let played = agent(&room());
    assert!(!played.stderr.contains("--ticket"), "{played:?}");
    assert!(!file.exists());
    // One that was killed has left its ticket. The code is used up.
    let code = room();
    let joined = in_runtime(async {
        let client = Client::connect(&url).await.unwrap();
        client.join_with_code(&*code, "Ada").await.unwrap()
    });
    std::fs::write(&file, format!("{}\n", joined.ticket)).unwrap();
    agent(&code);
    assert!(!file.exists());
    let line = format!("agent random --ticket-file {}", file.display());
    run(&url, &line).assert_failed("give --code or --code-file");
}

#[test]
fn an_agent_reports_an_aborted_game() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let made = run(&url, "room create --json").json();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let code = text(&made["join_code"]);
    let mut agent = Running::start(&url, &format!("agent random --json --code {code}"));
    // Printed once it has its seat.
    let mut line = String::new();
    let mut stderr = BufReader::new(agent.0.stderr.take().unwrap());
    stderr.read_line(&mut line).unwrap();
    assert!(line.contains("seat 1; waits for 3 other seats"), "{line}");

    let (room_id, token) = (text(&made["room"]["roomId"]), text(&made["owner_token"]));
    run(&url, &format!("room close {room_id} --owner-token {token}")).well();
    let (code, lines) = agent.ended();
    assert_eq!(code, Some(1));
    let event = only_line(&lines)["event"].clone();
    assert!(event == "aborted" || event == "lost", "{lines:?}");
}

#[test]
fn invalid_room_options_are_reported_by_flag_before_a_room_is_created() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let nowhere = folder.path().join("nowhere").join("code");
    for (flags, words) in [
        (
            format!("--code-file {}", nowhere.display()).as_str(),
            "--code-file: ",
        ),
        ("--max-turns 0", "--max-turns is 0"),
        ("--decision-time-ms 1", "--decision-time-ms: "),
        ("--target-shifts 1000000", "--target-shifts: "),
    ] {
        run(&url, &format!("room create {flags}")).assert_failed(words);
    }
    assert_eq!(run(&url, "room list").stdout, "no rooms\n");

    let made = run(&url, "room create --seat greedy");
    made.assert_says(&["3 seats are free"]);
    made.assert_says(&[&format!("chefshat agent greedy --server {url} --code ")]);
}

#[test]
fn invalid_server_options_are_reported_at_the_start() {
    for (flags, words) in [
        ("--listen localhost", "use IP:PORT"),
        ("--max-rooms 0", "--max-rooms"),
        ("--allow-origin example.org", "https://example.org"),
    ] {
        let ended = typed(&format!("serve {flags}"));
        assert_eq!(ended.code, Some(2), "{flags}");
        ended.assert_refused(words);
    }
}

#[test]
fn a_missing_server_is_reported() {
    let url = "http://127.0.0.1:1";
    let ended = run(url, "room list");
    ended.assert_failed(url);
    ended.assert_failed("chefshat serve");
}

#[test]
fn a_private_room_is_shown_with_its_owner_token() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let owner = folder.path().join("owner");
    let owner = format!("--owner-file {}", owner.display());
    let seats = "--seat random --seat random --seat random --seat random";
    let create =
        format!("room create --visibility private {seats} --target-shifts 1 {owner} --json");
    let made = run(&url, &create).json();
    let room_id = made["room"]["roomId"].as_str().unwrap();
    let game_id = made["room"]["gameId"].as_str().unwrap();

    for command in ["show", "watch"] {
        let command = format!("room {command} {room_id}");
        run(&url, &command).assert_failed("ROOM_UNKNOWN");
        run(&url, &format!("{command} {owner}")).well();
    }
    let get = format!("records get {game_id}");
    run(&url, &get).assert_failed("GAME_UNKNOWN");
    let record = run(&url, &format!("{get} {owner}")).well();
    record.assert_says(&["VISIBILITY_PRIVATE"]);
    for (list, nothing) in [
        ("room list", "no rooms\n"),
        ("records list", "no records\n"),
    ] {
        assert_eq!(run(&url, list).stdout, nothing);
        run(&url, &format!("{list} {owner}")).assert_says(&["(private)"]);
    }
    run(&url, &format!("room close {room_id} {owner}")).well();
}

#[test]
fn an_agent_goes_on_after_a_room_without_a_seat() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let file = folder.path().join("code");
    std::fs::write(&file, "BCDF2345").unwrap();
    let file = file.to_str().unwrap();
    let agent = format!("agent random --games 2 --json --code-file {file}");
    let mut agent = Running::start(&url, &agent);
    let stdout = agent.0.stdout.take().unwrap();
    let mut lines = BufReader::new(stdout).lines().map(Result::unwrap);
    let refused: Value = serde_json::from_str(&lines.next().unwrap()).unwrap();
    assert_eq!(refused["event"], "refused");
    assert_eq!(refused["reason"], "JOIN_CODE_WRONG");
    let room = format!("room create --seat greedy*3 --target-shifts 1 --code-file {file}");
    run(&url, &room).well();
    let result: Value = serde_json::from_str(&lines.next().unwrap()).unwrap();
    assert_eq!(result["event"], "result");
    assert_eq!(agent.0.wait().unwrap().code(), Some(1));
}
