//! `chefshat serve`, `room` and `agent` as processes: a room is created, four agents join with the
//! code from a file, a spectator watches, and all report the same result.

use std::io::{BufRead as _, BufReader};

use serde_json::Value;
use tempfile::TempDir;

use super::server::{Running, json, program, run, serve};

#[test]
fn four_processes_play_a_game_that_a_fifth_watches() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let code_file = folder.path().join("code");
    let code_file = code_file.to_str().unwrap();

    // The agents may start before the code exists.
    let agents: Vec<Running> = ["greedy", "random", "random_unmasked", "greedy"]
        .iter()
        .zip(["Ada", "Ben", "Cleo", "Dan"])
        .map(|(kind, name)| {
            let mut command = program();
            command.args(["agent", kind, "--name", name, "--seed", "7", "--json"]);
            command.args(["--server", &url, "--code-file", code_file]);
            Running(command.spawn().unwrap())
        })
        .collect();
    let create = [
        "room",
        "create",
        "--name",
        "friday",
        "--target-shifts",
        "2",
        "--code-file",
        code_file,
        "--json",
    ];
    let made = json(&run(&url, &create));
    let room_id = made["room"]["roomId"].as_str().unwrap();
    let watched = run(&url, &["room", "watch", room_id]);
    assert_eq!(watched.status.code(), Some(0), "{watched:?}");
    let watched = String::from_utf8(watched.stdout).unwrap();
    for words in [
        "friday",
        "Ada",
        "Dan",
        "Shift 1",
        "Shift 2",
        "Standings",
        "★ wins",
    ] {
        assert!(watched.contains(words), "{words} is not in {watched}");
    }

    let mut results = Vec::new();
    for mut agent in agents {
        let stdout = agent.0.stdout.take().unwrap();
        let lines: Vec<String> = BufReader::new(stdout).lines().map(Result::unwrap).collect();
        assert_eq!(agent.0.wait().unwrap().code(), Some(0));
        let [line] = lines.as_slice() else {
            panic!("one line was expected: {lines:?}");
        };
        let result: Value = serde_json::from_str(line).unwrap();
        assert_eq!(result["event"], "result");
        assert_eq!(result["game_id"], made["room"]["gameId"]);
        results.push((
            result["place"].as_u64().unwrap(),
            result["points"].as_u64().unwrap(),
        ));
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
    let none = run(&url, &["room", "list"]);
    assert_eq!(String::from_utf8(none.stdout).unwrap(), "no rooms\n");

    let create = [
        "room", "create", "--name", "quiet", "--seat", "greedy", "--seat", "human", "--json",
    ];
    let made = json(&run(&url, &create));
    let room_id = made["room"]["roomId"].as_str().unwrap();
    let listed = json(&run(
        &url,
        &["room", "list", "--json", "--state", "waiting"],
    ));
    assert_eq!(listed["roomId"], room_id);
    let shown = String::from_utf8(run(&url, &["room", "show", room_id]).stdout).unwrap();
    for words in [
        "quiet",
        "waiting",
        "greedy, played by the server",
        "free for humans",
        "free for anyone",
    ] {
        assert!(shown.contains(words), "{words} is not in {shown}");
    }

    let wrong = run(
        &url,
        &["room", "close", room_id, "--owner-token", "nonsense"],
    );
    assert_eq!(wrong.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("OWNER_TOKEN_WRONG"));
    let token = made["owner_token"].as_str().unwrap();
    let closed = json(&run(
        &url,
        &["room", "close", room_id, "--owner-token", token, "--json"],
    ));
    assert_eq!(closed["room"]["state"], "ROOM_STATE_ABORTED");

    let watched = run(&url, &["room", "watch", room_id]);
    assert_eq!(
        watched.status.code(),
        Some(1),
        "an aborted game has no result"
    );
    let code = made["join_code"].as_str().unwrap();
    let late = run(&url, &["agent", "greedy", "--code", code]);
    assert_eq!(late.status.code(), Some(1));
}

