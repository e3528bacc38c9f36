//! `chefshat records`, and rooms that branch, replay or start with given hands, as in
//! `docs/branching.md`.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use super::run::{json_lines, run, serve, serve_with};

const DOCS: &str = include_str!("../../../../docs/branching.md");

/// The output of a command line that must succeed.
fn output_of(server: &str, line: &str) -> String {
    run(server, line).well().stdout
}

/// Creates a room of built-in agents and waits for its end. Returns the id of its game.
fn played(server: &str, flags: &str) -> String {
    let made = run(server, &format!("room create --json {flags}")).json();
    let id = |field: &str| made["room"][field].as_str().unwrap().to_owned();
    output_of(server, &format!("room watch {}", id("roomId")));
    id("gameId")
}

/// A game of two Shifts between built-in agents.
fn original(server: &str) -> String {
    let seats = "--seat greedy --seat random --seat random --seat random";
    played(server, &format!("--name first --target-shifts 2 {seats}"))
}

/// The seat and action of each decision of a record.
fn decisions(record: &str) -> Vec<(u64, u64)> {
    let number = |value: &Value| value.as_u64().unwrap_or(0);
    json_lines(record)
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
    let record = output_of(&url, &format!("records get {first}"));
    assert!(decisions(&record).len() > 60);

    let point = format!("{first}@25");
    let replayed = |seat| format!("--seat replay:{first}:{seat}");
    let seats = [0, 1, 2, 3].map(replayed).join(" ");
    let flags = format!("--branch {point} --same-deals --durability ephemeral {seats}");
    let second = played(&url, &flags);
    let again = output_of(&url, &format!("records get {second}"));
    assert_eq!(decisions(&again), decisions(&record));
    let start = &json_lines(&again)[0]["header"]["start"];
    assert_eq!(start["branchedFrom"]["gameId"], first.as_str());
    assert_eq!(start["branchedFrom"]["sameDeals"], true);

    // Listed with room and state.
    let listed = |flags: &str| {
        let summaries = run(&url, &format!("records list --json {flags}")).json_lines();
        let ids = summaries.iter().map(|summary| &summary["gameId"]);
        ids.map(|id| id.as_str().unwrap().to_owned())
            .collect::<Vec<_>>()
    };
    assert_eq!(listed(""), [first.as_str(), second.as_str()]);
    assert_eq!(listed("--newest-first"), [second.as_str(), first.as_str()]);
    assert_eq!(listed("--origin branched"), [second.as_str()]);
    assert_eq!(listed("--room-name first"), [first.as_str()]);
    assert_eq!(listed("--participant replay"), [second.as_str()]);
    assert!(listed("--state aborted").is_empty());
    let told_first = output_of(&url, "records list --room-name first");
    assert!(
        told_first.starts_with(&first) && told_first.contains("finished"),
        "{told_first}"
    );
    let nothing = output_of(&url, "records list --kind robot");
    assert_eq!(nothing, "no records\n");

    // A waiting room shows its parent game, and whom it waits for.
    let seats = format!("--seat open {}", replayed(1));
    let made = run(
        &url,
        &format!("room create --json --branch {point} {seats}"),
    )
    .json();
    let room_id = made["room"]["roomId"].as_str().unwrap();
    assert_eq!(made["room"]["seats"].as_array().unwrap().len(), 4);
    let shown = run(&url, &format!("room show {room_id}"));
    shown.assert_says(&[
        &format!("as game {first} until after decision 25"),
        &format!("imitates seat 2 of game {first}"),
        "free for anyone",
    ]);
    assert!(output_of(&url, "room list").contains("(branched)"));
}

#[test]
fn a_recorded_player_joins_as_a_remote_agent() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let first = original(&url);
    let file = folder.path().join("game.jsonl");
    let file = file.to_str().unwrap();
    assert_eq!(
        output_of(&url, &format!("records get {first} --out {file}")),
        ""
    );
    let record = fs::read_to_string(file).unwrap();

    let point = format!("{first}@10");
    let replayed = |seat| format!("--seat replay:{first}:{seat}");
    let seats = format!(
        "{} {} --seat open {}",
        replayed(0),
        replayed(1),
        replayed(3)
    );
    let create = format!("room create --json --branch {point} --same-deals {seats}");
    let made = run(&url, &create).json();
    let code = made["join_code"].as_str().unwrap();
    let result = run(
        &url,
        &format!("agent replay --record {file} --seat 2 --code {code} --json"),
    )
    .json();
    assert_eq!(
        (result["event"].as_str(), result["seat"].as_u64()),
        (Some("result"), Some(2))
    );
    let game_id = result["game_id"].as_str().unwrap();
    let again = output_of(&url, &format!("records get {game_id}"));
    assert_eq!(decisions(&again), decisions(&record));

    let nowhere = "/nowhere.jsonl";
    for (arguments, words) in [
        ("replay", "--record"),
        (&format!("replay --record {file} --seat 4"), "not 4"),
        (&format!("replay --record {nowhere} --seat 0"), nowhere),
        ("greedy --seat 0", "replay"),
    ] {
        run(&url, &format!("agent {arguments} --code {code}")).assert_refused(words);
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
        let seats = "--seat greedy ".repeat(4);
        let game = played(&url, &format!("--hands {} {seats}", file.display()));
        let record = json_lines(&output_of(&url, &format!("records get {game}")));
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
    let refused = run(&url, &format!("room create --hands {}", file.display()));
    refused.assert_refused("--hands: ");
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
    let stream = format!("records stream --out-dir {}", out.display());
    let said = output_of(&url, &stream);
    assert!(said.starts_with("2 records in "), "{said}");
    let all = output_of(&url, "records stream --room-name first");
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
    let missing = run(&url, &format!("records get {}", "0".repeat(32)));
    missing.assert_failed("GAME_UNKNOWN");

    // Another server accepts them only with --allow-import.
    let elsewhere = TempDir::new().unwrap();
    let (_closed, closed) = serve(elsewhere.path());
    let file = out.join(format!("{}.jsonl", games[0]));
    let file = file.to_str().unwrap();
    run(&closed, &format!("records import {file}")).assert_failed("--allow-import");
    let open = TempDir::new().unwrap();
    let (_open, open) = serve_with(open.path(), &["--allow-import"]);
    let added = output_of(&open, &format!("records import {file}"));
    assert!(added.starts_with(&games[0]), "{added}");
    let back = output_of(&open, &format!("records get {}", games[0]));
    assert_eq!(back, fs::read_to_string(file).unwrap());
    let again = output_of(&open, &format!("records import {file}"));
    assert_eq!(again, "");
}
