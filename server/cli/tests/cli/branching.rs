//! `chefshat records`, and rooms that branch, replay or start with given hands, as in
//! `docs/branching.md`.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use super::server::{json, run, serve, serve_with};

const DOCS: &str = include_str!("../../../../docs/branching.md");

/// The output of a command that must succeed.
fn output_of(server: &str, arguments: &[&str]) -> String {
    let output = run(server, arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// Creates a room of built-in agents and waits for its end. Returns the id of its game.
fn played(server: &str, arguments: &[&str]) -> String {
    let mut create = vec!["room", "create", "--json"];
    create.extend(arguments);
    let made = json(&run(server, &create));
    output_of(
        server,
        &["room", "watch", made["room"]["roomId"].as_str().unwrap()],
    );
    made["room"]["gameId"].as_str().unwrap().to_owned()
}

/// A game of two Shifts between built-in agents.
fn original(server: &str) -> String {
    let seats = [
        "--name",
        "first",
        "--target-shifts",
        "2",
        "--seat",
        "greedy",
        "--seat",
        "random",
        "--seat",
        "random",
        "--seat",
        "random",
    ];
    played(server, &seats)
}

fn lines(record: &str) -> Vec<Value> {
    let lines = record.lines();
    lines
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

/// The seat and action of each decision of a record.
fn decisions(record: &str) -> Vec<(u64, u64)> {
    let number = |value: &Value| value.as_u64().unwrap_or(0);
    lines(record)
        .iter()
        .filter_map(|line| line.get("decision"))
        .map(|decision| (number(&decision["seat"]), number(&decision["action"])))
        .collect()
}

#[test]
fn a_recorded_game_is_branched_with_replayed_seats() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let first = original(&url);
    let record = output_of(&url, &["records", "get", &first]);
    assert!(decisions(&record).len() > 60);

    let point = format!("{first}@25");
    let seats: Vec<String> = (0..4)
        .map(|seat| format!("replay:{first}:{seat}"))
        .collect();
    let mut flags = vec![
        "--branch",
        &point,
        "--same-deals",
        "--durability",
        "ephemeral",
    ];
    for seat in &seats {
        flags.extend(["--seat", seat]);
    }
    let second = played(&url, &flags);
    let again = output_of(&url, &["records", "get", &second]);
    assert_eq!(decisions(&again), decisions(&record));
    let start = &lines(&again)[0]["header"]["start"];
    assert_eq!(start["branchedFrom"]["gameId"], first.as_str());
    assert_eq!(start["branchedFrom"]["sameDeals"], true);

    // Listed with room and state.
    let listed = |flags: &[&str]| {
        let mut list = vec!["records", "list", "--json"];
        list.extend(flags);
        let summaries = lines(&output_of(&url, &list)).into_iter();
        summaries
            .map(|summary| summary["gameId"].as_str().unwrap().to_owned())
            .collect::<Vec<_>>()
    };
    assert_eq!(listed(&[]), [first.as_str(), second.as_str()]);
    assert_eq!(
        listed(&["--newest-first"]),
        [second.as_str(), first.as_str()]
    );
    assert_eq!(listed(&["--origin", "branched"]), [second.as_str()]);
    assert_eq!(listed(&["--room-name", "first"]), [first.as_str()]);
    assert_eq!(listed(&["--participant", "replay"]), [second.as_str()]);
    assert!(listed(&["--state", "aborted"]).is_empty());
    let told_first = output_of(&url, &["records", "list", "--room-name", "first"]);
    assert!(
        told_first.starts_with(&first) && told_first.contains("finished"),
        "{told_first}"
    );
    let nothing = output_of(&url, &["records", "list", "--kind", "robot"]);
    assert_eq!(nothing, "no records\n");

    // A waiting room shows its parent game, and whom it waits for.
    let made = json(&run(
        &url,
        &[
            "room", "create", "--json", "--branch", &point, "--seat", "open", "--seat", &seats[1],
        ],
    ));
    let room_id = made["room"]["roomId"].as_str().unwrap();
    assert_eq!(made["room"]["seats"].as_array().unwrap().len(), 4);
    let shown = output_of(&url, &["room", "show", room_id]);
    for words in [
        format!("as game {first} until after decision 25"),
        format!("imitates seat 1 of game {first}"),
        "free for anyone".to_owned(),
    ] {
        assert!(shown.contains(&words), "{words} is not in {shown}");
    }
    assert!(output_of(&url, &["room", "list"]).contains("(branched)"));
}

#[test]
fn a_recorded_player_joins_as_a_remote_agent() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let first = original(&url);
    let file = folder.path().join("game.jsonl");
    let file = file.to_str().unwrap();
    assert_eq!(
        output_of(&url, &["records", "get", &first, "--out", file]),
        ""
    );
    let record = fs::read_to_string(file).unwrap();

    let point = format!("{first}@10");
    let seats: Vec<String> = [0, 1, 3]
        .map(|seat| format!("replay:{first}:{seat}"))
        .into();
    let made = json(&run(
        &url,
        &[
            "room",
            "create",
            "--json",
            "--branch",
            &point,
            "--same-deals",
            "--seat",
            &seats[0],
            "--seat",
            &seats[1],
            "--seat",
            "open",
            "--seat",
            &seats[2],
        ],
    ));
    let code = made["join_code"].as_str().unwrap();
    let result = json(&run(
        &url,
        &[
            "agent", "replay", "--record", file, "--seat", "2", "--code", code, "--json",
        ],
    ));
    assert_eq!(
        (result["event"].as_str(), result["seat"].as_u64()),
        (Some("result"), Some(2))
    );
    let again = output_of(
        &url,
        &["records", "get", result["game_id"].as_str().unwrap()],
    );
    assert_eq!(decisions(&again), decisions(&record));

    for (arguments, words) in [
        (vec!["agent", "replay", "--code", code], "--record"),
        (
            vec![
                "agent", "replay", "--record", file, "--seat", "4", "--code", code,
            ],
            "not 4",
        ),
        (
            vec![
                "agent",
                "replay",
                "--record",
                "/nowhere.jsonl",
                "--seat",
                "0",
                "--code",
                code,
            ],
            "/nowhere.jsonl",
        ),
        (
            vec!["agent", "greedy", "--seat", "0", "--code", code],
            "replay",
        ),
    ] {
        let refused = run(&url, &arguments);
        assert_ne!(refused.status.code(), Some(0), "{arguments:?}");
        let errors = String::from_utf8(refused.stderr).unwrap();
        assert!(errors.contains(words), "{words} is not in {errors}");
    }
}

/// The JSON example number `n` of the page.
fn example(n: usize) -> Value {
    let block = DOCS.split("```json\n").nth(n + 1).unwrap();
    serde_json::from_str(block.split("```").next().unwrap()).unwrap()
}

#[test]
fn the_hands_of_the_page_start_a_game() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let first_shift = example(0);
    let mut later_shift = first_shift.clone();
    later_shift
        .as_object_mut()
        .unwrap()
        .extend(example(1).as_object().unwrap().clone());
    let file = folder.path().join("hands.json");
    for script in [first_shift, later_shift] {
        fs::write(&file, script.to_string()).unwrap();
        let mut flags = vec!["--hands", file.to_str().unwrap()];
        flags.extend(["--seat", "greedy"].repeat(4));
        let game = played(&url, &flags);
        let record = lines(&output_of(&url, &["records", "get", &game]));
        let dealt = record
            .iter()
            .find_map(|line| line["event"].get("shiftStarted"))
            .unwrap();
        assert_eq!(
            dealt["shift"],
            script.get("shift").cloned().unwrap_or(1.into())
        );
        for (seat, hand) in script["hands"].as_array().unwrap().iter().enumerate() {
            assert_eq!(dealt["hands"][seat]["cards"], hand["cards"]);
        }
    }
    fs::write(&file, r#"{"hands": []}"#).unwrap();
    let refused = run(&url, &["room", "create", "--hands", file.to_str().unwrap()]);
    let errors = String::from_utf8(refused.stderr).unwrap();
    assert!(errors.contains("--hands: "), "{errors}");
}

fn files_of(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn records_are_downloaded_and_added_to_another_server() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let mut games = [original(&url), original(&url)];
    let out = folder.path().join("out");
    let stream = ["records", "stream", "--out-dir", out.to_str().unwrap()];
    let said = output_of(&url, &stream);
    assert!(said.starts_with("2 records in "), "{said}");
    let all = output_of(&url, &["records", "stream", "--room-name", "first"]);
    let kept = games.iter().map(|game| {
        let file = out.join(format!("{game}.jsonl"));
        fs::read_to_string(file).unwrap()
    });
    assert_eq!(all, kept.collect::<String>());
    games.sort();
    assert_eq!(
        files_of(&out),
        games.clone().map(|game| format!("{game}.jsonl"))
    );
    let missing = run(&url, &["records", "get", &"0".repeat(32)]);
    assert_eq!(missing.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&missing.stderr).contains("GAME_UNKNOWN"));

    // Another server accepts them only with --allow-import.
    let elsewhere = TempDir::new().unwrap();
    let (_closed, closed) = serve(elsewhere.path());
    let file = out.join(format!("{}.jsonl", games[0]));
    let file = file.to_str().unwrap();
    let refused = run(&closed, &["records", "import", file]);
    assert_eq!(refused.status.code(), Some(1));
    let errors = String::from_utf8(refused.stderr).unwrap();
    assert!(errors.contains("--allow-import"), "{errors}");
    let open = TempDir::new().unwrap();
    let (_open, open) = serve_with(open.path(), &["--allow-import"]);
    let added = output_of(&open, &["records", "import", file]);
    assert!(added.starts_with(&games[0]), "{added}");
    let back = output_of(&open, &["records", "get", &games[0]]);
    assert_eq!(back, fs::read_to_string(file).unwrap());
    let twice = run(&open, &["records", "import", file]);
    assert_eq!(twice.status.code(), Some(1));
    let errors = String::from_utf8(twice.stderr).unwrap();
    assert!(errors.contains(file), "{errors}");
}
