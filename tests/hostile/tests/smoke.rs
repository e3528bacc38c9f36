//! The program works and the server bears the attacks: a few of them with tiny counts. Asserts
//! facts, never times.

use std::process::Command;

use chefshat_tests::{set_up, skip};
use serde_json::Value;

/// How long an attack lasts, seconds: longer if the machine was too busy for it to show anything.
const LASTING: [&str; 3] = ["2", "10", "60"];

/// Runs an attack whose counts are divided by a number, after this many quiet seconds, until its row
/// shows something. Returns the report.
fn attacked(attack: &str, divide: &str, quiet: &str, shows: impl Fn(&Value) -> bool) -> Value {
    let mut report = Value::Null;
    for seconds in LASTING {
        let mut command = Command::new(env!("CARGO_BIN_EXE_chefshat-hostile"));
        command.arg("--server").arg(set_up("CHEFSHAT_BIN"));
        command.args(["--json", "--quiet", quiet, "--seconds", seconds]);
        command.args(["--rest", "0", "--divide", divide, "--attack", attack]);
        let output = command.output().expect("the program can be started");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{errors}");
        report = serde_json::from_slice(&output.stdout).expect("a JSON document");
        let row = &report["attacks"][0];
        if row.is_null() || shows(row) {
            break;
        }
    }
    report
}

/// Whether a row counts some of something.
fn some(row: &Value, of: &str) -> bool {
    row[of].as_u64() > Some(0)
}

#[test]
fn honest_games_end_while_the_server_is_attacked() {
    for attack in ["built-in-tournament", "silent-play-streams", "ping-flood"] {
        let shows = |row: &Value| some(row, "tried") && some(row, "games");
        let row = &attacked(attack, "50", "1", shows)["attacks"][0];
        assert_eq!(row["missed"], 0, "{row:#}");
        assert_eq!(row["lost_games"], 0, "{row:#}");
        assert_eq!(row["last_game_ended"], true, "{row:#}");
        assert!(shows(row), "{row:#}");
    }
}

#[test]
fn what_one_client_may_not_take_is_refused_and_others_are_served() {
    for (attack, reason) in [
        ("idle-vector-streams", "TOO_MANY_VECTOR_STREAMS"),
        ("waiting-tournaments", "TOO_MANY_TOURNAMENTS"),
    ] {
        let shows = |row: &Value| some(&row["reasons"], reason);
        let row = &attacked(attack, "1", "1", shows)["attacks"][0];
        assert!(shows(row), "{row:#}");
        let others = &row["others"];
        assert_eq!(others["served"], others["tried"], "{row:#}");
        assert_eq!(row["missed"], 0, "{row:#}");
        assert_eq!(row["last_game_ended"], true, "{row:#}");
    }
}

/// Runs an attack until it counts some of something, and checks that the server survives it. `None`
/// if this machine cannot run it.
fn survived(attack: &str, counted: &str) -> Option<Value> {
    // A node that has just started is slow on a busy machine.
    let report = attacked(attack, "50", "4", |row| some(row, counted));
    if let Some(why) = report["skipped"][attack].as_str() {
        skip(attack, why);
        return None;
    }
    let row = report["attacks"][0].clone();
    assert_eq!(row["attack"], attack, "{report:#}");
    for counted in ["tried", counted] {
        assert!(some(&row, counted), "{row:#}");
    }
    for fact in ["alive", "starts_again", "last_game_ended"] {
        assert_eq!(row[fact], true, "{fact}: {row:#}");
    }
    // The summary has it on the side that its own verdict says.
    let is_within = row["exceeds"].as_array().expect("a list").is_empty();
    let side = if is_within { "within" } else { "exceeding" };
    assert_eq!(report[side], serde_json::json!([attack]), "{report:#}");
    Some(row)
}

#[test]
#[ignore = "long"]
fn what_an_attack_wants_is_granted_as_far_as_it_may_be() {
    for attack in [
        "mcp-sessions",
        "tls-hellos",
        "full-disk",
        "samples",
        "refused-webhook",
        "long-stream",
    ] {
        survived(attack, "granted");
    }
}

#[test]
#[ignore = "long"]
fn a_picture_may_take_longer_than_the_attack() {
    survived("replay-pictures", "tried");
}

/// Checks that a server survives these attacks and accepts nothing of them.
fn refused(attacks: &[&str]) {
    for attack in attacks {
        if let Some(row) = survived(attack, "refused") {
            assert_eq!(row["granted"], 0, "{row:#}");
        }
    }
}

#[test]
fn what_no_server_accepts_is_refused() {
    refused(&["import-elements", "unknown-tokens"]);
}

#[test]
#[ignore = "long"]
fn messages_of_too_many_elements_are_refused() {
    refused(&["study-elements", "answer-elements", "vector-elements"]);
}

#[test]
#[ignore = "long"]
fn long_analyses_are_asked_for() {
    // None of them ends as early as this attack, so none counts as granted.
    if let Some(row) = survived("evaluations", "tried") {
        assert_eq!(row["lost"], 0, "{row:#}");
    }
}

#[test]
fn the_listener_for_nodes_is_attacked() {
    if let Some(row) = survived("peer-connections", "tried") {
        assert_eq!(row["tried"], 20, "{row:#}");
    }
}

/// Runs a scenario and returns its report.
fn scenario(arguments: &[&str]) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_chefshat-hostile"))
        .arg("--server")
        .arg(set_up("CHEFSHAT_BIN"))
        .arg("--json")
        .args(arguments)
        .output()
        .expect("the program can be started");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    serde_json::from_slice(&output.stdout).expect("a JSON document")
}

#[test]
fn idle_connections_are_counted_and_stay() {
    let report = scenario(&["idle", "--connections", "20", "--seconds", "1"]);
    assert_eq!(report["connections"], 20, "{report:#}");
    assert_eq!(report["served_again"], 20, "{report:#}");
}

#[test]
#[ignore = "long"]
fn spectators_that_do_not_read_are_admitted_and_players_miss_nothing() {
    let report = scenario(&[
        "spectators",
        "--spectators",
        "20",
        "--rooms",
        "2",
        "--rounds",
        "1",
        "--seconds",
        "1",
    ]);
    assert_eq!(report["tried"], 20, "{report:#}");
    assert_eq!(report["granted"], 20, "{report:#}");
    assert_eq!(report["missed"], 0, "{report:#}");
    assert!(report["watched_p99_ms"].as_f64() > Some(0.0), "{report:#}");
}

#[test]
#[ignore = "long"]
fn rooms_of_a_soak_start_and_end() {
    let report = scenario(&["soak", "--seconds", "3", "--settle", "1", "--rooms", "2"]);
    assert!(report["games"].as_u64() > Some(0), "{report:#}");
    assert_eq!(report["lost_games"], 0, "{report:#}");
    assert_eq!(report["missed"], 0, "{report:#}");
    assert!(
        report["samples"]
            .as_array()
            .is_some_and(|samples| samples.len() > 100),
        "{report:#}"
    );
    assert!(report["mib_per_hour"].is_number(), "{report:#}");
}

#[test]
fn an_unknown_attack_is_refused_with_advice() {
    let output = Command::new(env!("CARGO_BIN_EXE_chefshat-hostile"))
        .args(["--attack", "kindness"])
        .output()
        .expect("the program can be started");
    assert!(!output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("--list"));
}
