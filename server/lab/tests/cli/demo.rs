//! `chefshat demo`: ends by itself, prints what its record contains, and is repeatable with a seed.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tempfile::TempDir;

use super::run::{Ended, json_lines, typed};

fn demo(folder: &Path, flags: &str) -> Ended {
    typed(&format!("demo --data-dir {} {flags}", folder.display()))
}

/// The lines of a record.
fn record(path: &Path) -> Vec<Value> {
    json_lines(&std::fs::read_to_string(path).unwrap())
}

/// Seat and points of the final standings of a record, best first.
fn standings(record: &[Value]) -> Vec<(u64, u64)> {
    let ended = record
        .iter()
        .find_map(|line| line["event"].get("gameEnded"))
        .unwrap();
    let lines = ended["standings"].as_array().unwrap();
    lines
        .iter()
        .map(|line| {
            // Canonical JSON omits seat 0 and writes 64-bit numbers as strings.
            let seat = line["seat"].as_u64().unwrap_or(0);
            let points = line["points"]
                .as_str()
                .map_or(0, |text| text.parse().unwrap());
            (seat, points)
        })
        .collect()
}

/// The only file in the folder of records.
fn only_record(folder: &Path) -> PathBuf {
    let files: Vec<PathBuf> = std::fs::read_dir(folder.join("records"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    let [file] = files.as_slice() else {
        panic!("one record was expected: {files:?}");
    };
    file.clone()
}

/// The lines below a heading.
fn section<'a>(text: &'a str, heading: &str) -> Vec<&'a str> {
    text.lines()
        .skip_while(|line| !line.starts_with(&format!("━━ {heading} ")))
        .skip(1)
        .take_while(|line| !line.is_empty())
        .collect()
}

#[test]
fn a_game_is_narrated_to_its_end() {
    let folder = TempDir::new().unwrap();
    let ended = demo(folder.path(), "--seed 3").clean();
    assert!(!ended.stdout.contains('\u{1b}'), "no colours in a pipe");
    for line in ended.stdout.lines() {
        assert!(line.chars().count() <= 100, "{line}");
    }

    let path = only_record(folder.path());
    assert!(ended.stdout.contains(path.to_str().unwrap()));
    assert!(ended.stdout.contains("check out"));
    assert!(ended.stdout.contains("how to read"));
    let record = record(&path);
    assert_eq!(
        record.last().unwrap()["footer"]["state"],
        "ROOM_STATE_FINISHED"
    );
    let names: Vec<String> = record[0]["header"]["seats"]
        .as_array()
        .unwrap()
        .iter()
        .map(|seat| seat["name"].as_str().unwrap().to_owned())
        .collect();
    let expected: Vec<(String, u64)> = standings(&record)
        .into_iter()
        .map(|(seat, points)| (names[usize::try_from(seat).unwrap()].clone(), points))
        .collect();
    assert!(expected[0].1 >= 15, "the game is played to 15 points");
    let printed: Vec<(String, u64)> = section(&ended.stdout, "Standings")
        .iter()
        .map(|line| {
            let words: Vec<&str> = line.split_whitespace().collect();
            (words[1].to_owned(), words[3].parse().unwrap())
        })
        .collect();
    assert_eq!(printed, expected);
}

#[test]
fn colours_can_be_forced() {
    let folder = TempDir::new().unwrap();
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_chefshat-lab"))
        .args(["demo", "--target-shifts", "1", "--data-dir"])
        .arg(folder.path())
        .env("CLICOLOR_FORCE", "1")
        .env_remove("NO_COLOR")
        .output()
        .unwrap();
    assert!(output.status.success());
    assert!(String::from_utf8_lossy(&output.stdout).contains("\u{1b}["));
}

#[test]
fn programs_read_every_line() {
    let folder = TempDir::new().unwrap();
    let ended = demo(
        folder.path(),
        "--json --agents random_unmasked,greedy,random",
    )
    .clean();
    let lines = ended.json_lines();
    let (first, rest) = lines.split_first().unwrap();
    let (last, events) = rest.split_last().unwrap();
    assert_eq!(first["event"], "listening");
    let address: std::net::SocketAddr = first["address"].as_str().unwrap().parse().unwrap();
    assert!(address.ip().is_loopback() && address.port() != 0);

    let path = only_record(folder.path());
    let record = record(&path);
    let recorded = record.iter().filter(|line| line.get("event").is_some());
    assert_eq!(
        events.len(),
        recorded.count(),
        "the spectator misses nothing"
    );
    for (number, event) in (1u64..).zip(events) {
        assert_eq!(event["event"], "game");
        assert_eq!(event["game_event"]["sequence"], number.to_string());
    }

    assert_eq!(last["event"], "result");
    assert_eq!(last["record"], path.to_str().unwrap());
    assert_eq!(last["game_id"], record[0]["header"]["gameId"]);
    assert_eq!(last["seed_committed"], true);
    let shifts = events
        .iter()
        .filter(|event| event["game_event"].get("shiftStarted").is_some());
    assert_eq!(last["deals_checked"], shifts.count());
    let printed: Vec<(u64, u64)> = last["standings"]
        .as_array()
        .unwrap()
        .iter()
        .map(|line| {
            let seat = line["seat"].as_u64().unwrap();
            (seat, line["points"].as_u64().unwrap())
        })
        .collect();
    assert_eq!(printed.len(), 3);
    assert_eq!(printed, standings(&record));
}

#[test]
fn a_seed_repeats_the_game() {
    let game = |flags: &str| -> Vec<Value> {
        let folder = TempDir::new().unwrap();
        demo(folder.path(), flags).clean();
        record(&only_record(folder.path()))
            .into_iter()
            .filter_map(|line| line.get("decision").cloned())
            .map(|decision| json!([decision["seat"], decision["text"], decision["actionMask"]]))
            .collect()
    };
    let first = game("--seed 5");
    assert!(first.len() > 100, "a game has many decisions");
    assert_eq!(first, game("--seed 5"));
    assert_ne!(first, game("--seed 6"));
}

#[test]
fn invalid_options_are_explained() {
    let folder = TempDir::new().unwrap();
    for (flags, words) in [
        ("--agents greedy,random --players 3", "2 agents"),
        ("--agents greedy", "--agents names 1 agent; name 2 to 6"),
        ("--faces 3", "--faces: "),
        ("--max-turns 0", "--max-turns is 0"),
    ] {
        demo(folder.path(), flags).assert_failed(words);
    }
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let ended = demo(&file, "");
    assert_eq!(ended.code, Some(1));
    assert!(ended.stderr.contains("--data-dir"), "{ended:?}");
}