#[test]
fn an_agent_reports_an_aborted_game() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let made = json(&run(&url, &["room", "create", "--json"]));
    let (room_id, token) = (
        made["room"]["roomId"].as_str(),
        made["owner_token"].as_str(),
    );
    let mut command = program();
    command.args(["agent", "random", "--json", "--server", &url, "--code"]);
    let mut agent = Running(
        command
            .arg(made["join_code"].as_str().unwrap())
            .spawn()
            .unwrap(),
    );
    // Printed once it has its seat.
    let mut line = String::new();
    let mut stderr = BufReader::new(agent.0.stderr.take().unwrap());
    stderr.read_line(&mut line).unwrap();
    assert!(line.contains("seat 0; waits for 3 other seats"), "{line}");

    let close = [
        "room",
        "close",
        room_id.unwrap(),
        "--owner-token",
        token.unwrap(),
    ];
    assert_eq!(run(&url, &close).status.code(), Some(0));
    let stdout = agent.0.stdout.take().unwrap();
    let lines: Vec<String> = BufReader::new(stdout).lines().map(Result::unwrap).collect();
    assert_eq!(agent.0.wait().unwrap().code(), Some(1));
    let [line] = lines.as_slice() else {
        panic!("one line was expected: {lines:?}");
    };
    let result: Value = serde_json::from_str(line).unwrap();
    assert!(
        ["aborted", "lost"].contains(&result["event"].as_str().unwrap()),
        "{line}"
    );
}

#[test]
fn invalid_room_options_are_reported_by_flag_before_a_room_is_created() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let nowhere = folder.path().join("nowhere").join("code");
    let nowhere = nowhere.to_str().unwrap();
    for (flags, words) in [
        (["--code-file", nowhere], "--code-file: "),
        (["--max-turns", "0"], "--max-turns is 0"),
        (["--decision-time-ms", "1"], "--decision-time-ms: "),
        (["--target-shifts", "1000000"], "--target-shifts: "),
    ] {
        let mut arguments = vec!["room", "create"];
        arguments.extend(flags);
        let refused = run(&url, &arguments);
        assert_eq!(refused.status.code(), Some(1), "{flags:?}");
        let stderr = String::from_utf8(refused.stderr).unwrap();
        assert!(stderr.contains(words), "{stderr}");
        assert!(refused.stdout.is_empty(), "{flags:?}");
    }
    let none = run(&url, &["room", "list"]);
    assert_eq!(String::from_utf8(none.stdout).unwrap(), "no rooms\n");

    let made = run(&url, &["room", "create", "--seat", "greedy"]);
    let told = String::from_utf8(made.stdout).unwrap();
    assert!(told.contains("3 seats are free"), "{told}");
    assert!(
        told.contains(&format!("chefshat agent greedy --server {url} --code ")),
        "{told}"
    );
}

#[test]
fn invalid_server_options_are_reported_at_the_start() {
    for (flags, words) in [
        (["--listen", "localhost"], "use IP:PORT"),
        (["--max-rooms", "0"], "--max-rooms"),
        (["--allow-origin", "example.org"], "https://example.org"),
    ] {
        let ended = program().arg("serve").args(flags).output().unwrap();
        assert_eq!(ended.status.code(), Some(2), "{flags:?}");
        let stderr = String::from_utf8(ended.stderr).unwrap();
        assert!(stderr.contains(words), "{stderr}");
    }
}

#[test]
fn a_missing_server_is_reported() {
    // A port that was free a moment ago, without a server.
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    drop(listener);
    let ended = run(&url, &["room", "list"]);
    assert_eq!(ended.status.code(), Some(1));
    let words = String::from_utf8(ended.stderr).unwrap();
    assert!(
        words.contains(&url) && words.contains("chefshat serve"),
        "{words}"
    );
}
