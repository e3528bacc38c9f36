//! `chefshat ratings`: a leaderboard from records, each game counted once.

use std::iter;

use serde_json::{Value, json};
use tempfile::TempDir;

use super::run::{chefshat, fixture, run, serve, typed_into_a_closed_pipe, until_recorded};

const AGENTS: [&str; 4] = ["greedy", "random", "random_unmasked", "trained"];

/// Plays a number of games of built-in agents on a server, and two that are not public. Returns its
/// data folder and its leaderboard.
fn played(games: usize) -> (TempDir, Value) {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let hidden = ["private", "unlisted"];
    for visibility in iter::repeat_n("public", games).chain(hidden) {
        let seats = AGENTS.map(|agent| format!(" --seat {agent}")).concat();
        let room = format!("room create --target-shifts 1 --visibility {visibility}{seats}");
        run(&url, &room).well();
    }
    until_recorded(games + hidden.len(), folder.path());
    let board = run(&url, "leaderboard --json").json();
    (folder, board)
}

#[test]
fn a_leaderboard_is_recomputed_from_the_records() {
    let (folder, board) = played(12);
    let data_dir = folder.path().to_str().unwrap();
    let fixtures = fixture("records");
    let records = folder.path().join("records");
    let (records, fixtures) = (records.to_str().unwrap(), fixtures.to_str().unwrap());
    // A folder with each record twice counts each game once.
    let copies = folder.path().join("copies");
    std::fs::create_dir(&copies).unwrap();
    for file in std::fs::read_dir(records).unwrap() {
        let file = file.unwrap();
        std::fs::copy(file.path(), copies.join(file.file_name())).unwrap();
    }
    let copies = copies.to_str().unwrap();

    let printed = chefshat(&["ratings", "--json", records, fixtures, copies])
        .well()
        .json();
    assert_eq!(printed["records"], 16);
    // A participant that was substituted has lost the game.
    assert_eq!(printed["rated_games"], 13);
    let not_rated = json!({"not_dealt": 1, "not_public": 2});
    assert_eq!(printed["not_rated"], not_rated);
    // The numbers equal the server's.
    let printed = chefshat(&["ratings", "--json", records, copies])
        .well()
        .json();
    assert_eq!(board["rated_games"], printed["rated_games"]);
    assert_eq!(board["leaderboard"], printed["leaderboard"]);
    let lines = printed["leaderboard"].as_array().unwrap();
    let mut names: Vec<&str> = lines
        .iter()
        .map(|line| line["name"].as_str().unwrap())
        .collect();
    names.sort_unstable();
    assert_eq!(names, AGENTS);
    let bound =
        |line: &Value| line["mean"].as_f64().unwrap() - 2.0 * line["deviation"].as_f64().unwrap();
    for (two, place) in lines.windows(2).zip(1..) {
        assert!(bound(&two[0]) >= bound(&two[1]), "{two:?}");
        assert_eq!(two[0]["place"], place);
    }
    for line in lines {
        assert_eq!(
            (&line["games"], &line["kind"]),
            (&json!(12), &json!("built-in"))
        );
        let places = line["places"].as_array().unwrap().iter();
        assert_eq!(places.map(|times| times.as_u64().unwrap()).sum::<u64>(), 12);
    }

    let table = chefshat(&["ratings", "--data-dir", data_dir]).well();
    table.assert_table_fits(5);
    assert!(table.stdout.starts_with("12 rated games of 14 records\n"));
    let sheet = chefshat(&["ratings", "--csv", records]).well().stdout;
    assert_eq!(sheet.lines().count(), 5, "{sheet}");
    assert!(sheet.starts_with("place,name,kind,mean,deviation,games,place_1,"));
    for flags in [["--kind", "human"], ["--min-games", "13"]] {
        let nobody = chefshat(&["ratings", "--json", records, flags[0], flags[1]]);
        assert_eq!(nobody.well().json()["leaderboard"], json!([]));
    }
}

#[test]
fn a_damaged_record_is_named_and_the_others_are_rated() {
    let folder = TempDir::new().unwrap();
    let damaged = folder.path().join("damaged.jsonl");
    let whole = std::fs::read_to_string(fixture("records").join("fixed.jsonl")).unwrap();
    std::fs::write(&damaged, whole.replace("\"place\":2", "\"place\":3")).unwrap();
    let (damaged, fixtures) = (damaged.to_str().unwrap(), fixture("records"));
    let fixtures = fixtures.to_str().unwrap();
    let ended = chefshat(&["ratings", damaged, fixtures]);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    for named in ["damaged.jsonl: ", "--skip-damaged"] {
        assert!(ended.stderr.contains(named), "{ended:?}");
    }
    assert!(ended.stdout.contains("of 2 records"), "{ended:?}");
    let unread = typed_into_a_closed_pipe(&format!("ratings {damaged} {fixtures}"));
    assert_eq!(unread.code, Some(1), "{unread:?}");
    let nowhere = folder.path().join("nowhere.jsonl");
    let ended = chefshat(&["ratings", nowhere.to_str().unwrap(), fixtures]);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.stderr.contains("nowhere.jsonl: "), "{ended:?}");
    assert!(ended.stdout.contains("of 2 records"), "{ended:?}");
    let printed = chefshat(&["ratings", "--json", "--skip-damaged", damaged, fixtures]).well();
    assert!(
        printed.stderr.contains("damaged.jsonl"),
        "{}",
        printed.stderr
    );
    let printed = printed.json();
    assert_eq!(
        (&printed["records"], &printed["damaged"]),
        (&json!(2), &json!(1))
    );
}

#[test]
fn missing_records_are_reported() {
    let folder = TempDir::new().unwrap();
    let data_dir = folder.path().to_str().unwrap();
    chefshat(&["ratings", "--data-dir", data_dir]).assert_refused("--data-dir");
    chefshat(&["ratings", data_dir]).assert_refused("contains no records");
    chefshat(&["ratings", "--help"]).assert_helps("chefshat ratings ./chefshat-data/records");
}
